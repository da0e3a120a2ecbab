"""`design --watch`: a search that takes up edits of its project and writes sounds."""

import os
import re
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.files.yaml_input import MOST_BYTES
from sound.clips.wav import ENDINGS, write_wav
from sound.design.interrupts import interruptible
from sound.design.optimise import optimise
from sound.design.preparation import DesignProblem, prepare
from sound.design.search import Search
from sound.outputs import require_output
from sound.project.design import Design
from sound.project.design_file import write_design
from sound.project.project import Project
from sound.rendering.listening import Listening
from sound.rendering.render import Hit
from sound.rendering.rendered_sound import render_sound
from sound.rendering.solid import SoundingSolid

LOOK_SECONDS = 1.0
"""Least time between two readings of the project's file [s]."""
WRITE_SECONDS = 2.0
"""Least time between two designs that are written and rendered [s]."""
AS_BEFORE = "going on with the project as it was"


class EditedProject:
    """A project whose file at `path` is edited; `project` is the last valid one.

    `load` reads the file, and raises a `UserError` if it is invalid.
    """

    def __init__(self, path: str | Path, load: Callable[[], Project]) -> None:
        self._path, self._load = Path(path), load
        self._known = self._last = self._content()
        self._due = time.monotonic() + LOOK_SECONDS
        self.project = load()

    def has_changed(self) -> bool:
        """Whether there is another valid project than before; an invalid one is reported.

        A file is read when its content has been the same twice, so not while it is written.
        """
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + LOOK_SECONDS
        content, before = self._content(), self._last
        self._last = content
        if content != before or content == self._known:
            return False
        self._known = content
        try:
            project = self._load()
        except UserError as error:
            say(f"{error}; {AS_BEFORE}")
            return False
        if project == self.project:
            return False
        self.project = project
        return True

    def _content(self) -> bytes | None:
        try:
            if not self._path.is_file():
                return None
            with self._path.open("rb") as file:
                return file.read(MOST_BYTES + 1)
        except OSError:
            return None


def design_on(
    edited: EditedProject,
    problem: DesignProblem,
    initial: Design | None,
    out: Path,
    show: Callable[[Search], None],
) -> Design:
    """Search until an interrupt, with the project as it is edited; `problem` is the first one.

    Every better design is written to `out`, and its sounds beside it. An edit of the solid starts a
    new search; after any other edit the search goes on from the best material. An edit that cannot
    be designed is reported, and the search goes on with the project before.  Raises UserError if
    the project to begin with cannot be designed, or the results cannot be written.
    """
    writer = _Writer(out, edited.project)
    former: tuple[DesignProblem, Design | None, _Writer] | None = None
    with interruptible() as interrupted:
        while True:
            is_edited = False

            def look(search: Search) -> bool:
                nonlocal is_edited
                show(search)
                is_edited = edited.has_changed()
                return is_edited

            try:
                design = optimise(problem, initial, writer.write, look, WRITE_SECONDS)
            except UserError as error:
                if former is None:
                    raise
                say(f"{error}; {AS_BEFORE}")
                (problem, initial, writer), former = former, None
                continue
            writer.write(design)
            if interrupted() or not is_edited:
                return design
            former, initial = (problem, design, writer), design
            try:
                problem, writer = _edited(problem, edited.project), _Writer(out, edited.project)
            except UserError as error:
                say(f"{error}; {AS_BEFORE}")
                problem, _, writer = former
                former = None
                continue
            if problem.project.solid == former[0].project.solid:
                say("the project was edited: going on from the best material")
            else:
                initial, kept = None, out.with_stem(f"{out.stem}-before")
                os.replace(out, require_output(kept, [out.suffix.lower()]))
                say(f"the solid was edited: beginning anew; the design before is {kept}")


def _edited(former: DesignProblem, project: Project) -> DesignProblem:
    before = former.project
    same = (project.targets, project.modes) == (before.targets, before.modes)
    return prepare(project, former.setting.objective.targets if same else None)


class _Writer:
    def __init__(self, out: Path, project: Project) -> None:
        self._out = out
        self._files = sound_files(out, [target.name for target in project.targets])
        clips = [target.clip for target in project.targets]
        for path in self._files.values():
            if path.is_symlink():  # which the user has not named
                raise UserError(f"{path}: is a link, expected a sound or nothing; remove it")
            require_output(path, ENDINGS, clips)
        self._cost = float("inf")

    def write(self, design: Design) -> None:
        """Write a design, and its sounds if they are better than those that were written."""
        write_design(self._out, design)
        cost = float(design.evidence["cost"])
        if cost >= self._cost:
            return
        self._cost = cost
        write_sounds(self._files, design)
        names = ", ".join(str(path) for path in self._files.values())
        say(f"{design.evidence['seconds']:6.1f} s  cost {cost:9.4g}  {names}")


def sound_files(out: Path, names: list[str]) -> Mapping[str, Path]:
    """Files beside a design for the sounds of its targets, by the targets' names.

    Examples
    --------
    >>> [path.name for path in sound_files(Path("pan.h5"), ["plate", "left ear"]).values()]
    ['pan-plate.wav', 'pan-left_ear.wav']
    >>> [path.name for path in sound_files(Path("pan.h5"), ["a/b", "a_b"]).values()]
    ['pan-1.wav', 'pan-2.wav']
    """
    plain = [re.sub(r"[^\w.-]", "_", name) for name in names]
    if len({name.casefold() for name in plain}) < len(names):
        plain = [str(number + 1) for number in range(len(names))]
    return {name: out.with_name(f"{out.stem}-{each}.wav") for name, each in zip(names, plain)}


def write_sounds(files: Mapping[str, Path], design: Design) -> None:
    """Write what `render` makes of a strike of each target."""
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    for strike in design.strikes:
        hit = Hit(0.0, strike.position, strike.inward)
        sound = render_sound(solid, [hit], listening=listening)
        write_wav(files[strike.name], sound.samples, sound.rate)
