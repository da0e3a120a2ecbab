"""Named materials: every one is physical, says where its numbers are from, and is found by name."""

import math
from functools import partial

import numpy as np
import pytest

from carillon.composition.materials import MATERIALS, named_material
from carillon.errors import UserError
from carillon.limits import require_constants
from solver.response.response import Damping

LOCKING = 0.45
"""Poisson's ratio above which trilinear elements are too stiff to be of use."""
SPEEDS = (1.0, 7000.0)
"""Bounds [m/s] of longitudinal waves in bars: no solid at hand is outside."""
EXPECTED = {"steel", "iron", "aluminium", "brass", "tin", "glass", "ceramic", "wood", "plywood"} | {
    "plastic",
    "polycarbonate",
    "pla",
    "rubber",
    "concrete",
    "stone",
}
LOSS_FACTORS = {
    "aluminium": 1e-3,
    "brass": 1e-3,
    "softwood": 9e-3,
    "plywood": 1.6e-2,
    "rubber": 0.1,
    "concrete": 6e-3,
    "stone": 1.0 / 150.0,
}
"""Of those whose damping follows from one, at 1 kHz."""

every = pytest.mark.parametrize(
    "material", [named_material(name) for name in MATERIALS], ids=MATERIALS
)


@every
def test_numbers_are_finite_and_within_physical_bounds(material):
    require_constants(material.poisson, material.density)
    assert 0.0 < material.poisson <= LOCKING
    assert SPEEDS[0] < math.sqrt(material.young / material.density) < SPEEDS[1]
    assert 0.0 < material.alpha < math.inf
    assert 0.0 < material.beta < 1.0
    assert 0.0 < material.restitution < 1.0
    assert 0.0 < material.friction < 2.0
    assert 0.0 < material.roughness < 1e-3
    assert len(material.colour) == 3
    assert all(0.0 <= part <= 1.0 for part in material.colour)


@every
def test_every_number_has_a_source(material):
    heads = [sentence.split(":")[0] for sentence in material.source.split(". ") if ":" in sentence]
    named = {name for head in heads for name in head.split(", ")}
    expected = {"young", "poisson", "density", "alpha", "beta"}
    expected |= {"grain"} if material.is_wood else set()
    assert named == expected | {"restitution", "friction", "roughness"}
    assert material.about


def test_the_ordinary_materials_are_there():
    assert set(MATERIALS) >= EXPECTED


def loss_factor(material, hertz):
    """Loss factor of its Rayleigh damping."""
    turns = 2.0 * math.pi * hertz
    return material.alpha / turns + material.beta * turns


@pytest.mark.parametrize("name", LOSS_FACTORS)
def test_damping_fits_the_loss_factor_and_is_least_at_1_khz(name):
    loss = partial(loss_factor, named_material(name))
    assert loss(1000.0) == pytest.approx(LOSS_FACTORS[name], rel=5e-3)
    # Both terms are equal there but for rounding to three digits: the minimum is flat.
    assert min(loss(500.0), loss(2000.0)) == pytest.approx(1.25 * loss(1000.0), rel=5e-3)


def test_damping_is_what_the_solver_takes():
    steel = named_material("steel")
    damping = Damping(steel.alpha, steel.beta)
    (rate,) = damping.decay_per_second(np.array([(2000.0 * math.pi) ** 2]))
    assert rate == pytest.approx(math.pi * 1000.0 * loss_factor(steel, 1000.0))


def test_an_unknown_name_is_refused_with_the_known_ones_and_the_closest():
    with pytest.raises(UserError) as refusal:
        named_material("aluminum")
    said = str(refusal.value)
    assert said.startswith("there is no material 'aluminum', only steel, iron, aluminium, ")
    assert said.endswith("; did you mean aluminium?")


@pytest.mark.parametrize("name", ["xyzzy", "unobtainium"])
def test_a_name_like_no_other_gets_no_guess(name):
    with pytest.raises(UserError, match=f"there is no material '{name}', only [a-z, ]+$"):
        named_material(name)
