"""The report: one HTML page that carries its figures, tables and style within itself."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from markupsafe import Markup

from workflow.report.conditions import LABELS
from workflow.report.convergence_tables import convergence_sentences
from workflow.report.findings import findings, headline
from workflow.report.numbers import show
from workflow.report.results import Results
from workflow.report.scaling_tables import assumptions
from workflow.report.style import themed
from workflow.report.table import Table, read_table
from workflow.report.tables import BUILDERS
from workflow.variants import SHOWN, TRUTH, VARIANTS

HERE = Path(__file__).parent

FIRST_MODES = 12
"""Elastic modes listed from the first on; beyond them `HIGHER_MODES`."""
HIGHER_MODES = (24, 32, 48, 64, 96, 128, 192, 256)


def render(results: Results) -> str:
    """Build the page from the tables and figures of a run.

    Nothing is computed anew: every number comes from a table, so that page and tables agree.
    """
    tables = {name: read_table(results.folder / "tables" / f"{name}.json") for name in BUILDERS}
    return page_template("report/page.html.j2").render(
        title=results.config["title"],
        variants=VARIANTS,
        shown=SHOWN,
        truth=TRUTH,
        config=results.config,
        tables=tables,
        findings=findings(tables),
        models=[_model(results, tables, model) for model in results.models],
        convergence=[
            {
                "title": results.title(model),
                "figure": inline(results.figure(f"{model}-convergence.svg")),
            }
            for model in results.config["convergence"]["models"]
        ],
        convergence_sentences=convergence_sentences(tables["convergence"]),
        scaling=[
            {
                "name": model,
                "title": results.title(model),
                "plot": inline(results.figure(f"{model}-scaling.svg")),
            }
            for model in results.config["scaling"]["models"]
        ],
        assumptions=assumptions(results.scaling),
        times=inline(results.figure("times.svg")),
        methods=inline(results.figure("methods.svg")) if tables["methods"].rows else "",
    )


def page_template(name: str) -> Template:
    """Template below `workflow`, with the style sheet and the filter `show` that all pages use."""
    environment = Environment(
        loader=FileSystemLoader(HERE.parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["show"] = unbroken
    environment.globals["condition_labels"] = LABELS
    environment.globals["style"] = Markup((HERE / "page.css").read_text())
    return environment.get_template(name)


def inline(path: Path) -> Markup:
    """An SVG file as part of a page, in the page's own colours and font."""
    return Markup(themed(path.read_text(encoding="utf-8")))


def unbroken(value: Any, kind: str = "text") -> str:
    """The number as `show` writes it, with a space before its unit at which no line breaks."""
    text = show(value, kind)
    return text if kind == "text" else text.replace(" ", "\N{NO-BREAK SPACE}")


def _model(results: Results, tables: dict[str, Table], model: str) -> dict[str, Any]:
    description = json.loads(results.figure(f"{model}-mode.json").read_text())
    pictures = [
        {
            "variant": variant,
            "source": picture_uri(results.figure(f"{model}-mode-{variant}.png")),
            **description[variant],
        }
        for variant in SHOWN
    ]
    return {
        "name": model,
        "title": results.title(model),
        "settings": results.config["models"][model],
        "summary": _rows(tables["summary"], model)[0],
        "pictures": pictures,
        "judgement": _judgement(results, model),
        "spectrum": inline(results.figure(f"{model}-spectrum.svg")),
        "frequencies": _listed(_rows(tables["frequencies"], model)),
        "errors": {row["variant"]: row for row in _rows(tables["errors"], model)},
        "evidence": {row["variant"]: row for row in _rows(tables["evidence"], model)},
    }


def _judgement(results: Results, model: str) -> str:
    """How the model's validation ended, in a sentence."""
    rows = read_table(results.folder / "validation" / "tables" / f"{model}-criteria.json").rows
    return headline(len(rows), sum(row["verdict"] != "met" for row in rows))


def _rows(table: Table, model: str) -> list[dict[str, Any]]:
    return [row for row in table.rows if row["model"] == model]


def _listed(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    first = rows[:FIRST_MODES]
    return first + [row for row in rows[FIRST_MODES:] if row["mode"] in HIGHER_MODES]


def picture_uri(path: Path) -> str:
    """A PNG file as a data URI."""
    return f"data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}"
