"""Validate a shard of training data, and say what is in it."""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from carillon.arrays import Index
from carillon.command_line.progress import say, track
from dataset_gen.objectives import ratios_of
from dataset_gen.objectives.quadratic import MODULUS_FLOOR
from dataset_gen.shards import UNIT, Shard, iterate_shard
from dataset_gen.speed import Speed

RESIDUAL_STEP = 1e-5
"""Resolution of the median residual; all beyond `RESIDUAL_STEPS` such steps count as that."""
RESIDUAL_STEPS = 200_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("file", help="shard (HDF5)")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Read all of the shard and print its summary."""
    speed = Speed()
    description = describe(arguments.file)
    first, past = description["samples"]
    say(f"read {speed.report(arguments.file, past - first)}")
    print(json.dumps(description, indent=2) if arguments.json else as_text(description))


class _Totals:
    def __init__(self) -> None:
        self.samples = self.partly_void = self.failures = self.at_floor = 0
        self.fine, self.coarse = [np.inf, 0.0], [np.inf, 0.0]
        self.residuals: Index = np.zeros(RESIDUAL_STEPS + 1, dtype=np.int64)

    def add(self, piece: Shard) -> None:
        """Count the samples of one piece."""
        void = piece.fine == 0
        floor = MODULUS_FLOOR * piece.fine.max(axis=1, keepdims=True)
        self.samples += len(piece.fine)
        self.partly_void += int(void.any(axis=1).sum())
        self.failures += int((~piece.converged).sum())
        self.at_floor += int((piece.coarse <= floor * (1 + 1e-9)).sum())
        for ends, moduli in ((self.fine, piece.fine[~void]), (self.coarse, piece.coarse)):
            ends[:] = [min(ends[0], float(moduli.min())), max(ends[1], float(moduli.max()))]
        steps = np.minimum(piece.residual / RESIDUAL_STEP, RESIDUAL_STEPS).astype(np.int64)
        self.residuals += np.bincount(steps, minlength=RESIDUAL_STEPS + 1)

    def median_residual(self) -> float:
        """The median, to within half a step."""
        middle = np.searchsorted(np.cumsum(self.residuals), (self.samples + 1) // 2)
        return float((middle + 0.5) * RESIDUAL_STEP)


def describe(path: str | Path) -> dict[str, Any]:
    """Read all of the shard at `path`, validate it and summarise it, in constant memory.

    Raises UserError, see `dataset_gen.shards.iterate_shard`.
    """
    totals = _Totals()
    pieces = track(
        iterate_shard(path), f"reading {path}", unit="samples", weight=lambda piece: len(piece.fine)
    )
    for piece in pieces:
        totals.add(piece)
    settings = replace(piece.settings, start=piece.stop - totals.samples)
    return {
        "path": str(path),
        "objective": settings.objective,
        "poisson": settings.poisson,
        "poisson_range": list(ratios_of(settings.objective, settings.poisson)),
        "seed": settings.seed,
        "samples": [settings.start, settings.stop],
        "unit": UNIT,
        "distribution": settings.distribution,
        "range": [settings.low, settings.high],
        "smallest_modulus": totals.fine[0],
        "largest_modulus": totals.fine[1],
        "smallest_coarse_modulus": totals.coarse[0],
        "largest_coarse_modulus": totals.coarse[1],
        "partly_void": totals.partly_void / totals.samples,
        "converged": 1.0 - totals.failures / totals.samples,
        "failures": totals.failures,
        "at_floor": totals.at_floor / (8 * totals.samples),
        "median_residual": totals.median_residual(),
        "version": settings.version,
        "provenance": piece.provenance,
    }


def as_text(summary: dict[str, Any]) -> str:
    """The result of `describe` as lines."""
    first, past = summary["samples"]
    low, high = summary["range"]
    least, largest = summary["poisson_range"]
    unit = summary["unit"]
    return "\n".join(
        [
            f"{summary['path']}: samples {first}..{past - 1} of seed {summary['seed']}, "
            f"{past - first:,} in all, checksums right",
            f"objective {summary['objective']}, Poisson's ratio {summary['poisson']}"
            + (f", for solids of {least:g} to {largest:g}" if least < largest else ""),
            f"moduli {summary['distribution']} in {low:g}..{high:g} {unit}: fine "
            f"{summary['smallest_modulus']:.4g}..{summary['largest_modulus']:.4g}, coarse "
            f"{summary['smallest_coarse_modulus']:.4g}..{summary['largest_coarse_modulus']:.4g}",
            f"partly void {summary['partly_void']:.1%}, moduli at the floor "
            f"{summary['at_floor']:.1%}",
            f"fits that did not converge {summary['failures']:,} ({1 - summary['converged']:.2%}), "
            f"median residual {summary['median_residual']:.4f}",
            f"Carillon {summary['version']}, commit "
            f"{summary['provenance'].get('commit', 'unknown')}",
        ]
    )
