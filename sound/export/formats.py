"""The formats that a design is exported in, each loaded when it is asked for."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from carillon.errors import UserError
from carillon.files.atomic import atomic_path
from carillon.parameters import option, parameters
from carillon.parameters.quantities import UpAxis, between

if TYPE_CHECKING:
    from carillon.arrays import Array
    from sound.project.design import Design

FOLDER, PARTS = "folder", "parts"
"""What folders hold: sounds and models, or the parts of a design that was built."""
FORMATS = ("h5", "gltf", "glb", "dsp", "js", "json", "csv", "npy", FOLDER, PARTS)
MODAL = ("dsp", "js", "json", "csv")
"""Formats of a modal model, see `sound.export.modal_model`."""
MOST_POINTS = 10_000
"""To strike, each of which is an entry of a Faust program's menu."""


@parameters
class ExportSettings:
    """How a design is exported; each setting is of some formats."""

    points: Annotated[int, between(0, MOST_POINTS)] = option(
        0,
        "points to strike all over the surface, besides the targets'; of .dsp, .js, tables, /",
    )
    up: UpAxis | None = option(
        None,
        "for glTF: axis of the mesh file that points up (default: that of the design's project, or "
        "y of meshes in glTF and z of others)",
    )


def format_of(out: str, named: str | None = None) -> str:
    """The format of a file, as named or as its ending says; names of folders end in `/`.

    Raises UserError if the two contradict each other, or neither tells one.
    """
    ending = Path(out).suffix.lstrip(".").lower()
    if named is None and out.endswith(("/", os.sep)):
        named = FOLDER
    if named is not None and ending in FORMATS and ending != named:
        asked = f"--format is {named}" if named != FOLDER else "a folder is asked for"
        raise UserError(f"--out {out}: ends in .{ending}, but {asked}; leave one of them")
    if named is None and ending not in FORMATS:
        raise UserError(
            f"--out {out}: the ending tells no format, expected one of "
            f".{', .'.join(FORMATS[:-2])}, or / for a folder of sounds and models; or name it by "
            "--format"
        )
    return named or ending


def export_design(
    path: str | Path,
    design: Design,
    kind: str,
    settings: ExportSettings | None = None,
    source: str | None = None,
    name: str | None = None,
) -> None:
    """Write a design, read from the file `source`, in one of `FORMATS` other than folders'.

    The name of models is by default that of the solid.  Raises UserError if the file cannot be
    written.
    """
    settings = settings or ExportSettings()
    if kind in MODAL:
        _write_modes(path, design, kind, settings.points, name)
    elif kind == "h5":
        from sound.export.embedded import write_embedded

        write_embedded(path, design, {} if source is None else {"design": source})
    elif kind == "npy":
        from numpy import save

        with atomic_path(path) as temporary, open(temporary, "wb") as file:
            save(file, exported_moduli(design))
    else:
        from sound.export.gltf import write_gltf

        write_gltf(path, design, kind == "glb", settings.up, name)


def _write_modes(
    path: str | Path, design: Design, kind: str, points: int, name: str | None
) -> None:
    from sound.export.faust import write_faust
    from sound.export.modal_model import ModalModel
    from sound.export.modal_table import write_modal_csv, write_modal_json
    from sound.export.web_audio import write_web_audio

    writers = {
        "dsp": write_faust,
        "js": write_web_audio,
        "json": write_modal_json,
        "csv": write_modal_csv,
    }
    writers[kind](path, ModalModel.of_design(design, points, name))


def exported_moduli(design: Design) -> Array:
    """Moduli (M,) [Pa] of the voxels as `carillon modes --material` takes them.

    Those of a solid with regions are the factors on the regions' moduli, times 1 GPa. Raises
    UserError for a design that was built, whose densities differ, too.
    """
    if design.evidence.get("build"):
        raise UserError(
            "the design is built of materials of several densities, which moduli alone do not "
            "tell; export its parts (--format parts), which regions.yaml describes"
        )
    if not has_table(design):
        return design.young
    from carillon.fem.materials import UNIFORM_YOUNG

    return design.young / design.model.regions.moduli(design.fine_region) * UNIFORM_YOUNG


def has_table(design: Design) -> bool:
    """Whether a design names regions."""
    return bool(design.settings.get("regions"))
