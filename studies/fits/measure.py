"""Fits per second on one core: closed forms, Eq. (8) with sampled forces, and arithmetic."""

import time
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.fem.element import DEFAULT_POISSON
from carillon.numerics.simd import LANES, add_product, empty, load_tile, store_tile
from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import PoissonRatio, between
from carillon.processes.threads import blas_threads
from carillon.records.provenance import compiled_for, processor
from dataset_gen.objectives import DEFAULT_OBJECTIVE, OBJECTIVES, fit, flops, sampled_energy
from dataset_gen.objectives.compiled import PANEL, compiled
from dataset_gen.sampling import samples

RUNS = 7
"""Timed runs after one that is not; the median counts."""

SAMPLED_SHARE = 100
"""The sampled evaluator is timed on one block in so many; it is that much slower."""

MOST_TIMED = 1_000_000
"""Samples that a benchmark keeps in memory."""

MATRIX = 768
"""Size of the matrices of the BLAS product that the arithmetic is compared with."""

SUMS, DEPTH, REPETITIONS = 12, 64, 4000
"""Sums that the core's peak is measured with, terms added to each at a time, and how often.

Enough to keep two units busy that take four cycles each, and few enough for 16 registers.
"""


Rate = tuple[float, float, float]
"""Items per second: median, minimum and maximum of the runs."""


def _runs(*works: tuple[Callable[[], Any], float]) -> list[list[float]]:
    """Items per second in each run of works that do so many at a time.

    They take turns, so that a clock that drifts favours none.
    """
    rates: list[list[float]] = [[] for _ in works]
    for run in range(1 + RUNS):
        for (work, items), found in zip(works, rates):
            start = time.perf_counter()
            work()
            if run:
                found.append(items / (time.perf_counter() - start))
    return rates


def _rate(runs: list[float]) -> Rate:
    return float(np.median(runs)), min(runs), max(runs)


def _sampled_rate(young: Array, poisson: float) -> Rate:
    def work() -> None:
        generator = np.random.default_rng(0)
        for block in young:
            sampled_energy.fit_block(block, generator, poisson)

    return _rate(*_runs((work, len(young))))


@blas_threads(1)
def _multiply_by_blas(matrix: Array) -> None:
    matrix @ matrix


@compiled
def _multiply_in_registers(repetitions: int) -> Array:
    numbers = empty(2 + SUMS)
    for n in range(2 + SUMS):
        numbers[n] = 1e-9 * n
    sums = (numbers, 2, SUMS, 1)
    tile = load_tile(sums, 1, SUMS)
    for _ in range(repetitions):
        tile = add_product(tile, (numbers, 0, 1, 0), (numbers, 1, 0, 0), DEPTH)
    store_tile(sums, tile)
    return numbers


def _arithmetic(
    per_fit: float | None, fits: list[float], dgemm: list[float], peak: list[float]
) -> dict[str, float | None]:
    """From the rates of runs that took turns; of fits whose operations are unknown, the limits."""
    values: dict[str, float | None] = {
        **dict.fromkeys(("flops_per_fit", "gflops")),
        "gflops_dgemm": float(np.median(dgemm)),
        "gflops_peak": max(peak),
        **dict.fromkeys(("peak_fraction", "dgemm_fraction")),
    }
    if per_fit is not None:
        gflops = 1e-9 * per_fit * float(np.median(fits))
        shares = [1e-9 * per_fit * one / other for one, other in zip(fits, dgemm)]
        values |= {"flops_per_fit": per_fit, "gflops": gflops}
        values |= {"peak_fraction": gflops / max(peak), "dgemm_fraction": float(np.median(shares))}
    return values


def _flops_per_fit(objective: str, young: Array, poisson: float) -> float | None:
    """Mean number of operations of a fit; unknown for iterative ones.

    The least squares at the end, a few thousandths of it, are left out.
    """
    with flops.counted() as counts:
        fit(objective, young, poisson)
    return sum(counts) / len(young) if counts else None


@parameters
class FitBenchmarkOptions:
    """Which fits are timed."""

    samples: Annotated[int, between(1, MOST_TIMED)] = option(4000, "of seed 0")
    objective: Annotated[str, OneOf(*OBJECTIVES)] | None = option(None, "this one only")
    poisson: PoissonRatio = option(DEFAULT_POISSON, "Poisson's ratio")


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
        `gflops_dgemm` is what BLAS reaches on the same core in turn with the fits, `gflops_peak`
        the core without loads and stores; `peak_fraction` and `dgemm_fraction` are the shares of
        them, `dgemm_fractions` the latter by objective.
    lanes, panel, compiled_for
        Blocks side by side, columns of a product at a time, and the processor that numba compiles
        for, from which they follow.
    """
    count, poisson = options.samples, options.poisson
    young = samples(0, 0, count)
    chosen = options.objective or DEFAULT_OBJECTIVE
    names = list(OBJECTIVES) if options.objective is None else [options.objective]
    matrix = np.random.default_rng(0).random((MATRIX, MATRIX))
    dgemm = partial(_multiply_by_blas, matrix), 2e-9 * MATRIX**3
    peak = partial(_multiply_in_registers, REPETITIONS), 2e-9 * LANES * SUMS * DEPTH * REPETITIONS
    rates: dict[str, Rate] = {}
    arithmetic: dict[str, dict[str, float | None]] = {}
    for name in track(names, "timing", total=len(names), unit="objective"):
        runs = _runs((partial(fit, name, young, poisson), count), dgemm, peak)
        rates[name] = _rate(runs[0])
        arithmetic[name] = _arithmetic(_flops_per_fit(name, young, poisson), *runs)
    few = young[: max(1, count // SAMPLED_SHARE)]
    closed, sampled = rates[chosen], _sampled_rate(few, poisson)
    return {
        "objective": chosen,
        "fits_per_second": {"closed_form": closed[0], "sampled": sampled[0]},
        "spread": {"closed_form": closed[1:], "sampled": sampled[1:]},
        "speedup": closed[0] / sampled[0],
        "rows_per_fit": 8,
        "threads": 1,
        "runs": RUNS,
        "samples": count,
        "samples_of_sampled": len(few),
        "forces_of_sampled": sampled_energy.DIRECTIONS * len(sampled_energy.MAGNITUDES),
        "objectives": {name: rate[0] for name, rate in rates.items()},
        **arithmetic[chosen],
        "dgemm_fractions": {name: each["dgemm_fraction"] for name, each in arithmetic.items()},
        "lanes": LANES,
        "panel": PANEL,
        "compiled_for": compiled_for(),
        "processor": processor(),
    }


def as_text(result: dict[str, Any]) -> str:
    """The result of `benchmark` as a table."""
    lines = [f"{'objective':<24}{'fits/s, one core':>18}{'of BLAS':>10}"]
    for name, rate in result["objectives"].items():
        fraction = result["dgemm_fractions"][name]
        share = "" if fraction is None else f"{fraction:>10.0%}"
        lines.append(f"{name:<24}{rate:>18,.1f}{share}")
    sampled = result["fits_per_second"]["sampled"]
    lines.append(f"{'energy, sampled forces':<24}{sampled:>18,.1f}")
    lines.append(
        f"{result['objective']}: {result['speedup']:,.0f} times as fast as "
        f"{result['forces_of_sampled']:,} sampled forces ({result['processor']})"
    )
    if result["gflops"] is not None:
        lines.append(
            f"{result['flops_per_fit']:,.0f} operations per fit, {result['gflops']:.0f} billion "
            f"per second: {result['peak_fraction']:.0%} of the core's peak of "
            f"{result['gflops_peak']:.0f}, {result['dgemm_fraction']:.0%} of the "
            f"{result['gflops_dgemm']:.0f} of BLAS"
        )
    lines.append(
        f"compiled for {result['compiled_for']}: {result['lanes']} blocks side by side, "
        f"{result['panel']} columns at a time"
    )
    return "\n".join(lines)
