"""Tables of all methods timed in alternating runs (Fig. 11)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from workflow.report.conditions import IN_COLUMNS, Repeats
from workflow.report.table import LEAST, MOST, Column, Table

Row = dict[str, Any]

METHODS = {
    "arpack": "ARPACK",
    "slepc": "SLEPc",
    "ddfem": "DDFEM*",
    "hcms": "HCMS",
    "hcms_ec": "HCMS + EC",
    "ddfem_hcms_ec_accurate": "DDFEM* + HCMS + EC, 10⁻⁶",
    "ddfem_hcms_ec": "DDFEM* + HCMS + EC",
    "ddfem_hcms_ec_warm": "the same, warm",
    "arpack_regular": "ARPACK, no factorisation",
}
"""Methods of `solver benchmark` and their names for people, in the table's order."""

_IDENTITY = [Column("model", "Model", shown=False), Column("title", "Solid")]


def methods(found: Mapping[str, Row], titles: Mapping[str, str]) -> Table:
    """Fig. 11: a row a solid, a column a method.

    Parameters
    ----------
    found : output of `solver benchmark` by model.
    titles : names for people by model.
    """
    timed = [name for name in METHODS if any(row["seconds"].get(name) for row in found.values())]
    extremes = [
        Column(f"{name}{end}", f"{METHODS[name]}, {label}", "seconds", "s", shown=False)
        for name in timed
        for end, label in ((LEAST, "min"), (MOST, "max"))
    ]
    return Table(
        "methods",
        _caption(found),
        [
            *_IDENTITY,
            Column("modes", "Modes", "count"),
            Column("dof_fine", "Unknowns", "count"),
            Column("dof_coarse", "coarsened", "count"),
            Column("precompute", "Precomputation", "seconds", "s"),
            *(Column(name, METHODS[name], "seconds", "s") for name in timed),
            Column("hcms_error", "HCMS, worst eigenvalue", "percent"),
            Column("hcms_ec_error", "HCMS + EC, worst", "percent"),
            Column("ddfem_error", "DDFEM*, frequencies 7–60", "percent"),
            Column("average_error", "Average, 7–60", "percent"),
            *extremes,
        ],
        [_methods_row(model, titles[model], row) for model, row in found.items()],
    )


def repeats(found: Mapping[str, Row]) -> Repeats:
    """How often every method ran."""
    return Repeats(f"{_rounds(found)}, all methods in turn", IN_COLUMNS)


def _rounds(found: Mapping[str, Row], counted: str = "") -> str:
    runs = sorted({row["runs"]["slepc"] for row in found.values()})
    slow = sorted({row["runs"]["arpack"] for row in found.values() if "arpack" in row["runs"]})
    less = f" (ARPACK {' or '.join(map(str, slow))})" if slow and slow != runs else ""
    return f"{' or '.join(map(str, runs))}{counted}{less}"


def _caption(found: Mapping[str, Row]) -> str:
    return (
        f"Median wall seconds of {_rounds(found, ' rounds')} in which every method runs once, from "
        "moduli to modes: coarsening, assembly and solution. Precomputation is what the meshes "
        "need once for any material, fine and coarse. Checks of the results are not timed. DDFEM* "
        "alone is coarsening and SLEPc on the coarse mesh. The warm run follows moduli that "
        "differ by a smooth field of 5 %, from the modes of the unchanged ones. HCMS + EC is "
        "corrected to an eigenvalue error of 10⁻⁶, coarsened to 10⁻² but where 10⁻⁶ is said. "
        "Errors are against SLEPc on the fine mesh: the largest of an eigenvalue, and the rms of "
        "frequencies 7 to 60. SLEPc: "
        + ("; ".join(f"{model} {_configuration(row)}" for model, row in found.items()) or "none")
        + "."
        + "".join(
            f" {model}, {METHODS[name]}: {reason}."
            for model, row in found.items()
            for name, reason in row["failed"].items()
        )
    )


def _configuration(row: Row) -> str:
    chosen = row["slepc_configuration"]
    of = len(row["slepc_configurations_tried"])
    tuned = f", the fastest of {of} tried" if of else ", its default"
    return f"{chosen['package'].upper()}, {chosen['subspace']:g} Lanczos vectors a mode{tuned}"


def _methods_row(model: str, title: str, row: Row) -> Row:
    coarse = row["frequency_error"].get("ddfem", {})
    extremes = {
        key: value
        for name, between in row["spread"].items()
        for key, value in _spread(name, between["min"], between["max"]).items()
    }
    return {
        "model": model,
        "title": title,
        **{key: row[key] for key in ("modes", "dof_fine", "dof_coarse")},
        **row["seconds"],
        "hcms_error": row["eigenvalue_error"].get("hcms", {}).get("max"),
        "hcms_ec_error": row["eigenvalue_error"].get("hcms_ec", {}).get("max"),
        "ddfem_error": coarse.get("rms_7_60"),
        "average_error": row["frequency_error"]["average"]["rms_7_60"],
        **extremes,
    }


def spreads(found: Mapping[str, Row], titles: Mapping[str, str]) -> Table:
    """Median, least and greatest time of every method, and its eigenvalue errors."""
    return Table(
        "spreads",
        "The same runs one by one: median, least and greatest wall seconds, and errors of the "
        "elastic eigenvalues against SLEPc’s of the same operator, fine or coarse.",
        [
            *_IDENTITY,
            Column("method", "Method"),
            Column("runs", "Runs", "count"),
            Column("seconds", "Median", "seconds", "s"),
            Column(f"seconds{LEAST}", "min", "seconds", "s"),
            Column(f"seconds{MOST}", "max", "seconds", "s"),
            Column("error_median", "Error, median", "percent"),
            Column("error_p90", "90 % below", "percent"),
            Column("error_max", "worst", "percent"),
        ],
        [
            _spread_row(model, titles[model], name, row)
            for model, row in found.items()
            for name in METHODS
            if name in row["spread"]
        ],
        ["model", "method"],
    )


def _spread_row(model: str, title: str, name: str, row: Row) -> Row:
    errors = row["eigenvalue_error"].get(name, {})
    return {
        "model": model,
        "title": title,
        "method": METHODS[name],
        "runs": row["runs"][name],
        "seconds": row["seconds"][name],
        **_spread("seconds", row["spread"][name]["min"], row["spread"][name]["max"]),
        **{f"error_{key}": value for key, value in errors.items()},
    }


def ratios(found: Mapping[str, Row], titles: Mapping[str, str]) -> Table:
    """Speed-ups, each with its base."""
    return Table(
        "ratios",
        "Speed-ups: median time of the base over that of the method; with precomputation, the "
        "method’s partition, sparsity and elimination plan are added to its time, and nothing to "
        "that of the base. Least is the fastest run of the base over the slowest of the method, "
        "most the other way round.",
        [
            *_IDENTITY,
            Column("method", "Method"),
            Column("base", "Base"),
            Column("ratio", "Speed-up", "times"),
            Column(f"ratio{LEAST}", "min", "times"),
            Column(f"ratio{MOST}", "max", "times"),
            Column("with_precompute", "with precomputation", "times"),
            Column(f"with_precompute{LEAST}", "min", "times", shown=False),
            Column(f"with_precompute{MOST}", "max", "times", shown=False),
        ],
        [
            {
                "model": model,
                "title": titles[model],
                "method": METHODS[method],
                "base": METHODS[base],
                **_ratio("ratio", row, method, base, row["speedup"]),
                **_ratio("with_precompute", row, method, base, row["speedup_with_precompute"]),
            }
            for model, row in found.items()
            for method, bases in row["speedup"].items()
            for base in bases
        ],
        ["model", "method", "base"],
    )


def _ratio(
    key: str, row: Row, method: str, base: str, ratios: Mapping[str, Mapping[str, float]]
) -> Row:
    """A speed-up with its extremes: the fastest base over the slowest method, and vice versa.

    What the method needs beforehand, if that counts, is the same in both. A single run has none.
    """
    ratio = ratios[method][base]
    if min(row["runs"][method], row["runs"][base]) < 2:
        return {key: ratio}
    seconds, spread = row["seconds"], row["spread"]
    before = seconds[base] / ratio - seconds[method]
    return {
        key: ratio,
        **_spread(
            key,
            spread[base]["min"] / (spread[method]["max"] + before),
            spread[base]["max"] / (spread[method]["min"] + before),
        ),
    }


def _spread(key: str, least: float, most: float) -> Row:
    return {f"{key}{LEAST}": least, f"{key}{MOST}": most}
