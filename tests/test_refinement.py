"""Coarse meshes of which some blocks stay fine: the fine model, the coarse one, or between both."""

import shutil
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from mpi4py import MPI
from scipy.sparse.csgraph import connected_components

from carillon.errors import UserError
from carillon.fem.element import rigid_motions
from carillon.fem.elements import HexElements
from carillon.fem.geometry import (
    CORNER_OFFSETS,
    HexMesh,
    blocks_from_mesh,
    hexmesh_from_grid,
    prolongation,
)
from carillon.fem.geometry.faces import boundary_faces, corner_values, face_neighbours
from carillon.fem.geometry.hanging import makes_sense, node_places, node_weights
from carillon.fem.laplacian import cell_laplacian
from carillon.fem.regions import Regions
from solver.assembly.sparse import assembled
from solver.coarsening.choice import make_coarsening
from solver.coarsening.model import build_model
from solver.distribution.local_mesh import distribute
from solver.files.initial_modes import modes_from_file
from solver.files.modes_file import read_modes, write_modes
from solver.hcms.condense import INTERFACES, restrict_stiffness
from solver.hcms.synthesis import synthesize
from solver.response.points import interpolation
from solver.verification.comparison import compare_files, on_mesh_of
from tests import solids
from tests.edited_files import edited, put
from tests.rank_counts import TO_THREE

COMM = MPI.COMM_SELF
SEEDS = range(12)


def random_solid(seed: int) -> HexMesh:
    """Voxels with holes, touching by faces, edges, corners or not at all."""
    rng = np.random.default_rng(seed)
    filled = rng.random(rng.integers(3, 7, 3)) < rng.choice([0.4, 0.6, 0.85])
    return hexmesh_from_grid(np.argwhere(filled), rng.standard_normal(3), 0.25)


def random_blocks(seed: int, share: float = 0.4, whole_hinges: bool = True):
    """Fine mesh and its blocks, some of them divided; all that are in parts without hinges."""
    fine, rng = random_solid(seed), np.random.default_rng(1000 + seed)
    coarse = blocks_from_mesh(fine).coarse
    refined = rng.random(coarse.n_cells) < share
    refined[rng.integers(len(refined))] = True
    if not whole_hinges:
        _, block, parts = np.unique(coarse.grid, axis=0, return_inverse=True, return_counts=True)
        refined |= parts[block.ravel()] > 1
    return fine, refined, blocks_from_mesh(fine, refined)


def random_moduli(mesh: HexMesh, seed: int) -> np.ndarray:
    return 1e9 * 10.0 ** np.random.default_rng(2000 + seed).uniform(-1.0, 1.0, mesh.n_cells)


def mixed_model(seed: int, method: str = "galerkin", **constants):
    fine, refined, blocks = random_blocks(seed, whole_hinges=False)
    young = random_moduli(fine, seed)
    return (
        build_model(fine, young, **constants),
        build_model(fine, young, make_coarsening(method), refined, **constants),
        sp.kron(prolongation(blocks), sp.identity(3), format="csr"),
    )


def assert_equal(left, right) -> None:
    assert np.abs(left - right).max() <= 1e-13 * np.abs(right).max()


# Meshes


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_refined_is_the_coarse_mesh(seed):
    fine = random_solid(seed)
    plain = blocks_from_mesh(fine)
    none = blocks_from_mesh(fine, np.zeros(plain.coarse.n_cells, dtype=bool))
    for field in ("cells", "grid", "node_grid", "edge"):
        assert np.array_equal(getattr(plain.coarse, field), getattr(none.coarse, field))
    assert none.coarse.span is None and none.coarse.hanging is None
    assert np.array_equal(plain.fine_of_block, none.fine_of_block)
    assert np.array_equal(plain.contacts, none.contacts)
    young, coarsening = random_moduli(fine, seed), make_coarsening("galerkin")
    models = (
        build_model(fine, young, coarsening),
        build_model(fine, young, coarsening, np.zeros(plain.coarse.n_cells, dtype=bool)),
    )
    for left, right in zip(*map(assembled, models), strict=True):
        assert (left != right).nnz == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_everything_refined_is_the_fine_model(seed):
    fine = random_solid(seed)
    everything = np.ones(blocks_from_mesh(fine).coarse.n_cells, dtype=bool)
    order = prolongation(blocks_from_mesh(fine, everything))
    assert order.nnz == fine.n_nodes == order.shape[1] and (order.data == 1.0).all()
    P = sp.kron(order, sp.identity(3))
    young = random_moduli(fine, seed)
    for lumped in (False, True):
        models = [
            build_model(fine, young, *coarse, lumped=lumped)
            for coarse in ((), (make_coarsening("fit"), everything))
        ]
        for exact, found in zip(*map(assembled, models), strict=True):
            assert_equal(P @ found @ P.T, exact)
    mesh = blocks_from_mesh(fine, everything).coarse
    assert mesh.volume == pytest.approx(fine.volume)
    assert len(boundary_faces(mesh)[0]) == len(boundary_faces(fine)[0])
    assert len(face_neighbours(mesh)) == len(face_neighbours(fine))


@pytest.mark.parametrize("seed", SEEDS)
def test_mixed_meshes_are_consistent(seed):
    fine, refined, blocks = random_blocks(seed)
    mesh, plain = blocks.coarse, blocks_from_mesh(fine)
    assert np.array_equal(np.sort(blocks.fine_of_block[blocks.mask]), np.arange(fine.n_cells))
    assert (blocks.mask.sum(axis=1)[blocks.is_fine] == 1).all()
    divided = {tuple(place) for place in plain.coarse.grid[refined].tolist()}
    found = [tuple(place) in divided for place in (mesh.grid >> 1).tolist()]
    assert np.array_equal(found, blocks.is_fine)
    assert makes_sense()[mesh.kinds].all()
    places = 2 * (mesh.grid >> 1)[:, None] + node_places()[mesh.kinds]
    assert np.array_equal(mesh.node_grid[mesh.cells], places)
    assert np.array_equal(np.unique(mesh.cells), np.arange(mesh.n_nodes))
    assert (np.diff(mesh.node_grid @ np.array([1, 100, 10_000])) >= 0).all()
    # Parts that stay whole are those of the coarse mesh, with the same contacts.
    part = {tuple(cells): bits for cells, bits in zip(plain.fine_of_block.tolist(), plain.contacts)}
    for cells, bits, own in zip(blocks.fine_of_block.tolist(), blocks.contacts, blocks.is_fine):
        assert own or part[tuple(cells)] == bits


@pytest.mark.parametrize("seed", SEEDS)
def test_open_faces_of_a_mixed_mesh_are_squares(seed):
    _, _, blocks = random_blocks(seed)
    mesh = blocks.coarse
    quads, cells = boundary_faces(mesh)
    corners = corner_values(mesh, mesh.node_grid.astype(float), quads, cells)
    diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    area = np.cross(*diagonals) / 2
    assert np.array_equal(np.abs(area).sum(axis=1), mesh.span[cells].astype(float) ** 2)


@pytest.mark.parametrize("seed", SEEDS)
def test_linear_fields_are_reproduced(seed):
    fine, _, blocks = random_blocks(seed)
    P = prolongation(blocks)
    assert np.abs(P @ blocks.coarse.nodes - fine.nodes).max() < 1e-14
    assert np.abs(P.sum(axis=1) - 1.0).max() < 1e-15
    mesh = blocks.coarse
    corners = node_weights()[mesh.kinds] @ mesh.node_grid[mesh.cells]
    expected = mesh.grid[:, None] + mesh.span[:, None, None] * CORNER_OFFSETS
    assert np.abs(corners - expected).max() < 1e-14


@pytest.mark.parametrize("seed", SEEDS)
def test_elements_that_touch_by_a_face_are_neighbours(seed):
    fine, _, blocks = random_blocks(seed)
    element = np.empty(fine.n_cells, dtype=int)
    element[blocks.fine_of_block[blocks.mask]] = np.nonzero(blocks.mask)[0]
    touching = np.sort(element[face_neighbours(fine)], axis=1)
    touching = touching[touching[:, 0] != touching[:, 1]]
    pairs = {tuple(pair) for pair in np.sort(face_neighbours(blocks.coarse), axis=1).tolist()}
    assert len(pairs) == len(face_neighbours(blocks.coarse))
    assert {tuple(pair) for pair in touching.tolist()} <= pairs
    # Others have all corners of a face in common nevertheless.
    cells = blocks.coarse.cells
    for left, right in pairs - {tuple(pair) for pair in touching.tolist()}:
        assert len(np.intersect1d(cells[left], cells[right])) >= 4


def test_pieces_of_a_mixed_mesh_are_those_of_the_fine_one():
    assert connected_components(cell_laplacian(solids.bar_models()[1].mesh))[0] == 1


# Matrices


@pytest.mark.parametrize("seed", SEEDS)
def test_mixed_galerkin_matrices_are_projections_of_the_fine_ones(seed):
    fine, mixed, P = mixed_model(seed)
    for exact, found in zip(assembled(fine), assembled(mixed), strict=True):
        assert_equal(found, P.T @ exact @ P)
    assert mixed.mass == pytest.approx(fine.mass, rel=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_patch_of_constant_strain(seed):
    fine, refined, blocks = random_blocks(seed)
    young = np.full(fine.n_cells, 2e9)
    model = build_model(fine, young, make_coarsening("galerkin"), refined, regions=Regions.one(0.3))
    K, M = assembled(model)
    nodes = blocks.coarse.nodes
    rigid = rigid_motions(nodes.astype(float), nodes.mean(axis=0))
    scale = np.abs(K).max() * np.abs(rigid).max()
    assert np.abs(K @ rigid).max() < 1e-13 * scale
    gradient = np.random.default_rng(seed).standard_normal((3, 3))
    strain = 0.5 * (gradient + gradient.T)
    mu, lam = 2e9 / 2.6, 2e9 * 0.3 / (1.3 * 0.4)
    density = 2.0 * mu * (strain**2).sum() + lam * np.trace(strain) ** 2
    field = (nodes @ gradient.T).ravel()
    assert field @ (K @ field) == pytest.approx(density * fine.volume, rel=1e-12)
    translation = np.tile([0.0, 1.0, 0.0], len(nodes))
    assert translation @ (M @ translation) == pytest.approx(model.mass, rel=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_lumped_masses(seed):
    _, whole, _ = mixed_model(seed)
    lumped = assembled(replace(whole, lumped=True))[1]
    consistent = assembled(whole)[1]
    assert (lumped != sp.diags(lumped.diagonal())).nnz == 0 and lumped.diagonal().min() > 0.0
    assert_equal(lumped.diagonal(), np.asarray(consistent.sum(axis=1)).ravel())
    same = (replace(whole, lumped_share=0.3).nodal_mass() == whole.nodal_mass()).all(axis=(1, 2))
    assert np.array_equal(same, (whole.mesh.span == 1) | (whole.fill != 255))


def test_fine_cells_by_themselves_know_that_they_are():
    _, mixed, _ = mixed_model(3)
    mixed = replace(mixed, lumped_share=0.5)
    cells = np.flatnonzero(mixed.mesh.span == 1)
    alone: HexElements = mixed.elements.of(*(values[cells] for values in mixed.elements.arrays()))
    assert (alone.nodal_mass() == mixed.nodal_mass(cells)).all()
    assert (alone.stiffness() == mixed.stiffness(cells)).all()


@pytest.mark.parametrize("interface", ["free", "overlapping"])
def test_relaxed_elements_with_hanging_corners_are_free(interface):
    kinds = np.flatnonzero(makes_sense()[:-1])
    kinds = kinds[np.random.default_rng(0).permutation(len(kinds))[:60]].astype(np.int32)
    young = np.random.default_rng(1).uniform(0.1, 10.0, (len(kinds), 8))
    fill = np.full(len(kinds), 255, dtype=np.uint8)
    elements = HexElements(young, fill, 1.0, Regions.one(0.25, 1.0), False, 0.0, kinds)
    stiffness, places = elements.stiffness(), elements.node_places
    for corners in combinations(range(8), 3):
        inside = np.broadcast_to(np.isin(np.arange(8), corners), (len(kinds), 8))
        relaxed = restrict_stiffness(stiffness, inside, interface, places)
        for matrix, nodes in zip(relaxed, places):
            motions = (
                rigid_motions(nodes.astype(float), nodes.mean(axis=0))
                * np.repeat(inside[0], 3)[:, None]
            )
            assert np.abs(matrix @ motions).max() < 1e-11
            assert la.eigvalsh(matrix)[0] > -1e-11


# Spectra


def test_mixed_spectra_lie_between_the_fine_and_the_coarse_one():
    fine, mixed, coarse = (solids.dense_eigenvalues(model) for model in solids.bar_models())
    count, slack = len(coarse), 1e-9 * coarse[20]
    assert (fine[:count] <= mixed[:count] + slack).all()
    assert (mixed[:count] <= coarse + slack).all()
    assert mixed[10] < 0.99 * coarse[10]


@pytest.mark.parametrize("interface", INTERFACES)
def test_synthesis_bounds_a_mixed_spectrum_from_above(interface):
    _, mixed, _ = solids.bar_models("fit")
    exact = solids.dense_eigenvalues(mixed)
    values = synthesize(distribute(mixed, 5, comm=COMM), 120, interface, COMM).values
    assert (values[:60] >= exact[:60] - 1e-9 * exact[60]).all()
    if interface != "fixed":
        assert np.abs(values[:6]).max() < 1e-9 * values[-1]
        assert values[6] < 1.5 * exact[6]


@pytest.mark.parametrize("method", ["hcms", "slepc", "arpack"])
def test_every_method_finds_the_modes_of_a_mixed_model(method):
    _, mixed, _ = solids.bar_models("fit")
    exact = solids.dense_eigenvalues(mixed)
    values = solids.analysed(mixed, modes=30, method=method, subdomains=5, tolerance=1e-11).values
    assert np.abs(values[6:] / exact[6:30] - 1.0).max() < 1e-9


@pytest.mark.parametrize("number", [0, 2])
def test_no_element_of_one_size_reaches_past_a_plane(number):
    model = solids.bar_models()[number]
    local_mesh = distribute(model, 5, comm=COMM)
    places = local_mesh.lattice()[local_mesh.cells.corners]
    steps = local_mesh.cells.elements.steps
    assert (-(-places.max(axis=1) // steps) - places.min(axis=1) // steps <= 1).all()
    assert np.array_equal(local_mesh.lattice(), model.mesh.node_grid[local_mesh.nodes])


def test_planes_pass_through_elements_of_two_sizes():
    _, mixed, _ = solids.bar_models()
    local_mesh = distribute(mixed, 5, comm=COMM)
    assert local_mesh.cells.elements.steps is None
    assert np.array_equal(local_mesh.lattice(), mixed.mesh.node_grid[local_mesh.nodes])


# Points and files


@pytest.mark.parametrize("seed", SEEDS)
def test_points_move_as_on_the_fine_mesh(seed):
    fine, refined, blocks = random_blocks(seed, whole_hinges=False)
    young = np.ones(fine.n_cells)
    local = np.random.default_rng(seed).uniform(0.01, 0.99, (fine.n_cells, 3))
    points = fine.origin + fine.edge * (fine.grid + local)
    found = interpolation(build_model(fine, young, make_coarsening("average"), refined), points)
    expected = interpolation(build_model(fine, young), points) @ prolongation(blocks)
    assert np.abs(found - expected).max() < 1e-13


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Modes files of the fine, the mixed and the coarse bar."""
    folder, paths = tmp_path_factory.mktemp("mixed"), {}
    for name, model in zip(("fine", "mixed", "coarse"), solids.bar_models(), strict=True):
        K, M = (matrix.toarray() for matrix in assembled(model))
        values, modes = la.eigh(K, M, subset_by_index=[0, 19])
        paths[name] = folder / f"{name}.h5"
        write_modes(paths[name], model, values, [modes], np.zeros(20), {}, {})
    return paths


def test_a_mixed_model_is_read_as_it_was_written(files):
    _, mixed, _ = solids.bar_models()
    again = read_modes(files["mixed"]).model
    for field in ("cells", "grid", "node_grid", "span", "hanging"):
        left, right = getattr(again.mesh, field), getattr(mixed.mesh, field)
        assert np.array_equal(left, right) and left.dtype == right.dtype
    for left, right in zip(assembled(again), assembled(mixed), strict=True):
        assert_equal(left, right)


def test_mixed_modes_are_compared_on_the_fine_mesh(files):
    fine, mixed = (read_modes(files[name]) for name in ("fine", "mixed"))
    modes = on_mesh_of(fine, mixed)
    K, M = assembled(fine.model)
    assert np.abs(modes.T @ (M @ modes) - np.eye(20)).max() < 1e-10
    scale = mixed.eigenvalues[-1]
    assert np.abs(modes.T @ (K @ modes) - np.diag(mixed.eigenvalues)).max() < 1e-9 * scale
    assert not np.isnan(compare_files(files["mixed"], files["fine"]).subspace_angle_max)
    assert compare_files(files["mixed"], files["mixed"]).subspace_angle_max < 1e-6
    assert not np.isnan(compare_files(files["coarse"], files["mixed"]).subspace_angle_max)


def test_modes_of_another_mixed_mesh_start_nothing(files):
    _, mixed, coarse = solids.bar_models()
    other = solids.bar_models(share=0.6)[1]
    rows = modes_from_file(files["mixed"], mixed, 20, distribute(mixed, 4, comm=COMM), COMM)
    assert rows.shape == (mixed.n_dofs, 20)
    for model in (coarse, other):
        local_mesh = distribute(model, 4, comm=COMM)
        with pytest.raises(UserError, match="modes of another mesh"):
            modes_from_file(files["mixed"], model, 20, local_mesh, COMM)


def first_fine(values, value):
    """The value in place of the first cell that is fine and has one."""
    return np.where(np.arange(len(values)) == np.flatnonzero(values)[0], value, values)


EDITS = {
    "no span": lambda file: file.__delitem__("span"),
    "no hanging": lambda file: file.__delitem__("hanging"),
    "spans of other cells": put("span", lambda values: values[1:]),
    "real spans": put("span", lambda values: values.astype(float)),
    "a span of three": put("span", lambda values: first_fine(values, 3)),
    "fine cells for whole blocks": put("span", np.ones_like),
    "whole blocks for fine cells": put("span", lambda values: np.full_like(values, 2)),
    "a corner that is none": put("hanging", lambda values: first_fine(values.astype(int), 256)),
    "a corner below zero": put("hanging", lambda values: first_fine(values.astype(int), -1)),
    "the middle hangs": put("hanging", lambda values: first_fine(values, 255)),
    "hanging corners of whole blocks": put("hanging", lambda values: values | 2),
    "other corners hang": put("hanging", np.zeros_like),
    "void octants of fine cells": put("fill", lambda values: np.full_like(values, 1)),
}


@pytest.mark.parametrize("name", EDITS)
def test_damaged_mixed_meshes_are_refused(name, files, tmp_path):
    path = shutil.copy(files["mixed"], tmp_path / "modes.h5")
    with edited(path) as file:
        EDITS[name](file)
    with pytest.raises(UserError) as caught:
        read_modes(path)
    assert str(path) in str(caught.value) and "generate the file again" in str(caught.value)


def test_a_block_is_whole_or_divided(files, tmp_path):
    path = shutil.copy(files["mixed"], tmp_path / "modes.h5")
    with edited(path) as file:
        span, grid = file["span"][()], file["grid"][()]
        fine = np.flatnonzero(span == 1)[0]
        span[fine], grid[fine] = 2, grid[fine] & ~1
        file["span"][...], file["grid"][...] = span, grid
        hanging = file["hanging"][()]
        hanging[fine] = 0
        file["hanging"][...] = hanging
    with pytest.raises(UserError, match="both whole and divided"):
        read_modes(path)


def test_files_of_plain_meshes_have_nothing_new(files):
    for name in ("fine", "coarse"):
        with h5py.File(files[name]) as file:
            assert not {"span", "hanging"} & set(file)


# Several ranks


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", TO_THREE)
def test_mixed_models_on_several_ranks(ranks, mpiexec):
    program = Path(__file__).with_name("distributed_checks.py")
    checks = ("products_of_a_mixed_model", "mixed_models_are_solved_by_every_method")
    mpiexec(ranks, program, ",".join(checks), check=True)
