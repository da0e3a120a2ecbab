"""What a struck solid does over time, and how that sounds: superposition of its modes.

A free body that is struck also flies off and turns.  Only what it does besides is computed here:
the rigid modes are left out, elastic ones alone vibrate and sound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Flags
from solver.files.modes_file import ModesFile
from solver.response.contact import Contact
from solver.response.points import motion_at

SAMPLE_RATE_HERTZ = 44_100
"""Samples of a sound per second [Hz]."""
AUDIBLE_HERTZ = (20.0, 20_000.0)
"""Lowest and highest frequency that is heard [Hz]."""
STRIKE_SECONDS = 0.4
"""Time from one strike to the next in a sound [s]."""
FLOOR_DECIBELS = -60.0
"""Level, relative to the loudest, at which a spectrogram ends [dB]."""
_WINDOW_SECONDS, _HOP_SECONDS = 0.023, 0.004


@dataclass(frozen=True)
class Damping:
    """Rayleigh damping: the damping matrix is `mass_per_second` M + `stiffness_seconds` K.

    The defaults are those of a plastic (Wang and James 2019, KleinPAT, table 4), whose modulus of
    1.4 GPa and density of 1070 kg/m^3 are closest to the 1 GPa and 1000 kg/m^3 that a solid has
    here unless told otherwise.
    """

    mass_per_second: float = 30.0
    stiffness_seconds: float = 1e-6

    def decay_per_second(self, eigenvalues: Array) -> Array:
        """Rates xi_k omega_k at which modes with these eigenvalues [rad^2/s^2] decay."""
        return 0.5 * (self.mass_per_second + self.stiffness_seconds * eigenvalues)


@dataclass(frozen=True)
class Contacts:
    """Elastic modes seen at a few points of the surface; all that a response depends on."""

    eigenvalues: Array
    """(k,) [rad^2/s^2]: rigid modes left out."""
    motion: Array
    """(p, 3, k) [kg^-1/2]: displacement of the points in each mode."""
    push: Array
    """(p, k) [kg^-1/2]: force on each mode by a unit force along the points' inward normals."""

    def lowest(self, count: int) -> Contacts:
        """The same without all modes beyond the first `count`."""
        return Contacts(self.eigenvalues[:count], self.motion[:, :, :count], self.push[:, :count])


def at_contacts(file: ModesFile, contacts: list[Contact]) -> Contacts:
    """Elastic modes of a solid at points of its surface, interpolated in the cells they lie in.

    The mesh may be another one than that which the points were chosen on.
    """
    assert file.modes is not None
    positions = np.array([contact.position for contact in contacts])
    motion = motion_at(file.model, file.modes[:, file.model.rigid_modes :], positions)
    inward = np.array([contact.inward for contact in contacts])
    push = np.einsum("pik,pi->pk", motion, inward)
    return Contacts(file.eigenvalues[file.model.rigid_modes :], motion, push)


def impulse_responses(eigenvalues: Array, damping: Damping, seconds: Array) -> Array:
    """Displacement (t, k) [s] of modal coordinates after a unit impulse on each at time 0.

    exp(-xi w t) sin(w_d t) / w_d, and its continuation to modes that are damped beyond oscillating.

    Examples
    --------
    >>> undamped = impulse_responses(np.array([4.0]), Damping(0.0, 0.0), np.array([np.pi / 4]))
    >>> bool(np.isclose(undamped[0, 0], 0.5))
    True
    """
    decay = damping.decay_per_second(eigenvalues)
    square = eigenvalues - decay**2
    hertz = np.sqrt(np.maximum(square, 0.0)) / (2.0 * np.pi)
    t = np.asarray(seconds, dtype=float)[:, None]
    # numpy's sinc(x) is sin(pi x) / (pi x), and 1 where x is 0.
    result = np.exp(-decay * t) * t * np.sinc(2.0 * hertz * t)
    for k in np.flatnonzero(square < 0.0):
        rate = np.sqrt(-square[k])
        slow, fast = np.exp((rate - decay[k]) * t), np.exp(-(rate + decay[k]) * t)
        result[:, k] = ((slow - fast) / (2.0 * rate))[:, 0]
    return np.asarray(result)


def displacements(
    contacts: Contacts, damping: Damping, seconds: Array, strike: int = 0, observed: int = 1
) -> Array:
    """Displacement (t, 3) [m] of a point after an impulse of 1 N s inwards at another (Fig. 12)."""
    modal = impulse_responses(contacts.eigenvalues, damping, seconds)
    return np.asarray((modal * contacts.push[strike]) @ contacts.motion[observed].T)


def contact_sounds(contacts: Contacts, damping: Damping, contact_seconds: float) -> Array:
    """Sounds (p, s) [m/s] of a strike at each point (Fig. 13).

    After an impulse f at a point it is the sum of a_k exp(-xi_k w_k t) sin(w_d t) over the audible
    modes, with a_k = (u_k^T f) (u_k^T n): the amplitude of mode k by the paper's section 5, times
    how much the mode moves the struck point along its normal n.  That product depends neither on
    the sign of a mode nor on how the modes of a cluster are mixed.  The force is half a sine of
    `contact_seconds` with an impulse of 1 N s.  Nothing is said about radiation into the air.
    """
    from scipy.signal import fftconvolve  # Loaded where sound is made, not by every command.

    seconds = np.arange(round(STRIKE_SECONDS * SAMPLE_RATE_HERTZ)) / SAMPLE_RATE_HERTZ
    modes = is_audible(contacts.eigenvalues)
    values = contacts.eigenvalues[modes]
    damped = np.sqrt(np.maximum(values - damping.decay_per_second(values) ** 2, 0.0))
    amplitudes = contacts.push[:, modes] ** 2 * damped
    single = impulse_responses(values, damping, seconds) @ amplitudes.T
    strikes = fftconvolve(single, half_sine(contact_seconds)[:, None], axes=0)[: len(seconds)]
    return np.asarray(strikes.T)


def half_sine(seconds: float, rate: int = SAMPLE_RATE_HERTZ) -> Array:
    """Samples of a force of half a sine with unit sum; a single one if it is too short."""
    count = max(1, round(seconds * rate))
    force = np.sin(np.pi * (np.arange(count) + 0.5) / count)
    return np.asarray(force / force.sum())


def in_turn(sounds: Array, loudest: Array) -> Array:
    """Sounds (p, s) one after another, each divided by its `loudest` value (p,); none if that is 0.

    A strike where the solid is stiff would not be heard beside one where it is soft.
    """
    return np.asarray((sounds / np.where(loudest > 0.0, loudest, np.inf)[:, None]).ravel())


def is_audible(eigenvalues: Array) -> Flags:
    """Which eigenvalues [rad^2/s^2] belong to audible frequencies."""
    hertz = np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi)
    return np.asarray((hertz >= AUDIBLE_HERTZ[0]) & (hertz <= AUDIBLE_HERTZ[1]))


def spectrogram(sound: Array, rate: int = SAMPLE_RATE_HERTZ) -> tuple[Array, Array, Array]:
    """Times (t,) [s], frequencies (f,) [Hz] and magnitudes (f, t) of a sound at `rate` [Hz]."""
    from scipy.signal import ShortTimeFFT
    from scipy.signal.windows import hann

    window = hann(round(_WINDOW_SECONDS * rate), sym=False)
    bins = max(2048, 2 ** int(np.ceil(np.log2(len(window)))))
    transform = ShortTimeFFT(
        window, round(_HOP_SECONDS * rate), rate, mfft=bins, scale_to="magnitude"
    )
    return transform.t(len(sound)), transform.f, np.abs(transform.stft(sound))


def decibels(magnitudes: Array, loudest: float) -> Array:
    """Levels below the `loudest` magnitude, not below `FLOOR_DECIBELS`, where all of silence is."""
    floor = 10.0 ** (FLOOR_DECIBELS / 20.0)
    shares = magnitudes / loudest if loudest > 0.0 else np.zeros_like(magnitudes)
    return np.asarray(20.0 * np.log10(np.maximum(shares, floor)))


def spectral_distance(sound: Array, truth: Array) -> float:
    """Rms difference [dB] of two spectrograms where either is above the floor."""
    reference = spectrogram(truth)[2]
    loudest = float(reference.max())
    levels = [decibels(part, loudest) for part in (spectrogram(sound)[2], reference)]
    heard = np.maximum(*levels) > FLOOR_DECIBELS
    return float(np.sqrt(np.mean((levels[0] - levels[1])[heard] ** 2)))


def relative_difference(response: Array, truth: Array) -> float:
    """|found - truth| / |truth| in the 2-norm over all entries."""
    return float(np.linalg.norm(response - truth) / np.linalg.norm(truth))
