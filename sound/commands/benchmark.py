"""`python -m sound benchmark`: times of an evaluation, optimisers side by side."""

from __future__ import annotations

import argparse
import json
from typing import Any

from carillon.arguments import number_of_workers, positive_number, whole_number
from carillon.measurement import measured
from carillon.progress import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("project", help="project file (YAML)")
    parser.add_argument("--seconds", type=positive_number, help="of each, not the project's")
    parser.add_argument("--evaluations", type=whole_number(1), help="of each at most")
    parser.add_argument("--workers", type=number_of_workers, help="processes, not the project's")
    parser.add_argument("--runs", type=whole_number(1, 1000), default=7, help="timed evaluations")
    parser.add_argument("--json", action="store_true", help="print everything as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from sound.design.benchmark import benchmark
    from sound.design.preparation import prepare
    from sound.project.project import load_project, with_optimiser

    given = {key: getattr(arguments, key) for key in ("seconds", "evaluations", "workers")}
    project = with_optimiser(load_project(arguments.project), **given)
    results = benchmark(prepare(project), arguments.runs, lambda what: say(f"measuring: {what}"))
    if arguments.json:
        print(json.dumps({**results, "provenance": measured(project.as_dict())}))
        return 0
    print(_table(results))
    return 0


def _table(results: dict[str, Any]) -> str:
    times = results["evaluation"]
    lines = [
        f"evaluation of {times['n_dofs']:,} unknowns, {times['modes']} modes, "
        f"{times['coordinates']} coordinates, one thread, median of {times['runs']}:",
        f"  cold {1e3 * times['cold_seconds']:.0f} ms, warm {1e3 * times['warm_seconds']:.0f} ms "
        f"(analysis {1e3 * times['analysis_seconds']:.0f}), with derivatives "
        f"{1e3 * times['gradient_seconds']:.0f} ms",
        f"{'method':8} {'cost':>19} {'fall':>7} {'90 % after':>11} {'evaluations':>12} "
        f"{'a minute':>9} {'seconds':>8}",
    ]
    for row in results["rows"]:
        after = row["seconds_to_90_percent"]
        lines.append(
            f"{row['method']:8} {row['cost_start']:8.4g} -> {row['cost_end']:7.4g} "
            f"{row['fall_percent']:6.2f}% {'-' if after is None else f'{after:.1f} s':>11} "
            f"{row['evaluations']:12,} {row['evaluations_per_minute']:9,.0f} {row['seconds']:8.1f}"
        )
    return "\n".join(lines)
