"""`carillon init`: a project file to begin with."""

import argparse
import os
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect

ENDINGS = (".yaml", ".yml")
"""Endings of the names of project files."""
DEFAULT_NAME = "project.yaml"
PLACEHOLDER = "clip.wav"
"""File name of the clip in a project without clips."""
DIGITS = 5
"""Significant digits of positions; the nearest vertices are struck."""

EXAMPLES = """examples:
  init pan.yaml --mesh builtin:frying-pan --clips plate.wav handle.wav
  init jugs --mesh jug.obj
"""


@parameters
class InitOptions:
    """The project to begin with."""

    mesh: str = option(REQUIRED, "surface mesh file, or builtin:NAME")
    path: str | None = option(
        None,
        f"folder or file (.yaml) to write (default: {DEFAULT_NAME} in this folder)",
        metavar="FOLDER|FILE",
    )
    clips: tuple[str, ...] | None = option(
        None, "a strike each, at points spread over the surface", metavar="CLIP.wav"
    )
    allow_clipped: bool = option(False, "leave out samples of clips at full scale")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, InitOptions, positional=("path",))


def run(arguments: argparse.Namespace) -> int:
    """Look at mesh and clips, write the project and say what to do next."""
    from carillon.files.atomic import atomic_path
    from carillon.files.yaml_input import parse_yaml
    from sound.outputs import require_output
    from sound.project.project import project_of
    from sound.project.template import project_text

    options = collect(InitOptions, arguments)
    path = require_output(_file_of(options.path or "."), ENDINGS)
    values = _values(options, path.parent)
    text = project_text(values)
    project_of(parse_yaml(text), path.parent)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print(_sentence(options, path))
    return 0


def _file_of(path: str) -> str:
    file = os.path.join(path, DEFAULT_NAME) if os.path.isdir(path) else path
    if os.path.lexists(file):
        raise UserError(f"{file}: is there already; name another file, or remove it first")
    return file


def _values(options: InitOptions, folder: Path) -> dict[str, Any]:
    from carillon.builtin_names import BUILTIN_PREFIX

    builtin = options.mesh.startswith(BUILTIN_PREFIX)
    mesh = options.mesh if builtin else _seen_from(folder, options.mesh)
    if options.clips is None:
        return {"mesh": mesh, "targets": _targets(options.mesh, [PLACEHOLDER])}
    clips = [_seen_from(folder, clip) for clip in options.clips]
    targets = _targets(options.mesh, clips)
    if options.allow_clipped:
        targets = [target | {"allow_clipped": True} for target in targets]
    _require_modes(options.clips, options.allow_clipped)
    return {"mesh": mesh, "targets": targets}


def _targets(mesh: str, clips: Sequence[str]) -> list[dict[str, Any]]:
    import numpy as np

    from solver.response.vertices import spread
    from sound.clips.files import clip_names
    from sound.strikes import longest_side, struck_surface

    surface = struck_surface(mesh)
    vertices = np.asarray(surface.vertices)[np.unique(surface.faces)]
    chosen = spread(vertices, surface.bounds.mean(axis=0)[None], len(clips))
    if len(chosen) < len(clips):
        raise UserError(
            f"{len(clips):,} clips for {len(chosen):,} points of the surface; give fewer"
        )
    decimals = DIGITS - int(np.ceil(np.log10(longest_side(surface))))
    positions = np.round(vertices[chosen], decimals) + 0.0  # no -0.0
    return [
        {"name": name, "at": position, "clip": clip}
        for name, position, clip in zip(clip_names(clips), positions.tolist(), clips)
    ]


def _require_modes(clips: Sequence[str], allow_clipped: bool) -> None:
    from sound.clips.files import clip_names, extract_file
    from sound.clips.targets import share_frequencies

    sounds = [extract_file(clip, visible=True, allow_clipped=allow_clipped) for clip in clips]
    share_frequencies(clip_names(clips), sounds, "auto")


def _seen_from(folder: Path, path: str) -> str:
    """Name of a file in a project that lies in `folder`; an absolute one stays as it is."""
    if os.path.isabs(path):
        return path
    own = Path(path)
    return os.path.relpath(own.parent.resolve() / own.name, folder.resolve())


def _sentence(options: InitOptions, path: Path) -> str:
    run = shlex.join(["carillon", "design", str(path), "--out", str(path.with_suffix(".h5"))])
    if options.clips is not None:
        return f"{path}: a project of {options.mesh}; next: {run}"
    clip = path.parent / PLACEHOLDER
    return f"{path}: a project of {options.mesh}; record a strike as {clip}, then: {run}"
