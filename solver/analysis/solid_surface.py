"""The surface of a solid, or of what its wall follows, read once for all that is made of it."""

from dataclasses import dataclass
from typing import Self

from carillon.arrays import Surface
from carillon.composition.entries import describes_regions, joined_surface, read_composition
from carillon.errors import UserError
from carillon.fem.geometry import load_surface, surface_name
from carillon.fem.geometry.hints import MeshHints
from carillon.fem.geometry.walls import Wall, WallSize


@dataclass(frozen=True)
class SolidSurface:
    """Triangles around a solid."""

    mesh: str
    """Path of the file, or `builtin:NAME`."""
    triangles: Surface
    """The surface in metres; of a wall, both of its sides, see `Wall.skin`."""
    unit: float = 1.0
    """Metres per unit of the mesh's own coordinates."""
    wall: Wall | None = None
    """The wall that the solid is; None if it is what the surface encloses."""
    up: str | None = None
    """Axis of the mesh that points up, see `carillon.parameters.quantities.UpAxis`."""

    @classmethod
    def read(
        cls, mesh: str, unit: float = 1.0, wall: WallSize | None = None, up: str | None = None
    ) -> Self:
        """Read the mesh, see `carillon.fem.geometry.load_surface` also for the errors.

        Of a file of regions with a mesh each it is that of all together, which takes no wall.
        """
        if describes_regions(mesh):
            if wall is not None:
                raise UserError(
                    f"{mesh}: is made of its regions, expected one mesh that a wall follows; name "
                    "it, with --regions"
                )
            return cls(mesh, joined_surface(read_composition(mesh), mesh, up), unit, up=up)
        if wall is not None:
            made = wall.read(mesh, unit, up)
            return cls(mesh, made.skin, unit, made, up)
        return cls(mesh, load_surface(mesh, unit, up=up), unit, up=up)

    @property
    def name(self) -> str:
        """Short name for messages and files."""
        return surface_name(self.mesh)

    @property
    def solid(self) -> Surface | Wall:
        """What finite cells cover."""
        return self.triangles if self.wall is None else self.wall

    @property
    def extents(self) -> tuple[float, ...]:
        """Sides (3,) of the bounding box [m]."""
        return tuple(float(side) for side in self.solid.extents)

    @property
    def hints(self) -> MeshHints:
        """What may be otherwise than the mesh was opened."""
        is_wall = self.wall is not None
        return MeshHints.of(self.mesh, self.triangles, self.unit, self.up, is_wall)
