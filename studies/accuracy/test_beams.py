"""Equations of rods and beams have the limits that other theories know."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from studies.accuracy.beams import (
    BeamPart,
    Layer,
    RodPart,
    bending_frequencies,
    layered,
    rod_frequencies,
    timoshenko_cantilever,
)
from tests import solids, theories

SOFT, STIFF = RodPart(0.4, 1e9, 1000.0), RodPart(0.6, 4e9, 1500.0)
SLENDER, THICK = BeamPart(0.4, 1.0, 1.0), BeamPart(0.6, 5.0, 2.0)


def beam(length: float, side: float, young: float, poisson: float, density: float) -> BeamPart:
    """Of a square section, with the shear factor of `tests.solids`."""
    area, moment = side**2, side**4 / 12.0
    factor = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson)
    shear = factor * area * young / (2.0 * (1.0 + poisson))
    return BeamPart(length, young * moment, density * area, shear, density * moment)


@pytest.mark.parametrize("clamped", [False, True])
def test_a_cut_changes_nothing_where_both_sides_are_alike(clamped):
    whole = BeamPart(1.0, 2.0, 3.0, shear=500.0, rotary=0.01)
    parts = [replace(whole, length=length) for length in (0.1, 0.7, 0.2)]
    one, three = (bending_frequencies(each, 8, clamped) for each in ([whole], parts))
    assert np.allclose(one, three, rtol=1e-9)


def test_a_free_one_sounds_the_same_from_both_ends():
    assert np.allclose(rod_frequencies(SOFT, STIFF, 5), rod_frequencies(STIFF, SOFT, 5))
    both = [bending_frequencies(each, 6) for each in ([SLENDER, THICK], [THICK, SLENDER])]
    assert np.allclose(*both, rtol=1e-9)


def test_a_short_heavy_part_is_a_mass_at_the_end_of_a_rod():
    ratio = 0.7
    end = RodPart(1e-6, 1e18, ratio * SOFT.density * SOFT.length / 1e-6)
    found = rod_frequencies(SOFT, end, 2, clamped=True) * 2.0 * np.pi * SOFT.delay
    exact = [
        brentq(lambda x: np.cos(x) - ratio * x * np.sin(x), low, low + 1.5)
        for low in (0.1, np.pi + 0.01)
    ]
    assert np.allclose(found, exact, rtol=1e-5)


def test_a_short_heavy_part_is_a_mass_at_the_end_of_a_beam():
    ratio = 0.5
    whole = BeamPart(1.0, 1.0, 1.0)
    end = BeamPart(1e-5, 1e9, ratio / 1e-5)
    found = np.sqrt(2.0 * np.pi * bending_frequencies([whole, end], 3, clamped=True))

    def equation(x: float) -> float:
        c, s, ch, sh = np.cos(x), np.sin(x), np.cosh(x), np.sinh(x)
        return 1.0 + c * ch + ratio * x * (c * sh - s * ch)

    exact = [brentq(equation, low, low + 1.2) for low in (1.0, 3.7, 6.9)]
    assert np.allclose(found, exact, rtol=1e-4)


def test_high_frequencies_do_not_drown_in_growing_waves():
    """cosh of the last is 10^43, and a determinant of its differences would be rounding alone."""
    found = np.sqrt(2.0 * np.pi * bending_frequencies([BeamPart(1.0, 1.0, 1.0)], 32))
    assert np.allclose(found[3:], (np.arange(4, 33) + 0.5) * np.pi, rtol=1e-6)


def test_beams_with_shear_agree_with_timoshenkos_theory_by_ritz():
    constants = (2e9, 0.3, 1200.0)
    found = bending_frequencies([beam(0.5, 0.05, *constants)], 4)
    exact = solids.timoshenko_free_frequencies(0.5, 0.05, *constants, 4)
    assert np.allclose(found, exact, rtol=1e-6)
    radius, poisson = 0.03, 0.25
    area, moment = np.pi * radius**2, np.pi * radius**4 / 4.0
    factor = 6.0 * (1.0 + poisson) / (7.0 + 6.0 * poisson)
    shear = factor * area * 1e9 / (2.0 * (1.0 + poisson))
    rod = BeamPart(0.5, 1e9 * moment, 1000.0 * area, shear, 1000.0 * moment)
    exact = theories.rod_frequencies(0.5, radius, 1e9, poisson, 1000.0)[:4]
    assert np.allclose(bending_frequencies([rod], 4), exact, rtol=1e-4)


@pytest.mark.parametrize("side", [0.02, 0.2])
def test_both_ways_to_timoshenkos_cantilever_agree(side):
    """The thick one has frequencies above the cut-off, where a second kind of wave travels."""
    part, count = beam(1.0, side, 1e9, 0.3, 1000.0), 6 if side < 0.1 else 12
    found = timoshenko_cantilever(part, count)
    cut_off = np.sqrt(part.shear / part.rotary) / (2.0 * np.pi)
    assert (found[-1] > cut_off) == (side == 0.2)
    assert np.allclose(found, bending_frequencies([part], count, clamped=True), rtol=1e-8)
    slender = bending_frequencies([replace(part, shear=np.inf, rotary=0.0)], count, clamped=True)
    assert (found < slender).all()
    assert (found[0] / slender[0] > 0.999) == (side == 0.02)


def test_two_layers_bend_as_timoshenkos_thermostat():
    """His formula of 1925 for the bending stiffness of bimetal strips."""
    (a, e), (b, f) = (0.002, 200e9), (0.003, 70e9)
    width = 0.02
    strip = layered([Layer(a, e, 7800.0), Layer(b, f, 2700.0)], width, 0.1)
    own = (e * a**3 + f * b**3) / 12.0
    joint = e * a * f * b * (a + b) ** 2 / (4.0 * (e * a + f * b))
    assert strip.bending == pytest.approx(width * (own + joint))
    assert strip.mass == pytest.approx(width * (7800.0 * a + 2700.0 * b))
