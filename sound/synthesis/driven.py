"""Modes driven by strikes and lasting forces, with damping that changes over time.

As in `sound.synthesis.sinusoids`, each mode is a complex number x that turns and decays from sample
to sample, and its sound is Im x.  Forces are added to x before a sample is taken.  Samples are
computed in blocks, within which the damping is constant, for all modes side by side.
"""

from dataclasses import dataclass
from functools import cache
from typing import Self

import numba
import numpy as np

from carillon.arrays import Array, Complex, Index
from solver.response.response import half_sine
from sound.synthesis.sinusoids import sampled_exponents

BLOCK = 64
"""Number of samples in a block, in which places of forces and dampings are constant."""
SILENT = 1e-30
"""Squared magnitude, over that of the greatest force on any mode, below which a mode is silent."""


@dataclass(frozen=True)
class Excitation:
    """Strikes, lasting forces and added damping of the K modes of a body."""

    firsts: Index
    since: Array
    """(S,) numbers of the first samples of S strikes, ascending, and time from the beginning of
    each strike to that, in samples from 0 to 1."""
    durations: Array
    amplitudes: Array
    """(S,) [s], (S, K): durations of the strikes' forces, half a sine each, and amplitudes of the
    modes after them."""
    blocks: Index
    courses: Array
    """(P,), (P, BLOCK): numbers of the blocks in which P lasting forces act, ascending; each force
    by samples."""
    pushes: Array
    """(P, K) [1/s]: amplitudes of the modes after a second of each lasting force at magnitude 1."""
    damped: Index
    dampings: Array
    """(D,), (D, K) [1/s]: numbers of the blocks with added damping, ascending, and that of the
    modes."""


@dataclass(frozen=True)
class Gains:
    """Factors of the K modes in a sound: complex `values` (T, K) at ascending `frames` (T,)
    [samples], linear between them and constant beyond.

    A mode x of the gain g is heard as Im g x.
    """

    frames: Array
    values: Complex

    @classmethod
    def constant(cls, values: Array) -> Self:
        """Gains (K,) that do not change."""
        return cls(np.zeros(1), np.asarray(values, dtype=complex)[None])


def ring(
    frequencies: Array, dampings: Array, gains: Gains, act: Excitation, count: int, rate: int
) -> Array:
    """Samples (count,) of modes that an excitation drives, added up with their gains.

    Modes with `frequencies` (K,) [Hz] from half the rate [Hz] on stay silent; `dampings` (K,) are
    in 1/s.
    """
    exponents, heard = sampled_exponents(frequencies, dampings, rate)
    begun = act.amplitudes * heard * np.exp(act.since[:, None] * exponents)
    pulses = [pulse(seconds, rate) for seconds in act.durations]
    lengths = np.array([len(pulse) for pulse in pulses], dtype=np.int64)
    ends = np.cumsum(lengths)
    pushes = act.pushes * heard / rate
    loudest = max(np.abs(begun).max(initial=0.0), np.abs(pushes).max(initial=0.0))
    samples = np.zeros(count)
    turns = np.exp(exponents)
    _ring(
        samples,
        turns.real.copy(),
        turns.imag.copy(),
        np.ascontiguousarray(gains.frames, dtype=float),
        np.ascontiguousarray(gains.values.real),
        np.ascontiguousarray(gains.values.imag),
        act.firsts,
        ends - lengths,
        lengths,
        np.concatenate(pulses) if pulses else np.zeros(0),
        np.ascontiguousarray(begun.real),
        np.ascontiguousarray(begun.imag),
        act.blocks,
        act.courses,
        np.ascontiguousarray(pushes),
        act.damped,
        np.exp(-act.dampings / rate),
        SILENT * loudest**2,
    )
    return samples


def pulse(seconds: float, rate: int) -> Array:
    """Samples of a force of half a sine, see `solver.response.response.half_sine`."""
    return _pulse(max(1, round(seconds * rate)))


@cache
def _pulse(count: int) -> Array:
    return half_sine(float(count), 1)


@numba.njit(cache=True, nogil=True)
def _ring(  # type: ignore[no-untyped-def]
    samples,
    turn_re,
    turn_im,
    frames,
    gains_re,
    gains_im,
    firsts,
    offsets,
    lengths,
    pulses,
    struck_re,
    struck_im,
    blocks,
    courses,
    pushes,
    damped,
    decays,
    silent,
):
    n_samples = len(samples)
    n_modes = len(turn_re)
    re, im = np.zeros(n_modes), np.zeros(n_modes)
    now_re, now_im = turn_re.copy(), turn_im.copy()
    force_re, force_im = np.zeros((BLOCK, n_modes)), np.zeros((BLOCK, n_modes))
    oldest, next_press, next_damped = 0, 0, 0
    frame, last = 0, len(frames) - 1
    ringing = False
    for begin in range(0, n_samples, BLOCK):
        size = min(BLOCK, n_samples - begin)
        block = begin // BLOCK
        pushed = False
        while oldest < len(firsts) and firsts[oldest] + lengths[oldest] <= begin:
            oldest += 1
        strike = oldest
        while strike < len(firsts) and firsts[strike] < begin + size:
            low = max(firsts[strike], begin)
            high = min(firsts[strike] + lengths[strike], begin + size)
            if low < high:
                if not pushed:
                    force_re[:] = 0.0
                    force_im[:] = 0.0
                    pushed = True
                for n in range(low, high):
                    size_now = pulses[offsets[strike] + n - firsts[strike]]
                    for k in range(n_modes):
                        force_re[n - begin, k] += size_now * struck_re[strike, k]
                        force_im[n - begin, k] += size_now * struck_im[strike, k]
            strike += 1
        while next_press < len(blocks) and blocks[next_press] <= block:
            if blocks[next_press] == block:
                if not pushed:
                    force_re[:] = 0.0
                    force_im[:] = 0.0
                    pushed = True
                for n in range(size):
                    for k in range(n_modes):
                        force_re[n, k] += courses[next_press, n] * pushes[next_press, k]
            next_press += 1
        while next_damped < len(damped) and damped[next_damped] < block:
            next_damped += 1
        if not pushed and not ringing:
            continue
        if next_damped < len(damped) and damped[next_damped] == block:
            for k in range(n_modes):
                now_re[k] = turn_re[k] * decays[next_damped, k]
                now_im[k] = turn_im[k] * decays[next_damped, k]
        else:
            now_re[:] = turn_re
            now_im[:] = turn_im
        for n in range(size):
            if pushed:
                for k in range(n_modes):
                    re[k] += force_re[n, k]
                    im[k] += force_im[n, k]
            place = begin + n
            while frame < last and frames[frame + 1] <= place:
                frame += 1
            then = min(frame + 1, last)
            share = 0.0
            if then > frame:
                share = max(0.0, (place - frames[frame]) / (frames[then] - frames[frame]))
            total = 0.0
            for k in range(n_modes):
                gain_re = gains_re[frame, k] + share * (gains_re[then, k] - gains_re[frame, k])
                gain_im = gains_im[frame, k] + share * (gains_im[then, k] - gains_im[frame, k])
                total += gain_re * im[k] + gain_im * re[k]
                turned = re[k] * now_re[k] - im[k] * now_im[k]
                im[k] = re[k] * now_im[k] + im[k] * now_re[k]
                re[k] = turned
            samples[place] = total
        ringing = False
        for k in range(n_modes):
            if re[k] * re[k] + im[k] * im[k] > silent:
                ringing = True
            else:
                re[k] = 0.0
                im[k] = 0.0
