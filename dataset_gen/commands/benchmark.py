"""Time the fits of every objective on one core, and compare them with what the core can do."""

from __future__ import annotations

import argparse
import json

from carillon.arguments import poisson_ratio, whole_number
from carillon.fem.element import DEFAULT_POISSON
from dataset_gen import benchmark
from dataset_gen.objectives import OBJECTIVES

MOST_TIMED = 1_000_000
"""Samples that a benchmark keeps in memory."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument(
        "--samples", type=whole_number(1, MOST_TIMED), default=4000, help="(default 4000)"
    )
    parser.add_argument("--objective", choices=tuple(OBJECTIVES), help="this one only")
    parser.add_argument("--poisson", type=poisson_ratio, default=DEFAULT_POISSON)
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    result = benchmark.benchmark(arguments.samples, arguments.poisson, arguments.objective)
    print(json.dumps(result, indent=2) if arguments.json else benchmark.as_text(result))
