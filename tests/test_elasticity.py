"""Elasticity matrices: what they are equal to, and what no material has."""

import numpy as np
import pytest

from carillon.composition.materials import MATERIALS, named_material
from carillon.errors import UserError
from carillon.fem.elasticity import (
    Elasticity,
    axes_along,
    elasticity_matrix,
    orthotropic_matrix,
    require_elasticity,
    rotated,
    young_moduli,
)
from carillon.fem.element import CORNERS, quadrature_stiffness, rigid_motions

SPRUCE = named_material("spruce").region("spruce")
ORTHOTROPIC = SPRUCE.elasticity[0]


def turn(seed):
    """A random rotation."""
    matrix = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    return matrix * np.sign(np.linalg.det(matrix))


def test_an_isotropic_one_is_orthotropic():
    young, poisson = 3.0, 0.3
    shear = young / (2.0 * (1.0 + poisson))
    matrix = orthotropic_matrix(np.full(3, young), np.full(3, shear), np.full(3, poisson))
    assert np.allclose(matrix, young * elasticity_matrix(poisson), rtol=1e-13)
    ratio, equivalent = Elasticity.of_matrix(matrix, young).isotropic_equivalent()
    assert ratio == pytest.approx(1.0, abs=1e-12)
    assert equivalent == pytest.approx(poisson, abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_turning_keeps_energy_and_turns_back(seed):
    axes = turn(seed)
    turned = rotated(ORTHOTROPIC, axes)
    assert np.allclose(np.linalg.norm(turned[:3, :3]), np.linalg.norm(turned[:3, :3].T))
    assert np.allclose(rotated(turned, axes.T), ORTHOTROPIC, atol=1e-12)
    assert np.linalg.eigvalsh(turned).min() > 0.0
    # The same element, turned: strain energies of turned motions are the same.
    strain = np.random.default_rng(seed).standard_normal((3, 3))
    strain = strain + strain.T

    def vector(tensor):
        pairs = ((0, 1), (1, 2), (2, 0))
        return np.array([*np.diag(tensor), *(2.0 * tensor[pair] for pair in pairs)])

    own, other = vector(strain), vector(axes @ strain @ axes.T)
    assert other @ turned @ other == pytest.approx(own @ ORTHOTROPIC @ own, rel=1e-12)


def test_means_of_all_directions_do_not_depend_on_the_axes():
    law = Elasticity.of_matrix(ORTHOTROPIC, 1.0)
    expected = law.isotropic_equivalent()
    assert law.rotated(turn(1)).isotropic_equivalent() == pytest.approx(expected, rel=1e-10)


def test_elements_of_any_elasticity_are_free():
    law = Elasticity.of_matrix(ORTHOTROPIC, 1.0).rotated(turn(2))
    rigid = rigid_motions(CORNERS.astype(float))
    assert np.abs(quadrature_stiffness(law) @ rigid).max() < 1e-12


def test_spruce_is_stiff_along_its_grain():
    across = axes_along(np.array([0.0, 0.0, 1.0]))
    moduli = young_moduli(SPRUCE.young[0] * rotated(ORTHOTROPIC, across))
    assert moduli[2] == pytest.approx(SPRUCE.young[0])
    assert 10.0 < moduli[2] / moduli[:2].max() < 30.0


@pytest.mark.parametrize("name", [name for name in MATERIALS if named_material(name).is_wood])
def test_woods_are_symmetric_and_stable(name):
    material = named_material(name)
    assert material.grain_young[0] == material.young
    assert (np.diff(material.grain_young) < 0.0).all()
    assert (np.linalg.eigvalsh(material.region(name).elasticity[0]) > 0.0).all()


@pytest.mark.parametrize(
    ("young", "shear", "poisson", "said"),
    [
        ([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.3, 1.2, 0.3], "nu_yz is 1.2; with E_y = 1 Pa"),
        ([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.6, 0.6, 0.6], "together are those of no material"),
        ([1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [0.3, 0.3, 0.3], "E_y is -1 Pa"),
        ([1.0, 1.0, 1.0], [1.0, 0.0, 1.0], [0.3, 0.3, 0.3], "G_yz is 0 Pa"),
    ],
)
def test_constants_of_no_material(young, shear, poisson, said):
    with pytest.raises(UserError, match=said):
        orthotropic_matrix(*map(np.array, (young, shear, poisson)))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda c: c[:5], "expected \\(6, 6\\)"),
        (lambda c: c + np.triu(np.ones((6, 6)), 1), "not symmetric: row 1, column"),
        (lambda c: c - 3.0 * np.eye(6), "not positive definite"),
        (lambda c: c * np.nan, "not finite"),
        (lambda _: "steel", "expected 6 rows"),
    ],
)
def test_matrices_of_no_material(change, said):
    with pytest.raises(UserError, match=said):
        require_elasticity(change(elasticity_matrix(0.3)))


def test_a_radius_along_the_grain_is_refused():
    with pytest.raises(UserError, match="is along the grain"):
        axes_along(np.array([1.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]))
