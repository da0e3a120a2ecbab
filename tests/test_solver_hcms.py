"""Merge tree, partition and groups of the component mode synthesis."""

from itertools import combinations

import numpy as np
import pytest
from mpi4py import MPI

import solver.distribution.decomposition as decomposition
from carillon.errors import UserError
from carillon.fem.block import degrees_of_freedom
from solver.assembly.sparse import assembled
from solver.distribution.local_mesh import distribute
from solver.distribution.partition import connect_subdomains, partition_nodes, subdomain_pieces
from solver.distribution.tree import assign_ranks, build_tree
from solver.hcms.counts import eigen_flops, krylov_flops
from solver.hcms.merge import boundary_of, interface
from solver.hcms.schedule import modes_to_keep
from solver.hcms.synthesis import make_subdomains, synthesize
from tests import solids

COMM = MPI.COMM_SELF


def corner_parts(edges: list[tuple[int, int]]) -> np.ndarray:
    """One cell between each of these pairs of subdomains."""
    return np.array([[a] * 4 + [b] * 4 for a, b in edges], dtype=np.int32)


def grid_edges(width: int, height: int) -> list[tuple[int, int]]:
    number = np.arange(width * height).reshape(height, width)
    across = zip(number[:, :-1].ravel(), number[:, 1:].ravel())
    return [*across, *zip(number[:-1].ravel(), number[1:].ravel())]


GRAPHS = {
    "path": [(i, i + 1) for i in range(16)],
    "star": [(0, i) for i in range(1, 13)],
    "comet": [(0, i) for i in range(1, 8)] + [(i, i + 1) for i in range(7, 20)],
    "grid": grid_edges(6, 5),
    "unconnected": [(0, 1), (1, 2), (3, 4), (5, 6)],
}


@pytest.mark.parametrize("name", GRAPHS)
def test_tree_is_no_chain(name):
    corners = corner_parts(GRAPHS[name])
    parts = int(corners.max()) + 1
    tree, renumbered = build_tree(corners, np.full(parts, 700))
    assert sorted(renumbered) == list(range(parts))
    assert len(tree.merges) == parts - 1
    assert tree.ranges()[-1] == (0, parts)
    merged = [child for merge in tree.merges for child in (merge.left, merge.right)]
    assert sorted(merged) == list(range(2 * parts - 2))
    for merge in tree.merges:
        left, right = tree.ranges()[merge.left], tree.ranges()[merge.right]
        assert left[1] == right[0]
        lighter, heavier = sorted((left[1] - left[0], right[1] - right[0]))
        # A quarter of the whole, where whole subdomains allow it.
        assert lighter >= 0.25 * (lighter + heavier) or heavier == 2 * lighter
    assert tree.levels()[-1] <= np.ceil(np.log(parts) / np.log(4 / 3))
    assert tree.levels()[parts:] == sorted(tree.levels()[parts:])


def test_two_blobs_on_a_thread_are_cut_at_the_thread():
    blobs = [*combinations(range(6), 2), *combinations(range(6, 12), 2)]
    tree, renumbered = build_tree(corner_parts([*blobs, (5, 6)]), np.full(12, 500))
    last = tree.merges[-1]
    left = {int(part) for part in np.flatnonzero(renumbered < tree.ranges()[last.left][1])}
    assert left in ({*range(6)}, {*range(6, 12)})


def test_ranks_own_contiguous_ranges_and_the_costliest_is_as_cheap_as_can_be():
    random = np.random.default_rng(3)
    for parts, ranks in ((5, 2), (9, 4), (7, 7), (11, 3)):
        costs = random.uniform(1.0, 5.0, parts) ** 2
        owner = assign_ranks(costs, ranks)
        assert (np.diff(owner) >= 0).all()
        assert sorted(set(owner)) == list(range(ranks))
        best = min(
            max(costs[a:b].sum() for a, b in zip((0, *cuts), (*cuts, parts)))
            for cuts in combinations(range(1, parts), ranks - 1)
        )
        assert np.bincount(owner, costs).max() <= best * (1 + 1e-12)


def test_more_ranks_than_subdomains_is_an_error():
    with pytest.raises(UserError, match="3 ranks for 2 subdomains"):
        assign_ranks(np.ones(2), 3)


def test_part_that_gets_no_node_vanishes():
    mesh = solids.box_mesh(4, 4, 4)
    cell_part = np.zeros(mesh.n_cells, dtype=np.int32)
    inner = (mesh.grid == 1).all(axis=1)
    # One cell in the middle of another part is outvoted at each of its corners.
    cell_part[inner] = 1
    cell_part[mesh.grid[:, 2] == 3] = 2
    assert sorted(np.unique(partition_nodes(mesh.cells, mesh.n_nodes, cell_part))) == [0, 1]


def ends_and_middle(length: int, end: int) -> tuple:
    """A bar whose two ends of `end` cells are one part."""
    mesh = solids.box_mesh(2, 2, length)
    place = mesh.node_grid[:, 2]
    return mesh, ((place > end) & (place < length - end)).astype(np.int32)


def test_small_piece_of_a_subdomain_goes_to_its_neighbour():
    mesh, node_part = ends_and_middle(12, 3)
    node_part[mesh.node_grid[:, 2] > 10] = 1
    node_part[mesh.node_grid[:, 2] == 12] = 0
    connected = connect_subdomains(mesh.cells, node_part, 20)
    assert connected.max() == 1
    assert len(np.unique(subdomain_pieces(mesh.cells, connected))) == 2


def test_large_piece_of_a_subdomain_becomes_one():
    mesh, node_part = ends_and_middle(12, 3)
    connected = connect_subdomains(mesh.cells, node_part, 20)
    assert sorted(np.bincount(connected)) == [36, 36, 45]
    assert len(np.unique(subdomain_pieces(mesh.cells, connected))) == 3


def test_piece_that_hangs_by_two_nodes_is_apart():
    mesh = solids.hexmesh_from_grid(np.array([[0, 0, 0], [1, 1, 0]]), np.zeros(3), 0.01)
    node_part = np.ones(mesh.n_nodes, dtype=np.int32)
    node_part[np.intersect1d(*mesh.cells)] = 0
    pieces = subdomain_pieces(mesh.cells, node_part)
    # Either cell's other six nodes; the shared ones do not hold each other.
    assert sorted(np.bincount(pieces)) == [1, 1, 6, 6]


def test_default_partition_hangs_together():
    model = solids.uniform_box(14, 11, 9, 0.01)
    node_part = decomposition.partition_model(model, 9)
    assert subdomain_pieces(model.mesh.cells, node_part).max() == node_part.max()


def test_default_partition_has_a_subdomain_for_every_rank():
    model = solids.uniform_box(3, 3, 2, 0.01)
    found, order = decomposition.decompose(model, ranks=13)
    assert sorted(set(found.owner)) == list(range(13))
    assert sorted(order) == list(range(model.mesh.n_nodes))
    assert (np.diff(found.offsets) > 0).all()


@pytest.fixture
def in_pieces(monkeypatch):
    """A bar with a subdomain in two pieces, left as it is."""
    mesh, node_part = ends_and_middle(12, 3)
    monkeypatch.setattr(decomposition, "partition_model", lambda *arguments: node_part)
    return solids.fine_model(mesh, 1e9 * 10.0 ** np.linspace(-1.0, 1.0, mesh.n_cells))


def test_all_rigid_motions_of_a_subdomain_in_pieces_are_kept(in_pieces):
    local_mesh = distribute(in_pieces, comm=COMM)
    part = int(np.argmax(np.diff(local_mesh.decomposition.offsets)))
    cells = local_mesh.cells.take(local_mesh.cells_by_subdomain(range(part, part + 1))[part])
    values, vectors = make_subdomains(local_mesh, "free", COMM)[part].modes(cells.elements, 3)
    assert len(values) == vectors.shape[1] > 12
    assert (np.abs(values[:12]) < 1e-9 * values[-1]).all()
    assert values[12] > 1e-6 * values[-1]


def test_subdomain_in_pieces_spoils_no_spectrum(in_pieces):
    exact = solids.dense_eigenvalues(in_pieces)
    values = synthesize(distribute(in_pieces, comm=COMM), 60, "free", COMM).values
    assert (values[:30] >= exact[:30] - 1e-9 * exact[30]).all()
    assert np.abs(values[:6]).max() < 1e-9 * values[-1]
    assert values[6] < 1.5 * exact[6]


@pytest.mark.parametrize("share_of_modes", [0.05, 0.3])
def test_local_modes_are_good_for_smooth_motions_of_any_material(share_of_modes):
    model = solids.random_box(9, 7, 6)
    exact = solids.dense_eigenvalues(model)
    local_mesh = distribute(model, 1, comm=COMM)
    (subdomain,) = make_subdomains(local_mesh, "free", COMM).values()
    count = int(share_of_modes * model.n_dofs)
    values, vectors = subdomain.modes(local_mesh.cells.elements, count)
    assert len(values) == count
    assert np.abs(values[:6]).max() < 1e-10 * values[-1]
    error = values[6:] / exact[6:count] - 1.0
    assert (error > -1e-10).all()
    assert np.median(error) < 0.1
    order = degrees_of_freedom(local_mesh.nodes)
    gram = vectors.T @ assembled(model)[1][order][:, order] @ vectors
    assert np.abs(gram - np.eye(count)).max() < 1e-11


def test_overlapping_subdomains_give_better_values_than_free_ones_and_these_than_fixed():
    model = solids.random_box(14, 8, 6)
    exact = solids.dense_eigenvalues(model)[6:60]
    errors = {}
    for treatment in ("overlapping", "free", "fixed"):
        values = synthesize(distribute(model, 4, comm=COMM), 120, treatment, COMM).values
        errors[treatment] = values[6:60] / exact - 1.0
        assert (errors[treatment] > -1e-9).all()
    assert np.median(errors["overlapping"]) < 0.7 * np.median(errors["free"])
    assert np.median(errors["free"]) < np.median(errors["fixed"])


@pytest.mark.parametrize("treatment", ["overlapping", "free", "fixed"])
def test_a_cutoff_takes_the_place_of_numbers_of_modes(treatment):
    model = solids.random_box(9, 5, 4)
    exact = solids.dense_eigenvalues(model)[6:46]
    local_mesh = distribute(model, 4, comm=COMM)
    errors = []
    for factor in (2.0, 6.0, 15.0):
        found = synthesize(local_mesh, 60, treatment, COMM, cutoff=factor * exact[-1])
        assert len(found.values) == 60
        errors.append(np.median(found.values[6:46] / exact - 1.0))
    assert errors[0] > errors[1] > errors[2] > -1e-9
    # With every mode below the root, the result is exact.
    whole = synthesize(local_mesh, 60, treatment, COMM, cutoff=np.inf)
    assert np.abs(whole.values[6:46] / exact - 1.0).max() < 1e-9


def test_rigid_motions_are_kept_of_the_smallest_group():
    assert modes_to_keep(1e-9, 100) == 6
    assert modes_to_keep(1.0, 100) == 100


def test_boundary_and_interface_are_those_of_the_whole_mesh():
    local_mesh = distribute(solids.random_box(8, 6, 5), 6, comm=COMM)
    merges, ranges = local_mesh.decomposition.tree.merges, local_mesh.decomposition.row_ranges()
    everything = local_mesh.cells
    for step in merges:
        start, middle = ranges[step.left]
        _, stop = ranges[step.right]
        sides = [boundary_of(everything, *ranges[child]) for child in (step.left, step.right)]
        for (rows, cells), (first, last) in zip(sides, (ranges[step.left], ranges[step.right])):
            corners = everything.corners
            inside = (corners >= first) & (corners < last)
            mixed = inside.any(axis=1) & ~inside.all(axis=1)
            assert set(rows) == set(corners[mixed & inside.any(axis=1)][inside[mixed]])
            assert len(cells) == mixed.sum()
        left, right = (interface(cells, start, middle, stop, "free") for _, cells in sides)
        # Either side makes the same matrices, to the last bit.
        assert (left.stiffness != right.stiffness).nnz == 0
        assert (left.mass != right.mass).nnz == 0
        assert (left.left >= start).all()
        assert (left.right >= middle).all()


def test_formulae_of_operations():
    assert eigen_flops(10, generalised=False) == pytest.approx(14 / 3 * 1000)
    assert eigen_flops(10, generalised=True) == pytest.approx(7000)
    assert krylov_flops(2000, 100) > 1.9 * krylov_flops(1000, 100)
