"""Boxes of any elasticity agree with isotropic ones, and with beams along their axes."""

import numpy as np
import pytest

from carillon.fem.elasticity import elasticity_matrix
from studies.accuracy import domains
from studies.accuracy.anisotropic_box import (
    BoxLayer,
    PointMass,
    box_eigenvalues,
    box_frequencies,
    layered_eigenvalues,
)
from studies.accuracy.beams import (
    BeamPart,
    Layer,
    RodPart,
    bending_frequencies,
    layered,
    rod_frequencies,
    timoshenko_cantilever,
)
from studies.accuracy.ritz import free_eigenvalues

SIDES, DEGREES, DENSITY = (0.03, 0.04, 0.05), (7, 7, 7), 2000.0


def cubic(c11: float, c12: float, c44: float) -> np.ndarray:
    """Elasticity (6, 6) of a cubic crystal along the axes."""
    matrix = np.diag([c11] * 3 + [c44] * 3)
    matrix[:3, :3] += c12 * (1.0 - np.eye(3))
    return matrix


def triclinic(seed: int) -> np.ndarray:
    """Some elasticity (6, 6) without any symmetry."""
    values = np.random.default_rng(seed).standard_normal((6, 6))
    return cubic(3e9, 1e9, 1e9) + 1e8 * values @ values.T


def hertz(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.maximum(values[6:], 0.0)) / (2.0 * np.pi)


def test_an_isotropic_box_is_that_of_the_other_way():
    values = box_eigenvalues(SIDES, DEGREES, 1e9 * elasticity_matrix(0.3), DENSITY)
    others = free_eigenvalues(domains.box(SIDES, DEGREES), DEGREES, 1e9, 0.3, DENSITY)
    assert np.allclose(values[6:], others[6:], rtol=1e-8)
    assert np.abs(values[:6]).max() < 1e-8 * values[6]


def test_a_crystal_turned_with_its_box_sounds_the_same():
    """x to y, y to z, z to x, of an elasticity without any symmetry."""
    elasticity = triclinic(0)
    turn = np.array([1, 2, 0, 4, 5, 3])
    turned = np.empty_like(elasticity)
    turned[np.ix_(turn, turn)] = elasticity
    found = box_frequencies(SIDES, DEGREES, elasticity, DENSITY, 30)
    x, y, z = SIDES
    assert np.allclose(found, box_frequencies((z, x, y), DEGREES, turned, DENSITY, 30), rtol=1e-9)
    assert not np.allclose(found, box_frequencies(SIDES, DEGREES, turned, DENSITY, 30), rtol=1e-2)


def test_stiffer_is_higher_and_more_polynomials_are_lower():
    elasticity = triclinic(1)
    found = box_frequencies(SIDES, DEGREES, elasticity, DENSITY, 20)
    assert np.allclose(box_frequencies(SIDES, DEGREES, 4.0 * elasticity, DENSITY, 20), 2.0 * found)
    more = elasticity + 1e7 * np.eye(6)
    assert (box_frequencies(SIDES, DEGREES, more, DENSITY, 20) > found).all()
    assert (box_frequencies(SIDES, (9, 9, 9), elasticity, DENSITY, 20) <= found * 1.000001).all()


@pytest.mark.parametrize("seed", [2, 3])
def test_a_slender_crystal_bends_by_its_modulus_along_the_axis(seed):
    elasticity = triclinic(seed)
    young = 1.0 / np.linalg.inv(elasticity)[2, 2]
    side, length = 0.01, 1.0
    found = box_frequencies((side, side, length), (4, 4, 12), elasticity, DENSITY, 4)
    beam = BeamPart(length, young * side**4 / 12.0, DENSITY * side**2)
    exact = np.repeat(bending_frequencies([beam], 2), 2)
    assert np.allclose(found, exact, rtol=5e-3)


@pytest.mark.parametrize(("poisson", "excess"), [(0.0, 5e-4), (0.3, 1e-2)])
def test_a_clamped_box_is_a_cantilever(poisson, excess):
    """With Poisson's contraction, which the held face lacks, it is a little stiffer."""
    side, length, young = 0.015, 0.4, 1e9
    elasticity = young * elasticity_matrix(poisson)
    values = box_eigenvalues((side, side, length), (4, 4, 16), elasticity, DENSITY, clamped=True)
    area, moment = side**2, side**4 / 12.0
    factor = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson)
    shear = factor * area * elasticity[3, 3]
    beam = BeamPart(length, young * moment, DENSITY * area, shear, DENSITY * moment)
    ratios = np.sqrt(values[:4]) / (2.0 * np.pi) / np.repeat(timoshenko_cantilever(beam, 2), 2)
    assert (ratios > 1.0 - 1e-4).all() and (ratios < 1.0 + excess).all()


def test_masses_at_the_end_are_those_of_a_beam():
    side, length, ratio = 0.01, 0.5, 0.5
    own = DENSITY * side**2 * length
    corners = [(x, y, length / 2.0) for x in (-0.004, 0.004) for y in (-0.004, 0.004)]
    masses = [PointMass(ratio * own / 4.0, corner) for corner in corners]
    elasticity = 1e9 * elasticity_matrix(0.0)
    sides, degrees = (side, side, length), (3, 3, 12)
    values = box_eigenvalues(sides, degrees, elasticity, DENSITY, clamped=True, masses=masses)
    beam = BeamPart(length, 1e9 * side**4 / 12.0, DENSITY * side**2)
    end = BeamPart(1e-6, 1e12, ratio * own / 1e-6)
    exact = bending_frequencies([beam, end], 1, clamped=True)
    assert np.allclose(np.sqrt(values[:2]) / (2.0 * np.pi), exact, rtol=2e-3)


def test_a_rigid_motion_of_a_free_box_takes_its_masses_along():
    masses = [PointMass(0.1, (0.01, 0.02, -0.01)), PointMass(0.05, (0.0, 0.0, 0.025))]
    values = box_eigenvalues(SIDES, DEGREES, triclinic(4), DENSITY, masses=masses)
    free = box_eigenvalues(SIDES, DEGREES, triclinic(4), DENSITY)
    assert np.abs(values[:6]).max() < 1e-8 * values[6]
    assert (hertz(values) <= hertz(free) * (1.0 + 1e-9)).all()


@pytest.mark.parametrize("clamped", [False, True])
def test_a_cut_between_layers_that_are_alike_changes_nothing(clamped):
    x, y, z = SIDES
    elasticity = triclinic(5)
    layers = [BoxLayer(share * z, elasticity, DENSITY) for share in (0.3, 0.7)]
    whole = box_eigenvalues(SIDES, (9, 9, 9), elasticity, DENSITY, clamped)
    cut = layered_eigenvalues((x, y), (9, 9, 9), layers, clamped)
    first = slice(0 if clamped else 6, 16)
    assert np.allclose(cut[first], whole[first], rtol=2e-3)
    assert (cut[first] <= whole[first] * (1.0 + 1e-9)).all()


@pytest.mark.parametrize("clamped", [False, True])
def test_two_materials_along_a_rod_are_those_of_its_equation(clamped):
    """Without Poisson's contraction sections move as one, and the rod's equation is exact."""
    constants = [(0.4, 1e9, 1000.0), (0.6, 5e9, 3000.0)]
    layers = [BoxLayer(z, young * elasticity_matrix(0.0), rho) for z, young, rho in constants]
    values = layered_eigenvalues((0.02, 0.03), (3, 3, 10), layers, clamped)
    found = np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi)
    exact = rod_frequencies(*(RodPart(*each) for each in constants), 3, clamped)
    assert all(np.abs(found / hertz - 1.0).min() < 1e-6 for hertz in exact)


@pytest.mark.parametrize("clamped", [False, True])
def test_two_materials_along_a_bar_bend_as_a_beam_of_two_parts(clamped):
    side = 0.01
    constants = [(0.4, 1e9, 1000.0), (0.6, 5e9, 3000.0)]
    layers = [BoxLayer(z, young * elasticity_matrix(0.0), rho) for z, young, rho in constants]
    values = layered_eigenvalues((side, side), (3, 3, 12), layers, clamped)
    parts = [
        BeamPart(z, young * side**4 / 12.0, rho * side**2, 5.0 / 12.0 * young * side**2)
        for z, young, rho in constants
    ]
    exact = np.repeat(bending_frequencies(parts, 2, clamped), 2)
    first = 0 if clamped else 6
    found = np.sqrt(values[first : first + 4]) / (2.0 * np.pi)
    assert np.allclose(found, exact, rtol=2e-3)


def test_two_layers_across_a_bar_bend_as_a_bimetal_strip():
    """A little lower, as Euler's and Bernoulli's beams do not shear."""
    length, width = 1.0, 0.02
    strip = [Layer(0.006, 2e9, 3000.0), Layer(0.010, 7e8, 900.0)]
    layers = [
        BoxLayer(layer.thickness, layer.young * elasticity_matrix(0.0), layer.density)
        for layer in strip
    ]
    values = layered_eigenvalues((length, width), (14, 4, 3), layers)
    found = np.sqrt(values[6:20]) / (2.0 * np.pi)
    for hertz in bending_frequencies([layered(strip, width, length)], 2):
        lower = 1.0 - found[np.abs(found / hertz - 1.0).argmin()] / hertz
        assert 0.0 < lower < 3e-3
