"""Finite cells in files of older versions, which were quadratic, are what they were."""

import h5py
import numpy as np
import pytest

from carillon.composition.materials import named_material
from carillon.composition.places import Everywhere, Expression
from carillon.errors import UserError
from carillon.fem.block import CELL_NODES, CORNER_NODES, NODES
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.basis import basis
from carillon.fem.finite_cells.build import covering
from carillon.fem.finite_cells.hanging import parts_of_kind, places_of_kinds
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import builtin_surface
from carillon.files.datasets import put
from solver.assembly.sparse import assembled
from solver.exchange.displayed import DENSITY, displayed
from solver.files.model_group import get_model, put_model
from solver.files.regions_group import _BORDERS, put_regions
from tests import edited_files
from tests.cut_solids import divided
from tests.test_regions import composed, spectrum

BORDER = Expression("x + 0.7 * y - 0.3 * z < 0.01")
CASES = {"whole": ("bell", ()), "divided": ("fork", (0.4,)), "bell divided": ("bell", (0.3,))}


def older_places(kind):
    """Places (27, 3) of the nodes as they once were: those that hang went beyond a corner."""
    octant, hangs = parts_of_kind(kind)
    at_end = NODES == 2 * octant
    gone = np.zeros(27, dtype=bool)
    for axis in range(3):
        others = np.delete(np.arange(3), axis)
        gone |= at_end[:, axis] & hangs[axis] & (NODES[:, others] == 1).any(axis=1)
        gone |= at_end[:, others].all(axis=1) & hangs[3 + axis] & (NODES[:, axis] == 1)
    beyond = np.where(NODES == 1, np.where(octant > 0, -2, 4), NODES)
    return np.where(gone[:, None], beyond, NODES)


def older_nodes(cells):
    """Nodes (c, 27) in the order of these places."""
    found = np.empty_like(cells.nodes)
    today = places_of_kinds(2, cells.kinds)
    for cell, kind in enumerate(cells.kinds):
        same = (older_places(int(kind))[:, None] == today[cell]).all(axis=2)
        found[cell] = cells.nodes[cell, same.argmax(axis=1)]
    return found


def put_as_once(group, model):
    """Write a solid of quadratic cells, divided once at most, as version 1 did."""
    cells, mesh = model.cells, model.mesh
    is_mixed = cells.levels.any()
    nodes, octants = older_nodes(cells), np.full((len(cells), 8), -1)
    octants[cells.cell, cells.place] = np.arange(len(cells.cell))
    there = octants >= 0
    # A voxel for each octant of whole cells, and one for each that is divided.
    small = is_mixed & (cells.levels == 1)
    cell, octant = np.nonzero(there & ~small[:, None])
    cell = np.append(cell, np.flatnonzero(small))
    octant = np.append(octant, np.zeros(np.count_nonzero(small), dtype=int))
    corners = np.where(small[:, None, None], nodes[:, None, CORNER_NODES], nodes[:, CELL_NODES])
    steps = np.where(small, 0, cells.span // 2)[cell]
    grid = cells.corner[cell] + steps[:, None] * CORNERS[octant]
    order = np.lexsort(grid.T)
    cell, octant, grid = cell[order], octant[order], grid[order]
    numbers = np.full((len(cells), 8), -1)
    numbers[cell, octant] = np.arange(len(cell))
    numbers[small] = np.where(there[small], numbers[small, :1], -1)
    of_today = cells.voxel[np.where(there, octants, 0)]
    first = np.where(small[cell], there[cell].argmax(axis=1), octant)
    voxel = of_today[cell, first]
    weights = np.zeros((len(cells), 8, 125))
    weights[cells.cell, cells.place] = cells.weights[cells.row]
    put(group, "nodes", model.positions, "m", "positions of the nodes")
    put(group, "node_grid", model.node_grid, "1", "integer coordinates of the nodes")
    put(group, "cells", corners[cell, octant], "1", "node numbers of the cells")
    put(group, "grid", grid, "1", "integer coordinates of the cells")
    put(group, "young", model.young[voxel], "Pa", "Young's modulus per voxel")
    region = None if model.region is None else model.region[voxel]
    put_regions(group, model.regions, region)
    group.attrs["cell_edge"], group.attrs["origin"] = cells.step, mesh.origin
    if is_mixed:
        put(group, "span", np.full(len(grid), 2), "1", "edge of each cell in steps of the grid")
        put(group, "hanging", np.zeros(len(grid), dtype=int), "1", "corners that hang")
    inner = group.create_group("finite_cells")
    put(inner, "nodes", nodes, "1", "node numbers of the finite cells")
    put(inner, "voxels", numbers, "1", "voxels of their octants")
    put(inner, "row", np.arange(1, len(cells) + 1), "1", "row of the weights")
    weights = np.concatenate([basis(2).voxels(2)[None], weights])
    put(inner, "weights", weights, "1", "integrals of the points' Lagrange polynomials")
    if model.shared is None:
        return
    shared, both = model.shared, inner.create_group("shared")
    put(both, "cell", cells.cell[shared.portion], "1", "cell of each part")
    put(both, "octant", cells.place[shared.portion], "1", "octant of each part")
    put(both, "region", shared.region, "1", "region of each part")
    put(both, "weights", shared.weights, "1", "integrals of the points' Lagrange polynomials")
    for name, meaning in _BORDERS.items():
        put(both, f"border_{name}", getattr(shared.borders, name), "1", meaning)


def quadratic(name, shares, several):
    """Solid of quadratic cells, of random moduli, or of two regions."""
    surface = builtin_surface(name)
    cells = divided(covering(surface, 12, degree=2), shares)
    factor = np.random.default_rng(0).uniform(0.5, 2.0, cells.mesh.n_cells)
    if not several:
        return finite_cell_model(cells, 1e9 * factor)
    steel, spruce = (named_material(each).region(each) for each in ("steel", "spruce"))
    placed = composed([(steel, Everywhere()), (spruce, BORDER)], surface).of_cells(cells)
    young = placed.regions.moduli(placed.region, factor)
    return finite_cell_model(cells, young, placed.regions, placed.region, placed.shared)


@pytest.mark.parametrize("several", [False, True], ids=["one", "two regions"])
@pytest.mark.parametrize("case", CASES)
def test_solids_of_older_versions_are_read(case, several, tmp_path):
    name, shares = CASES[case]
    model = quadratic(name, shares, several)
    assert (model.cells.kinds > 0).any() == bool(shares)
    with h5py.File(tmp_path / "older.h5", "w") as file:
        put_as_once(file, model)
        older = get_model(file)
    for found, expected in zip(assembled(older), assembled(model), strict=True):
        assert abs(found - expected).max() < 1e-12 * abs(expected).max()
    np.testing.assert_allclose(spectrum(older)[6:], spectrum(model)[6:], rtol=1e-6)
    # Its cubes are where they were, and it can be written today.
    shown = displayed(older)
    corners = shown.points[shown.cells]
    edges = np.ptp(corners, axis=1)
    np.testing.assert_allclose(edges, np.broadcast_to(edges[0], edges.shape), rtol=1e-9)
    if not several:
        assert shown.data[DENSITY] @ edges.prod(axis=1) == pytest.approx(older.mass, rel=1e-9)
    with h5py.File(tmp_path / "today.h5", "w") as file:
        put_model(file, older)
        again = get_model(file)
    for found, expected in zip(assembled(again), assembled(older), strict=True):
        assert abs(found - expected).max() < 1e-12 * abs(expected).max()


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("row", lambda values: values + 10**6),
        ("nodes", lambda values: values[:, ::-1]),
        ("nodes", lambda values: values[:, [1, 0, *range(2, 27)]]),
        ("nodes", lambda values: values - 1),
        ("voxels", lambda values: values + 10**6),
        ("weights", lambda values: values[1:]),
        ("weights", lambda values: np.where(np.arange(125) == 3, np.nan, values)),
    ],
)
@pytest.mark.parametrize("case", CASES)
def test_those_that_do_not_fit_are_refused(case, name, change, tmp_path):
    with h5py.File(tmp_path / "older.h5", "w") as file:
        put_as_once(file, quadratic(*CASES[case], False))
        edited_files.put(f"finite_cells/{name}", change)(file)
        with pytest.raises(UserError):
            get_model(file)
