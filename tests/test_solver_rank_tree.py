"""How the ranks cut a solid for its elimination: even parts, and few nodes between them."""

from itertools import combinations

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.model import fine_model
from solver.assembly.node_rows import Pattern
from solver.distribution.halves import cut_by_planes, elimination_work
from solver.distribution.rank_groups import groups_of
from solver.linear.plan import Plan
from solver.linear.separators import smallest_cover
from tests import solids


def lattice_of(mesh):
    return mesh.node_grid.astype(np.int64)


@pytest.mark.parametrize("seed", range(20))
def test_no_fewer_nodes_cover_all_edges(seed):
    rng = np.random.default_rng(seed)
    edges = np.unique(rng.integers(0, 6, (rng.integers(1, 14), 2)) + [0, 10], axis=0)
    cover = smallest_cover(edges)
    assert np.isin(edges, cover).any(axis=1).all()
    nodes = np.unique(edges)
    for fewer in combinations(nodes, max(len(cover) - 1, 0)):
        assert not np.isin(edges, fewer).any(axis=1).all()


@pytest.mark.parametrize("ranks", [1, 2, 3, 4, 7])
def test_ranks_have_equal_work(ranks):
    mesh = solids.box_mesh(24, 18, 13)
    lattice = lattice_of(mesh)
    part = cut_by_planes(lattice, ranks)
    assert set(part) == set(range(ranks))
    works = [elimination_work(lattice[part == n], lattice[part != n]) for n in range(ranks)]
    assert max(works) < 1.35 * np.mean(works)


def test_halves_of_unlike_bodies_have_unlike_sizes():
    """A cube's nodes are more work than as many of a rod."""
    cube = np.stack(np.meshgrid(*3 * [range(12)], indexing="ij"), axis=-1).reshape(-1, 3)
    rod = np.stack(np.meshgrid(range(12, 300), *2 * [range(3)], indexing="ij"), axis=-1)
    lattice = np.concatenate([cube, rod.reshape(-1, 3)])
    part = cut_by_planes(lattice, 2)
    works = [elimination_work(lattice[part == n], lattice[part != n]) for n in range(2)]
    sizes = np.bincount(part)
    assert max(sizes) > 1.5 * min(sizes)
    even = cut_by_planes(lattice[::-1], 2)[::-1]
    assert max(np.bincount(even)) == max(sizes)
    assert max(works) < 2.0 * min(works)


def test_work_is_about_that_of_the_plan():
    mesh = solids.box_mesh(30, 20, 14)
    model = fine_model(mesh, np.full(mesh.n_cells, 1e9))
    pattern = Pattern.of_cells(model.mesh.cells.astype(np.int64), 0, mesh.n_nodes)
    plan = Plan(lattice_of(mesh), pattern.indptr, pattern.columns)
    work = elimination_work(lattice_of(mesh), lattice_of(mesh)[:0])
    assert 0.7 < work / plan.operations < 1.4


def test_more_ranks_than_nodes_are_refused():
    lattice = lattice_of(solids.box_mesh(1, 1, 1))
    assert sorted(cut_by_planes(lattice, 8)) == list(range(8))
    with pytest.raises(UserError, match="9 ranks for 8 nodes: every rank needs one"):
        cut_by_planes(lattice, 9)


def test_halves_come_before_what_they_are_halves_of():
    groups = [(group.first, group.stop) for group in groups_of(0, 5)]
    assert groups == [(0, 2), (0, 3), (3, 5), (0, 5)]
