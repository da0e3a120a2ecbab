"""Wall time over MPI ranks, measured and modelled."""

from collections.abc import Iterator
from typing import Any

from studies.base.conditions import Repeats, measured
from studies.base.table import SOLID, Column, Row, hidden, solid, table

KINDS = ("strong", "weak")


def _repeats(results: Any) -> Repeats:
    runs = {run["repeats"] for each in results.scaling.values() for run in each["strong"]["runs"]}
    times = " or ".join(map(str, sorted(runs)))
    return Repeats(f"{times}, after a small one", "fastest and slowest run")


MEASURED = measured(
    lambda results: {name: each["provenance"] for name, each in results.scaling.items()},
    _repeats,
)


@table(
    SOLID,
    Column("kind", "Scaling"),
    Column("ranks", "Ranks", "count"),
    Column("n_dofs", "Unknowns", "count"),
    Column("subdomains", "Subdomains", "count"),
    Column("measured", "Measured", "seconds", source="seconds"),
    hidden("measured_min", "min", "seconds", source="seconds"),
    Column("measured_max", "slowest", "seconds", source="slowest_seconds"),
    Column("modelled", "Model", "modelled"),
    Column("misfit", "Model − measured", "misfit"),
    Column("note", "Note"),
    Column("peak_memory", "Peak memory of a rank", "bytes"),
    keys="model kind ranks",
    conditions=MEASURED,
    fits=lambda results: " ".join(fits(results)),
)
def scaling(results: Any) -> Iterator[Row]:
    """HCMS and error correction over MPI ranks of one core each, from moduli to modes: the fastest
    run, and a model of operations, bytes and messages at rates fitted to the runs that do not have
    more ranks than cores. Strong scaling keeps the solid, weak scaling the unknowns of a rank.
    Model − measured is relative to the measured time. {fits}"""
    for model, kind, part in _parts(results):
        runs = {run["ranks"]: run for run in part["runs"]}
        modelled = {row["ranks"]: row for row in part["model"]["rows"]}
        for ranks in sorted({*runs, *modelled}):
            run = runs.get(ranks)
            yield {
                **solid(results, model),
                "kind": kind,
                **{key: (run or modelled[ranks])[key] for key in ("ranks", "n_dofs", "subdomains")},
                **({} if run is None else run),
                "modelled": modelled[ranks]["total"] if ranks in modelled else None,
                "misfit": _misfit(run, modelled.get(ranks)),
                "note": _note(run),
                "peak_memory": max(run["peak_memory_bytes"]) if run else None,
            }


def assumptions(results: Any) -> list[str]:
    """What the model takes for granted, each once."""
    stated = (part["model"]["assumptions"] for _, _, part in _parts(results))
    return list(dict.fromkeys(assumption for each in stated for assumption in each))


def fits(results: Any) -> list[str]:
    """How far the model is from the measurements, a sentence for each solid and scaling."""
    return [
        f"{results.titles[model]}, {kind} scaling: {part['model']['fit']}"
        for model, kind, part in _parts(results)
    ]


def _parts(results: Any) -> Iterator[tuple[str, str, Row]]:
    for model, result in results.scaling.items():
        for kind in KINDS:
            if result[kind] is not None:
                yield model, kind, result[kind]


def _misfit(run: Row | None, modelled: Row | None) -> float | None:
    if run is None or modelled is None or run["oversubscribed"]:
        return None
    return float(modelled["total"] / run["seconds"] - 1.0)


def _note(run: Row | None) -> str:
    if run is None:
        return "model alone"
    return f"oversubscribed: {run['cores']} cores" if run["oversubscribed"] else "measured"
