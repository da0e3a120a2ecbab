"""Fits of blocks whose cells have any elasticity: as the isotropic ones, and by dense matrices."""

from itertools import permutations, product

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.block import ALL_FILLED, CELL_NODES, NODES, degrees_of_freedom, symmetries
from carillon.fem.elasticity import DEFAULT_POISSON
from carillon.fem.element import CORNERS, elasticity_matrix, shape_functions
from dataset_gen.objectives import fit, general_cells, inertial
from dataset_gen.objectives.anisotropic import GENERAL_OBJECTIVES, fit_blocks
from dataset_gen.objectives.elasticity import filled_mean, stiffness_size, turned, unit_cells
from dataset_gen.objectives.oversampled import PATCH_NODES, RIGID_SHARE
from dataset_gen.objectives.patterns import pattern_of, straining_motions
from dataset_gen.objectives.quadratic import NormalEquations
from dataset_gen.sampling import pattern_classes, samples
from solver.coarsening.anisotropic import AnisotropicCoarsening, octant_laws
from solver.coarsening.choice import make_coarsening
from tests.anisotropic_spectra import (
    bar,
    element_stiffness,
    errors,
    one_law,
    places,
    rotated,
    spruce,
    turn,
    two_laws,
)

EVERY = pytest.mark.parametrize("objective", GENERAL_OBJECTIVES)

# Rounding, amplified by normal equations whose condition number the ridge of 1e-3 bounds near 1e4:
# as for the isotropic fits.
TOLERANCE = 1e-8


def random_elasticity(shape, seed=0):
    """Matrices (*shape, 6, 6) without any symmetry, of condition numbers of some hundreds."""
    factors = np.random.default_rng(seed).standard_normal((*shape, 6, 9))
    return factors @ factors.swapaxes(-1, -2) / 9.0 + 0.1 * np.eye(6)


def random_blocks(count, seed=0):
    """Blocks of random matrices and moduli, zero where void, and their filled cells."""
    young = samples(seed=seed, start=0, stop=count)
    return random_elasticity((count, 8), seed) * young[..., None, None], young > 0


def all_symmetries():
    """Each symmetry's permutation of cells (8,) and its orthogonal matrix (3, 3)."""
    for image, (axes, flips) in zip(
        symmetries(), product(permutations(range(3)), product((0, 1), repeat=3))
    ):
        matrix = np.zeros((3, 3))
        matrix[np.arange(3), axes] = 1.0 - 2.0 * np.array(flips)
        yield image, matrix


@EVERY
@pytest.mark.parametrize("poisson", [0.0, 0.25, 0.4])
def test_isotropic_cells_of_one_ratio_have_the_moduli_of_the_isotropic_fit(objective, poisson):
    patterns = (np.arange(1, 256)[:, None] >> np.arange(8) & 1).astype(float)
    young = np.concatenate([samples(seed=5, start=0, stop=100), patterns])
    expected = fit(objective, young, poisson)
    if objective == "calibrated":
        # Its moduli are those of fits at one ratio.
        poisson = DEFAULT_POISSON
    found = fit_blocks(young[..., None, None] * elasticity_matrix(poisson), young > 0, objective)
    own = np.where(young > 0, young, filled_mean(young, young > 0)[:, None])
    np.testing.assert_allclose(found.scales * own, expected.moduli, rtol=TOLERANCE)
    assert found.converged.all()


@EVERY
def test_scales_do_not_change_with_the_unit(objective):
    elasticity, filled = random_blocks(40)
    one, other = (fit_blocks(unit * elasticity, filled, objective) for unit in (1.0, 3e9))
    np.testing.assert_allclose(one.scales, other.scales, rtol=TOLERANCE)


@EVERY
def test_scales_follow_the_symmetries_of_the_cube(objective):
    elasticity, filled = random_blocks(12)
    expected = fit_blocks(elasticity, filled, objective).scales
    for image, matrix in all_symmetries():
        moved, full, answer = (np.empty_like(a) for a in (elasticity, filled, expected))
        moved[:, image] = [[rotated(cell, matrix) for cell in block] for block in elasticity]
        full[:, image], answer[:, image] = filled, expected
        found = fit_blocks(moved, full, objective).scales
        np.testing.assert_allclose(found, answer, rtol=TOLERANCE)


@EVERY
def test_a_row_does_not_depend_on_its_company(objective):
    elasticity, filled = random_blocks(40)
    elasticity[::3] = np.where(filled[::3, :, None, None], elasticity[0, 0], 0.0)
    together = fit_blocks(elasticity, filled, objective)
    alone = [fit_blocks(elasticity[n : n + 1], filled[n : n + 1], objective) for n in range(40)]
    for whole, parts in zip(together, zip(*alone)):
        np.testing.assert_array_equal(whole, np.concatenate(parts))


@EVERY
def test_uniform_blocks_have_the_symmetry_of_their_matrix(objective):
    """All eight octants alike for an orthotropic matrix; opposite ones for any."""
    laws = np.stack([spruce(), elasticity_matrix(0.3), random_elasticity(())])
    scales = fit_blocks(np.repeat(laws[:, None], 8, axis=1), np.ones((3, 8)), objective).scales
    np.testing.assert_allclose(scales[:2], scales[:2, :1].repeat(8, axis=1), rtol=TOLERANCE)
    np.testing.assert_allclose(scales[2], scales[2, ::-1], rtol=TOLERANCE)
    assert ((scales > 0.5) & (scales < 1.1)).all()


@EVERY
def test_void_octants_without_a_matrix_have_the_mean(objective):
    elasticity, filled = random_blocks(40)
    mean = filled_mean(elasticity, filled)[:, None]
    given = np.where(filled[..., None, None], elasticity, mean)
    for left, right in zip(
        fit_blocks(elasticity, filled, objective), fit_blocks(given, filled, objective)
    ):
        np.testing.assert_array_equal(left, right)


def assembled(cells, nodes, matrices):
    """Dense stiffness of cells (m, 8) of edge 1 with elasticity matrices (m, 6, 6)."""
    whole = np.zeros((3 * nodes, 3 * nodes))
    for dofs, matrix in zip(
        degrees_of_freedom(cells), element_stiffness(1.0, np.repeat(matrices[:, None], 8, axis=1))
    ):
        whole[np.ix_(dofs, dofs)] += matrix
    return whole


def mismatch_equations(motions, energies, basis):
    """Normal equations of `2 |D|_F^2 + tr(D)^2`, D = sum_q E_q u^T K_q u - V, term by term."""
    points = [np.where(np.arange(8)[:, None, None] == q, basis, 0.0)[None] for q in range(8)]
    forms = [motions.T @ element_stiffness(2.0, each)[0] @ motions for each in points]
    forms.append(energies)
    gram = np.array([[2 * (a * b).sum() + np.trace(a) * np.trace(b) for a in forms] for b in forms])
    return NormalEquations(gram[:8, :8], gram[8, :8], gram[8, 8])


def free_equations(cells, basis, mask):
    filled = np.flatnonzero(mask >> np.arange(8) & 1)
    dofs, pattern = pattern_of(mask, 0.25).dofs, pattern_of(mask, 0.25)
    stiffness = assembled(CELL_NODES[filled], 27, cells[filled])[np.ix_(dofs, dofs)]
    loads = inertial.inertia_loads(mask, 0.25)
    displacements = np.linalg.pinv(stiffness, rcond=1e-10, hermitian=True) @ loads
    return mismatch_equations(pattern.to_corners @ displacements, loads.T @ displacements, basis)


def held_equations(cells, basis, mask):
    places = np.array([[x, y, z] for z in range(4) for y in range(4) for x in range(4)])
    octant = (places // 2) @ (1, 2, 4)
    kept = (mask >> octant & 1) > 0
    nodes = (places[kept][:, None] + CORNERS) @ (1, 5, 25)
    whole = assembled(nodes, 125, cells[octant[kept]])
    pattern = pattern_of(mask, 0.25)
    inner = degrees_of_freedom((NODES + 1) @ (1, 5, 25))[pattern.dofs]
    boundary = np.setdiff1d(np.arange(375), degrees_of_freedom((NODES + 1) @ (1, 5, 25)))
    fields = np.kron(shape_functions((PATCH_NODES - 1) / 2.0), np.eye(3)) @ straining_motions()
    inside = np.linalg.solve(
        whole[np.ix_(inner, inner)], -whole[np.ix_(inner, boundary)] @ fields[boundary]
    )
    filled = np.flatnonzero(mask >> np.arange(8) & 1)
    own = assembled(CELL_NODES[filled], 27, cells[filled])[np.ix_(pattern.dofs, pattern.dofs)]
    energies = inside.T @ own @ inside
    shift = RIGID_SHARE * np.trace(energies) * np.eye(len(energies))
    factor = np.linalg.inv(np.linalg.cholesky(energies + shift))
    motions = pattern.to_corners @ inside @ factor.T
    return mismatch_equations(motions, factor @ energies @ factor.T, basis)


@pytest.mark.parametrize("kind", ["free", "held"])
def test_normal_equations_are_those_of_dense_matrices(kind, monkeypatch):
    """Every class of void patterns, and solid blocks of spruce, whose shear is a hundredth."""
    caught = []

    def keep(equations, size, reference):
        caught.append(equations)
        return None

    monkeypatch.setattr(general_cells, "bounded_moduli", keep)
    answer = {"free": general_cells.fit_free, "held": general_cells.fit_held}[kind]
    dense = {"free": free_equations, "held": held_equations}[kind]
    masks = [int(members[0]) for members in pattern_classes()] + [ALL_FILLED]
    for number, mask in enumerate(masks):
        filled = mask >> np.arange(8) & 1 > 0
        cells = random_elasticity((8,), number)
        if number == len(masks) - 1:
            cells = np.stack([rotated(spruce(), turn((1, 2, 3), 20 * j)) for j in range(8)]) / 1e10
        basis = cells / stiffness_size(cells)[:, None, None]
        cells = np.where(filled[:, None, None], cells, 0.0)
        answer(general_cells.GeneralBlocks(cells[None], basis[None]), mask)
        # A single cell has one rigid field, whose energy is rounding before it is whitened.
        accuracy = 1e-7 if kind == "held" and mask.bit_count() == 1 else 1e-10
        for left, right in zip(caught.pop(), dense(cells, basis, mask)):
            np.testing.assert_allclose(left[0], right, rtol=0, atol=accuracy * np.abs(right).max())


def test_numbers_of_a_matrix_rebuild_the_stiffness_of_a_cell():
    elasticity = random_elasticity(())
    rebuilt = np.tensordot(elasticity[np.tril_indices(6)], unit_cells(), axes=1)
    expected = element_stiffness(1.0, np.repeat(elasticity[None, None], 8, axis=1))[0]
    np.testing.assert_allclose(rebuilt, expected, atol=1e-13)


def test_turned_matrices_are_rotated_ones_of_the_same_size():
    elasticity = random_elasticity((48,))
    found = turned(elasticity, np.arange(48))
    for number, (_, matrix) in enumerate(all_symmetries()):
        np.testing.assert_allclose(found[number], rotated(elasticity[number], matrix), atol=1e-14)
    oblique = rotated(elasticity[0], turn((1, 2, 3), 40))
    assert stiffness_size(oblique) == pytest.approx(stiffness_size(elasticity[0]), rel=1e-13)


@pytest.mark.parametrize(
    ("elasticity", "filled", "message"),
    [
        (np.ones((1, 8, 6, 6)), np.ones((1, 8)), "positive definite"),
        (-np.tile(np.eye(6), (1, 8, 1, 1)), np.ones((1, 8)), "positive definite"),
        (np.tile(np.eye(6), (1, 8, 1, 1)), np.zeros((1, 8)), "void in all eight"),
        (np.full((1, 8, 6, 6), np.nan), np.ones((1, 8)), "finite"),
        (np.ones((1, 8)), np.ones((1, 8)), "expected (1, 8, 6, 6)"),
        (np.ones((1, 7, 6, 6)), np.ones((1, 7)), "expected (n, 8)"),
    ],
)
def test_bad_blocks_are_refused_in_a_sentence(elasticity, filled, message):
    with pytest.raises(UserError) as error:
        fit_blocks(elasticity, filled)
    assert message in str(error.value)


def test_objectives_without_general_cells_are_refused():
    with pytest.raises(UserError, match="hybrid, calibrated"):
        fit_blocks(np.tile(np.eye(6), (1, 8, 1, 1)), np.ones((1, 8)), "energy")


LAWS = np.stack([spruce() / 1e10, elasticity_matrix(0.3), random_elasticity(())])


@EVERY
def test_solids_of_one_isotropic_law_coarsen_as_the_fit_does(objective):
    young = samples(seed=1, start=0, stop=50)
    law = np.zeros(young.shape, dtype=int)
    found = AnisotropicCoarsening(objective)
    expected = make_coarsening("fit", 0.25, objective=objective)
    moduli = found.moduli(young, law, elasticity_matrix(0.25)[None])
    np.testing.assert_allclose(moduli, expected.moduli(young), rtol=TOLERANCE)
    assert found.lumped_fraction == expected.lumped_fraction


@EVERY
def test_blocks_of_several_laws_are_fitted_as_if_alone(objective):
    """Equal ones once, and those that differ by a factor."""
    generator = np.random.default_rng(0)
    young = 1e9 * samples(seed=2, start=0, stop=30)
    law = generator.integers(3, size=young.shape)
    coarsening = AnisotropicCoarsening(objective)
    moduli = coarsening.moduli(young, law, LAWS)
    order = generator.permutation(90)
    many = coarsening.moduli(
        np.concatenate([young, 2.0 * young, young])[order],
        np.concatenate([law, law, law])[order],
        LAWS,
    )
    np.testing.assert_array_equal(many, np.concatenate([moduli, 2.0 * moduli, moduli])[order])
    octants = octant_laws(young, law)
    mean = filled_mean(young, young > 0)[:, None]
    own = np.where(young > 0, young, mean)
    fits = fit_blocks(own[..., None, None] * LAWS[octants], young > 0, objective)
    np.testing.assert_allclose(moduli, fits.scales * own, rtol=TOLERANCE)


def test_void_octants_have_the_law_of_most_filled_cells():
    young = np.array(
        [[1.0, 0, 1, 1, 0, 0, 0, 0], [1, 1, 0, 1, 1, 0, 0, 0], [0, 0, 0, 0, 0, 0, 0, 5]]
    )
    law = np.array([[2, 0, 1, 1, 0, 0, 2, 2], [2, 1, 9, 2, 1, 9, 9, 9], [1, 1, 1, 1, 1, 1, 1, 0]])
    expected = [[2, 1, 1, 1, 1, 1, 1, 1], [2, 1, 1, 2, 1, 1, 1, 1], [0, 0, 0, 0, 0, 0, 0, 0]]
    np.testing.assert_array_equal(octant_laws(young, law), expected)


def test_a_coarse_spruce_bar_has_half_the_error_of_the_average_at_most():
    for solid in (one_law(bar(20, 9, 7), spruce()), one_law(bar(20, 8, 6), oblique())):
        rms = errors(solid)
        assert rms["calibrated"] < 0.5 * min(rms["average"], rms["galerkin"])


def oblique():
    return rotated(spruce(), turn((0, 0, 1), 20))


def test_a_coarse_solid_of_two_woods_is_better_than_its_average():
    mesh = bar(20, 8, 6)
    rms = errors(two_laws(mesh, oblique(), places(mesh, 0) > 11))
    assert rms["calibrated"] < 0.5 * min(rms["average"], rms["galerkin"])
