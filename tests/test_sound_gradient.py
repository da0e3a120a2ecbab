"""Derivatives of the objective against finite differences, on models with clustered modes."""

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

from carillon.fem.finite_cells.build import covering
from carillon.fem.geometry import hexmesh_from_grid
from solver.analysis.problem import ProblemOptions
from solver.assembly.sparse import assembled
from sound.clips.targets import Targets
from sound.design.constants import NOTHING, Bounded, FreeConstants
from sound.design.material import LAWS, ReducedMaterial
from sound.design.modal_truncation import lies_between, shift_between
from sound.design.objective import Objective
from sound.design.pitch import bark, bark_slope
from sound.design.simulation import Simulation
from sound.project.settings import Weights
from sound.strikes import Strike
from tests import cut_solids

EDGE = 0.01
MODES, SIZE = 8, 6


def block_mesh(shape):
    grid = np.argwhere(np.ones(shape)).astype(np.int32)
    return hexmesh_from_grid(grid[np.lexsort(grid.T)], np.zeros(3), EDGE)


def strikes(shape):
    extent = EDGE * np.array(shape)
    return [
        Strike("a", 0, np.array([0.2, 0.3, 1.0]) * extent, np.array([0.0, 0.0, -1.0])),
        Strike("b", 1, np.array([1.0, 0.6, 0.4]) * extent, np.array([-1.0, 0.0, 0.0])),
    ]


def simulation(shape, coarsen, law, free=NOTHING, heard=None):
    mesh = block_mesh(shape)
    material = ReducedMaterial.of_mesh(mesh, SIZE, 1e9, law, free)
    options = ProblemOptions("block", 8, coarsen=coarsen)
    return Simulation(mesh, options, material, strikes(shape), MODES, 1e-13, heard=heard)


def free_poisson(low, high):
    """A ratio that begins at 0.25."""
    return FreeConstants.of_poisson(Bounded(low, high, 0.25))


def random_objective(seed=0):
    random = np.random.default_rng(seed)
    frequencies = np.sort(200.0 * (1.0 + random.uniform(0.0, 3.0, MODES)))
    residuals, rates = (np.zeros(1),) * 2, (44100,) * 2
    amplitudes = random.uniform(0.0, 1.0, (2, MODES))
    targets = Targets(("a", "b"), frequencies, np.ones(MODES), amplitudes, residuals, rates)
    return Objective(targets, Weights(1.0, 10.0, 1e-5))


def gradients(simulation, objective, z):
    """Gradients (m,) of E_f and E_a by formula, and what was evaluated."""
    evaluation = simulation.evaluate(z, derivatives=True)
    values, pushed, sensitivity = evaluation.eigenvalues, evaluation.pushed, evaluation.sensitivity
    frequency = objective.frequency_jacobian(values, sensitivity)
    amplitude = objective.amplitude_jacobian(values, pushed, sensitivity)
    return (
        frequency.T @ objective.frequency_residual(values),
        np.einsum("tnm,tn->m", amplitude, objective.amplitude_residual(values, pushed)),
        evaluation,
    )


def exact(simulation, z):
    """Eigenvalues and pushed modes to rounding, by ARPACK.

    The solver leaves an error of 3e-9 in its modes, more or less of it on each processor; in a
    difference over a step of 1e-6 that would be 3e-3.
    """
    model = simulation.elements.with_young(simulation.material.moduli(z))
    model = model.with_regions(simulation.regions(z))
    K, M = assembled(model)
    shift = -1e-2 * model.young.max() / (model.density * EDGE**2)
    start = np.random.default_rng(0).standard_normal(K.shape[0])
    values, vectors = eigsh(K.tocsc(), 6 + MODES, M=M.tocsc(), sigma=shift, v0=start)
    return values[6:], simulation.mesh_rows(simulation._pushes).T @ vectors[:, 6:]


def differences(simulation, objective, z, step):
    """The same by central differences."""
    rows = []
    for direction in np.eye(len(z)):
        ends = [exact(simulation, z + sign * step * direction) for sign in (1.0, -1.0)]
        costs = [objective.cost(*end, 0.0) for end in ends]
        rows.append(
            [
                (getattr(costs[0], part) - getattr(costs[1], part)) / (2.0 * step)
                for part in ("frequency", "amplitude")
            ]
        )
    return np.array(rows).T


def relative(actual, expected):
    return np.linalg.norm(actual - expected) / np.linalg.norm(expected)


def assert_gradients(solid, z, step=1e-5):
    """Formulae and differences agree; dE_f/dz by either, and what was evaluated."""
    objective = random_objective()
    frequency, amplitude, evaluation = gradients(solid, objective, z)
    by_frequency, by_amplitude = differences(solid, objective, z, step)
    assert relative(frequency, by_frequency) < 1e-4
    assert relative(amplitude, by_amplitude) < 1e-4
    return frequency, by_frequency, evaluation


@pytest.mark.parametrize("law", LAWS)
def test_gradient_through_the_forests(law):
    z = 0.2 * np.random.default_rng(0).standard_normal(SIZE)
    # So small a step stays on one piece of the forests.
    assert_gradients(simulation((8, 6, 4), "ddfem", law), z, 1e-5)


@pytest.mark.parametrize("coarsen", ["none", "galerkin"])
def test_gradient_with_clustered_modes(coarsen):
    """A cube whose pairs and triples of modes are parted by a thousandth and less."""
    z = 0.01 * np.random.default_rng(0).standard_normal(SIZE)
    *_, evaluation = assert_gradients(simulation((6, 6, 6), coarsen, "linear"), z, 1e-6)
    gaps = np.diff(evaluation.eigenvalues) / evaluation.eigenvalues[1:]
    assert np.sum(gaps < 5e-3) >= 3 and gaps.min() < 1e-4


@pytest.mark.parametrize("coarsen", ["none", "average"])
@pytest.mark.parametrize("coordinate", [-2.0, 0.0, 1.5])
def test_gradient_by_poissons_ratio(coarsen, coordinate):
    solid = simulation((8, 6, 4), coarsen, "exponential", free_poisson(-0.2, 0.45))
    z = np.append(0.2 * np.random.default_rng(0).standard_normal(SIZE), coordinate)
    frequency, by_frequency, evaluation = assert_gradients(solid, z)
    assert abs(frequency[-1] / by_frequency[-1] - 1.0) < 1e-3
    np.testing.assert_allclose(evaluation.eigenvalues, exact(solid, z)[0], rtol=1e-8)


@pytest.mark.parametrize("law", LAWS)
def test_gradient_by_poissons_ratio_through_the_forests(law):
    """Their moduli do not depend on it, the elements' stiffness does."""
    solid = simulation((8, 6, 4), "ddfem", law, free_poisson(0.0, 0.45))
    z = np.append(0.2 * np.random.default_rng(0).standard_normal(SIZE), 1.0)
    frequency, by_frequency, evaluation = assert_gradients(solid, z, 1e-5)
    assert abs(frequency[-1] / by_frequency[-1] - 1.0) < 1e-3
    np.testing.assert_allclose(evaluation.eigenvalues, exact(solid, z)[0], rtol=1e-8)


def test_poissons_ratio_stays_between_its_bounds_and_has_a_slope():
    free = Bounded(0.0, 0.45, 0.3)
    at = [free.at(each) for each in (-40.0, -1.0, 0.0, 1.0, 40.0)]
    assert at == sorted(at) and 0.0 <= at[0] and at[-1] <= 0.45 and at[2] == pytest.approx(0.3)
    for poisson, coordinate in zip(at[1:-1], (-1.0, 0.0, 1.0)):
        assert free.coordinate(poisson) == pytest.approx(coordinate, abs=1e-12)
        difference = (free.at(coordinate + 1e-6) - free.at(coordinate - 1e-6)) / 2e-6
        assert free.slope(poisson) == pytest.approx(difference)


@pytest.mark.parametrize("divisions", [(), (0.3, 0.1)], ids=["whole", "divided"])
@pytest.mark.parametrize("free", [NOTHING, free_poisson(0.0, 0.45)])
def test_gradient_through_finite_cells(free, divisions):
    """The stiffness is linear in the moduli, so that there is no kink anywhere."""
    sides = (0.08, 0.06, 0.03)
    surface = cut_solids.turned(cut_solids.box(*sides))
    resolution = round(float(np.ptp(surface.bounds, axis=0).max()) / EDGE)
    cells = cut_solids.divided(covering(surface, resolution), divisions)
    assert cells.levels.max() == len(divisions) and (cells.kinds > 0).any() == bool(divisions)
    struck = [Strike("a", 0, surface.vertices[1], -surface.vertex_normals[1])]
    struck.append(Strike("b", 1, surface.vertices[6], -surface.vertex_normals[6]))
    material = ReducedMaterial.of_mesh(cells.mesh, SIZE, 1e9, "exponential", free)
    options = ProblemOptions("block", 8, discretisation="finite-cell")
    solid = Simulation(cells.mesh, options, material, struck, MODES, 1e-13, cells)
    assert_gradients(solid, 0.2 * np.random.default_rng(0).standard_normal(material.dimensions))


def test_gradient_at_repeated_modes():
    """A square prism has exact pairs, whose amplitudes one by one have no derivatives."""
    shape = (8, 8, 4)
    solid, objective = simulation(shape, "none", "linear"), random_objective()
    frequency, amplitude, evaluation = gradients(solid, objective, np.zeros(SIZE))
    gaps = np.diff(evaluation.eigenvalues) / evaluation.eigenvalues[1:]
    assert gaps.min() < 1e-9
    # Modes of a pair change places on the way from one end to the other, which adds errors of first
    # and second order in the step: both are extrapolated away.
    whole, half, quarter = (
        differences(solid, objective, np.zeros(SIZE), h) for h in (1.6e-4, 8e-5, 4e-5)
    )
    by_frequency, by_amplitude = (8.0 * quarter - 6.0 * half + whole) / 3.0
    assert relative(frequency, by_frequency) < 1e-4
    assert relative(amplitude, by_amplitude) < 1e-4


def test_modes_beyond_those_computed_matter(monkeypatch):
    """Leaving them out, as the appendix does, is not accurate enough for a gradient."""
    shape = (8, 6, 4)
    solid, objective = simulation(shape, "none", "linear"), random_objective()
    z = 0.2 * np.random.default_rng(0).standard_normal(SIZE)
    _, amplitude, _ = gradients(solid, objective, z)
    none = np.zeros((solid.model.n_dofs, 2, MODES))
    monkeypatch.setattr("sound.design.simulation.outside_response", lambda *_: none)
    _, without, _ = gradients(solid, objective, z)
    assert relative(without, amplitude) > 1e-2


def test_bark():
    f = np.array([50.0, 440.0, 3000.0, 15000.0])
    step = 1e-3
    slope = (bark(f + step) - bark(f - step)) / (2.0 * step)
    np.testing.assert_allclose(bark_slope(f), slope, rtol=1e-6)
    # Table of Zwicker: upper limits of the critical bands 1, 5, 10, 15, 20 and 24.
    limits = np.array([100.0, 510.0, 1270.0, 2700.0, 6400.0, 15500.0])
    np.testing.assert_allclose(bark(limits), [1, 5, 10, 15, 20, 24], atol=0.25)


@pytest.mark.parametrize("law", LAWS)
def test_moduli_stay_positive(law):
    material = ReducedMaterial.of_mesh(block_mesh((6, 4, 3)), SIZE, 2e9, law)
    np.testing.assert_allclose(material.moduli(np.zeros(SIZE)), 2e9)
    z = 20.0 * np.random.default_rng(0).standard_normal(SIZE)
    assert (material.moduli(z) > 0.0).all()
    step = 1e-6
    z *= 0.02
    slope = material.slopes(material.moduli(z))[:, None] * material.basis
    for k, direction in enumerate(np.eye(SIZE)):
        ends = material.moduli(z + step * direction), material.moduli(z - step * direction)
        np.testing.assert_allclose(
            (ends[0] - ends[1]) / (2 * step), slope[:, k], rtol=1e-4, atol=1e3
        )


@pytest.mark.parametrize("law", LAWS)
def test_coordinates_of_moduli(law):
    material = ReducedMaterial.of_mesh(block_mesh((6, 4, 3)), SIZE, 2e9, law)
    z = 0.05 * np.random.default_rng(1).standard_normal(SIZE)
    np.testing.assert_allclose(material.coordinates(3.0 * material.moduli(z)), z, atol=1e-3)


def test_energies_of_pairs_are_those_of_the_assembled_derivative():
    """u_i^T (dK/dz) u_j of close modes, also with more elements than are worked on together."""
    solid = simulation((6, 6, 6), "none", "exponential")
    z = 0.01 * np.random.default_rng(1).standard_normal(SIZE)
    evaluation = solid.evaluate(z, derivatives=True)
    elastic = solid.mesh_rows(evaluation.modes.vectors[:, 6:])
    directions = solid.material.slopes(solid.material.moduli(z))[:, None] * solid.material.basis
    largest = np.abs(evaluation.sensitivity.stiffness).max()
    i, j = evaluation.sensitivity.pairs.T
    assert len(i) > MODES and (i[:MODES] == j[:MODES]).all()
    for k in range(SIZE):
        # The stiffness is linear in the moduli, which need not be positive here.
        parts = [np.maximum(sign * directions[:, k], 1.0) for sign in (1.0, -1.0)]
        K = np.subtract(*(assembled(solid.elements.with_young(part))[0] for part in parts))
        found = evaluation.sensitivity.stiffness[k]
        np.testing.assert_allclose(found, (elastic.T @ (K @ elastic))[i, j], atol=1e-9 * largest)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-13])
def test_the_inverse_of_the_derivatives_serves_the_next_analysis(tolerance):
    shape = (8, 6, 4)
    mesh, options = block_mesh(shape), ProblemOptions("block", 8, coarsen="none")
    material = ReducedMaterial.of_mesh(mesh, SIZE, 1e9, "linear")
    solid = Simulation(mesh, options, material, strikes(shape), MODES, tolerance)
    start = solid.evaluate(np.zeros(SIZE))
    z = np.full(SIZE, 0.01)
    near = solid.evaluate(z, start.modes, derivatives=True)
    assert near.modes.inverse.shift < near.eigenvalues[-1]
    again = solid.evaluate(1.01 * z, near.modes)
    # A loose analysis needs no other; an accurate one has no use for it.
    assert (again.modes.inverse is near.modes.inverse) == (tolerance == 1e-3)
    values, _ = exact(solid, 1.01 * z)
    np.testing.assert_allclose(
        again.eigenvalues, values, rtol=tolerance if tolerance > 1e-6 else 1e-9
    )


def test_a_shift_keeps_away_from_all_eigenvalues():
    values = np.array([1.0, 4.0, 5.0, 8.0, 9.0, 10.0])
    assert shift_between(values) == 6.5
    assert lies_between(values, 6.0) and not lies_between(values, 8.001)
    assert not lies_between(values, 2.0)
