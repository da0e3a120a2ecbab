"""`carillon study benchmark-design`: times of an evaluation, optimisers side by side."""

import argparse
import json
from dataclasses import asdict
from typing import Annotated, Any

from carillon.command_line.progress import say
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from carillon.parameters.quantities import Count, between
from carillon.records.measurement import measured
from sound.commands.common_options import SearchOptions


@parameters
class DesignBenchmarkOptions:
    """What is measured."""

    project: str = option(REQUIRED, "project file (YAML)")
    runs: Annotated[int, between(1, 1000)] = option(7, "timed evaluations")
    resolutions: tuple[Count, ...] | None = option(
        None,
        "time evaluations alone, of the solid in these numbers of voxels along its longest side",
        metavar="N",
    )
    seeds: Annotated[int, between(1, 1000)] = option(
        1,
        "searches by each optimiser, their seeds from the project's on, of which medians and "
        "spreads are told",
    )
    fine_check: bool = option(
        False, "compare searches with checks on the fine solid, by their costs there"
    )
    json: bool = option(False, "print everything as JSON")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, DesignBenchmarkOptions, positional=("project",))
    add_options(parser, SearchOptions, leave_out=("method", "seed"))


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from sound.design.preparation import prepare
    from sound.project.project import load_project, with_optimiser
    from studies.design.measure import benchmark, time_sizes

    options = collect(DesignBenchmarkOptions, arguments)
    settings = asdict(collect(SearchOptions, arguments))
    project = with_optimiser(load_project(options.project), **settings)

    def report(what: str) -> None:
        say(f"measuring: {what}")

    results: dict[str, Any]
    if options.resolutions is None:
        results = benchmark(
            prepare(project), options.runs, options.seeds, options.fine_check, report
        )
    else:
        results = {"evaluations": time_sizes(project, options.resolutions, options.runs, report)}
    if options.json:
        print(json.dumps({**results, "provenance": measured(project.as_dict())}))
        return 0
    for times in results.get("evaluations", [results.get("evaluation")]):
        print(_sentence(times))
    if "rows" in results:
        print(_table(results["rows"]))
    return 0


def _sentence(times: dict[str, Any]) -> str:
    return (
        f"evaluation of {times['n_dofs']:,} unknowns, {times['modes']} modes, "
        f"{times['coordinates']} coordinates, one thread, median of {times['runs']}:\n"
        f"  cold {1e3 * times['cold_seconds']:.0f} ms, warm {1e3 * times['warm_seconds']:.0f} ms "
        f"(analysis {1e3 * times['analysis_seconds']:.0f}), with derivatives "
        f"{1e3 * times['gradient_seconds']:.0f} ms"
    )


def _table(rows: list[dict[str, Any]]) -> str:
    lines = [
        f"{'method':8} {'cost':>19} {'fall':>7} {'90 % after':>11} {'evaluations':>12} "
        f"{'a minute':>9} {'seconds':>8} {'fine cents':>11}",
    ]
    for row in rows:
        after, rms = row["seconds_to_90_percent"], row["fine_rms_cents"]
        lines.append(
            f"{row['method']:8} {row['cost_start']:8.4g} -> {row['cost_end']:7.4g} "
            f"{row['fall_percent']:6.2f}% {'-' if after is None else f'{after:.1f} s':>11} "
            f"{row['evaluations']:12,.0f} {row['evaluations_per_minute']:9,.0f} "
            f"{row['seconds']:8.1f} {'-' if rms is None else f'{rms:.1f}':>11}"
        )
    if rows[0]["seeds"] > 1:
        lines.append(f"medians of {rows[0]['seeds']} seeds; smallest and largest:")
        lines += [_spread(row) for row in rows]
    return "\n".join(lines)


def _spread(row: dict[str, Any]) -> str:
    """From the smallest to the largest value of what seeds change."""
    words = {
        "cost": ("cost_end", ".4g", ""),
        "fall": ("fall_percent", ".2f", "%"),
        "evaluations": ("evaluations", ",.0f", ""),
        "fine": ("fine_rms_cents", ".1f", " cents"),
    }
    spreads = [
        f"{word} {row[f'{key}_min']:{form}} to {row[f'{key}_max']:{form}}{unit}"
        for word, (key, form, unit) in words.items()
        if row[key] is not None
    ]
    return f"{row['method']:8} {', '.join(spreads)}"
