"""`carillon export`: a design for other tools."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from carillon.command_line.counts import counted
from carillon.parameters import REQUIRED, OneOf, option, parameters
from carillon.parameters.command_line import add_options, collect
from sound.commands.common_options import DampingOptions
from sound.export.formats import FOLDER, FORMATS, PARTS, ExportSettings, format_of
from sound.export.sound_set_options import SoundSetOptions

if TYPE_CHECKING:  # Its import takes long, and `--help` needs none.
    from sound.project.design import Design


@parameters
class ExportOptions:
    """What is exported, and where to."""

    design: str = option(REQUIRED, "design.h5")
    out: str = option(
        REQUIRED,
        "file to write: .h5 (embedded mesh with eigenpairs), .gltf, .glb, .dsp (Faust), .js (Web "
        "Audio), .json, .csv (tables of modes), or .npy (Young's moduli [Pa] of the fine cells, "
        "for carillon modes --material); or a folder, ending in /, of sounds with their levels and "
        "all models, for game engines",
    )
    format: Annotated[str, OneOf(*FORMATS)] | None = option(
        None,
        "where --out has another ending; parts fills a folder with the parts of a design that was "
        "built of real materials: STL, 3MF, a table and a file of regions",
    )
    json: bool = option(False, "print what was written as JSON")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, ExportOptions, positional=("design",))
    add_options(parser, ExportSettings)
    add_options(parser, SoundSetOptions)
    add_options(parser, DampingOptions)


def run(arguments: argparse.Namespace) -> int:
    """Write the file or folder and say what it holds."""
    from sound.project.design_file import read_design

    options, settings = collect(ExportOptions, arguments), collect(ExportSettings, arguments)
    kind = format_of(options.out, options.format)
    _require_output(options, kind)
    design = read_design(options.design).damped_by(collect(DampingOptions, arguments).damping_from)
    if kind == FOLDER:
        told = _write_folder(options, design, settings, collect(SoundSetOptions, arguments))
    elif kind == PARTS:
        told = _write_parts(options, design)
    else:
        told = _write_file(options, design, kind, settings)
    print(json.dumps(told) if options.json else told["sentence"])
    return 0


def _require_output(options: ExportOptions, kind: str) -> None:
    if kind in (FOLDER, PARTS):
        from sound.export.placing import require_folder

        require_folder(options.out)
    else:
        from sound.outputs import require_output

        require_output(options.out, [Path(options.out).suffix.lower()], [options.design])


def _write_file(
    options: ExportOptions, design: Design, kind: str, settings: ExportSettings
) -> dict[str, Any]:
    from sound.export.formats import export_design

    name = Path(options.design).stem
    export_design(options.out, design, kind, settings, options.design, name)
    size = Path(options.out).stat().st_size
    return {
        "out": options.out,
        "format": kind,
        "bytes": size,
        "sentence": f"{options.out}: {_content(kind, design)}, {size:,} bytes",
    }


def _write_folder(
    options: ExportOptions, design: Design, settings: ExportSettings, sounds: SoundSetOptions
) -> dict[str, Any]:
    from dataclasses import asdict

    from sound.export.engine_folder import TABLES, write_engine_folder

    name = Path(options.design).stem
    written = write_engine_folder(options.out, design, sounds, settings, name)
    size = sum((Path(options.out) / file).stat().st_size for file in written.files)
    points = len({level.point for level in written.levels})
    models = len(written.files) - len(written.levels) - len(TABLES)
    sentence = (
        f"{options.out}: {counted(len(written.levels), 'sound')} of {counted(points, 'point')}, "
        f"{counted(len(sounds.strengths), 'strength')} and "
        f"{counted(sounds.variations, 'variation')}, 24 bits at {sounds.rate:,} Hz; levels in "
        f"sounds.csv and sounds.json; {counted(models, 'model')}; {size:,} bytes"
    )
    sentence += _removal(written.removed)
    return {
        "out": options.out,
        "format": FOLDER,
        "bytes": size,
        "files": written.files,
        "missing": written.missing,
        "removed": written.removed,
        "sounds": [asdict(level) for level in written.levels],
        "sentence": sentence,
    }


def _write_parts(options: ExportOptions, design: Design) -> dict[str, Any]:
    from sound.export.parts_folder import write_parts

    written = write_parts(options.out, design)
    listed = ", ".join(f"{row['material']} {row['mass_g']:.4g} g" for row in written.rows)
    surfaces = (
        "cut by the solid's surface"
        if written.is_clipped
        else "with the faces of voxels, since manifold3d is not installed or the mesh not closed"
    )
    return {
        "out": options.out,
        "format": PARTS,
        "files": written.files,
        "parts": written.rows,
        "is_clipped": written.is_clipped,
        "removed": written.removed,
        "sentence": f"{options.out}: {counted(len(written.rows), 'part')} in millimetres, "
        f"{surfaces}: {listed}{_removal(written.removed)}",
    }


def _removal(files: list[str]) -> str:
    """End of a sentence, of files of a former export that were removed."""
    return f"; {counted(len(files), 'file')} of a former export removed" if files else ""


def _content(kind: str, design: Design) -> str:
    from sound.export.formats import exported_moduli, has_table

    if kind == "npy":
        young, model = exported_moduli(design), design.model
        text = (
            f"{len(young):,} moduli, {young.min() / 1e9:.3g} to {young.max() / 1e9:.3g} GPa, for "
        )
        if has_table(design):
            return f"{text}--regions: factors on those of the regions, times 1 GPa"
        return f"{text}--density {model.density:.6g} --poisson {model.poisson:.6g}"
    hertz = design.frequencies
    return f"{counted(len(hertz), 'mode')}, {hertz[0]:.4g} to {hertz[-1]:.4g} Hz"
