"""Checks on several ranks: `python -m mpi4py tests/distributed_checks.py NAME[,NAME] [PATH]`.

Every rank makes the same checks, and one that fails ends them all.
"""

import os
import sys
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from carillon.errors import ConvergenceError, UserError
from carillon.fem.block import degrees_of_freedom
from carillon.fem.finite_cells.build import covering
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import hexmesh_from_grid
from carillon.fem.geometry.hanging import WHOLE
from carillon.fem.model import ElasticModel, Solid
from carillon.fem.regions import Regions
from solver.analysis.modal_solver import ModalSolver, modal_analysis
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions, build_problem
from solver.assembly.sparse import assembled
from solver.assembly.system import Layout, assemble
from solver.distribution import collective
from solver.distribution.collective import receive_arrays, send_arrays, share_cores
from solver.distribution.local_mesh import distribute
from solver.distribution.redistribution import Redistribution
from solver.files.modes_file import write_modes
from solver.hcms import schedule as scheduling
from solver.hcms.condense import INTERFACES
from solver.hcms.counts import Tally
from solver.hcms.merge import Reduced, all_pairs
from solver.hcms.scalapack import grid_side, shared_pairs
from solver.hcms.synthesis import synthesize
from solver.linear import LinearSolver, multifrontal
from solver.linear.factorisation import count_negative
from solver.linear.multigrid import Multigrid
from solver.linear.shared_factor import SharedFactor
from solver.reference.truth import complete, count_beyond, solve_truth, start_vector
from tests import cut_solids, octrees, solids

ROOMS = ("/solver/", "/carillon/fem/")
COMM = MPI.COMM_WORLD
PARTS = 8
COLLECTIVES = ("all", "barrier", "bcast", "gather", "reduce", "scatter", "scan", "split", "create")
"""Beginnings of the names of what all ranks of a communicator call."""
REPETITIONS = 3


def on_first(model: Solid) -> Solid | None:
    """The model on rank 0 alone."""
    return model if COMM.rank == 0 else None


@contextmanager
def on_machines_of_their_own() -> Iterator[None]:
    """The ranks as those of several machines, with half of them, or one, on the first."""

    def machine_of(comm: MPI.Comm) -> MPI.Comm:
        return comm.Split(2 * comm.rank // comm.size)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(collective, "machine_of", machine_of)
        yield


def shares_make_up_the_solid() -> None:
    model = solids.random_box(9, 6, 5)
    local_mesh = distribute(on_first(model), PARTS, comm=COMM)
    touching = np.isin(model.mesh.cells, local_mesh.nodes).any(axis=1)
    assert len(local_mesh.cells) == touching.sum()
    assert (local_mesh.cells.elements.young == model.young[touching]).all()
    assert (local_mesh.positions == model.mesh.nodes[local_mesh.nodes]).all()
    own = local_mesh.cells.inside(local_mesh.start, local_mesh.stop)
    corners = model.mesh.cells[touching]
    assert (
        local_mesh.nodes[local_mesh.cells.corners[own] - local_mesh.start] == corners[own]
    ).all()
    assert (
        COMM.allreduce(len(local_mesh.nodes))
        == model.mesh.n_nodes
        == local_mesh.decomposition.n_nodes
    )


def ranks_share_the_cores_they_have_together() -> None:
    """Bound to the same core or each to one of its own, they have one thread each."""
    every, own = sorted(os.sched_getaffinity(0)), COMM.rank % os.cpu_count()
    try:
        for cores in ({every[0]}, {every[own % len(every)]}, set(every)):
            os.sched_setaffinity(0, cores)
            os.environ.pop("OMP_NUM_THREADS", None)
            together = len(set().union(*COMM.allgather(cores)))
            threads = share_cores(COMM)
            assert threads == min(len(cores), max(1, together // COMM.size))
    finally:
        os.sched_setaffinity(0, every)
        os.environ["OMP_NUM_THREADS"] = "1"
        share_cores(COMM)


def products_are_those_of_the_whole_matrices() -> None:
    _check_products(solids.random_box(9, 6, 5))


def products_of_a_mixed_model() -> None:
    _, model, _ = solids.bar_models("fit")
    _check_products(model)
    kinds = distribute(on_first(model), PARTS, comm=COMM).cells.elements.kinds
    # So a share without elements of twice the edge is among those of three ranks.
    assert (COMM.allreduce(int((kinds < WHOLE).all())) > 0) == (COMM.size > 2)


def _check_products(model: ElasticModel) -> None:
    system = assemble(distribute(on_first(model), PARTS, comm=COMM), COMM)
    block = np.random.default_rng(0).standard_normal((model.n_dofs, 3))
    for whole, product in zip(assembled(model), (system.times_stiffness, system.times_mass)):
        found = system.gather(product(solids.local_rows(system, block)))
        if COMM.rank == 0:
            expected = whole @ block
            assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()
        else:
            assert found is None
    stiffness = system.times_stiffness(system.rigid)
    assert np.abs(stiffness).max() < 1e-10 * system.K.norm() * np.abs(system.rigid).max()
    gram = system.inner(system.rigid, system.times_mass(system.rigid))
    assert np.abs(gram - np.eye(6)).max() < 1e-12


def only_the_first_rank_holds_arrays_of_the_length_of_the_mesh() -> None:
    # No other length in the analysis happens to be one of these: 9 x 5 x 31 nodes.
    model = solids.random_box(8, 4, 30)
    forbidden = {model.mesh.n_nodes, model.n_dofs, model.mesh.n_cells}
    seen: list[str] = []

    def spy(frame: FrameType, event: str, argument: Any) -> None:
        if event != "return" or not any(room in frame.f_code.co_filename for room in ROOMS):
            return
        for name, value in [*frame.f_locals.items(), ("the result", argument)]:
            fields = vars(value).values() if hasattr(value, "__dict__") else (value,)
            for item in fields:
                if isinstance(item, np.ndarray) and forbidden & set(item.shape):
                    seen.append(f"{name} {item.shape} in {frame.f_code.co_qualname}")

    modes = 40
    mine = on_first(model)
    sys.setprofile(spy)
    result = modal_analysis(mine, SolverOptions(modes=modes, subdomains=PARTS), COMM)
    result.system.stream_to_root(result.vectors, lambda blocks: [None for _ in blocks] and None)
    sys.setprofile(None)
    assert bool(seen) == (COMM.rank == 0), seen[:5]
    whole = (model.n_dofs, modes)
    assert not any(f"{whole} " in line for line in seen)


def modes_are_the_same_however_many_columns_travel_together(folder: Path) -> None:
    model = on_first(solids.random_box(9, 6, 5))
    result = modal_analysis(model, SolverOptions(modes=20, subdomains=PARTS), COMM)
    whole = result.system.gather(result.vectors)
    for columns in (1, 7, 16, 50):

        def write(blocks: Any, columns: int = columns) -> None:
            assert model is not None
            blocks = list(blocks)
            assert max(block.shape[1] for block in blocks) == min(columns, 20)
            assert (np.concatenate(blocks, axis=1) == whole).all()
            path = folder / f"{columns}.h5"
            write_modes(path, model, result.values, blocks, result.residuals, {}, {})

        result.system.stream_to_root(result.vectors, write, columns)


def failure_of_the_writer_is_everyones() -> None:
    model = solids.random_box(4, 3, 8)
    system = assemble(distribute(on_first(model), PARTS, comm=COMM), COMM)
    block = solids.local_rows(system, np.ones((model.n_dofs, 40)))

    def fail(blocks: Any) -> None:
        next(blocks)
        raise UserError("planted")

    with pytest.raises(UserError, match="^planted$"):
        system.stream_to_root(block, fail, columns=3)
    # Nothing is left under way.
    assert system.inner(block, block)[0, 0] == model.n_dofs


def bad_input_is_everyones() -> None:
    model = on_first(solids.random_box(2, 2, 2))
    for parts, sentence in ((COMM.size - 1, "ranks for"), (1000, "1000 subdomains asked for")):
        try:
            distribute(model, max(parts, 1), comm=COMM)
        except UserError as error:
            assert sentence in str(error)
        else:
            assert COMM.size == 1 and parts < 1


def a_share_is_no_larger_than_its_part_of_the_mesh() -> None:
    # A long bar: what a rank holds beyond its part is one layer of cells at either end.
    model = solids.random_box(2, 2, 20 * COMM.size)
    local_mesh = distribute(on_first(model), COMM.size, comm=COMM)
    assert len(local_mesh.cells) < 0.8 * model.mesh.n_cells
    assert len(local_mesh.nodes) < 0.8 * model.mesh.n_nodes


class CountingComm:
    """A communicator that counts what leaves this rank by its buffers."""

    def __init__(self, comm: MPI.Comm) -> None:
        self._comm = comm
        self.sent: Counter[str] = Counter()

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._comm, name)
        if name.lower().startswith(COLLECTIVES):
            self.sent.update(collectives=1)
        return found

    def Isend(self, array: Any, dest: int, tag: int) -> MPI.Request:  # noqa: N802
        self.sent.update(messages=1, bytes=array.nbytes)
        return self._comm.Isend(array, dest=dest, tag=tag)


def messages_counted_are_messages_sent() -> None:
    local_mesh = distribute(on_first(solids.random_box(9, 6, 5)), PARTS, comm=COMM)
    counting = CountingComm(COMM)
    result = synthesize(local_mesh, 60, "free", counting)
    tallies = result.counts.phases().values()
    for quantity in ("messages", "bytes"):
        assert sum(getattr(tally, quantity) for tally in tallies) == counting.sent[quantity]
    per_rank = result.counts.per_rank(COMM)
    sent = sum(phase["messages"] for phase in per_rank.values())
    assert sent[COMM.rank] == counting.sent["messages"]
    assert (sum(phase["flops"] for phase in per_rank.values()) > 0).all()


def ranks_send_each_other_a_message_up_and_one_down_for_a_merge() -> None:
    """Whatever the subdomains and the modes, and nothing is asked of all ranks."""
    model = on_first(solids.random_box(9, 6, 5))
    for parts, keep in ((PARTS, 60), (2 * PARTS, 60), (2 * PARTS, 120)):
        local_mesh = distribute(model, parts, comm=COMM)
        counting = CountingComm(COMM)
        synthesize(local_mesh, keep, "free", counting)
        assert counting.sent["collectives"] == 0
        decomposition = local_mesh.decomposition
        nodes = [stop - start for start, stop in decomposition.row_ranges()]
        plan = scheduling.schedule(decomposition.tree, decomposition.owner, nodes, keep)
        away = [
            {plan.holder[merge.left], plan.holder[merge.right]} - {plan.holder[merge.group]}
            for merge in decomposition.tree.merges
        ]
        merges = sum(map(len, away))
        assert merges <= (COMM.size - 1) * decomposition.tree.levels()[-1]
        assert not any(plan.exchanges)
        assert COMM.allreduce(counting.sent["messages"]) == 2 * merges


def exchanges_leave_the_modes_as_they_are() -> None:
    local_mesh = distribute(on_first(solids.random_box(9, 6, 5)), PARTS, comm=COMM)
    alone = synthesize(local_mesh, 60, "free", COMM)
    before, scheduling.ACROSS_COST = scheduling.ACROSS_COST, np.inf
    exchanged = synthesize(local_mesh, 60, "free", COMM)
    scheduling.ACROSS_COST = before
    assert (exchanged.values == alone.values).all()
    assert (exchanged.vectors == alone.vectors).all()


def arrays_arrive_as_they_were() -> None:
    arrays = [
        np.arange(12.0).reshape(3, 4).T,
        np.empty((0, 8)),
        np.arange(5, dtype=np.int64),
        np.arange(6, dtype=np.uint8).reshape(1, 2, 3),
    ]
    sent = send_arrays(COMM, arrays, (COMM.rank + 1) % COMM.size, 5)
    received = receive_arrays(COMM, (COMM.rank - 1) % COMM.size, 5)
    sent.wait()
    assert sent.bytes % 8 == 0
    for before, now in zip(arrays, received, strict=True):
        assert now.dtype == before.dtype
        assert now.shape == before.shape
        assert (now == before).all()


def shared_merges_are_those_of_one_rank() -> None:
    """Every merge of groups of different ranks is shared by all ranks of both."""
    local_mesh = distribute(on_first(solids.random_box(9, 6, 5)), PARTS, comm=COMM)
    alone = synthesize(local_mesh, 60, "free", COMM).values
    before = scheduling.SHARED_SIZE, scheduling.SHARED_PRODUCTS
    scheduling.SHARED_SIZE, scheduling.SHARED_PRODUCTS = 20, 1e3
    plan = scheduling.schedule(
        local_mesh.decomposition.tree,
        local_mesh.decomposition.owner,
        [stop - start for start, stop in local_mesh.decomposition.row_ranges()],
        60,
    )
    shared = synthesize(local_mesh, 60, "free", COMM)
    scheduling.SHARED_SIZE, scheduling.SHARED_PRODUCTS = before
    assert len(plan.teams[-1]) == {1: 1, 2: 1, 3: 1, 4: 4, 7: 4}[COMM.size]
    assert plan.ranks_of(len(plan.teams) - 1, local_mesh.decomposition.tree.merges[-1]) == {
        *range(COMM.size)
    }
    # Sums in another order: rounding alone.
    assert np.abs(shared.values - alone).max() < 1e-12 * alone[-1]
    system = assemble(local_mesh, COMM)
    gram = system.inner(shared.vectors, system.times_mass(shared.vectors))
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-9


def shared_eigenpairs_are_those_of_lapack() -> None:
    random = np.random.default_rng(5)
    for size, generalised in ((3, True), (40, True), (150, False), (201, True)):
        square = random.standard_normal((size, size))
        K = np.asfortranarray(square @ square.T)
        M = np.eye(size, order="F")
        M[1:, 0] = 0.3 / size
        pencil = Reduced(np.tril(K), np.tril(M) if generalised else None)
        expected, _ = all_pairs(
            Reduced(K.copy(order="F"), M.copy(order="F") if generalised else None), Tally()
        )
        ranks = grid_side(COMM.size) ** 2
        if COMM.rank >= ranks:
            continue
        team = COMM.Create_group(COMM.group.Incl(range(ranks)))
        found = shared_pairs(team, pencil if COMM.rank == 0 else None, Tally())
        team.Free()
        assert (found is None) == (COMM.rank > 0)
        if found is not None:
            assert np.abs(found[0] - expected).max() < 1e-12 * expected[-1]


def failure_of_shared_eigenpairs_is_told() -> None:
    pencil = Reduced(np.eye(60, order="F"), -np.eye(60, order="F"))
    ranks = grid_side(COMM.size) ** 2
    if COMM.rank >= ranks:
        return
    team = COMM.Create_group(COMM.group.Incl(range(ranks)))
    with pytest.raises(np.linalg.LinAlgError, match="pdpotrf of ScaLAPACK"):
        shared_pairs(team, pencil if COMM.rank == 0 else None, Tally())


def synthesis_bounds_the_spectrum() -> None:
    model = solids.random_box(7, 5, 4)
    exact = solids.dense_eigenvalues(model)[:40]
    local_mesh = distribute(on_first(model), PARTS, comm=COMM)
    result = synthesize(local_mesh, 80, "free", COMM)
    assert (result.values[:40] >= exact - 1e-9 * exact[-1]).all()
    system = assemble(local_mesh, COMM)
    vectors = result.vectors
    gram = system.inner(vectors, system.times_mass(vectors))
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-9
    stiff = system.inner(vectors, system.times_stiffness(vectors))
    assert np.abs(stiff - np.diag(result.values)).max() < 1e-7 * result.values[-1]


def mixed_models_are_solved_by_every_method() -> None:
    _, model, _ = solids.bar_models("fit")
    exact = solids.dense_eigenvalues(model)[:40]
    local_mesh = distribute(on_first(model), PARTS, comm=COMM)
    for interface in INTERFACES:
        values = synthesize(local_mesh, 80, interface, COMM).values[:40]
        assert (values >= exact - 1e-9 * exact[-1]).all()
    for method in ("hcms", "slepc"):
        options = SolverOptions(modes=40, method=method, subdomains=PARTS, tolerance=1e-11)
        values = modal_analysis(on_first(model), options, COMM).values
        assert np.abs(values[6:] / exact[6:] - 1.0).max() < 1e-9, method


def synthesis_with_every_interface(path: Path) -> None:
    """Its eigenvalues are written for the caller, who compares numbers of ranks."""
    solid = ProblemOptions("builtin:bar", 24, "smooth")
    model = build_problem(solid).model if COMM.rank == 0 else None
    values = {}
    for interface in INTERFACES:
        options = SolverOptions(modes=50, corrections=0, interface=interface, subdomains=7)
        values[interface] = modal_analysis(model, options, COMM).values
    if COMM.rank == 0:
        np.savez(path, **values)


def groups_that_do_not_touch_can_be_merged() -> None:
    grid = np.array([[x, 0, 0] for x in (*range(4), *range(10, 14))])
    model = solids.fine_model(hexmesh_from_grid(grid, np.zeros(3), 0.01), np.full(len(grid), 1e9))
    local_mesh = distribute(on_first(model), 4, comm=COMM)
    result = synthesize(local_mesh, 40, "free", COMM)
    exact = solids.dense_eigenvalues(model)
    assert (result.values[:12] < 1e-9 * exact[-1]).all()
    assert result.values[12] > 1e-9 * exact[-1]
    assert len(degrees_of_freedom(local_mesh.nodes)) == len(result.vectors)


def missed_copies_are_found() -> None:
    model = solids.uniform_box(4, 4, 4, 0.01)
    exact = solids.dense_eigenvalues(model)
    local_mesh = distribute(on_first(model), PARTS, comm=COMM)
    layout = Layout.of_local_mesh(local_mesh, COMM)
    system = assemble(local_mesh, COMM, layout)
    start = system.gather(start_vector(system, 3)[:, None])
    if COMM.rank == 0:
        whole = replace(system, nodes=np.arange(model.mesh.n_nodes))
        assert (start[:, 0] == start_vector(whole, 3)).all()
    found = solve_truth(system, 30, seed=3)
    lost = np.flatnonzero(found.values > 0.9 * exact[12])[:2]
    poorer = replace(
        found, values=np.delete(found.values, lost), vectors=np.delete(found.vectors, lost, axis=1)
    )
    inertia = count_beyond(system, poorer)
    assert inertia.counted == inertia.computed + 2
    linear = LinearSolver("multifrontal", layout)
    assert count_beyond(system, poorer, linear.count_below) == inertia
    again, inertia = complete(system, poorer, inertia)
    assert inertia.counted == inertia.computed
    assert again.added == 2
    assert np.abs(again.values[6:30] / exact[6:30] - 1.0).max() < 1e-9
    gram = system.inner(again.vectors, system.times_mass(again.vectors))
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-9


def painted_parts_give_the_bits_of_a_whole_synthesis() -> None:
    """Materials that follow each other: one part is painted, then Poisson's ratio, then nothing."""
    model = on_first(solids.random_box(12, 6, 5))
    options = SolverOptions(modes=16, method="hcms", subdomains=6, corrections=0)
    random = np.random.default_rng(0)
    before = random.uniform(1e9, 2e9, 12 * 6 * 5)
    painted = before.copy()
    painted[:20] *= 3.0
    following = ModalSolver(model, options, COMM)
    for young, poisson in (
        (before, None),
        (before, None),
        (painted, None),
        (painted, 0.2),
        (painted, 0.2),
        (before, 0.2),
    ):
        regions = None if poisson is None else Regions.one(poisson)
        modes = following.solve(young if COMM.rank == 0 else None, regions=regions)
        alone = ModalSolver(model, options, COMM)
        cold = alone.solve(young if COMM.rank == 0 else None, regions=regions)
        assert (modes.values == cold.values).all()
        assert (modes.vectors == cold.vectors).all()


def corrections_of_a_synthesis_have_rows_cut_by_planes() -> None:
    """The rows are those of Lanczos, the vectors those of the synthesis to the bit."""
    model = on_first(solids.random_box(9, 6, 5))
    by_planes = distribute(model, comm=COMM, by_planes=True)
    by_parts = distribute(model, PARTS, comm=COMM)
    options = SolverOptions(modes=16, method="hcms", subdomains=PARTS, tolerance=1e-4)
    modes = modal_analysis(model, options, COMM)
    expected = by_planes if COMM.size > 1 else by_parts
    assert np.array_equal(modes.system.nodes, expected.nodes)
    assert modes.evidence["subdomains"] == by_parts.decomposition.tree.parts
    uncorrected = modal_analysis(model, replace(options, corrections=0), COMM)
    assert np.array_equal(uncorrected.system.nodes, by_parts.nodes)

    synthesis = synthesize(by_parts, 60, "free", COMM)
    there = Redistribution(by_parts, by_planes, COMM).rows(synthesis.vectors)
    back = Redistribution(by_planes, by_parts, COMM).rows(there)
    assert np.array_equal(back, synthesis.vectors)
    found, made = (
        assemble(local_mesh, COMM).gather(vectors)
        for local_mesh, vectors in ((by_planes, there), (by_parts, synthesis.vectors))
    )
    assert COMM.rank or np.array_equal(found, made)


def a_synthesis_follows_materials_that_are_corrected_by_planes() -> None:
    """A material of its own, the next one after it, and one from the modes of another."""
    model = solids.random_box(9, 6, 5)
    options = SolverOptions(modes=16, method="hcms", subdomains=PARTS, tolerance=1e-8)
    following = ModalSolver(on_first(model), options, COMM)
    modes = None
    for factor, poisson, warm in ((1.0, None, 0), (2.0, None, 0), (3.0, 0.2, 0), (3.5, 0.2, 1)):
        young = model.young.copy()
        young[:20] *= factor
        mine = young if COMM.rank == 0 else None
        regions = Regions.one(poisson or model.poisson)
        modes = following.solve(mine, modes if warm else None, regions=regions)
        other = model.with_regions(regions)
        exact = solids.dense_eigenvalues(other.with_young(young))[6:16]
        assert np.abs(modes.values[6:] / exact - 1.0).max() < 1e-8
        assert ("hcms" in modes.evidence) == (not warm)


def corrections_of_a_synthesis_do_not_depend_on_ranks() -> None:
    """They agree to rounding, however far from the modes they may end."""
    model = solids.random_box(12, 7, 6)
    for tolerance in (1e-2, 1e-4):
        options = SolverOptions(modes=24, method="hcms", subdomains=PARTS, tolerance=tolerance)
        alone = modal_analysis(model, options, MPI.COMM_SELF).values[6:]
        values = modal_analysis(on_first(model), options, COMM).values[6:]
        assert np.abs(values / alone - 1.0).max() < 1e-9


def multigrid_is_the_same_bits_again() -> None:
    system = assemble(distribute(on_first(solids.random_box(9, 6, 5)), PARTS, comm=COMM), COMM)
    block = np.ones((len(system.rigid), 2))

    def solution() -> np.ndarray:
        matrix = system.K.copy()
        matrix.shift(1e-3 * matrix.norm())
        return Multigrid(matrix, system.rigid, COMM).apply(block)

    first, *others = (solution() for _ in range(8))
    assert all((other == first).all() for other in others)


def all_ranks_factorise() -> None:
    """One subdomain a rank, several, and a solid so thin that halves of the ranks hardly touch."""
    whole = solids.random_box(9, 6, 5)
    for model, by_planes in ((whole, True), (whole, False), (solids.random_box(17, 2, 1), True)):
        values = solids.dense_eigenvalues(model)
        local_mesh = distribute(on_first(model), PARTS, comm=COMM, by_planes=by_planes)
        layout = Layout.of_local_mesh(local_mesh, COMM)
        system = assemble(local_mesh, COMM, layout)
        linear = LinearSolver("auto", layout)
        assert linear.method == "multifrontal"
        block = np.random.default_rng(COMM.rank).standard_normal((len(system.rigid), 5))
        for below in (0, 12, 40, len(values)):
            shift = 0.5 * (values[below - 1] + values[below]) if 0 < below < len(values) else 0.0
            shift = shift or (1.1 * values[-1] if below else -0.1 * values[6])
            inverse = linear.inverse(system, shift)
            assert inverse.negative == linear.count_below(system, shift) == below
            found = inverse.solve(block)
            residual = system.times_stiffness(found) - shift * system.times_mass(found) - block
            assert np.abs(residual).max() < (1e-10 if below == 12 else 1e-9)
            again = linear.inverse(system, shift)
            assert (again.solve(block) == found).all()
            assert (inverse.solve(block) == found).all()
            inverse.destroy()


def all_ranks_factorise_through_cells_of_several_sizes() -> None:
    line = octrees.about_a_line(np.array([1.0, 0.53, 0.57]), np.array([1.0, 0.3, 0.2]), 0.4)
    mesh = octrees.octree([(0, 0, 0), (1, 0, 0)], 3, line)
    model = octrees.solid_of(mesh) if COMM.rank == 0 else None
    local_mesh = distribute(model, comm=COMM, by_planes=True)
    largest = COMM.allreduce(local_mesh.stop - local_mesh.start, MPI.MAX)
    assert largest < 1.6 * len(mesh.lattice) / COMM.size
    layout = Layout.of_local_mesh(local_mesh, COMM)
    system, linear = assemble(local_mesh, COMM, layout), LinearSolver("multifrontal", layout)
    block = np.random.default_rng(COMM.rank).standard_normal((len(system.rigid), 5))
    inverse = linear.inverse(system, -1.0)
    found = inverse.solve(block)
    residual = system.times_stiffness(found) + system.times_mass(found) - block
    assert np.abs(residual).max() < 1e-9
    assert inverse.negative == 0 and linear.count_below(system, 1e-6) == 6


def a_rank_that_fails_to_factorise_ends_all() -> None:
    local_mesh = distribute(on_first(solids.random_box(9, 6, 5)), comm=COMM, by_planes=True)
    layout = Layout.of_local_mesh(local_mesh, COMM)
    system, linear = assemble(local_mesh, COMM, layout), LinearSolver("multifrontal", layout)
    tree = linear.tree
    with pytest.MonkeyPatch.context() as patch:
        if COMM.rank == COMM.size - 1:
            patch.setattr(multifrontal, "available_memory", lambda: 0)
        with pytest.raises(ConvergenceError, match="factorisation of 1,260 unknowns takes about"):
            tree.inverse(system, -1.0)
    system.rows.stiffness[:] = 0.0
    with pytest.raises(ConvergenceError, match="singular to rounding"):
        tree.inverse(system, 0.0)
    for front in tree.fronts[-1:]:
        data = np.zeros(front.strips.size)
        assert SharedFactor(front, data).failed


def mumps_solves_and_counts_what_the_own_factorisation_does() -> None:
    model = solids.random_box(9, 6, 5)
    values = solids.dense_eigenvalues(model)
    local_mesh = distribute(on_first(model), PARTS, comm=COMM)
    layout = Layout.of_local_mesh(local_mesh, COMM)
    system = assemble(local_mesh, COMM, layout)
    own = LinearSolver("multifrontal", layout)
    other = LinearSolver("mumps", layout)
    block = np.random.default_rng(COMM.rank).standard_normal((len(system.rigid), 5))
    between = [(n, 0.5 * (values[n - 1] + values[n])) for n in (6, 12, 40, len(values) // 2)]
    for below, shift in [(0, -0.1 * values[6]), *between, (len(values), 1.1 * values[-1])]:
        found = []
        for linear in (own, other):
            inverse = linear.inverse(system, shift)
            assert inverse.negative == linear.count_below(system, shift) == below
            assert count_negative(system.K, system.M, shift) == below
            found.append(inverse.solve(block))
            inverse.destroy()
        largest = COMM.allreduce(float(np.abs(found[0]).max()), MPI.MAX)
        assert np.abs(found[1] - found[0]).max() < 1e-8 * largest, below


def modes_of_several_machines_are_those_of_one() -> None:
    model = solids.random_box(9, 6, 5)
    exact = solids.dense_eigenvalues(model)[6:30]
    for method in ("hcms", "lanczos", "slepc"):
        options = SolverOptions(modes=30, method=method, tolerance=1e-10, check_inertia=True)
        with on_machines_of_their_own():
            found = modal_analysis(on_first(model), options, COMM)
        assert np.abs(found.values[6:] / exact - 1.0).max() < 1e-8, method
        if method != "slepc":
            together = modal_analysis(on_first(model), options, COMM)
            assert (found.values == together.values).all(), method
            assert (found.vectors == together.vectors).all(), method
        evidence = found.evidence
        assert evidence["inertia_count"] == evidence["inertia_expected"] >= 30, method
        assert method == "slepc" or evidence["linear_solver"] == "multifrontal", method


def a_warm_start_takes_the_inverse_of_the_material_before() -> None:
    model = solids.random_box(10, 7, 6)
    prepared = ModalSolver(on_first(model), SolverOptions(modes=36, tolerance=1e-3), COMM)
    first = prepared.solve()
    young = model.young * (1.0 + 0.1 * np.cos(0.3 * model.mesh.grid[:, 0]))[:, None]
    warm = prepared.solve(young if COMM.rank == 0 else None, initial_modes=first)
    exact = solids.dense_eigenvalues(model.with_young(young))[6:36]
    assert np.abs(warm.values[6:] / exact - 1.0).max() <= 1e-3
    assert warm.evidence["corrections"] == 1
    assert warm.inverse is first.inverse is not None


def repetitions_give_the_same_bits() -> None:
    model = on_first(solids.random_box(9, 6, 5))
    for options in (
        SolverOptions(modes=20, corrections=0),
        SolverOptions(modes=20, tolerance=1e-4, linear_solver="icc-pcg"),
        SolverOptions(modes=20, tolerance=1e-7),
        SolverOptions(modes=20, tolerance=1e-7, method="hcms"),
    ):
        first, *others = (modal_analysis(model, options, COMM) for _ in range(REPETITIONS))
        for other in others:
            assert (other.values == first.values).all(), options
            assert (other.vectors == first.vectors).all(), options


def repetitions_with_mumps_agree_to_the_tolerance() -> None:
    model = on_first(solids.random_box(9, 6, 5))
    corrected = SolverOptions(modes=20, tolerance=1e-7, linear_solver="mumps")
    for options, bound in ((corrected, 2e-7), (SolverOptions(modes=20, method="slepc"), 1e-9)):
        first, *others = (modal_analysis(model, options, COMM) for _ in range(REPETITIONS))
        for other in others:
            assert np.abs(other.values[6:] / first.values[6:] - 1.0).max() < bound, options


def finite_cells_on_ranks() -> None:
    cover = covering(cut_solids.turned(cut_solids.box(0.2, 0.05, 0.03)), 9)
    for shares in ((), (0.4, 0.2)):
        cells = cut_solids.divided(cover, shares)
        young = 1e9 * 10.0 ** np.random.default_rng(1).uniform(-1.0, 1.0, cells.mesh.n_cells)
        model = finite_cell_model(cells, young)
        exact = solids.dense_eigenvalues(model)
        for method in ("hcms", "slepc"):
            options = SolverOptions(modes=24, method=method, subdomains=5, tolerance=1e-10)
            values = modal_analysis(on_first(model), options, COMM).values
            assert np.abs(values[6:] / exact[6:24] - 1.0).max() < 1e-7, (method, shares)


if __name__ == "__main__":
    for name in sys.argv[1].split(","):
        if COMM.rank == 0:
            print(name, flush=True)  # tells which one failed
        try:
            globals()[name](*map(Path, sys.argv[2:]))
        except BaseException:
            # PETSc's end is collective: without this, the others would wait for it for ever.
            traceback.print_exc()
            COMM.Abort(1)
