"""Finite cells of a surface."""

from collections.abc import Callable

import numpy as np

from carillon.arrays import Surface
from carillon.errors import UserError
from carillon.fem.finite_cells.basis import DEGREE, basis
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.cover import cover_of
from carillon.fem.finite_cells.covering import SMALLEST_PIECE, Covering, pieces
from carillon.fem.finite_cells.inside import Inside, fills, find_inside
from carillon.fem.finite_cells.lines import CUT, FULL
from carillon.fem.geometry.contacts import one_body
from carillon.fem.geometry.grid import Grid, bounding_grid
from carillon.fem.geometry.size import length_in_words
from carillon.fem.geometry.voxels import COMPONENTS, checked_resolution
from carillon.fem.geometry.walls import Wall

LOST = 1.1
"""Ratio of the volumes by two halves of the lines beyond which parts slip between the lines."""
SEEN, SURELY_SEEN = 0.03, 0.01
"""Relative error of the volume beyond which the lines are too few for a thin rod or wall, and that
of a resolution which is proposed."""
THINNEST = 0.01
"""Thickness of a wall, over the spacing, below which it is refused."""
TRIAL_FACTORS = (1.25, 1.5, 2.0, 3.0, 4.0, 6.0, *(2.0**power for power in range(3, 16)))
"""Factors by which a resolution is raised in search of one at which nothing is lost, or the solid
is in one piece."""
TRIAL_GRID = 4_000_000
PIECES_GRID = 200_000
"""Largest grids [voxels] of such trials."""


def covering(
    surface: Surface | Wall,
    resolution: int,
    components: str = "error",
    name: str = "mesh",
    grid: Grid | None = None,
    degree: int = DEGREE,
) -> Covering:
    """The cells of a lattice that cover the inside of a surface; see `finite_cells`.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> cover = covering(builtin_surface("bell"), 12)
    >>> finer = cover.divided([cover.cells.corner[:3] // 4])
    >>> len(finer) > len(cover.cells)
    True
    """
    triangles = surface.skin if isinstance(surface, Wall) else surface
    resolution = checked_resolution(triangles, resolution, name)
    if components not in COMPONENTS:
        raise UserError(
            f"components {components!r} is unknown, expected one of {', '.join(COMPONENTS)}"
        )
    grid = whole_cells(grid or cell_grid(surface, resolution, degree), degree)
    if isinstance(surface, Wall):
        _require_thick(surface, resolution, grid, name)
    else:
        surface = one_body(surface, components, name)
    inside = find_inside(surface, grid)
    if isinstance(surface, Wall) and fills(surface, inside, grid):
        surface.say_filled(name)
    if not _holds(inside):
        raise UserError(_lost(surface, inside, resolution, grid, name))
    share = _seen_share(surface, inside, grid)
    if abs(share - 1.0) > SEEN:
        raise UserError(_unseen(surface, share, resolution, grid, name))
    cover = cover_of(inside, basis(degree))
    piece, volumes = pieces(cover)
    kept = np.flatnonzero(volumes >= SMALLEST_PIECE)
    if not len(kept):
        raise UserError(_lost(surface, inside, resolution, grid, name))
    if len(kept) > 1 and components == "error":
        raise UserError(_in_pieces(surface, volumes[kept], resolution, name))
    return Covering(surface, name, degree, grid, cover, piece == volumes.argmax())


def finite_cells(
    surface: Surface | Wall,
    resolution: int,
    components: str = "error",
    name: str = "mesh",
    grid: Grid | None = None,
    degree: int = DEGREE,
) -> FiniteCells:
    """Cover the inside of a surface, or a wall, with cells of degree 4.

    Raises UserError if the resolution is not an integer >= 2 or needs too large a lattice, if the
    surface encloses nothing, or walls too thin for the lattice, or the solid is in pieces; if a
    wall is thinner than `THINNEST` of the lattice's spacing.

    Parameters
    ----------
    surface
        Triangles in metres; holes and overlapping shells are allowed. Or the wall that follows
        some.
    resolution
        Lattice spacings along the longest side of the bounding box, at least 2. Cells have four
        times that edge, and nodes a spacing apart.
    components
        ``"error"`` rejects a solid in several pieces, ``"largest"`` keeps the largest.
    grid
        Lattice of about this resolution around the solid, see `whole_cells`; `cell_grid` if None.
    degree
        Of the cells' shape functions, see `carillon.fem.finite_cells.basis`. Those of degree 2 have
        twice the spacing for an edge.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> cells = finite_cells(builtin_surface("bell"), 12)
    >>> bool(abs(cells.volume / 8.79e-4 - 1.0) < 0.01), len(cells)
    (True, 29)
    """
    return covering(surface, resolution, components, name, grid, degree).cells


def cell_grid(surface: Surface | Wall, resolution: int, degree: int = DEGREE) -> Grid:
    """The bounding grid, centred, with a whole number of cells of this degree along each axis."""
    grid = bounding_grid(surface, resolution)
    more = -np.array(grid.shape) % degree
    nx, ny, nz = (int(size) for size in np.array(grid.shape) + more)
    return Grid(grid.origin - 0.5 * more * grid.edge, grid.edge, (nx, ny, nz))


def whole_cells(grid: Grid, degree: int = DEGREE) -> Grid:
    """The lattice with more voxels at its far ends, where these would not be whole cells."""
    nx, ny, nz = (-(-size // degree) * degree for size in grid.shape)
    return Grid(grid.origin, grid.edge, (nx, ny, nz))


def _require_thick(wall: Wall, resolution: int, grid: Grid, name: str) -> None:
    """Refuse a wall far thinner than the spacing, whose stiffness would be lost in rounding."""
    if wall.thickness >= THINNEST * grid.edge:
        return
    better = int(np.ceil(resolution * THINNEST * grid.edge / wall.thickness))
    raise UserError(
        f"mesh {name!r} at resolution {resolution}: found a wall of "
        f"{length_in_words(wall.thickness)}, expected at least {THINNEST:g} of the lattice spacing "
        f"of {length_in_words(grid.edge)}; raise the resolution to {better}, or make it thicker"
    )


def _holds(inside: Inside) -> bool:
    if inside.sheet:
        return False
    if not (inside.state == CUT).any():
        return bool((inside.state == FULL).any())
    volumes = inside.volumes()
    return 0.0 < min(volumes) and max(volumes) <= LOST * min(volumes)


def _seen_share(surface: Surface | Wall, inside: Inside, grid: Grid) -> float:
    """Volume by the lines over that of the surface; 1 unless this is one closed shell."""
    volume = _shell_volume(surface)
    return float(_volume(inside) * grid.edge**3 / volume) if volume else 1.0


def _shell_volume(surface: Surface | Wall) -> float | None:
    """Volume [m^3] inside the surface; None unless this is one closed shell."""
    if isinstance(surface, Wall):
        return None
    if not surface.is_watertight:  # Triangles may have vertices of their own.
        surface = surface.copy(include_cache=False)
        surface.merge_vertices(merge_tex=True, merge_norm=True)
    if not surface.is_watertight or not surface.is_winding_consistent or surface.body_count != 1:
        return None
    return abs(float(surface.volume))


def _volume(inside: Inside) -> float:
    """Volume [voxels] by the lines."""
    return float(np.count_nonzero(inside.state == FULL) + 0.5 * sum(inside.volumes()))


def _unseen(surface: Surface | Wall, share: float, resolution: int, grid: Grid, name: str) -> str:
    better = _better_resolution(surface, resolution, _holds, TRIAL_GRID)
    remedy = f"to {better}" if better else "or turn the solid"
    return (
        f"mesh {name!r} at resolution {resolution} is so thin that lines of the lattice, whose "
        f"spacing is {length_in_words(grid.edge)}, find {share:.0%} of its volume; raise the "
        f"resolution {remedy}"
    )


def _lost(surface: Surface | Wall, inside: Inside, resolution: int, grid: Grid, name: str) -> str:
    start = f"mesh {name!r} at resolution {resolution}"
    nothing = f"{start} encloses nothing; expected a surface around a solid, repair the mesh"
    if inside.sheet:
        return nothing
    better = _better_resolution(surface, resolution, _is_more_than_a_crumb, PIECES_GRID)
    crossed = any(len(each.low) for each in inside.pieces)
    if not (better or crossed or _shell_volume(surface)):
        return nothing
    remedy = f"to {better}" if better else "or make them thicker"
    return (
        f"{start} has parts far thinner than the lattice spacing of {length_in_words(grid.edge)}, "
        f"which are lost between its lines; raise the resolution {remedy}"
    )


def _in_pieces(surface: Surface | Wall, volumes: np.ndarray, resolution: int, name: str) -> str:
    listed = ", ".join(f"{volume:,.0f}" for volume in sorted(volumes)[:-5:-1])
    # A piece for each closed shell: these are apart, and no lattice joins them.
    triangles = surface.surface if isinstance(surface, Wall) else surface
    apart = 1 < triangles.body_count <= len(volumes)
    better = None if apart else _better_resolution(surface, resolution, _is_one_piece, PIECES_GRID)
    remedy = f"raise the resolution to {better}, where it is one" if better else "join them"
    return (
        f"mesh {name!r} at resolution {resolution} is in {len(volumes):,} pieces ({listed} voxels "
        f"the largest); {remedy}, or keep the largest alone (--components largest)"
    )


def _is_more_than_a_crumb(inside: Inside) -> bool:
    if not _holds(inside) or _volume(inside) < SMALLEST_PIECE:
        return False
    volumes = pieces(cover_of(inside, basis()))[1]
    return bool((volumes >= SMALLEST_PIECE).any())


def _is_one_piece(inside: Inside) -> bool:
    volumes = pieces(cover_of(inside, basis()))[1]
    return _holds(inside) and np.count_nonzero(volumes >= SMALLEST_PIECE) == 1


def _better_resolution(
    surface: Surface | Wall, resolution: int, accepts: Callable[[Inside], bool], largest: int
) -> int | None:
    """A higher resolution that `accepts` what is inside, on a grid of at most `largest` voxels."""
    volume = _shell_volume(surface)
    for factor in TRIAL_FACTORS:
        better = int(np.ceil(factor * resolution))
        trial = cell_grid(surface, better)
        if np.prod([float(size) for size in trial.shape]) > largest:
            return None
        if volume and volume < SMALLEST_PIECE * trial.edge**3:
            continue
        inside = find_inside(surface, trial)
        if accepts(inside) and abs(_seen_share(surface, inside, trial) - 1.0) <= SURELY_SEEN:
            return better
    return None
