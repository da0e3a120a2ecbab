"""Fits per second: every objective, and Eq. (8) with sampled forces beside its closed form."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from carillon.progress import track
from carillon.provenance import processor
from dataset_gen.element import DEFAULT_POISSON
from dataset_gen.objectives import OBJECTIVES, fit, sampled_energy
from dataset_gen.sampling import samples
from dataset_gen.serial import serial_blas

SAMPLED_SHARE = 100
"""The sampled evaluator is timed on one block in so many; it is that much slower."""


def _fits_per_second(objective: str, young: np.ndarray, poisson: float) -> float:
    fit(objective, young, poisson)  # tables of the void patterns and compiled kernels
    start = time.perf_counter()
    fit(objective, young, poisson)
    return len(young) / (time.perf_counter() - start)


@serial_blas
def _sampled_per_second(young: np.ndarray, poisson: float) -> float:
    generator = np.random.default_rng(0)
    sampled_energy.fit_block(young[0], generator, poisson)
    start = time.perf_counter()
    for block in young:
        sampled_energy.fit_block(block, generator, poisson)
    return len(young) / (time.perf_counter() - start)


def benchmark(count: int, poisson: float = DEFAULT_POISSON) -> dict[str, Any]:
    """Time all objectives on the first `count` samples of seed 0, on one core.

    Returns
    -------
    dict with `fits_per_second` by objective and evaluator, `samples`, `closed_form_speedup`
    (`energy` against `energy, sampled`), the largest number of forces, and the processor.
    """
    young = samples(0, 0, count)
    rates: dict[str, float] = {}
    for objective in track(OBJECTIVES, "timing", total=len(OBJECTIVES), unit="objective"):
        rates[objective] = _fits_per_second(objective, young, poisson)
    few = young[: max(1, count // SAMPLED_SHARE)]
    rates["energy, sampled"] = _sampled_per_second(few, poisson)
    return {
        "fits_per_second": rates,
        "samples": count,
        "samples_of_sampled": len(few),
        "forces_of_sampled": sampled_energy.DIRECTIONS * len(sampled_energy.MAGNITUDES),
        "closed_form_speedup": rates["energy"] / rates["energy, sampled"],
        "processor": processor(),
    }


def as_text(result: dict[str, Any]) -> str:
    """The result of `benchmark` as a table."""
    lines = [f"{'objective':<18}{'fits/s, one core':>18}"]
    lines += [f"{name:<18}{rate:>18,.1f}" for name, rate in result["fits_per_second"].items()]
    lines.append(
        f"closed form of Eq. 8: {result['closed_form_speedup']:,.0f} times as fast as "
        f"{result['forces_of_sampled']:,} sampled forces ({result['processor']})"
    )
    return "\n".join(lines)
