"""Sound radiated by the modes of a solid, with the scattering of a sphere.

A surface that moves at the normal velocity v radiates, to a direction d far away and at a distance
r, the pressure (Kirchhoff and Helmholtz, with reciprocity; factors of modulus 1 left out)

    r p(d) = omega rho / (4 pi)  integral of v (J + S) over the surface,

where J = exp(-i k d.x) is a plane wave and S the field on the surface that the solid at rest
scatters of it.  S is the solution of a boundary value problem; here that of a sphere with an equal
surface, of radius a, stands for it: every order l of spherical harmonics of J is scattered to

    S_l = z_l dJ_l/dn,  z_l = -h_l(ka) / (k h_l'(ka)),

with spherical Hankel functions h_l.  Orders above 2 take z_2, which makes them one integral over
the plane wave itself.  This is exact for spheres whose velocity has orders up to 2, and for the
volume that any solid displaces at low frequencies.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
from scipy.special import spherical_jn, spherical_yn

from carillon.arrays import Array, Complex, Integers
from sound.radiation.air import AIR_DENSITY, SOUND_SPEED
from sound.radiation.directivity import Directivity, even_directions, harmonics, order_of
from sound.radiation.outer_surface import outer_faces
from sound.shape import Shape

STEPS = 1 << 12
"""Number of steps of a full turn in the table of cosines."""
SHIFT = float(STEPS * 1024)
"""Whole turns, in steps, that are added to phases so that none is negative."""
COSINES = np.cos(2.0 * np.pi * np.arange(STEPS + 1) / STEPS)
DIRECTION_PAIRS = 96
"""Number of pairs of opposite directions over which the power of orders above 1 is averaged.

Below 16 kHz its level is then 0.2 dB (rms) off that of all directions for a marimba bar, 0.6 dB for
a box of 20 cm.
"""
AT_CENTRE = 1e-9
"""Least distance of a point from the centre of mass, over the radius; nearer points are moved."""
ROUNDING = 1e-9
"""Rounding error of order 0, over the monopole: a smaller value has no sign."""


@dataclass(frozen=True)
class Radiation:
    """Pressure that N modes radiate, far away.

    A mode whose coordinate moves at a velocity of the amplitude 1 kg^1/2 m/s, which is what u_k^T f
    = 1 kg^-1/2 N s does to it, is heard at the distance r [m] in the direction n (unit vector) with
    the pressure amplitude (monopole + dipole . n) / r.  So `monopoles` (N,) and `dipoles` (N, 3),
    in the axes of the solid [Pa m / (kg^-1/2 N s)], are factors of the amplitudes that
    `sound.rendering.solid.SoundingSolid.amplitudes` gives.
    """

    monopoles: Array
    dipoles: Array

    @property
    def directivity(self) -> Directivity:
        """The same, by harmonics up to order 1."""
        return Directivity.of_dipoles(self.monopoles, self.dipoles)


@dataclass(frozen=True)
class SurfacePoints:
    """Points (P, 3) [m] of a surface from the centre of mass, outward unit normals (P, 3), and the
    areas (P,) [m^2] that they stand for."""

    points: Array
    outward: Array
    areas: Array

    @property
    def radius(self) -> float:
        """Radius [m] of the sphere with as large a surface."""
        return float(np.sqrt(self.areas.sum() / (4.0 * np.pi)))


def radiated(solid_motion: Array, shape: Shape, frequencies: Array) -> Radiation:
    """Sound radiated by the modes of a solid, approximately; see this module.

    `solid_motion` (V, 3, N) [kg^-1/2] are the displacements of the vertices in each mass-normalised
    mode, of frequencies (N,) [Hz] above 0.  The triangles of the surface, which is given from the
    centre of mass, may face either way; it may be open.

    Notes
    -----
    Order 0 becomes the monopole, order 1 the dipole.  The power of all higher orders, which keep no
    direction, is added to that of the monopole, whose sign stays: the mean of
    (monopole + dipole . n)^2 over all directions is the power of the field.  The sum is no picture
    of a single direction: the true terms differ in phase, by a quarter of a period if the solid is
    small, so that they never cancel.

    On a sphere it is |r p| = rho c v_l / (k |h_l'(ka)|) for orders l up to 2 of its normal velocity
    (E. G. Williams, Fourier Acoustics, 1999, chapter 6).

    Averaged over directions, the level of the first eight elastic modes is 0.9 dB (rms) off that by
    the boundary element method for a steel bar, 1.4 dB for a stoneware plate, 5.6 dB for a brass
    bowl and 6.6 dB for a wine glass, which amplify some modes by resonance of the air in them: the
    worst is 12 dB too soft (`python -m tests.radiation_bem bar plate bowl wine-glass`).
    """
    surface, faces = _outer_triangles(shape)
    thirds = surface.areas / 3.0
    flows = np.einsum("fcin,fi,f->fn", solid_motion[faces], surface.outward, thirds, optimize=True)
    numbers = 2.0 * np.pi * frequencies / SOUND_SPEED
    values, slopes = _hankel(numbers * surface.radius)
    scatter = -values / (numbers * slopes)
    low = _low_orders(surface, flows, numbers)
    plain, turned = low.scattered(scatter[0], scatter[1])
    above = low.scattered(scatter[2], scatter[2])
    rest = _power_above(surface, flows, numbers, scatter[2], *above)
    dipole, beside = _main_axis(turned, 1.0 / slopes[1])
    monopole = np.sqrt(np.abs(plain) ** 2 + rest + (beside**2).sum(axis=1) / 3.0)
    # On a sphere order 0 has the phase of i / h_0', order 1 that of 1 / h_1'.
    inward = (plain * np.conj(1j / slopes[0])).real < -ROUNDING * monopole * np.abs(1.0 / slopes[0])
    pressure = AIR_DENSITY * SOUND_SPEED * numbers / (4.0 * np.pi)
    return Radiation(pressure * np.where(inward, -monopole, monopole), pressure[:, None] * dipole)


def surface_points(shape: Shape) -> SurfacePoints:
    """The middles of a surface's triangles, but for those without area or of a cavity."""
    return _outer_triangles(shape)[0]


def sphere_fields(surface: SurfacePoints, direction: Array, hertz: Array) -> Complex:
    """Fields (F, P) [Pa m / (m/s)], whose products with the outward velocity of the points are the
    pressure times distance in a direction (3,), at frequencies (F,) [Hz].

    As `radiated` has it, with the phases of all orders, as a single direction needs them.
    """
    numbers = 2.0 * np.pi * hertz[:, None] / SOUND_SPEED
    values, slopes = _hankel(numbers[:, 0] * surface.radius)
    scatter = (-values / (numbers[:, 0] * slopes))[:, :, None]
    away = np.linalg.norm(surface.points, axis=1).clip(AT_CENTRE * surface.radius)
    steep = (surface.points * surface.outward).sum(axis=1) / away
    way, facing = surface.points @ direction, surface.outward @ direction
    one, two = (spherical_jn(order, numbers * away) for order in (1, 2))
    # dJ/dn, of order 0 and of order 1
    plain = -numbers * one * steep
    turned = -3j * (one / away * facing - numbers * two * steep * way / away)
    field = np.exp(-1j * numbers * way) * (1.0 - 1j * numbers * scatter[2] * facing)
    field = field + (scatter[0] - scatter[2]) * plain + (scatter[1] - scatter[2]) * turned
    pressure = AIR_DENSITY * SOUND_SPEED * numbers / (4.0 * np.pi)
    return np.asarray(-1j * pressure * field * surface.areas)


def sphere_directivity(
    motion: Callable[[Array], Array], shape: Shape, frequencies: Array
) -> Directivity:
    """Directivity of modes as `radiated` has them, but with the phases of all orders.

    `motion` gives the displacements (p, 3, N) [kg^-1/2] of points (p, 3) [m] of the surface in
    modes of frequencies (N,) [Hz].  A single direction is then nearer to the truth, by far: `python
    -m tests.radiation_bem` compares both.
    """
    surface = surface_points(shape)
    flows = np.einsum("fin,fi,f->fn", motion(surface.points), surface.outward, surface.areas)
    numbers = 2.0 * np.pi * frequencies / SOUND_SPEED
    values, slopes = _hankel(numbers * surface.radius)
    scatter = -values / (numbers * slopes)
    low = _low_orders(surface, flows, numbers)
    order = order_of(float(numbers.max() * np.linalg.norm(shape.vertices, axis=1).max()))
    directions, shares = even_directions(2 * order)
    ways, facings = directions @ surface.points.T, directions @ surface.outward.T
    flows = np.ascontiguousarray(flows)
    cosine, sine, steep_cosine, steep_sine = _waves(ways, facings, numbers, flows)
    heard = cosine - 1j * sine - numbers * scatter[2] * (1j * steep_cosine + steep_sine)
    heard += (scatter[0] - scatter[2]) * low.plain_slope
    heard += (scatter[1] - scatter[2]) * (directions @ low.turned_slope.T)
    projected = (shares[:, None] * harmonics(order, directions)).T @ heard
    pressure = AIR_DENSITY * SOUND_SPEED * numbers / (4.0 * np.pi)
    # With exp(i omega t), and the velocity of a coordinate as the real part of its oscillator.
    return Directivity(-pressure[:, None] * np.conj(projected.T))


def _outer_triangles(shape: Shape) -> tuple[SurfacePoints, Integers]:
    """The middles of a surface's triangles, and their corners (P, 3), none without area or of a
    cavity."""
    outer = outer_faces(shape.vertices, shape.faces)
    corners = shape.vertices[outer]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(doubled, axis=1) / 2.0
    there = areas > 0.0
    faces, areas = outer[there], areas[there]
    normals = doubled[there] / (2.0 * areas[:, None])
    outward = -shape.inward[faces].sum(axis=1)
    normals = np.where(((normals * outward).sum(axis=1) < 0.0)[:, None], -normals, normals)
    return SurfacePoints(corners[there].mean(axis=1), normals, areas), faces


def _hankel(x: Array) -> tuple[Complex, Complex]:
    """Spherical Hankel functions (3, N) of the first kind, orders 0 to 2, and their derivatives."""
    orders = np.arange(3)[:, None]
    values, slopes = (
        spherical_jn(orders, x, derivative) + 1j * spherical_yn(orders, x, derivative)
        for derivative in (False, True)
    )
    return values, slopes


@dataclass(frozen=True)
class _LowOrders:
    """Integrals over the surface of v J_l [m^2 kg^-1/2] and v dJ_l/dn [m kg^-1/2], of orders 0 (N,)
    and 1 (N, 3).

    J_0 = j_0(kr), and J_1 = -3i j_1(kr) x/|x|, to be multiplied by the direction d.
    """

    plain: Array
    plain_slope: Array
    turned: Complex
    turned_slope: Complex

    def scattered(self, first: Complex, second: Complex) -> tuple[Complex, Complex]:
        """Integrals (N,), (N, 3) of v (J_l + z_l dJ_l/dn), by z_0 and z_1 (N,) [m]."""
        return (
            self.plain + first * self.plain_slope,
            self.turned + second[:, None] * self.turned_slope,
        )


def _low_orders(surface: SurfacePoints, flows: Array, numbers: Array) -> _LowOrders:
    away = np.linalg.norm(surface.points, axis=1).clip(AT_CENTRE * surface.radius)[:, None]
    outward = surface.points / away
    steep = (outward * surface.outward).sum(axis=1)[:, None]
    zero, one, two = (spherical_jn(order, away * numbers) for order in range(3))
    along = (flows * one / away).T @ surface.outward
    bent = (flows * two * steep).T @ outward
    return _LowOrders(
        (flows * zero).sum(axis=0),
        -numbers * (flows * steep * one).sum(axis=0),
        -3j * ((flows * one).T @ outward),
        -3j * (along - numbers[:, None] * bent),
    )


def _power_above(
    surface: SurfacePoints,
    flows: Array,
    numbers: Array,
    scatter: Complex,
    plain: Complex,
    turned: Complex,
) -> Array:
    """Mean (N,) [m^4 kg^-1] over directions of |integral|^2, orders 0 and 1 taken off.

    `scatter` (N,) [m] is z of all orders; `plain` (N,) and `turned` (N, 3) are orders 0 and 1 with
    it.
    """
    directions = _half_of_all_directions(DIRECTION_PAIRS)
    ways, facings = directions @ surface.points.T, directions @ surface.outward.T
    sums = _waves(ways, facings, numbers, np.ascontiguousarray(flows))
    cosine, sine, steep_cosine, steep_sine = sums
    # What is the same, and what is opposite, in the opposite direction.
    even = cosine - numbers * scatter * steep_sine - plain
    odd = -1j * (sine + numbers * scatter * steep_cosine) - directions @ turned.T
    return np.asarray((np.abs(even) ** 2 + np.abs(odd) ** 2).mean(axis=0))


@numba.njit(cache=True, nogil=True)
def _waves(ways, facings, numbers, flows):  # type: ignore[no-untyped-def]
    """Sums (4, d, N) over F triangles of flows (F, N) times cosine, sine of k way, then so facing.

    `ways` (d, F) [m] and `facings` (d, F) tell how far these lie, and how much they face, in d
    directions; `numbers` (N,) [1/m] are k.
    """
    sums = np.zeros((4, len(ways), len(numbers)))
    for d in range(len(ways)):
        for f in range(len(flows)):
            way, facing = ways[d, f] * (STEPS / (2.0 * np.pi)), facings[d, f]
            for n in range(len(numbers)):
                # Cosine and sine from a table, between whose entries they hardly bend: their error
                # is 1e-6, and it takes a tenth of the time.
                place = way * numbers[n] + SHIFT
                step = int(place)
                share = place - step
                i, j = step & (STEPS - 1), (step - STEPS // 4) & (STEPS - 1)
                cosine = (COSINES[i] + share * (COSINES[i + 1] - COSINES[i])) * flows[f, n]
                sine = (COSINES[j] + share * (COSINES[j + 1] - COSINES[j])) * flows[f, n]
                sums[0, d, n] += cosine
                sums[1, d, n] += sine
                sums[2, d, n] += facing * cosine
                sums[3, d, n] += facing * sine
    return sums


def _main_axis(turned: Complex, towards: Complex) -> tuple[Array, Array]:
    """Dipoles (N, 3) along one axis each, and their parts a quarter of a period later.

    The ellipse that a complex dipole runs through is cut into its two half axes.  The first one is
    the longer and sets out as a dipole of the phase `towards` (N,) does.
    """
    phase = np.exp(-0.5j * np.angle((turned**2).sum(axis=1)))[:, None]
    main, beside = (turned * phase).real, (turned * phase).imag
    expected = (turned * np.conj(towards)[:, None]).real
    back = (main * expected).sum(axis=1) < 0.0
    return np.where(back[:, None], -main, main), beside


def _half_of_all_directions(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly over half a sphere, on a spiral of the golden angle."""
    index = np.arange(count) + 0.5
    height = index / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * index
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)
