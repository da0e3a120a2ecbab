"""A measured head: level and delay at both ears, by direction.

Each response is split into its magnitude, which a filter of minimum phase has, and its delay
(Kistler and Wightman, Journal of the Acoustical Society of America 91, 1992).  Between directions
either is interpolated by itself, so that responses of different delays do not cancel each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import resample_poly

from carillon.arrays import Array
from carillon.errors import UserError
from sound.heads.directions import DirectionMesh
from sound.heads.minimum_phase import minimum_phase
from sound.heads.sofa_file import MeasuredResponses, read_sofa

GRID_SECONDS = 0.04
"""Least period [s] of the frequency grid of magnitudes; what responses have later is left out."""
FILTER_SHARE = 4
"""Length of the frequency grid's period over that of filters."""
FADED_SHARE = 8
"""Length of filters over that of their fade at the end."""
LOWEST = 200.0
"""Frequency [Hz] below which a response has the level of `REFERENCE`: a head is small beside the
wave there, and loudspeakers of measurements end."""
REFERENCE = (200.0, 500.0)
"""Frequencies [Hz] whose mean level, from straight ahead, is that without a head."""
DELAY_BAND = (200.0, 3000.0)
"""Frequencies [Hz] by which delays are found."""
FINER = 16
"""Fineness of delays, as a share of a sample."""
FLOOR = np.log(1e-5)
"""Least magnitude, relative to the greatest of a response, as a natural logarithm."""
BEFORE = 64
"""Samples of silence before a response that is resampled."""
AHEAD = np.array([[1.0, 0.0, 0.0]])
AT_ONCE = 256
"""Directions that are transformed at once."""


@dataclass(frozen=True)
class MeasuredHead:
    """A head by directions (M, 3): unit vectors ahead, left, up to the source.

    Attributes
    ----------
    title : str
        What the file calls it.
    rate : float [Hz]
        Sampling rate of its filters.
    mesh : DirectionMesh
        Directions (M, 3) and the triangles between them.
    log_magnitudes : (M, 2, n / 2 + 1), of single precision
        Natural logarithms of the pressure at the left and the right ear over that at the place of
        the head's centre without a head, at multiples of rate / n.
    delays : (M, 2) [s]
        Of the arrival at an ear after that at the place of the head's centre.
    distance : float [m]
        Median distance that it was measured at.
    """

    title: str
    rate: float
    mesh: DirectionMesh
    log_magnitudes: NDArray[np.float32]
    delays: Array
    distance: float

    @property
    def directions(self) -> Array:
        """Measured directions (M, 3)."""
        return self.mesh.directions

    @cached_property
    def filters(self) -> Array:
        """Minimum-phase responses (M, 2, L) of the magnitudes."""
        count = self.log_magnitudes.shape[2] * 2 - 2
        filters = np.empty((*self.delays.shape, count // FILTER_SHARE))
        for first in range(0, len(filters), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            filters[part] = filters_of(self.log_magnitudes[part])
        return filters

    def equalised(self) -> MeasuredHead:
        """The head without what all directions have in common, as headphones play it.

        That is the level of a diffuse field, the mean energy over all directions and both ears: of
        the loudspeaker, and of an ear canal, which whoever listens has one of.  The level of
        `REFERENCE` from straight ahead stays.
        """
        logs = self.log_magnitudes.astype(float)
        energies = np.exp(2.0 * (logs - logs.max())).mean(axis=1)
        common = 0.5 * np.log(self.mesh.shares @ energies)
        logs = logs - common
        logs -= _ahead(self.mesh, _reference(logs, self.rate))
        return replace(self, log_magnitudes=logs.astype(np.float32))

    def responses(self) -> MeasuredResponses:
        """The head as a file has it: filters and delays, of which the least is 0."""
        delays = self.delays - self.delays.min()
        distances = np.full(len(delays), self.distance)
        return MeasuredResponses(
            self.title, self.rate, self.directions, distances, self.filters, delays
        )


def filters_of(log_magnitudes: NDArray[np.floating]) -> Array:
    """Minimum-phase responses (m, 2, L) of natural logarithms of magnitudes (m, 2, n / 2 + 1)."""
    length = (log_magnitudes.shape[2] * 2 - 2) // FILTER_SHARE
    filters = minimum_phase(log_magnitudes.astype(float))[:, :, :length]
    faded = length // FADED_SHARE
    filters[:, :, -faded:] *= np.cos(np.linspace(0.0, np.pi / 2.0, faded)) ** 2
    return filters


def read_head(path: str | Path, rate: float | None = None) -> MeasuredHead:
    """The head of a SOFA file at a sampling rate [Hz], which is the file's own if None.

    Raises UserError if there is no such file or it is of no use, see `read_sofa`.
    """
    responses = read_sofa(path)
    try:
        return head_of_responses(responses, rate or responses.rate)
    except UserError as error:
        raise UserError(f"{path}: {error}; name another file") from None


def head_of_responses(measured: MeasuredResponses, rate: float) -> MeasuredHead:
    """Split measured responses into magnitudes and delays, at a rate [Hz].

    The level is such that a source straight ahead is on average as loud at both ears, from 200 to
    500 Hz, as without a head; its delay is then 0.  Raises UserError if the directions span no
    space.
    """
    mesh = DirectionMesh(measured.directions)
    grid = 1 << int(np.ceil(np.log2(GRID_SECONDS * rate)))
    count = len(measured.directions)
    log_magnitudes = np.empty((count, 2, grid // 2 + 1), np.float32)
    delays = np.empty((count, 2))
    for first in range(0, count, AT_ONCE):
        part = slice(first, first + AT_ONCE)
        responses = _resampled(measured.responses[part], measured.rate, rate)[:, :, :grid]
        logs = _log_magnitudes(responses, grid, rate)
        log_magnitudes[part] = logs
        delays[part] = measured.delays[part] + _delays(responses, logs, rate)
    log_magnitudes -= _ahead(mesh, _reference(log_magnitudes, rate))
    delays -= _ahead(mesh, delays)
    distance = float(np.median(measured.distances))
    return MeasuredHead(measured.title, rate, mesh, log_magnitudes, delays, distance)


def _reference(log_magnitudes: Array | NDArray[np.float32], rate: float) -> Array:
    """Mean logarithms (M, 2) of magnitudes (M, 2, n / 2 + 1) at the frequencies of `REFERENCE`."""
    period = (2 * log_magnitudes.shape[2] - 2) / rate
    low, high = (round(each * period) for each in REFERENCE)
    return np.asarray(log_magnitudes[:, :, low:high].mean(axis=2), dtype=float)


def _ahead(mesh: DirectionMesh, values: Array) -> float:
    """Values (M, 2) of both ears straight ahead, their mean."""
    corners, weights, _ = mesh.weights(AHEAD)
    return float(weights[0] @ values[corners[0]].mean(axis=1))


def _resampled(responses: Array, present: float, rate: float) -> Array:
    if present == rate:
        return responses
    ratio = Fraction(rate / present).limit_denominator(1000)
    quiet = np.pad(responses, ((0, 0), (0, 0), (BEFORE, BEFORE)))
    return np.asarray(resample_poly(quiet, ratio.numerator, ratio.denominator, axis=2))


def _log_magnitudes(responses: Array, grid: int, rate: float) -> Array:
    """Natural logarithms (M, 2, grid / 2 + 1) of magnitudes, level below the lowest frequency."""
    magnitudes = np.abs(rfft(responses, grid))
    logs = np.log(np.maximum(magnitudes, np.finfo(float).tiny))
    logs = np.maximum(logs, logs.max(axis=2, keepdims=True) + FLOOR)
    low, high = (round(each * grid / rate) for each in REFERENCE)
    logs[:, :, : round(LOWEST * grid / rate)] = logs[:, :, low:high].mean(axis=2, keepdims=True)
    return logs


def _delays(responses: Array, log_magnitudes: Array, rate: float) -> Array:
    """Delays (M, 2) [s] at which responses are most alike their minimum-phase parts."""
    count = next_fast_len(2 * max(responses.shape[2], log_magnitudes.shape[2]), real=True)
    plain = minimum_phase(log_magnitudes)
    cross = rfft(responses, count) * rfft(plain[:, :, : count // 2], count).conj()
    frequencies = np.arange(cross.shape[2]) * rate / count
    cross[:, :, (frequencies < DELAY_BAND[0]) | (frequencies > DELAY_BAND[1])] = 0.0
    alike = irfft(cross, FINER * count)[:, :, : FINER * count // 2]
    return np.asarray(np.argmax(alike, axis=2) / (FINER * rate))
