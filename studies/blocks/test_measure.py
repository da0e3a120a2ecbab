"""Fig. 9: what its errors are, and what every table of them must satisfy."""

import json

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.block import (
    CORNER_NODES,
    active_nodes,
    cell_mass,
    cell_stiffness,
    degrees_of_freedom,
    prolongation,
    symmetries,
)
from carillon.fem.element import CORNERS, quadrature_stiffness, rigid_motions
from dataset_gen.generate import generate
from dataset_gen.objectives import fit
from dataset_gen.objectives.patterns import straining_motions
from dataset_gen.settings import ShardOptions
from forests.__main__ import main
from forests.baselines import average, galerkin
from forests.model import Model, load_model
from studies.blocks.block_error import LOADS, coarse_flexibility, displacement_errors, tables_of
from studies.blocks.cases import CASES
from studies.blocks.condensation import condense, corner_flexibility
from studies.blocks.methods import common_poisson, databases_of, methods_of
from studies.blocks.plot import plot
from studies.blocks.table import TableOptions, as_text, table
from tests.shard_files import write_shard

POISSON = 0.25
SOLID = (True,) * 8
HINGED = (False, True, True, False, False, True, False, False)
"""Cells that meet at edges only, so that they swing without strain."""
OPPOSITE = (True, False, False, False, False, False, False, True)
"""Two cells that share the block's centre alone."""


def blocks(filled, count=4, seed=0):
    young = np.random.default_rng(seed).uniform(0.1, 10.0, (count, 8))
    return np.where(filled, young, 0.0)


def answers(young):
    """Coarse answers by four methods."""
    return [
        average(young),
        galerkin(young),
        fit("calibrated", young, POISSON).moduli,
        corner_flexibility(young, POISSON),
    ]


class FreeBlock:
    """One block by dense linear algebra: no reduced bases, no batches."""

    def __init__(self, young):
        filled = young > 0
        nodes = active_nodes(filled)
        dofs = degrees_of_freedom(nodes)
        stiffness = np.einsum("j,jab->ab", young, cell_stiffness(POISSON))[np.ix_(dofs, dofs)]
        values, vectors = np.linalg.eigh(stiffness)
        strained = values > 1e-9 * values[-1]
        self.flexibility = (vectors[:, strained] / values[strained]) @ vectors[:, strained].T
        self.without_null = vectors[:, strained] @ vectors[:, strained].T
        self.null = vectors[:, ~strained]
        self.prolongation = prolongation()[dofs]
        mass = cell_mass()[filled].sum(axis=0)[np.ix_(nodes, nodes)]
        self.mass = np.kron(mass, np.eye(3))

    def forces(self, load, generator, count):
        """Random self-equilibrated forces (a, count)."""
        if load == "nodal":
            return self.without_null @ generator.standard_normal((len(self.mass), count))
        rigid = np.linalg.qr(rigid_motions(CORNERS.astype(float)))[0]
        motions = generator.standard_normal((24, count))
        motions -= rigid @ (rigid.T @ motions)
        inertia = self.mass @ self.prolongation @ motions
        moved = self.mass @ self.null
        return inertia - moved @ np.linalg.solve(self.null.T @ moved, self.null.T @ inertia)

    def squares(self, moduli, forces):
        """|u_c - u|^2 and |u|^2 of each force."""
        coarse = 2.0 * np.einsum("q,qab->ab", moduli, quadrature_stiffness(POISSON))
        fine = self.flexibility @ forces
        response = np.linalg.pinv(coarse, 1e-11) @ (self.prolongation.T @ forces)
        error = self.without_null @ (self.prolongation @ response) - fine
        return (error**2).sum(axis=0), (fine**2).sum(axis=0)


@pytest.mark.parametrize("load", ["nodal", "inertial"])
@pytest.mark.parametrize("filled", [SOLID, HINGED, OPPOSITE])
def test_expectation_is_the_mean_over_sampled_forces(filled, load):
    young = blocks(filled)
    moduli = galerkin(young) + 0.01
    (errors,) = displacement_errors(young, [moduli], POISSON)
    generator = np.random.default_rng(1)
    for row, block in enumerate(young):
        free = FreeBlock(block)
        samples = free.squares(moduli[row], free.forces(load, generator, 2000))
        for found, sampled in zip((errors.squared, errors.reference), samples, strict=True):
            spread = sampled.std() / np.sqrt(len(sampled))
            assert abs(found[load][row] - sampled.mean()) < 4.5 * spread


def test_corner_loads_are_forces_on_the_corners_and_displacements_there():
    young = blocks(SOLID)
    moduli = average(young)
    (errors,) = displacement_errors(young, [moduli], POISSON)
    corners = degrees_of_freedom(CORNER_NODES)
    rigid = np.linalg.qr(rigid_motions(CORNERS.astype(float)))[0]
    balanced = np.eye(24) - rigid @ rigid.T
    for row, block in enumerate(young):
        fine = balanced @ FreeBlock(block).flexibility[np.ix_(corners, corners)] @ balanced
        element = 2.0 * np.einsum("q,qab->ab", moduli[row], quadrature_stiffness(POISSON))
        coarse = np.linalg.pinv(element, 1e-11)
        np.testing.assert_allclose(errors.reference["corner"][row], (fine**2).sum(), rtol=1e-9)
        found = errors.squared["corner"][row]
        np.testing.assert_allclose(found, ((coarse - fine) ** 2).sum(), rtol=1e-9)


@pytest.mark.parametrize("filled", [SOLID, HINGED, OPPOSITE])
def test_static_condensation_is_exact_at_the_corners(filled):
    young = blocks(filled, 10)
    (errors,) = displacement_errors(young, [corner_flexibility(young, POISSON)], POISSON)
    assert errors.relative("corner").max() < 1e-24


def test_condensed_stiffness_is_the_schur_complement():
    young = blocks(SOLID, 3)
    corners = degrees_of_freedom(CORNER_NODES)
    inner = np.setdiff1d(np.arange(81), corners)
    stiffness = np.einsum("nj,jab->nab", young, cell_stiffness(POISSON))
    for found, full in zip(condense(young, POISSON), stiffness, strict=True):
        coupling = full[np.ix_(inner, corners)]
        answer = np.linalg.solve(full[np.ix_(inner, inner)], coupling)
        expected = full[np.ix_(corners, corners)] - coupling.T @ answer
        np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def test_no_element_falls_below_the_least_error_and_one_reaches_it():
    young = blocks(SOLID, 6)
    found = displacement_errors(young, answers(young), POISSON)
    for errors in found:
        for load in LOADS:
            assert (errors.relative(load) >= errors.relative_minimum(load) * (1 - 1e-12)).all()
    inverse = np.linalg.inv(tables_of(255, POISSON).loads["nodal"][0])
    free = [FreeBlock(block) for block in young]
    basis = free[0].without_null @ prolongation() @ straining_motions() @ inverse
    best = np.stack([inverse @ basis.T @ one.flexibility @ basis @ inverse.T for one in free])
    (errors,) = displacement_errors(young, [best], POISSON)
    np.testing.assert_allclose(errors.squared["nodal"], errors.minimum["nodal"], rtol=1e-9)


def test_uniform_blocks_are_coarsened_alike_by_average_and_galerkin():
    young = np.full((2, 8), 3.0)
    np.testing.assert_array_equal(average(young), young)
    np.testing.assert_allclose(galerkin(young), young, rtol=1e-14)
    (errors,) = displacement_errors(young * [[1.0], [7.0]], [young * [[1.0], [7.0]]], POISSON)
    for load in LOADS:
        np.testing.assert_allclose(*errors.relative(load), rtol=1e-10)


@pytest.mark.parametrize("filled", [SOLID, HINGED])
def test_errors_do_not_depend_on_the_scale_of_the_moduli(filled):
    young = blocks(filled)
    small = displacement_errors(young, answers(young), POISSON)
    large = displacement_errors(1000.0 * young, answers(1000.0 * young), POISSON)
    for one, other in zip(small, large, strict=True):
        for load in LOADS:
            np.testing.assert_allclose(
                other.relative(load), one.relative(load), rtol=1e-9, atol=1e-24
            )


@pytest.mark.parametrize("filled", [SOLID, HINGED])
def test_errors_do_not_depend_on_the_orientation_of_the_block(filled):
    young = blocks(filled, 1)
    images = young[:, np.argsort(symmetries(), axis=1)].reshape(-1, 8)
    for errors in displacement_errors(images, answers(images), POISSON):
        for load in LOADS:
            relative = errors.relative(load)
            np.testing.assert_allclose(relative, relative[0], rtol=1e-8, atol=1e-24)


def test_coarse_flexibility_is_the_inverse_of_the_stiffness():
    young = blocks(SOLID, 2)
    rigid = np.linalg.qr(rigid_motions(CORNERS.astype(float)))[0]
    motions = straining_motions()
    for found, moduli in zip(coarse_flexibility(young, POISSON), young, strict=True):
        element = 2.0 * np.einsum("q,qab->ab", moduli, quadrature_stiffness(POISSON))
        assert np.abs(element @ rigid).max() < 1e-12 * np.abs(element).max()
        np.testing.assert_allclose(found @ motions.T @ element @ motions, np.eye(18), atol=1e-10)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_blocks_are_what_their_case_says(case):
    young = case.blocks(1500, 3)
    low, high = case.range_gpa
    filled = young > 0.0
    assert young.shape == (1500, 8) and filled.any(axis=1).all()
    assert filled.all(axis=1).any() != case.void
    assert (young[filled] >= low).all() and (young <= high).all()
    np.testing.assert_array_equal(young[:700], case.blocks(700, 3))
    assert not np.array_equal(young, case.blocks(1500, 4))


def run(*arguments):
    return main([str(a) for a in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("table")
    write_shard(folder / "shard.h5", generate(ShardOptions(1500, 1), progress=False))
    assert run("train", folder / "shard.h5", "--trees", 1, "--out", folder / "forests.h5") == 0
    return folder


@pytest.fixture(scope="module")
def rows(folder):
    models = {"forests.h5": load_model(folder / "forests.h5")}
    return table(models, TableOptions(blocks=40), databases_of(CASES, POISSON, materials=3))


def test_rows_have_every_method_in_every_case(rows):
    names = [row["method"] for row in rows if row["fill"] == "partly void"]
    assert names[:3] == ["average", "Galerkin", "static condensation"]
    assert {"energy, fitted on the spot", "chen2015, fitted on the spot"} < set(names)
    assert any(name.endswith("forests") for name in names)
    assert any("database" in name for name in names)
    assert all(row["training_seconds"] > 0 for row in rows if "database" in row["method"])
    for row in rows:
        numbers = [row[key] for key in row if "error" in key or key == "mean_squared_m2"]
        assert len(numbers) == 9 and np.isfinite(numbers).all() and min(numbers) >= 0.0
        cost = [row[f"seconds_per_block{end}"] for end in ("_min", "", "_max")]
        assert cost == sorted(cost) and min(cost) > 0.0 and row["timed_runs"] > 2
        assert row["storage_bytes"] >= 0
        assert row["mean_error"] >= row["min_mean_error"]
    assert all(row["storage_bytes"] == 0 for row in rows if "fitted" in row["method"])


def test_scaled_rows_repeat_the_errors_of_the_trained_range(rows):
    scaled = {row["method"]: row for row in rows if row["scaled_by"] == 1000.0}
    plain = [row for row in rows if row["range_gpa"] == [0.0, 10.0] and row["fill"] == "solid"]
    assert len(plain) == len(scaled)
    for row in (row for row in plain if "database" not in row["method"]):
        other = scaled[row["method"]]
        for key in ("mean_error", "median_error", "mean_error_inertial", "median_error_inertial"):
            assert other[key] == pytest.approx(row[key], rel=1e-9)
        ratio = other["mean_squared_m2"] / row["mean_squared_m2"]
        assert ratio == pytest.approx(1e-6, rel=1e-9)


def test_json_is_a_list_of_rows(folder, capsys):
    model = folder / "forests.h5"
    assert run("table", "--model", model, "--blocks", 3, "--materials", 2, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, list)
    wanted = {"method", "range_gpa", "distribution", "fill", "mean_error", "median_error"}
    wanted |= {"mean_error_inertial", "median_error_inertial", "seconds_per_block"}
    wanted |= {"storage_bytes", "training_seconds", "scaled_by", "clamped", "blocks", "seed"}
    assert all(wanted <= row.keys() for row in found)


def test_text_names_every_method(rows):
    text = as_text(rows)
    assert max(map(len, text.splitlines())) <= 180
    assert all(row["method"] in text for row in rows)


@pytest.mark.parametrize("name", ["table.png", "table.svg"])
def test_plot_is_written(rows, tmp_path, name):
    plot(rows, tmp_path / name)
    assert (tmp_path / name).stat().st_size > 10_000


def test_picture_of_an_unknown_kind_is_refused_before_work(folder, capsys):
    model = folder / "forests.h5"
    assert run("table", "--model", model, "--plot", folder / "table.txt") == 2
    assert ".png" in capsys.readouterr().err


def test_forests_of_different_poisson_ratios_are_not_compared(folder):
    model = load_model(folder / "forests.h5")
    other = Model(**{**vars(model), "poisson": 0.3})
    with pytest.raises(UserError, match=r"Poisson.*0\.3"):
        common_poisson({"one": model, "other": other})


def test_methods_without_training_store_nothing(folder):
    untrained = methods_of({"one": load_model(folder / "forests.h5")})[:-1]
    assert len(untrained) >= 5
    assert all((each.storage_bytes, each.training_seconds) == (0, 0.0) for each in untrained)
