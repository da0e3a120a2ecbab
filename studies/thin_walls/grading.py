"""Sizes of Gmsh's elements that fall towards joints and corners, and in slender parts."""

from collections.abc import Mapping, Sequence
from typing import Any

from carillon.arrays import Array

REACH = 3.0
"""Distance from where elements are small at which they are as large as elsewhere, in edges there.
"""


def grade(
    gmsh: Any,
    entities: str,
    tags: Sequence[int],
    size: float,
    finer: float,
    boxes: Sequence[tuple[Array, float]] = (),
) -> None:
    """Let edges of about `size` [m] be shorter by the factor `finer` near points or curves.

    The `entities` with these tags are ``PointsList`` or ``CurvesList``, see the field ``Distance``
    of Gmsh. In each of the `boxes`, lowest and highest corner (2, 3) [m], edges have a size of
    their own at most.
    """
    field = gmsh.model.mesh.field
    distance = field.add("Distance")
    field.setNumbers(distance, entities, list(tags))
    field.setNumber(distance, "Sampling", 100)
    limits = {"SizeMin": size / finer, "SizeMax": size, "DistMin": 0.0, "DistMax": REACH * size}
    fields = [_added(field, "Threshold", {"InField": distance, **limits})]
    for (low, high), edge in boxes:
        within = {"VIn": edge, "VOut": size, "Thickness": REACH * size}
        for end, corner in (("Min", low), ("Max", high)):
            within |= {f"{axis}{end}": float(place) for axis, place in zip("XYZ", corner)}
        fields.append(_added(field, "Box", within))
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", fields)
    field.setAsBackgroundMesh(smallest)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size / finer)
    for option in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
        gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)


def _added(field: Any, kind: str, values: Mapping[str, float]) -> int:
    """A field with these values."""
    tag: int = field.add(kind)
    for name, value in values.items():
        field.setNumber(tag, name, value)
    return tag
