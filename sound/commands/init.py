"""`carillon init`: a project file to begin with."""

import argparse
import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from carillon.arrays import Surface
from carillon.errors import UserError
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from carillon.parameters.quantities import MetresPerUnit, UpAxis, WallThickness
from sound.clips.formats import CLIP_FORMATS
from sound.project.files import ProjectFiles

ENDINGS = (".yaml", ".yml")
"""Endings of the names of project files."""
DEFAULT_NAME = "project.yaml"
PLACEHOLDER = "clip.wav"
"""File name of the clip in a project without clips."""
DIGITS = 5
"""Significant digits of positions; the nearest vertices are struck."""

EXAMPLES = """examples:
  init pan.yaml --mesh builtin:frying-pan --clips plate.wav handle.wav
  init jugs --mesh jug.obj --unit mm --up y
"""


@parameters
class InitOptions:
    """The project to begin with."""

    mesh: str = option(REQUIRED, "surface mesh file, or builtin:NAME")
    path: str | None = option(
        None,
        f"folder, which is made, or file (.yaml) to write (default: {DEFAULT_NAME} in this folder)",
        metavar="FOLDER|FILE",
    )
    clips: tuple[str, ...] | None = option(
        None,
        f"a strike each ({CLIP_FORMATS}), at points spread over the surface",
        metavar="CLIP",
    )
    allow_clipped: bool = option(False, "leave out samples of clips at full scale")
    unit: MetresPerUnit = option(1.0)
    up: UpAxis | None = option(
        None,
        "axis of the mesh file that points up, and becomes z (default: y of glTF files, else z)",
    )
    wall: WallThickness | None = option(None, metavar="LENGTH")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, InitOptions, positional=("path",))


def run(arguments: argparse.Namespace) -> int:
    """Look at mesh and clips, write the project and say what to do next."""
    from carillon.files.atomic import atomic_path
    from carillon.files.yaml_input import parse_yaml
    from sound.project.project import project_of
    from sound.project.template import project_text

    options = collect(InitOptions, arguments)
    path, is_new = _writable(options.path or ".")
    files = ProjectFiles(path.parent, is_new)
    values = _solid(options, files)
    surface = _surface(options.mesh, values)
    values["targets"] = _targets(options, surface, files)
    heard = _heard(options)
    text = project_text(values)
    project_of(parse_yaml(text), path.parent)
    with files.written(), atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print(_sentence(options, path, surface, files))
    for line in heard:
        print(line)
    return 0


def _writable(path: str) -> tuple[Path, bool]:
    """The file to write, and whether its folder has to be made."""
    from carillon.files.paths import require_writable
    from sound.outputs import require_output

    is_new = not os.path.isdir(path) and (path.endswith("/") or not Path(path).suffix)
    file = Path(path, DEFAULT_NAME) if is_new or os.path.isdir(path) else Path(path)
    if os.path.lexists(file):
        raise UserError(f"{file}: is there already; name another file, or remove it first")
    if is_new:
        require_writable(str(file.parent))
        return file, True
    return require_output(file, ENDINGS), False


def _solid(options: InitOptions, files: ProjectFiles) -> dict[str, Any]:
    """Keys of the project that say what the solid is."""
    from carillon.builtin_names import BUILTIN_PREFIX
    from carillon.fem.geometry.turning import up_of_format
    from carillon.parameters.quantities import unit_in_words

    builtin = options.mesh.startswith(BUILTIN_PREFIX)
    values: dict[str, Any] = {"mesh": options.mesh if builtin else files.named(options.mesh)}
    if options.unit != 1.0:
        values["unit"] = unit_in_words(options.unit)
    up = options.up or up_of_format(options.mesh)
    if up is not None:
        values["up"] = up
    if options.wall is not None:
        values |= {"wall": options.wall, "discretisation": "finite-cell"}
    return values


def _surface(mesh: str, values: Mapping[str, Any]) -> Surface:
    """The surface that is struck, of which hints are logged."""
    from carillon.fem.geometry.hints import MeshHints
    from carillon.fem.geometry.walls import WallSize
    from carillon.parameters.model import checked
    from sound.strikes import struck_surface

    unit = checked("unit", values.get("unit", 1.0), MetresPerUnit)
    wall = WallSize(values["wall"]) if "wall" in values else None
    up = values.get("up")
    surface = struck_surface(mesh, unit, wall=wall, up=up)
    MeshHints.of(mesh, surface, unit, up, is_wall=wall is not None).say()
    return surface


def _targets(options: InitOptions, surface: Surface, files: ProjectFiles) -> list[dict[str, Any]]:
    if options.clips is None:
        return _at_points(surface, [PLACEHOLDER], options.unit)
    clips = [files.named(clip) for clip in options.clips]
    targets = _at_points(surface, clips, options.unit)
    if options.allow_clipped:
        targets = [target | {"allow_clipped": True} for target in targets]
    return targets


def _at_points(surface: Surface, clips: Sequence[str], unit: float) -> list[dict[str, Any]]:
    import numpy as np

    from solver.response.vertices import spread
    from sound.clips.files import clip_names
    from sound.strikes import longest_side

    vertices = np.asarray(surface.vertices)[np.unique(surface.faces)]
    chosen = spread(vertices, surface.bounds.mean(axis=0)[None], len(clips))
    if len(chosen) < len(clips):
        raise UserError(
            f"{len(clips):,} clips for {len(chosen):,} points of the surface; give fewer"
        )
    decimals = DIGITS - int(np.ceil(np.log10(longest_side(surface) / unit)))
    positions = np.round(vertices[chosen] / unit, decimals) + 0.0  # no -0.0
    return [
        {"name": name, "at": position, "clip": clip}
        for name, position, clip in zip(clip_names(clips), positions.tolist(), clips)
    ]


def _heard(options: InitOptions) -> list[str]:
    """A line for each clip: the partials that count, and what is unusual."""
    from sound.clips.audibility import heard_in_words, heard_partials
    from sound.clips.extraction import remarks
    from sound.clips.files import extract_file
    from sound.clips.wav import read_wav

    clips = dict.fromkeys(options.clips or ())
    faults: list[str] = []
    for clip in clips:  # all of them, before any is searched
        try:
            read_wav(clip, options.allow_clipped)
        except UserError as error:
            faults += error.args
    if faults:
        raise UserError(*faults)
    lines = []
    for clip in clips:
        sound = extract_file(clip, visible=True, allow_clipped=options.allow_clipped)
        heard = heard_in_words(heard_partials(sound).frequencies)
        lines.append(f"{clip}: {'; '.join([heard, *remarks(sound.evidence)])}")
    return lines


def _sentence(options: InitOptions, path: Path, surface: Surface, files: ProjectFiles) -> str:
    from carillon.fem.geometry.size import lengths_in_words

    out = path.with_suffix(".h5").as_posix()
    run = shlex.join(["carillon", "design", path.as_posix(), "--out", out])
    solid = f"{path}: a project of {options.mesh}, {lengths_in_words(surface.extents)}"
    if files.copied:
        solid += f", with copies of {' and '.join(files.copied)}"
    if options.clips is not None:
        return f"{solid}; next: {run}"
    return f"{solid}; record a strike as {path.parent / PLACEHOLDER}, then: {run}"
