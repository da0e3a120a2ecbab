"""Fits per second on one core: closed forms, Eq. (8) with sampled forces, and arithmetic."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from carillon.arguments import poisson_ratio, whole_number
from carillon.fem.element import DEFAULT_POISSON, Array
from carillon.options import option
from carillon.progress import track
from carillon.provenance import processor
from carillon.serial import serial_blas
from dataset_gen.objectives import DEFAULT_OBJECTIVE, OBJECTIVES, fit, flops, sampled_energy
from dataset_gen.objectives.lanes import LANES, add_product, compiled, empty, store_tile, zeros
from dataset_gen.sampling import samples

RUNS = 7
"""Timed runs after one that is not; the median counts."""

SAMPLED_SHARE = 100
"""The sampled evaluator is timed on one block in so many; it is that much slower."""

MOST_TIMED = 1_000_000
"""Samples that a benchmark keeps in memory."""

MATRIX = 768
"""Size of the matrices of the BLAS product that the arithmetic is compared with."""


class Rate(NamedTuple):
    """Items per second: median, minimum and maximum of the runs."""

    median: float
    minimum: float
    maximum: float


def _rate(work: Callable[[], Any], items: float) -> Rate:
    """Items per second of `work`, which does so many at a time."""
    work()
    rates = []
    for _ in range(RUNS):
        start = time.perf_counter()
        work()
        rates.append(items / (time.perf_counter() - start))
    return Rate(float(np.median(rates)), min(rates), max(rates))


def _sampled_rate(young: Array, poisson: float) -> Rate:
    def work() -> None:
        generator = np.random.default_rng(0)
        for block in young:
            sampled_energy.fit_block(block, generator, poisson)

    return _rate(work, len(young))


@serial_blas
def _blas_gflops() -> float:
    """Billions of operations per second of a product of full matrices by BLAS on one core."""
    left = np.random.default_rng(0).random((MATRIX, MATRIX))
    return _rate(lambda: left @ left, 2e-9 * MATRIX**3).maximum


@compiled
def _multiply_in_registers(repetitions: int) -> Array:
    numbers = empty(27)
    numbers[:] = 1e-9
    tile = zeros(3, 6)
    for _ in range(repetitions):
        tile = add_product(tile, (numbers, 0, 1, 0), (numbers, 3, 1, 0), 8)
    store_tile((numbers, 9, 6, 1), tile)
    return numbers


def _peak_gflops() -> float:
    """Billions of operations per second of multiplications and additions within registers."""
    repetitions = 20_000
    operations = 2e-9 * LANES * 18 * 8 * repetitions
    return _rate(lambda: _multiply_in_registers(repetitions), operations).maximum


def _flops_per_fit(objective: str, young: Array, poisson: float) -> float | None:
    """Mean number of operations of a fit; unknown for iterative ones.

    The least squares at the end, a few thousandths of it, are left out.
    """
    fit(objective, young, poisson)
    with flops.counted() as counts:
        fit(objective, young, poisson)
    return sum(counts) / len(young) if counts else None


@dataclass(frozen=True)
class FitBenchmarkOptions:
    """Which fits are timed."""

    samples: int = option(4000, "of seed 0", type=whole_number(1, MOST_TIMED))
    objective: str | None = option(None, "this one only", choices=OBJECTIVES)
    poisson: float = option(DEFAULT_POISSON, "Poisson's ratio", type=poisson_ratio)


def benchmark(options: FitBenchmarkOptions) -> dict[str, Any]:
    """Time the fits on one core: of one objective, or of the default one and all others too.

    Returns
    -------
    fits_per_second
        Of the `closed_form` and of Eq. (8) with `sampled` forces; a fit has `rows_per_fit` moduli.
        `spread` has minimum and maximum of the runs.
    objectives
        Fits per second by name.
    flops_per_fit, gflops
        Operations of the closed form and billions of them per second, null for an iterative one.
        `gflops_dgemm` is what BLAS reaches on the same core, `gflops_peak` the processor without
        loads and stores, `peak_fraction` the share of the latter.
    """
    count, poisson = options.samples, options.poisson
    young = samples(0, 0, count)
    chosen = options.objective or DEFAULT_OBJECTIVE
    names = list(OBJECTIVES) if options.objective is None else [options.objective]
    rates: dict[str, Rate] = {}
    for name in track(names, "timing", total=len(names), unit="objective"):
        rates[name] = _rate(partial(fit, name, young, poisson), count)
    few = young[: max(1, count // SAMPLED_SHARE)]
    closed, sampled = rates[chosen], _sampled_rate(few, poisson)
    per_fit = _flops_per_fit(chosen, young, poisson)
    gflops = None if per_fit is None else 1e-9 * per_fit * closed.median
    peak = _peak_gflops()
    return {
        "objective": chosen,
        "fits_per_second": {"closed_form": closed.median, "sampled": sampled.median},
        "spread": {"closed_form": closed[1:], "sampled": sampled[1:]},
        "speedup": closed.median / sampled.median,
        "rows_per_fit": 8,
        "threads": 1,
        "runs": RUNS,
        "samples": count,
        "samples_of_sampled": len(few),
        "forces_of_sampled": sampled_energy.DIRECTIONS * len(sampled_energy.MAGNITUDES),
        "objectives": {name: rate.median for name, rate in rates.items()},
        "flops_per_fit": per_fit,
        "gflops": gflops,
        "gflops_dgemm": _blas_gflops(),
        "gflops_peak": peak,
        "peak_fraction": None if gflops is None else gflops / peak,
        "processor": processor(),
    }


def as_text(result: dict[str, Any]) -> str:
    """The result of `benchmark` as a table."""
    lines = [f"{'objective':<24}{'fits/s, one core':>18}"]
    lines += [f"{name:<24}{rate:>18,.1f}" for name, rate in result["objectives"].items()]
    sampled = result["fits_per_second"]["sampled"]
    lines.append(f"{'energy, sampled forces':<24}{sampled:>18,.1f}")
    lines.append(
        f"{result['objective']}: {result['speedup']:,.0f} times as fast as "
        f"{result['forces_of_sampled']:,} sampled forces ({result['processor']})"
    )
    if result["gflops"] is not None:
        lines.append(
            f"{result['flops_per_fit']:,.0f} operations per fit, {result['gflops']:.0f} billion "
            f"per second: {result['peak_fraction']:.0%} of the core's peak; "
            f"BLAS {result['gflops_dgemm']:.0f}"
        )
    return "\n".join(lines)
