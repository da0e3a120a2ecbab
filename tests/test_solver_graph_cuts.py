"""Dissection of meshes whose cells are divided again and again, through which planes pass."""

from hashlib import sha256
from itertools import combinations

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from mpi4py import MPI
from scipy.sparse.linalg import splu

from carillon.fem.element import rigid_motions
from solver.assembly.node_rows import Pattern
from solver.assembly.system import assemble
from solver.distribution import partition
from solver.distribution.cuts import ABOVE, BELOW, BETWEEN, halves
from solver.distribution.graph_halves import cut_graph
from solver.distribution.halves import cut_by_planes
from solver.distribution.local_mesh import distribute
from solver.distribution.quotient import Quotient, pieces_of
from solver.distribution.rank_groups import groups_of
from solver.hcms.condense import INTERFACES, on_a_line, restrict_stiffness
from solver.hcms.synthesis import synthesize
from solver.linear.dissection import dissect
from solver.linear.multifrontal import Factor
from solver.linear.plan import Plan
from solver.linear.separators import smallest_cover
from tests import octrees, solids
from tests.octrees import QUARTERS, about_a_bowl, about_a_line, about_a_ring, octree


def box(*sides):
    return [tuple(root) for root in np.ndindex(*sides)]


def bowl(size, levels):
    """A thin hemisphere whose rim is fine."""
    middle, radius = np.full(3, 0.5 * size), 0.4 * size
    wall, rim = about_a_bowl(middle, radius, 0.1), about_a_ring(middle, radius, 0.7)
    roots = np.array(box(size, size, size))
    return octree(map(tuple, roots[wall(roots + 0.5, 1.0)].tolist()), levels, rim, wall)


MESHES = {
    "ring": lambda: octree(box(2, 2, 1), 3, about_a_ring(np.array([1.0, 1.0, 0.53]), 0.6, 0.65)),
    "line": lambda: octree(
        box(2, 1, 1), 3, about_a_line(np.array([1.0, 0.53, 0.57]), np.array([1.0, 0.3, 0.2]), 0.4)
    ),
    "bowl": lambda: bowl(4, 2),
    "block": lambda: octree(box(3, 3, 2), 0, octrees.none),
    "two blocks": lambda: octree([(0, 0, 0), (1, 0, 0), (4, 0, 0)], 0, octrees.none),
    "one cell": lambda: octree([(0, 0, 0)], 0, octrees.none),
}


@pytest.fixture(scope="module", params=MESHES)
def mesh(request):
    return MESHES[request.param]()


def graph_of(mesh):
    pattern = mesh.pattern()
    return mesh.lattice, pattern.indptr, pattern.columns


def test_cells_have_fifty_nodes_within_the_parents_box(mesh):
    assert (np.diff(np.sort(mesh.nodes, axis=1)) > 0).all()
    parent, edge = mesh.low // (2 * mesh.span[:, None]), 2 * mesh.span[:, None, None]
    beyond = mesh.lattice[mesh.nodes] - edge * parent[:, None]
    assert (beyond >= 0).all() and (beyond <= edge).all()
    # What stands for a node that hangs is a node of a cell that has it in its own place.
    own = (mesh.places == mesh.span[:, None, None] // 4 * QUARTERS).all(axis=2)
    assert np.isin(mesh.nodes[~own], mesh.nodes[own]).all()
    assert own.all() == (len(np.unique(mesh.span)) == 1)


def test_nodes_of_an_element_are_on_one_path_of_the_tree(mesh):
    fronts = dissect(*graph_of(mesh), steps=None, leaf_nodes=10)
    assert np.array_equal(np.sort(fronts.order), np.arange(len(mesh.lattice)))
    front_of = np.searchsorted(fronts.first, np.arange(len(mesh.lattice)), side="right") - 1
    for nodes in mesh.nodes:
        owners = set(front_of[fronts.position[nodes]].tolist())
        path, front = set(), min(owners)
        while front >= 0:
            path.add(front)
            front = int(fronts.parent[front])
        assert owners <= path


@pytest.mark.parametrize("threads", [1, 2])
def test_solutions_are_those_of_a_direct_solver(mesh, threads):
    rows = mesh.rows(mesh.pattern())
    plan = Plan(*graph_of(mesh), steps=None)
    size = 3 * len(mesh.lattice)
    block = np.random.default_rng(1).standard_normal((size, 3))
    found = Factor(plan, rows.stiffness, rows.mass, -1.0, threads).solve(block)
    expected = splu(sp.csc_matrix(rows.stiffness_csr(size) + rows.mass_csr(size))).solve(block)
    assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()


def test_some_nodes_can_be_kept(mesh):
    lattice, indptr, indices = graph_of(mesh)
    kept = np.flatnonzero(lattice[:, 0] < 2)
    inside = np.setdiff1d(np.arange(len(lattice)), kept)
    fronts = dissect(lattice, indptr, indices, None, 10, inside, kept)
    assert np.array_equal(np.sort(fronts.order[: len(inside)]), inside)
    assert np.array_equal(fronts.order[len(inside) :], kept)


def test_nodes_with_the_same_neighbours_are_one_group(mesh):
    lattice, indptr, indices = graph_of(mesh)
    inside = np.flatnonzero(lattice[:, 1] > 0)
    quotient = Quotient.of_graph(lattice, indptr, indices, inside)
    assert np.array_equal(np.sort(quotient.nodes), inside)
    rows = [tuple(indices[indptr[node] : indptr[node + 1]]) for node in quotient.nodes]
    number = np.repeat(np.arange(len(quotient)), quotient.sizes)
    assert len(set(zip(rows, number, strict=True))) == len(set(rows)) == len(quotient)
    group = dict(zip(quotient.nodes.tolist(), number.tolist(), strict=True))
    for each in range(len(quotient)):
        row = rows[quotient.offset[each]]
        beside = {group[node] for node in row if node in group} - {each}
        assert beside == set(quotient.indices[quotient.indptr[each] : quotient.indptr[each + 1]])


def test_no_edge_joins_the_sides_of_a_cut(mesh):
    lattice, indptr, indices = graph_of(mesh)
    quotient = Quotient.of_graph(lattice, indptr, indices, np.arange(len(lattice)))
    graph = quotient.indptr, quotient.indices
    side = halves(quotient.lattice, quotient.sizes, *graph)
    if pieces_of(*graph)[1] > 1 or len(quotient) == 1:
        assert (side == BETWEEN).sum() in (0, len(quotient))
        return
    row = np.repeat(np.arange(len(quotient)), np.diff(quotient.indptr))
    assert not ((side[row] == BELOW) & (side[quotient.indices] == ABOVE)).any()
    nodes = np.bincount(side, quotient.sizes, minlength=3)
    assert 0 < nodes[BETWEEN] < min(nodes[BELOW], nodes[ABOVE])


def test_fronts_are_small_though_planes_pass_through_elements():
    cases = {"fine rim": 0.1, "bowl": 0.4, "line": 0.8, "ring": 1.0, "block": 1.0}
    for name, share in cases.items():
        mesh = bowl(8, 4) if name == "fine rim" else MESHES[name]()
        by_planes = Plan(*graph_of(mesh), steps=int(mesh.span.max())).operations
        assert Plan(*graph_of(mesh), steps=None).operations <= share * by_planes, name


def test_fronts_of_uniform_meshes_stay_what_they_were():
    """The bits of all results hang on them."""
    expected = {(12, 12, 12): "3ead76d9d6f03ae4", (30, 7, 5): "dd47d0bc2b0d7e7e"}
    for sides, digest in expected.items():
        mesh = solids.box_mesh(*sides)
        pattern = Pattern.of_cells(mesh.cells.astype(np.int64), 0, mesh.n_nodes)
        fronts = dissect(mesh.node_grid.astype(np.int64), pattern.indptr, pattern.columns)
        arrays = fronts.order, fronts.first, fronts.parent
        assert sha256(b"".join(map(np.ndarray.tobytes, arrays))).hexdigest()[:16] == digest


@pytest.mark.parametrize("ranks", [1, 2, 3, 4])
def test_ranks_have_equal_work_with_few_nodes_between_them(ranks):
    mesh = bowl(8, 3)
    lattice, indptr, indices = graph_of(mesh)
    part = cut_graph(lattice, indptr, indices, ranks)
    assert set(part) == set(range(ranks))
    row = np.repeat(np.arange(len(lattice)), np.diff(indptr))
    between, works = separating(part, row, indices, ranks), []
    for rank in range(ranks):
        inside = np.flatnonzero((part == rank) & ~between)
        near = np.unique(indices[np.isin(row, inside)])
        options = {"inside": inside, "kept": near[between[near]]}
        works.append(Plan(lattice, indptr, indices, steps=None, **options).operations)
    assert max(works) < 1.3 * np.mean(works)
    by_planes = cut_by_planes(lattice, ranks, int(mesh.span.max()))
    assert between.sum() <= separating(by_planes, row, indices, ranks).sum()


def separating(part, row, column, ranks):
    """Which nodes separate the parts of the ranks."""
    between = np.zeros(len(part), dtype=bool)
    for group in reversed(list(groups_of(0, ranks))):
        first, second = part[row], part[column]
        across = (first >= group.first) & (first < group.middle)
        across &= (second >= group.middle) & (second < group.stop)
        across &= ~between[row] & ~between[column]
        between[smallest_cover(np.stack([row, column], axis=1)[across])] = True
    return between


def test_as_many_ranks_as_nodes():
    lattice, indptr, indices = graph_of(MESHES["one cell"]())
    assert sorted(cut_graph(lattice, indptr, indices, 50)) == list(range(50))


@pytest.mark.parametrize("interface", INTERFACES)
def test_synthesis_of_all_modes_is_exact(interface, monkeypatch):
    line = about_a_line(np.array([0.0, 0.53, 0.57]), np.array([1.0, 0.3, 0.2]), 0.5)
    mesh = octree(box(2, 1, 1), 1, line)
    solid = octrees.solid_of(mesh)
    part = np.arange(len(mesh.nodes), dtype=np.int32) * 4 // len(mesh.nodes)
    monkeypatch.setattr(partition, "partition_cells", lambda *_: part)
    local_mesh = distribute(solid, 4, comm=MPI.COMM_SELF)
    found = synthesize(local_mesh, 10**6, interface, MPI.COMM_SELF).values
    system = assemble(local_mesh, MPI.COMM_SELF)
    size = solid.n_dofs
    K, M = system.rows.stiffness_csr(size).toarray(), system.rows.mass_csr(size).toarray()
    exact = la.eigh(K, M, eigvals_only=True)
    assert np.abs(found - exact).max() < 1e-11 * exact[-1]
    assert exact[5] < 1e-11 * exact[-1] < exact[6]


def test_relaxed_cells_with_five_nodes_on_an_edge_are_free():
    rng = np.random.default_rng(0)
    motions = rigid_motions(QUARTERS.astype(float), np.full(3, 2.0))
    orthonormal = la.orth(motions)
    matrix = rng.standard_normal((150, 150))
    free = np.eye(150) - orthonormal @ orthonormal.T
    matrix = free @ (matrix @ matrix.T) @ free
    edge = np.flatnonzero((QUARTERS[:, :2] == [0, 4]).all(axis=1))
    subsets = [some for count in range(2, 6) for some in combinations(edge.tolist(), count)]
    subsets += [[*edge, 0], *rng.permuted(np.tile(np.arange(50), (6, 1)), axis=1)[:, :7].tolist()]
    inside = np.zeros((len(subsets), 50), dtype=bool)
    for flags, some in zip(inside, subsets, strict=True):
        flags[list(some)] = True
    places = np.broadcast_to(QUARTERS, (len(subsets), 50, 3))
    assert np.array_equal(on_a_line(places, inside), np.arange(len(subsets)) < len(subsets) - 7)
    stiffness = np.broadcast_to(matrix, (len(subsets), 150, 150))
    relaxed = restrict_stiffness(stiffness, inside, "free", places)
    scale = np.abs(matrix).max()
    for flags, each in zip(inside, relaxed, strict=True):
        moved = np.repeat(flags, 3)[:, None] * motions
        assert np.abs(each @ moved).max() < 1e-9 * scale
        assert la.eigvalsh(each)[0] > -1e-9 * scale
