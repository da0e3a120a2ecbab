"""The formats that a design is exported in, each loaded when it is asked for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from carillon.errors import UserError
from carillon.files.atomic import atomic_path

if TYPE_CHECKING:
    from carillon.arrays import Array
    from sound.project.design import Design

FORMATS = ("h5", "gltf", "glb", "dsp", "npy")


def format_of(out: str, named: str | None = None) -> str:
    """The format of a file, as named or as its ending says.

    Raises UserError if the two contradict each other, or neither tells one.
    """
    ending = Path(out).suffix.lstrip(".").lower()
    if named is not None and ending in FORMATS and ending != named:
        raise UserError(
            f"--out {out}: ends in .{ending}, but --format is {named}; leave one of them"
        )
    if named is None and ending not in FORMATS:
        raise UserError(
            f"--out {out}: the ending tells no format, expected one of .{', .'.join(FORMATS)}; or "
            "name it by --format"
        )
    return named or ending


def export_design(
    path: str | Path, design: Design, kind: str, points: int = 0, source: str | None = None
) -> None:
    """Write a design, read from the file `source`, in one of `FORMATS`.

    A Faust program has so many struck points besides the targets'.  Raises UserError if the file
    cannot be written.
    """
    match kind:
        case "h5":
            from sound.export.embedded import write_embedded

            write_embedded(path, design, {} if source is None else {"design": source})
        case "dsp":
            from sound.export.faust import write_faust

            write_faust(path, design, points)
        case "npy":
            from numpy import save

            with atomic_path(path) as temporary, open(temporary, "wb") as file:
                save(file, exported_moduli(design))
        case _:
            from sound.export.gltf import write_gltf

            write_gltf(path, design, binary=kind == "glb")


def exported_moduli(design: Design) -> Array:
    """Moduli (M,) [Pa] of the voxels as `carillon modes --material` takes them.

    Those of a solid with regions are the factors on the regions' moduli, times 1 GPa.
    """
    if not has_table(design):
        return design.young
    from carillon.fem.materials import UNIFORM_YOUNG

    return design.young / design.model.regions.moduli(design.fine_region) * UNIFORM_YOUNG


def has_table(design: Design) -> bool:
    """Whether a design names regions."""
    return bool(design.settings.get("regions"))
