"""The surface of a solid, read once for all that is made of it."""

from dataclasses import dataclass
from typing import Self

from carillon.arrays import Surface
from carillon.composition.entries import describes_regions, joined_surface, read_composition
from carillon.fem.geometry import load_surface, surface_name
from carillon.fem.geometry.size import doubt_unit


@dataclass(frozen=True)
class SolidSurface:
    """Triangles around a solid."""

    mesh: str
    """Path of the file, or `builtin:NAME`."""
    triangles: Surface
    """The surface in metres."""
    unit: float = 1.0
    """Metres per unit of the mesh's own coordinates."""

    @classmethod
    def read(cls, mesh: str, unit: float = 1.0) -> Self:
        """Read the mesh, see `carillon.fem.geometry.load_surface` also for the errors.

        Of a file of regions with a mesh each it is that of all together.
        """
        if describes_regions(mesh):
            return cls(mesh, joined_surface(read_composition(mesh), mesh), unit)
        return cls(mesh, load_surface(mesh, unit), unit)

    @property
    def name(self) -> str:
        """Short name for messages and files."""
        return surface_name(self.mesh)

    @property
    def extents(self) -> tuple[float, ...]:
        """Sides (3,) of the bounding box [m]."""
        return tuple(float(side) for side in self.triangles.extents)

    def doubt_unit(self) -> None:
        """Log a hint, once, if the size suggests that the unit is mistaken."""
        doubt_unit(self.mesh, self.extents, self.unit)
