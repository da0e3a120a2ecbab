"""Tables of the figures, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from workflow.figures.results import Figures, Row
from workflow.report import convergence_tables, methods_tables
from workflow.report.evidence_tables import provenance_table
from workflow.report.table import Column, Table


def methods(figures: Figures) -> Table:
    """Fig. 11."""
    return methods_tables.methods(figures.methods, figures.titles)


def spreads(figures: Figures) -> Table:
    """Spread of the times of Fig. 11."""
    return methods_tables.spreads(figures.methods, figures.titles)


def ratios(figures: Figures) -> Table:
    """Speed-ups, each with its base."""
    return methods_tables.ratios(figures.methods, figures.titles)


def convergence(figures: Figures) -> Table:
    """Fig. 10."""
    return convergence_tables.convergence(figures.convergence, figures.titles)


def scaling(figures: Figures) -> Table:
    """Wall time over ranks, measured and modelled."""
    return Table(
        "scaling",
        "HCMS and error correction over MPI ranks of one core each, from moduli to modes: one run, "
        "and a model of operations, bytes and messages at rates fitted to the runs that do not "
        "have more ranks than cores. Strong scaling keeps the solid, weak scaling the unknowns of "
        "a rank.",
        [
            Column("model", "Model", shown=False),
            Column("title", "Solid"),
            Column("kind", "Scaling"),
            Column("ranks", "Ranks", "count"),
            Column("n_dofs", "Unknowns", "count"),
            Column("subdomains", "Subdomains", "count"),
            Column("measured", "Measured", "seconds", "s"),
            Column("modelled", "Model", "seconds", "s"),
            Column("note", "Note"),
            Column("peak_memory", "Peak memory of a rank", "bytes", "B"),
        ],
        [
            row
            for model, found in figures.scaling.items()
            for kind in ("strong", "weak")
            if found[kind] is not None
            for row in _scaling_rows(model, figures.titles[model], kind, found[kind])
        ],
    )


def _scaling_rows(model: str, title: str, kind: str, part: Row) -> list[Row]:
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


def provenance(figures: Figures) -> Table:
    """Command, code and machine behind every result."""
    parts = {
        "methods": figures.methods,
        "convergence": figures.convergence,
        "scaling": figures.scaling,
    }
    return provenance_table(
        {
            f"models/{model}/{part}.json": found["provenance"]
            for part, by_model in parts.items()
            for model, found in by_model.items()
        }
    )


BUILDERS: dict[str, Callable[[Figures], Table]] = {
    "methods": methods,
    "spreads": spreads,
    "ratios": ratios,
    "convergence": convergence,
    "scaling": scaling,
    "provenance": provenance,
}


def build_tables(figures: Figures) -> list[Table]:
    """Build every table of the figures."""
    return [build(figures) for build in BUILDERS.values()]
