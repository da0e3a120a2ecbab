"""The report of a run as one page."""

from __future__ import annotations

from typing import Any

from studies.base.page import inline, listed_modes, picture_uri, rendered
from studies.base.table import Table, read_table
from workflow.report.convergence_tables import convergence_sentences
from workflow.report.findings import findings, headline, missed
from workflow.report.results import Run
from workflow.report.scaling_tables import assumptions
from workflow.variants import SHOWN, TRUTH, VARIANTS

Tables = dict[str, Table]
KINDS = {"voxel": "voxels", "finite-cell": "finite cells"}
"""Discretisations, in words."""


def page(run: Run, tables: Tables) -> str:
    """Build the page from the tables and figures of a run.

    Nothing is computed anew: every number comes from a table, so that page and tables agree.
    """
    used = {model["discretisation"] for model in run.config["models"].values()}
    kinds = [words for name, words in KINDS.items() if name in used]
    return rendered(
        "workflow/report/page.html.j2",
        kinds=" or ".join(kinds),
        cells="finite-cell" in used,
        title=run.config["title"],
        variants=VARIANTS,
        truth=TRUTH,
        config=run.config,
        tables=tables,
        findings=findings(tables, run.config["solver"]["refine_to"]),
        missed=missed(tables["evidence"], run.config["solver"]["tolerance"]),
        titles=run.titles,
        uncoarsened=[run.titles[model] for model in run.models if run.fine_taken(model)],
        models=[_model(run, tables, model) for model in run.models],
        convergence=plots(run, "convergence", run.convergence),
        sentences=convergence_sentences(tables["convergence"]),
        scaling=plots(run, "scaling", run.scaling),
        assumptions=assumptions(run),
        times=inline(run.figure("times.svg")),
        methods=inline(run.figure("methods.svg")) if tables["methods"].rows else "",
    )


def plots(results: Any, part: str, names: Any) -> list[dict[str, Any]]:
    """Figures of some solids, with their names."""
    return [
        {
            "name": name,
            "title": results.titles[name],
            "plot": inline(results.figure(f"{name}-{part}.svg")),
        }
        for name in names
    ]


def mode_pictures(run: Run, model: str) -> list[dict[str, Any]]:
    """Pictures of the first elastic mode by all variants that are shown."""
    described = run.read_json(f"figures/{model}-mode.json")
    return [
        {
            "variant": variant,
            "source": picture_uri(run.figure(f"{model}-mode-{variant}.png")),
            **described[variant],
        }
        for variant in run.shown_variants(model)
    ]


def _model(run: Run, tables: Tables, model: str) -> dict[str, Any]:
    of_model = {
        name: [row for row in tables[name].rows if row["model"] == model]
        for name in ("summary", "frequencies", "errors", "evidence")
    }
    return {
        "name": model,
        "title": run.titles[model],
        "settings": run.config["models"][model],
        "summary": of_model["summary"][0],
        "pictures": mode_pictures(run, model),
        "judgement": _judgement(run, model),
        "spectrum": inline(run.figure(f"{model}-spectrum.svg")),
        "shown": run.shown_variants(model),
        "skip": ["model", *_left_out(run, model)],
        "frequencies": listed_modes(of_model["frequencies"]),
        **{
            name: {row["variant"]: row for row in of_model[name]} for name in ("errors", "evidence")
        },
    }


def _left_out(run: Run, model: str) -> list[str]:
    """Columns of the table of frequencies that a model has nothing for."""
    absent = [variant for variant in SHOWN if variant not in run.shown_variants(model)]
    return [column for variant in absent for column in (variant, f"{variant}_error")]


def _judgement(run: Run, model: str) -> str:
    """How the model's validation ended, in a sentence."""
    rows = read_table(run.folder / "validation" / "tables" / f"{model}-criteria.json").rows
    return headline(len(rows), sum(row["verdict"] != "met" for row in rows))
