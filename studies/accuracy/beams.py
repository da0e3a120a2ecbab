"""Frequencies of rods and beams of one or two materials, from the equations of their theories."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from carillon.arrays import Array

PAIRS = tuple(combinations(range(4), 2))
"""Pairs of rows of a beam's state, by whose minors it is followed, see `_followed`."""
STEPS = 48
"""Places in a wave's half length at which an equation is tried for a change of sign."""


@dataclass(frozen=True)
class RodPart:
    """A length [m] of a rod, its modulus [Pa] and density [kg/m^3]."""

    length: float
    young: float
    density: float

    @property
    def impedance(self) -> float:
        """Of its waves, for a section of 1 m^2 [kg/s]."""
        return float(np.sqrt(self.young * self.density))

    @property
    def delay(self) -> float:
        """Seconds in which a wave passes."""
        return self.length * float(np.sqrt(self.density / self.young))


def rod_frequencies(first: RodPart, second: RodPart, count: int, clamped: bool = False) -> Array:
    """Longitudinal frequencies [Hz] of a rod of two parts of one section, elastic ones alone.

    Free at both ends, ``Z1 tan(w t1) + Z2 tan(w t2) = 0``; with the first part's end `clamped`,
    ``Z1 = Z2 tan(w t1) tan(w t2)``; Z are impedances and t delays.

    Examples
    --------
    >>> half = RodPart(0.5, 1e9, 1000.0)
    >>> rod_frequencies(half, half, 3).round(6).tolist()
    [500.0, 1000.0, 1500.0]
    >>> rod_frequencies(half, half, 2, clamped=True).round(6).tolist()
    [250.0, 750.0]
    """

    def free(w: float) -> float:
        a, b = w * first.delay, w * second.delay
        return first.impedance * np.sin(a) * np.cos(b) + second.impedance * np.cos(a) * np.sin(b)

    def held(w: float) -> float:
        a, b = w * first.delay, w * second.delay
        return first.impedance * np.cos(a) * np.cos(b) - second.impedance * np.sin(a) * np.sin(b)

    step = np.pi / (first.delay + second.delay) / STEPS
    return _roots(held if clamped else free, step, count) / (2.0 * np.pi)


@dataclass(frozen=True)
class BeamPart:
    """A length of a beam."""

    length: float
    """[m]."""
    bending: float
    """EI [N m^2]."""
    mass: float
    """Of a length of 1 m [kg/m]."""
    shear: float = np.inf
    """kappa G A [N]; infinite by Euler and Bernoulli, finite by Timoshenko."""
    rotary: float = 0.0
    """rho I [kg m]; zero by Euler and Bernoulli."""

    def rates(self, w: float) -> Array:
        """Derivative (4, 4) along the beam of deflection, rotation, moment and shear force."""
        return np.array(
            [
                [0.0, 1.0, 0.0, 1.0 / self.shear],
                [0.0, 0.0, 1.0 / self.bending, 0.0],
                [0.0, -self.rotary * w**2, 0.0, -1.0],
                [-self.mass * w**2, 0.0, 0.0, 0.0],
            ]
        )


@dataclass(frozen=True)
class Layer:
    """A layer across the thickness of a bar: thickness [m], modulus [Pa], density [kg/m^3]."""

    thickness: float
    young: float
    density: float


def layered(layers: Sequence[Layer], width: float, length: float) -> BeamPart:
    """A bar of layers that keep together, by Euler and Bernoulli; it bends about its own middle.

    That is where the first moment of E vanishes, so that bending takes no axial force.

    Examples
    --------
    >>> whole, half = Layer(0.02, 2.0, 1.0), Layer(0.01, 2.0, 1.0)
    >>> one, two = (layered(each, 0.1, 1.0).bending for each in ([whole], [half, half]))
    >>> bool(np.isclose(one, two))
    True
    """
    thickness, young, density = (
        np.array([getattr(layer, name) for layer in layers])
        for name in ("thickness", "young", "density")
    )
    middle = np.cumsum(thickness) - 0.5 * thickness
    from_axis = middle - (young * thickness) @ middle / (young @ thickness)
    second = thickness**3 / 12.0 + thickness * from_axis**2
    return BeamPart(length, width * float(young @ second), width * float(density @ thickness))


def bending_frequencies(parts: Sequence[BeamPart], count: int, clamped: bool = False) -> Array:
    """Bending frequencies [Hz] of a beam of parts one after the other, elastic ones alone.

    Both ends are free, or the first part's is `clamped`. Deflection, rotation, moment and shear
    force go on from part to part (transfer matrices).

    Examples
    --------
    >>> beam = BeamPart(1.0, 1.0, 1.0)
    >>> np.sqrt(2.0 * np.pi * bending_frequencies([beam], 3)).round(4).tolist()
    [4.73, 7.8532, 10.9956]
    >>> np.sqrt(2.0 * np.pi * bending_frequencies([beam], 3, clamped=True)).round(4).tolist()
    [1.8751, 4.6941, 7.8548]
    """
    start, end = PAIRS.index((2, 3) if clamped else (0, 1)), PAIRS.index((2, 3))
    slowest = sum(part.length * (part.mass / part.bending) ** 0.25 for part in parts)

    def determinant(root: float) -> float:
        state = np.eye(len(PAIRS))[start]
        for part in parts:
            state = _followed(part, root**2, state)
        return float(state[end])

    # Wave numbers go with the root of the frequency.
    step = np.pi / slowest / STEPS
    return _roots(determinant, step, count) ** 2 / (2.0 * np.pi)


def _followed(part: BeamPart, w: float, minors: Array) -> Array:
    """Minors (6,) of two states at the end of a part, from those at its beginning.

    Two states that grow alike lose what tells them apart, their minors do not (compound matrix
    method; Ng and Reid 1979). They change by the second additive compound of the rates.
    """
    # Units in which all four are alike, so that rounding is of the whole.
    scale = np.array([1.0, 1.0 / part.length, part.bending / part.length**2, 0.0])
    scale[3] = scale[2] / part.length
    rates = part.rates(w) * scale / scale[:, None] * part.length
    weights = np.array([scale[i] * scale[j] for i, j in PAIRS])
    return np.asarray(weights * (expm(_additive_compound(rates)) @ (minors / weights)))


def _additive_compound(rates: Array) -> Array:
    """Derivative (6, 6) of the minors of two states that change by these rates (4, 4)."""
    unit = np.eye(4)
    return np.array(
        [
            [
                rates[i, k] * unit[j, m]
                + unit[i, k] * rates[j, m]
                - rates[i, m] * unit[j, k]
                - unit[i, m] * rates[j, k]
                for k, m in PAIRS
            ]
            for i, j in PAIRS
        ]
    )


def timoshenko_cantilever(part: BeamPart, count: int) -> Array:
    """Frequencies [Hz] of a clamped and free beam by the frequency equation of Timoshenko's theory.

    With the wave numbers of Han, Benaroya and Wei 1999, a and b, of which the first is imaginary
    below the cut-off; complex arithmetic holds on both sides of it.

    Examples
    --------
    >>> beam = BeamPart(1.0, 1.0, 1.0, shear=1e3, rotary=1e-3)
    >>> np.allclose(timoshenko_cantilever(beam, 3), bending_frequencies([beam], 3, clamped=True))
    True
    """

    def equation(root: float) -> float:
        w = root**2
        slope = w**2 * (part.rotary / part.bending + part.mass / part.shear)
        product = part.mass * w**2 / part.bending * (part.rotary * w**2 / part.shear - 1.0)
        spread = np.sqrt(slope**2 / 4.0 - product)
        # Deflections are as exp(s x), s^4 + slope s^2 + product = 0.
        s = np.sqrt(np.array([spread - slope / 2.0, -spread - slope / 2.0], dtype=complex))
        # Rotation over deflection's derivative: 1 + m w^2 / (shear s^2).
        ratio = s + part.mass * w**2 / (part.shear * s)
        (p, q), (f, g) = s * part.length, ratio
        # Deflection cosh - cosh, and sinh / f - sinh / g, start with neither it nor a rotation.
        moments = (
            f * s[0] * np.cosh(p) - g * s[1] * np.cosh(q),
            s[0] * np.sinh(p) - s[1] * np.sinh(q),
        )
        shears = (
            (s[0] - f) * np.sinh(p) - (s[1] - g) * np.sinh(q),
            (s[0] / f - 1.0) * np.cosh(p) - (s[1] / g - 1.0) * np.cosh(q),
        )
        # Real on both sides of the cut-off: where one factor is imaginary, so is the other.
        return float((moments[0] * shears[1] - moments[1] * shears[0]).real)

    step = np.pi / part.length / (part.mass / part.bending) ** 0.25 / STEPS
    return _roots(equation, step, count) ** 2 / (2.0 * np.pi)


def _roots(function: Callable[[float], float], step: float, count: int) -> Array:
    """The lowest positive zeros of a function that changes its sign at each, more than steps apart.

    Zero, where rigid motions have theirs, is no one of them.
    """
    found: list[float] = []
    place, value = 0.5 * step, function(0.5 * step)
    while len(found) < count:
        following = place + step
        after = function(following)
        if value * after < 0.0:
            found.append(float(brentq(function, place, following, xtol=1e-14 * following)))
        place, value = following, after
    return np.array(found)
