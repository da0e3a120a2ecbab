"""Whether the targets of a project can be used, found out before their clips are searched."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from carillon.errors import UserError
from sound.clips.wav import read_wav
from sound.project.project import Project
from sound.strikes import Strike

if TYPE_CHECKING:
    import trimesh


def usable_strikes(project: Project, surface: trimesh.Trimesh) -> list[Strike]:
    """The points of a project's targets on its `surface`, all of which can be used.

    Raises
    ------
    UserError
        With a sentence for everything that is wrong with any target: names that several have, clips
        that are not there or no sound, points that are not on the surface.
    """
    faults = [*_shared_names(project), *_unreadable_clips(project)]
    try:
        strikes = project.strikes(surface)
    except UserError as error:
        faults += error.args
    if faults:
        raise UserError(*faults)
    return strikes


def _shared_names(project: Project) -> list[str]:
    counts = Counter(target.name for target in project.targets)
    return [
        f"{count} targets are named {name!r}; give each a name of its own"
        for name, count in counts.items()
        if count > 1
    ]


def _unreadable_clips(project: Project) -> list[str]:
    """A sentence for each clip that is no sound; several targets may have the same."""
    clips: dict[tuple[str, bool], list[str]] = {}
    for target in project.targets:
        clips.setdefault((target.clip, target.allow_clipped), []).append(repr(target.name))
    faults = []
    for (clip, allow_clipped), names in clips.items():
        try:
            read_wav(clip, allow_clipped)
        except UserError as error:
            faults.append(f"target{'s' * (len(names) > 1)} {', '.join(names)}: {error}")
    return faults
