"""Wall time over MPI ranks, measured and modelled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from workflow.report.conditions import Repeats
from workflow.report.table import LEAST, MOST, Column, Table

Row = dict[str, Any]

KINDS = ("strong", "weak")


def scaling(found: Mapping[str, Row], titles: Mapping[str, str]) -> Table:
    """Wall time over ranks.

    Parameters
    ----------
    found : output of `solver scaling` by model.
    titles : names for people by model.
    """
    return Table(
        "scaling",
        "HCMS and error correction over MPI ranks of one core each, from moduli to modes: the "
        "fastest run, and a model of operations, bytes and messages at rates fitted to the runs "
        "that do not have more ranks than cores. Strong scaling keeps the solid, weak scaling the "
        "unknowns of a rank.",
        [
            Column("model", "Model", shown=False),
            Column("title", "Solid"),
            Column("kind", "Scaling"),
            Column("ranks", "Ranks", "count"),
            Column("n_dofs", "Unknowns", "count"),
            Column("subdomains", "Subdomains", "count"),
            Column("measured", "Measured", "seconds", "s"),
            Column(f"measured{LEAST}", "min", "seconds", "s", shown=False),
            Column(f"measured{MOST}", "slowest", "seconds", "s"),
            Column("modelled", "Model", "modelled", "s"),
            Column("note", "Note"),
            Column("peak_memory", "Peak memory of a rank", "bytes", "B"),
        ],
        [
            row
            for model, result in found.items()
            for kind in KINDS
            if result[kind] is not None
            for row in _rows(model, titles[model], kind, result[kind])
        ],
        ["model", "kind", "ranks"],
    )


def repeats(found: Mapping[str, Row]) -> Repeats:
    """How often every number of ranks was measured."""
    runs = {run["repeats"] for result in found.values() for run in result["strong"]["runs"]}
    return Repeats(
        f"{' or '.join(map(str, sorted(runs)))}, after a small one", "fastest and slowest run"
    )


def assumptions(found: Mapping[str, Row]) -> list[str]:
    """What the model takes for granted, each once."""
    stated = [
        assumption
        for result in found.values()
        for kind in KINDS
        if result[kind] is not None
        for assumption in result[kind]["model"]["assumptions"]
    ]
    return list(dict.fromkeys(stated))


def _rows(model: str, title: str, kind: str, part: Row) -> list[Row]:
    runs = {run["ranks"]: run for run in part["runs"]}
    modelled = {row["ranks"]: row for row in part["model"]["rows"]}
    return [
        {
            "model": model,
            "title": title,
            "kind": kind,
            "ranks": ranks,
            "n_dofs": (runs.get(ranks) or modelled[ranks])["n_dofs"],
            "subdomains": (runs.get(ranks) or modelled[ranks])["subdomains"],
            "measured": _get(runs, ranks, "seconds"),
            f"measured{LEAST}": _get(runs, ranks, "seconds"),
            f"measured{MOST}": _get(runs, ranks, "slowest_seconds"),
            "modelled": _get(modelled, ranks, "total"),
            "note": _note(runs.get(ranks)),
            "peak_memory": max(runs[ranks]["peak_memory_bytes"]) if ranks in runs else None,
        }
        for ranks in sorted({*runs, *modelled})
    ]


def _get(rows: dict[int, Row], ranks: int, key: str) -> Any:
    return rows[ranks][key] if ranks in rows else None


def _note(run: Row | None) -> str:
    if run is None:
        return "model alone"
    return f"oversubscribed: {run['cores']} cores" if run["oversubscribed"] else "measured"
