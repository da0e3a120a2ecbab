"""Finite cells that are divided, some of them several times, fit each other."""

from itertools import product

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.block import degrees_of_freedom
from carillon.fem.element import elasticity_matrix
from carillon.fem.finite_cells import hanging
from carillon.fem.finite_cells.basis import basis
from carillon.fem.finite_cells.build import covering, finite_cells
from carillon.fem.finite_cells.covering import MOST_LEVELS
from carillon.fem.geometry import builtin_surface
from carillon.fem.geometry.grid import Grid
from carillon.fem.laplacian import laplacian_modes
from studies.accuracy.solids import SOLIDS
from tests import cut_solids, solids
from tests.cut_solids import box, divided, spaced, uniform

SHARES = {"bell": (0.2, 0.1, 0.05), "fork": (0.4, 0.1, 0.05), "box": (0.02, 0.02, 0.02, 0.02)}
"""Of the cells of each level that are divided."""


@pytest.fixture(scope="module", params=SHARES)
def some(request):
    """Undivided cells of a built-in solid, and the same with some of them divided."""
    cover = covering(builtin_surface(request.param), 14)
    return cover.cells, divided(cover, SHARES[request.param])


def own_values(cells, values):
    """Values (c, n) at the cells' own places from those of all nodes."""
    return hanging.own_values(cells.degree, values[cells.nodes][:, :, None], cells.kinds)[:, :, 0]


def test_divided_cells_fit_each_other(some):
    whole, cells = some
    assert cells.is_consistent() and (cells.kinds > 0).any()
    assert cells.levels.min() == 0 and cells.levels.max() >= 2
    assert cells.volume == pytest.approx(whole.volume, rel=1e-2)
    assert np.array_equal(cells.mesh.grid, whole.mesh.grid)
    # In one piece, by the neighbours that share faces.
    assert (laplacian_modes(uniform(cells).graph, 2)[0] > 1e-9).tolist() == [False, True]


def test_neighbours_are_at_most_twice_as_large(some):
    cells = some[1]
    finest = cells.span.min()
    low, edge = cells.corner // finest, cells.span // finest
    sizes = np.zeros(low.max(axis=0) + edge.max() + 1, dtype=int)
    for corner, size in zip(low, edge, strict=True):
        sizes[tuple(slice(start, start + size) for start in corner)] = size
    for step in product((-1, 0, 1), repeat=3):
        if 0 < np.abs(step).sum() < 3:
            beside = np.roll(sizes, step, axis=(0, 1, 2))  # nothing is at the upper ends
            both = (sizes > 0) & (beside > 0)
            assert (sizes[both] <= 2 * beside[both]).all()


def test_voxels_stay_what_they_are(some):
    """What cells have of them lies in them, and is all that is inside."""
    whole, cells = some
    low, edge = cells.frames()
    corner = cells.origin + cells.step * cells.corner + 0.0
    middle = corner[cells.cell] + cells.edges[cells.cell, None] * (low + edge[:, None] / 2.0)
    voxel = cells.origin + cells.mesh.edge * cells.mesh.grid[cells.voxel]
    own = (middle > voxel).all(axis=1) & (middle < voxel + cells.mesh.edge).all(axis=1)
    # The others are slivers in voxels of which undivided cells find nothing.
    volume = cells.shares * cells.edges[cells.cell] ** 3
    assert volume[~own].sum() < 1e-3 * cells.volume
    shares = cells.voxel_shares()
    assert shares.sum() * cells.mesh.edge**3 == pytest.approx(cells.volume)
    assert np.abs(shares - whole.voxel_shares()).mean() < 0.02


def test_quartic_displacements_are_the_same_in_all_cells(some):
    cells = some[1]
    rng = np.random.default_rng(2)
    scale = cells.positions.max()
    factors = rng.standard_normal(cells.basis.n_nodes)

    def field(places):
        powers = (places[..., None, :] / scale) ** cells.basis.degrees
        return powers.prod(axis=-1) @ factors

    values = own_values(cells, field(cells.positions))
    places = rng.random((20, 3))
    low = cells.origin + cells.step * cells.corner
    exact = field(low[:, None] + cells.edges[:, None, None] * places)
    found = values @ cells.basis.functions(places).T
    assert np.abs(found - exact).max() < 1e-10 * np.abs(exact).max()


def test_displacements_are_continuous_across_faces_and_edges():
    """Whatever the nodes' displacements are: a box, where no two cells are in one place."""
    cells = divided(covering(box(0.2, 0.2, 0.2), 12), (0.02, 0.0, 0.0, 0.0))
    assert set(cells.levels) == {0, 1, 2, 3, 4}
    rng = np.random.default_rng(3)
    values = own_values(cells, rng.standard_normal(cells.n_nodes))
    low, high = cells.corner, cells.corner + cells.span[:, None]
    sides = set()
    for one in range(len(cells)):
        bottom, top = np.maximum(low[one], low[one + 1 :]), np.minimum(high[one], high[one + 1 :])
        for other in np.flatnonzero((bottom <= top).all(axis=1)):
            start, end = bottom[other], top[other]
            sides.add(int((start == end).sum()))
            places = start + rng.random((4, 3)) * (end - start)
            found = [
                cells.basis.functions((places - low[each]) / cells.span[each]) @ values[each]
                for each in (one, one + 1 + other)
            ]
            np.testing.assert_allclose(*found, atol=1e-9)
    assert sides == {1, 2, 3}


def test_linear_displacements_have_the_energy_of_the_solid(some):
    cells = some[1]
    model = uniform(cells)
    nodes = degrees_of_freedom(cells.nodes.astype(np.int64))
    stiffness = model.stiffness()
    strain = np.array([[1.0, 0.3, 0.2], [0.3, -1.0, 0.5], [0.2, 0.5, 0.7]])
    for gradient in (strain, np.array([[0.0, 1.0, -2.0], [-1.0, 0.0, 3.0], [2.0, -3.0, 0.0]])):
        motion = (cells.positions @ gradient).ravel()[nodes]
        energy = np.einsum("ci,cij,cj->", motion, stiffness, motion)
        sym = 0.5 * (gradient + gradient.T)
        voigt = np.array([*np.diag(sym), 2 * sym[0, 1], 2 * sym[1, 2], 2 * sym[0, 2]])
        exact = cut_solids.YOUNG * cells.volume * voigt @ elasticity_matrix(0.25) @ voigt
        assert energy == pytest.approx(exact, rel=1e-6, abs=1e-8 * cut_solids.YOUNG * cells.volume)


def finer(cover):
    """The cells of the lattice of half the spacing, and all cells of this one divided."""
    cells = cover.cells
    places = np.unique(cells.corner // cells.span[:, None], axis=0)
    nx, ny, nz = (2 * size for size in cover.grid.shape)
    lattice = Grid(cover.grid.origin, cover.grid.edge / 2.0, (nx, ny, nz))
    fine = finite_cells(cover.surface, 16, grid=lattice, degree=cover.degree)
    return fine, cover.divided([places])


@pytest.mark.parametrize(
    ("surface", "degree", "tolerance"),
    [
        (builtin_surface("bell"), 2, 1e-7),
        (box(0.2, 0.149, 0.113), 4, 1e-7),
        # Half as many lines run across divided cells as across those of the finer lattice.
        (builtin_surface("bell"), 4, 2e-3),
    ],
    ids=["quadratic", "box", "quartic"],
)
def test_all_divided_are_those_of_the_finer_lattice(surface, degree, tolerance):
    fine, cells = finer(covering(surface, 8, degree=degree))
    assert (cells.levels == 1).all() and not cells.kinds.any()
    assert degree == 4 or cells.n_nodes == fine.n_nodes
    found, exact = (cut_solids.eigenvalues(uniform(each), 14)[6:] for each in (cells, fine))
    np.testing.assert_allclose(found, exact, rtol=tolerance)


@pytest.mark.parametrize("degree", [2, 4])
def test_hanging_nodes_say_what_the_whole_cell_says(degree):
    """A field on a whole cell is the same in the small ones that hang from it."""
    shape = basis(degree)
    field = np.random.default_rng(2).standard_normal(shape.n_nodes)
    masks = np.array(list(product((False, True), repeat=6)))
    for octant in range(8):
        corner = np.array([octant & 1, octant >> 1 & 1, octant >> 2])
        for kind in np.unique(hanging.kinds_of_cells(np.full(64, octant), masks)):
            places = (corner + hanging.node_places(degree, int(kind)) / degree) / 2.0
            if not kind:
                places = (corner + shape.nodes / degree) / 2.0
            values = hanging.node_weights(degree, int(kind)) @ shape.functions(places) @ field
            exact = shape.functions((corner + shape.nodes / degree) / 2.0) @ field
            np.testing.assert_allclose(values, exact, atol=1e-11)


@pytest.mark.parametrize("name", ["bell", "fork"])
def test_every_method_finds_their_modes(name):
    model = uniform(divided(covering(builtin_surface(name), 14), (0.4, 0.2)))
    exact = solids.analysed(model, modes=20, method="slepc", tolerance=1e-11).values[6:]
    for method in ("hcms", "lanczos"):
        for tolerance in (None, 1e-10):
            found = solids.analysed(model, modes=20, method=method, tolerance=tolerance).values[6:]
            np.testing.assert_allclose(found, exact, rtol=tolerance or 1e-7)


def test_frequencies_fall_where_cells_are_divided():
    cover = covering(builtin_surface("fork"), 14)
    levels = [cover.cells, *(divided(cover, shares) for shares in ((0.5,), (0.5, 0.5)))]
    values = [cut_solids.eigenvalues(uniform(cells), 20)[6:] for cells in levels]
    for coarse, fine in zip(values, values[1:]):
        assert (fine < coarse * (1.0 + 1e-3)).all()
    assert values[1][0] < 0.98 * values[0][0]


@pytest.mark.parametrize(
    ("name", "spacing"), [("ellipsoid", 0.03), ("block", 0.03), ("beam", 0.02)]
)
def test_no_mode_is_slower_than_that_of_the_solid(name, spacing):
    """What a surface barely cuts off moves with its neighbours."""
    solid = SOLIDS[name]
    exact = solid.frequencies(30, fewer=4)
    values = cut_solids.eigenvalues(uniform(spaced(solid.surface(), spacing)), 36)[6:]
    assert (np.sqrt(values) / (2.0 * np.pi * exact)).min() > 0.998


def test_cells_are_not_divided_ever_again():
    cover = covering(box(0.2, 0.2, 0.2), 8)
    finest = 2**MOST_LEVELS * (cover.cells.corner[:1] // 4).astype(int)
    places = [finest // 2 ** (MOST_LEVELS - level) for level in range(MOST_LEVELS + 1)]
    with pytest.raises(UserError, match="cells are divided 5 times, at most 4 are"):
        cover.divided(places)
    assert cover.divided(places[:-1]).levels.max() == MOST_LEVELS
