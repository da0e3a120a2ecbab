"""Errors and times of every discretisation over its unknowns, on solids with a closed form."""

import statistics
from argparse import ArgumentTypeError
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.errors import ConvergenceError, UserError
from carillon.fem.model import RIGID_MODES
from carillon.parameters import option, parameters
from carillon.parameters.quantities import between
from solver.analysis.problem import DISCRETISATIONS
from solver.verification.matching import frequency_errors
from studies.accuracy.solids import ANGLES, POISSON, SOLIDS, ReferenceSolid
from studies.accuracy.spectra import Spectrum, cells
from studies.accuracy.tetrahedra import ORDERS, missing, tetrahedra, versions

ELASTIC = 30
"""Frequencies compared."""
MODES = RIGID_MODES + ELASTIC
LOWER = 2
"""Difference of degrees by which the references are judged."""

FINER = {"voxel": 0.7, "linear tetrahedra": 0.7, "quadratic tetrahedra": 0.9}
"""Spacings relative to those of finite cells, so that unknowns and times reach as far as theirs."""
BASE = "finite-cell"
"""Discretisation whose unknowns and times all others are compared at."""

LEVELS = max(len(solid.spacings) for solid in SOLIDS.values())


def solid_names(text: str) -> tuple[str, ...]:
    """Names of solids, joined by commas."""
    names = tuple(dict.fromkeys(text.split(",")))
    unknown = [name for name in names if name not in SOLIDS]
    if unknown:
        raise ArgumentTypeError(
            f"{unknown[0]!r} is unknown, expected some of {', '.join(SOLIDS)}, joined by commas"
        )
    return names


@parameters
class AccuracyOptions:
    """What is measured."""

    solids: tuple[str, ...] = option(
        tuple(SOLIDS),
        f"solids, joined by commas (default {','.join(SOLIDS)})",
        read=solid_names,
        metavar="NAMES",
    )
    levels: Annotated[int, between(2, LEVELS)] = option(
        LEVELS, "sizes of each discretisation, coarsest first"
    )
    runs: Annotated[int, between(1, 100)] = option(3, "timed runs, of which medians are told")


def measure_accuracy(options: AccuracyOptions) -> dict[str, Any]:
    """Measure every discretisation of every solid.

    Returns plain values: `references`, a solid an entry, with its frequencies [Hz] and their
    largest relative change from lower degrees; `levels`, a model an entry; `summary`, see
    `summarised`; `without`, a sentence if there are no tetrahedra; `packages`, versions of what
    made them.
    """
    without = missing()
    kinds = [*DISCRETISATIONS, *(() if without else ORDERS)]
    references, levels = {}, []
    for name in options.solids:
        solid = SOLIDS[name]
        exact = solid.frequencies(ELASTIC)
        change = np.abs(solid.frequencies(ELASTIC, LOWER) / exact - 1.0).max()
        references[name] = {
            "title": solid.title,
            "degrees": solid.degrees,
            "change": float(change),
            "frequencies": exact.tolist(),
        }
        levels += _levels(name, solid, exact, kinds, options)
    return {
        "elastic_modes": ELASTIC,
        "angles": ANGLES,
        "poisson": POISSON,
        "runs": options.runs,
        "base": BASE,
        "without": without,
        "packages": {} if without else versions(),
        "references": references,
        "levels": levels,
        "summary": summarised(levels),
    }


def _levels(
    name: str,
    solid: ReferenceSolid,
    exact: Array,
    kinds: Sequence[str],
    options: AccuracyOptions,
) -> list[dict[str, Any]]:
    surface = solid.surface()
    jobs: list[tuple[str, float, Callable[[], Spectrum]]] = []
    for kind in kinds:
        for spacing in solid.spacings[: options.levels]:
            finer = FINER.get(kind, 1.0) * spacing
            if kind in ORDERS:
                jobs.append((kind, finer, partial(tetrahedra, solid, finer, kind, MODES)))
            else:
                jobs.append((kind, finer, partial(cells, surface, name, finer, kind, MODES)))
    # What is compiled or loaded when it is first used is not timed.
    for _, _, find in jobs[:: options.levels]:
        _tried(find)
    runs = [[_tried(find) for _, _, find in jobs] for _ in track(range(options.runs), name)]
    return [
        {"solid": name, "discretisation": kind, "spacing": spacing} | _rated(results, exact)
        for (kind, spacing, _), results in zip(jobs, zip(*runs, strict=True), strict=True)
    ]


def _tried(find: Callable[[], Spectrum]) -> Spectrum | str:
    """The spectrum, or why there is none."""
    try:
        return find()
    except (UserError, ConvergenceError) as error:
        return str(error)


def _rated(results: Sequence[Spectrum | str], exact: Array) -> dict[str, Any]:
    spectra = [each for each in results if isinstance(each, Spectrum)]
    if not spectra:
        return {"problem": results[0]}
    frequencies = np.sqrt(np.maximum(spectra[0].values[RIGID_MODES:], 0.0)) / (2.0 * np.pi)
    errors = frequency_errors(frequencies / exact - 1.0, MODES)
    seconds = {
        name: statistics.median(getattr(each, name) for each in spectra)
        for name in ("build_seconds", "solve_seconds")
    }
    return {
        "spacing": spectra[0].spacing,
        "unknowns": spectra[0].unknowns,
        **seconds,
        "seconds": sum(seconds.values()),
        "rms": errors.rms,
        "expected": spectra[0].expected,
        "worst": errors.worst,
        "worst_mode": errors.worst_mode,
    }


def summarised(levels: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rates, and errors at equal unknowns and at equal time, by solid and discretisation.

    The rate is the slope of log error over log spacing by least squares.  What is equal is the
    unknowns and the seconds of the finite cells in the middle; errors between levels are
    interpolated, log over log, and None beyond them.
    """
    groups: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for level in levels:
        found = groups.setdefault(level["solid"], {}).setdefault(level["discretisation"], [])
        if "rms" in level:
            found.append(level)
    rows = []
    for solid, kinds in groups.items():
        base = _middle(kinds.get(BASE, []))
        for kind, found in kinds.items():
            row = {"solid": solid, "discretisation": kind, "rate": _rate(found)}
            for size in ("unknowns", "seconds"):
                row[size] = base.get(size)
                row[f"error_at_{size}"] = interpolated(found, size, base.get(size))
            rows.append(row)
    return rows


def _middle(levels: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The level in the middle, never the finest; empty if there is none."""
    return levels[max(0, min(len(levels) // 2, len(levels) - 2))] if levels else {}


def _rate(levels: Sequence[dict[str, Any]]) -> float | None:
    if len(levels) < 2:
        return None
    spacing, error = np.log([[level["spacing"], level["rms"]] for level in levels]).T
    return float(np.polyfit(spacing, error, 1)[0])


def interpolated(levels: Sequence[dict[str, Any]], size: str, value: float | None) -> float | None:
    """The rms error where a size, `unknowns` or `seconds`, has this value; None beyond the levels.

    Examples
    --------
    >>> levels = [{"unknowns": 100, "rms": 0.1}, {"unknowns": 10000, "rms": 0.001}]
    >>> round(interpolated(levels, "unknowns", 1000), 6), interpolated(levels, "unknowns", 99)
    (0.01, None)
    """
    ordered = sorted((level[size], level["rms"]) for level in levels)
    if value is None or not ordered or not ordered[0][0] <= value <= ordered[-1][0]:
        return None
    sizes, errors = np.log(ordered).T
    return float(np.exp(np.interp(np.log(value), sizes, errors)))


def as_text(result: dict[str, Any]) -> str:
    """The result in columns."""
    lines = [
        f"{result['elastic_modes']} elastic frequencies of solids turned by "
        f"{', '.join(f'{angle:g}' for angle in result['angles'])} degrees, "
        f"median seconds of {result['runs']} run{'s' if result['runs'] > 1 else ''}"
    ]
    for name, reference in result["references"].items():
        lines += [
            "",
            f"{reference['title']}; reference to {reference['change']:.0e}",
            f"{'':<21}{'spacing':>9}{'unknowns':>10}{'build':>8}{'solve':>8}{'rms':>9}{'worst':>9}"
            f"{'expected':>10}",
        ]
        lines += [_line(level) for level in result["levels"] if level["solid"] == name]
        rows = [row for row in result["summary"] if row["solid"] == name]
        unknowns, seconds = rows[0]["unknowns"], rows[0]["seconds"]
        if unknowns is not None:
            at = f"{f'at {unknowns:,}':>19}{f'at {seconds:.2g} s':>18}"
            lines.append(f"{'':<21}{'rate':>9}{at}")
        lines += [_summary_line(row) for row in rows]
    if result["without"]:
        lines += ["", result["without"]]
    return "\n".join(lines)


def _line(level: dict[str, Any]) -> str:
    start = f"{level['discretisation']:<21}{1e3 * level['spacing']:6.1f} mm"
    if "problem" in level:
        return f"{start}  {level['problem']}"
    expected = f"{level['expected']:10.2%}" if level.get("expected") is not None else ""
    return (
        f"{start}{level['unknowns']:10,}{level['build_seconds']:8.2f}{level['solve_seconds']:8.2f}"
        f"{level['rms']:9.2%}{level['worst']:+9.2%}{expected}"
    )


def _summary_line(row: dict[str, Any]) -> str:
    rate = "-" if row["rate"] is None else f"{row['rate']:.1f}"
    at = [row[f"error_at_{size}"] for size in ("unknowns", "seconds")]
    first, second = ("-" if error is None else f"{error:.2%}" for error in at)
    return f"{row['discretisation']:<21}{rate:>9}{first:>19}{second:>18}"
