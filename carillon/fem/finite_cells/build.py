"""Finite cells of a surface."""

from collections.abc import Callable

import numpy as np

from carillon.arrays import Surface
from carillon.errors import UserError
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.cover import cover_of
from carillon.fem.finite_cells.covering import SMALLEST_PIECE, Covering, pieces
from carillon.fem.finite_cells.inside import Inside, find_inside
from carillon.fem.finite_cells.lines import CUT, FULL
from carillon.fem.geometry.contacts import one_body
from carillon.fem.geometry.grid import Grid, bounding_grid
from carillon.fem.geometry.voxels import COMPONENTS, checked_resolution

LOST = 1.1
"""Ratio of the volumes by two halves of the lines beyond which parts slip between the lines."""
SEEN, SURELY_SEEN = 0.03, 0.01
"""Relative error of the volume beyond which the lines are too few for a thin rod or wall, and that
of a resolution which is proposed."""
TRIAL_FACTORS = (1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Factors by which a resolution is raised in search of one at which nothing is lost, or the solid
is in one piece."""
TRIAL_GRID = 4_000_000
PIECES_GRID = 200_000
"""Largest grids [voxels] of such trials."""


def covering(
    surface: Surface,
    resolution: int,
    components: str = "error",
    name: str = "mesh",
    grid: Grid | None = None,
) -> Covering:
    """The cells of a lattice that cover the inside of a surface; see `finite_cells`.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> cover = covering(builtin_surface("bell"), 12)
    >>> division = cover.divided(cover.cells.grid[:3])
    >>> len(division.cells) > len(cover.cells)
    True
    """
    resolution = checked_resolution(surface, resolution, name)
    if components not in COMPONENTS:
        raise UserError(
            f"components {components!r} is unknown, expected one of {', '.join(COMPONENTS)}"
        )
    grid = grid or even_grid(surface, resolution)
    surface = one_body(surface, components, name)
    inside = find_inside(surface, grid)
    if not _holds(inside):
        raise UserError(_lost(surface, inside, resolution, grid, name))
    share = _seen_share(surface, inside, grid)
    if abs(share - 1.0) > SEEN:
        raise UserError(_unseen(surface, share, resolution, grid, name))
    cover = cover_of(inside)
    piece, volumes = pieces(cover)
    kept = np.flatnonzero(volumes >= SMALLEST_PIECE)
    if not len(kept):
        raise UserError(_lost(surface, inside, resolution, grid, name))
    if len(kept) > 1 and components == "error":
        raise UserError(_in_pieces(surface, volumes[kept], resolution, name))
    return Covering(surface, name, grid, cover, piece == volumes.argmax())


def finite_cells(
    surface: Surface,
    resolution: int,
    components: str = "error",
    name: str = "mesh",
    grid: Grid | None = None,
) -> FiniteCells:
    """Cover the inside of a surface with quadratic cells.

    Raises UserError if the resolution is not an integer >= 2 or needs too large a lattice, if the
    surface encloses nothing, or walls too thin for the lattice, or the solid is in pieces.

    Parameters
    ----------
    surface
        Triangles in metres; holes and overlapping shells are allowed.
    resolution
        Lattice spacings along the longest side of the bounding box, at least 2. Cells have twice
        that edge, and a node every spacing.
    components
        ``"error"`` rejects a solid in several pieces, ``"largest"`` keeps the largest.
    grid
        Lattice of about this resolution around the solid, with an even number of voxels along each
        axis; `even_grid` if None.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> cells = finite_cells(builtin_surface("bell"), 12)
    >>> bool(abs(cells.volume / 8.79e-4 - 1.0) < 0.01), len(cells) > 90
    (True, True)
    """
    return covering(surface, resolution, components, name, grid).cells


def even_grid(surface: Surface, resolution: int) -> Grid:
    """The bounding grid, centred, with an even number of voxels along each axis."""
    grid = bounding_grid(surface, resolution)
    shape = np.array(grid.shape)
    more = shape % 2
    even = [int(size) for size in shape + more]
    return Grid(grid.origin - 0.5 * more * grid.edge, grid.edge, (even[0], even[1], even[2]))


def _holds(inside: Inside) -> bool:
    if inside.sheet:
        return False
    if not (inside.state == CUT).any():
        return bool((inside.state == FULL).any())
    volumes = inside.volumes()
    return 0.0 < min(volumes) and max(volumes) <= LOST * min(volumes)


def _seen_share(surface: Surface, inside: Inside, grid: Grid) -> float:
    """Volume by the lines over that of the surface; 1 unless this is one closed shell."""
    if not surface.is_watertight:  # Triangles may have vertices of their own.
        surface = surface.copy(include_cache=False)
        surface.merge_vertices(merge_tex=True, merge_norm=True)
    if not surface.is_watertight or not surface.is_winding_consistent or surface.body_count != 1:
        return 1.0
    full = np.count_nonzero(inside.state == FULL)
    return float((full + 0.5 * sum(inside.volumes())) * grid.edge**3 / abs(surface.volume))


def _unseen(surface: Surface, share: float, resolution: int, grid: Grid, name: str) -> str:
    better = _better_resolution(surface, resolution, _holds, TRIAL_GRID)
    remedy = f"to {better}" if better else "or turn the solid"
    return (
        f"mesh {name!r} at resolution {resolution} is so thin that lines of the lattice, whose "
        f"spacing is {grid.edge:.3g} m, find {share:.0%} of its volume; raise the resolution "
        f"{remedy}"
    )


def _lost(surface: Surface, inside: Inside, resolution: int, grid: Grid, name: str) -> str:
    start = f"mesh {name!r} at resolution {resolution}"
    nothing = f"{start} encloses nothing; expected a surface around a solid, repair the mesh"
    if inside.sheet:
        return nothing
    better = _better_resolution(surface, resolution, _holds, TRIAL_GRID)
    if not better and not any(len(each.low) for each in inside.pieces):
        return nothing
    remedy = f"to {better}" if better else "or make them thicker"
    return (
        f"{start} has parts far thinner than the lattice spacing of {grid.edge:.3g} m, which are "
        f"lost between its lines; raise the resolution {remedy}"
    )


def _in_pieces(surface: Surface, volumes: np.ndarray, resolution: int, name: str) -> str:
    listed = ", ".join(f"{volume:,.0f}" for volume in sorted(volumes)[:-5:-1])
    # A piece for each closed shell: these are apart, and no lattice joins them.
    apart = 1 < surface.body_count <= len(volumes)
    better = None if apart else _better_resolution(surface, resolution, _is_one_piece, PIECES_GRID)
    remedy = f"raise the resolution to {better}, where it is one" if better else "join them"
    return (
        f"mesh {name!r} at resolution {resolution} is in {len(volumes):,} pieces ({listed} voxels "
        f"the largest); {remedy}, or keep the largest alone (--components largest)"
    )


def _is_one_piece(inside: Inside) -> bool:
    volumes = pieces(cover_of(inside))[1]
    return _holds(inside) and np.count_nonzero(volumes >= SMALLEST_PIECE) == 1


def _better_resolution(
    surface: Surface, resolution: int, accepts: Callable[[Inside], bool], largest: int
) -> int | None:
    """A higher resolution that `accepts` what is inside, on a grid of at most `largest` voxels."""
    for factor in TRIAL_FACTORS:
        better = int(np.ceil(factor * resolution))
        trial = even_grid(surface, better)
        if np.prod([float(size) for size in trial.shape]) > largest:
            return None
        inside = find_inside(surface, trial)
        if accepts(inside) and abs(_seen_share(surface, inside, trial) - 1.0) <= SURELY_SEEN:
            return better
    return None
