"""Solid voxel models of surfaces."""

import operator
from dataclasses import dataclass, replace

import numpy as np

from carillon.arrays import Surface
from carillon.errors import UserError
from carillon.fem.geometry.contacts import one_body
from carillon.fem.geometry.fill import FILLS, cut_triangles
from carillon.fem.geometry.grid import Grid, bounding_grid
from carillon.fem.geometry.size import length_in_words
from carillon.fem.geometry.topology import pieces as label_pieces

COMPONENTS = ("error", "largest")

MAX_GRID = 16_000_000
"""Most voxels of a bounding grid; filling takes about 150 bytes for each of them."""
MAX_TRIANGLES = 100_000_000
"""Most triangles that a surface may be cut into; each takes about 100 bytes."""
TRIAL_FACTORS, TRIAL_GRID = (1.25, 1.5, 2.0, 3.0), 500_000
"""Factors by which a resolution is raised in search of one that leaves the model in one piece,
and the largest grid [voxels] that such a trial may have."""


@dataclass(frozen=True, eq=False)
class VoxelModel:
    """Filled cubes of one edge length on a grid with an even number of cells along each axis."""

    filled: np.ndarray
    """(nx, ny, nz) bool: with even nx, ny, nz, so that 2x2x2 blocks start at index 0."""
    origin: np.ndarray
    """(3,) corner of the grid with the lowest coordinates [m]."""
    edge: float
    """Edge of a voxel [m]."""
    name: str
    """Name of the model for messages and files."""
    resolution: int
    """Voxels along the longest side of the surface's bounding box."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along x, y and z."""
        nx, ny, nz = self.filled.shape
        return nx, ny, nz

    @property
    def n_cells(self) -> int:
        """Number of filled voxels."""
        return int(np.count_nonzero(self.filled))

    @property
    def volume(self) -> float:
        """Volume of the filled voxels [m^3]."""
        return self.n_cells * self.edge**3

    @property
    def piece_sizes(self) -> np.ndarray:
        """Voxels in each face-connected piece, descending."""
        return label_pieces(self.filled)[1]


def voxelize(
    surface: Surface,
    resolution: int,
    fill: str = "winding",
    components: str = "error",
    name: str = "mesh",
) -> VoxelModel:
    """Fill the inside of a surface with cubes that hang together through their faces.

    Raises UserError if the resolution is not an integer >= 2 or needs too large a grid, if no voxel
    is filled, if the model falls into pieces, or its bodies touch along edges or in points alone.

    Parameters
    ----------
    surface
        Triangles in metres; holes and overlapping shells are allowed.
    resolution
        Voxels along the longest side of the bounding box, at least 2.
    fill
        How voxels are chosen, a key of `FILLS`; see `carillon.fem.geometry.fill`.
    components
        ``"error"`` rejects a model of several face-connected pieces, ``"largest"`` keeps the
        largest. Cubes that share but an edge or a corner would be joined by a hinge, which adds
        zero-frequency modes that the object does not have.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> voxels = voxelize(builtin_surface("box"), 8)
    >>> max(voxels.shape), voxels.n_cells == voxels.filled.sum()
    (8, True)
    """
    resolution = checked_resolution(surface, resolution, name)
    _require_few_triangles(surface, resolution, name)
    if fill not in FILLS:
        raise UserError(f"fill {fill!r} is unknown, expected one of {', '.join(FILLS)}")
    if components not in COMPONENTS:
        raise UserError(
            f"components {components!r} is unknown, expected one of {', '.join(COMPONENTS)}"
        )
    grid = bounding_grid(surface, resolution)
    surface = one_body(surface, components, name)
    model = _filled_model(surface, grid, resolution, fill, name)
    if model.n_cells == 0:
        raise UserError(
            f"mesh {name!r} at resolution {resolution} fills no voxel: its walls are thinner than "
            f"a voxel of {length_in_words(model.edge)}, or it encloses nothing; raise the "
            "resolution or repair the mesh"
        )
    labels, sizes = label_pieces(model.filled)
    if len(sizes) > 1 and components == "error":
        raise UserError(_pieces_message(surface, model, fill, sizes))
    return replace(model, filled=labels == 1)


def checked_resolution(surface: Surface, resolution: int, name: str) -> int:
    """The resolution as an int.

    Raises UserError if it is none of at least 2, or needs too large a grid.
    """
    try:
        checked = operator.index(resolution)
    except TypeError:
        checked = 0
    if checked < 2 or isinstance(resolution, bool):
        raise UserError(
            f"resolution {resolution!r}: expected a whole number of at least 2 voxels along the "
            f"longest side"
        )
    extents = np.ptp(surface.bounds, axis=0)
    count = float(np.prod(np.ceil(checked * extents / extents.max())))
    if count > MAX_GRID:
        largest = int(checked * (MAX_GRID / count) ** (1 / 3))
        raise UserError(
            f"mesh {name!r} at resolution {checked:,} needs a grid of {count:,.0f} voxels, the "
            f"limit is {MAX_GRID:,}; use a resolution of about {largest} or less"
        )
    return checked


def _require_few_triangles(surface: Surface, resolution: int, name: str) -> None:
    pieces = cut_triangles(surface, float(surface.extents.max()) / resolution / 2)
    if pieces > MAX_TRIANGLES:
        raise UserError(
            f"mesh {name!r} at resolution {resolution} would be cut into {pieces:.2g} triangles, "
            f"the limit is {MAX_TRIANGLES:,}; it has too many large triangles, or use a lower "
            "resolution"
        )


def _filled_model(
    surface: Surface, grid: Grid, resolution: int, fill: str, name: str
) -> VoxelModel:
    filled, origin = FILLS[fill](surface, grid)
    # Padding at the far end keeps index 0 the start of a block.
    even = np.pad(filled, [(0, size % 2) for size in filled.shape])
    return VoxelModel(even, origin, grid.edge, name, resolution)


def _pieces_message(surface: Surface, model: VoxelModel, fill: str, sizes: np.ndarray) -> str:
    shown = [f"{size:,}" for size in sizes[:4]]
    if len(sizes) > 4:
        shown = [*shown[:3], f"{len(sizes) - 3:,} smaller ones"]
    listed = f"{', '.join(shown[:-1])} and {shown[-1]}"
    better = _connected_resolution(surface, model, fill)
    hint = f" (at {better} it is one piece)" if better else ""
    return (
        f"mesh {model.name!r} at resolution {model.resolution} falls into {len(sizes):,} pieces "
        f"({listed} voxels); raise the resolution{hint} or keep the largest alone "
        "(--components largest)"
    )


def _connected_resolution(surface: Surface, model: VoxelModel, fill: str) -> int | None:
    for factor in TRIAL_FACTORS:
        resolution = int(np.ceil(model.resolution * factor))
        if model.filled.size * factor**3 > TRIAL_GRID:
            return None
        grid = bounding_grid(surface, resolution)
        if len(_filled_model(surface, grid, resolution, fill, model.name).piece_sizes) == 1:
            return resolution
    return None
