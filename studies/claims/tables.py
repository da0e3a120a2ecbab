"""The table of claims, and the one of files that its figures are from."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from carillon.files.yaml_input import read_own_yaml
from studies.base.numbers import show
from studies.base.table import Column, Row, hidden, table
from studies.claims.measures import MEASURES
from studies.claims.results import FULL, MEASURED, SCENE_TABLE, Claims

TEXTS: dict[str, dict[str, str]] = read_own_yaml(Path(__file__).with_name("claims.yaml"))
NO_MESH = "mesh not at hand"
COMMANDS = {
    f"{FULL}/": "snakemake figures",
    SCENE_TABLE: "snakemake scene_spectra",
    "results/reference/": "snakemake reference",
    "validation/": "snakemake (make run)",
    "tables/": "snakemake (make run)",
}
"""Commands that make a file, by the beginning of its name."""


@table(
    hidden("key", "Key"),
    Column("place", "Place"),
    Column("claim", "The paper’s claim"),
    Column("measured", "Measured here"),
    Column("verdict", "Verdict"),
    Column("why", "Why"),
    Column("files", "From"),
)
def claims(results: Claims) -> Iterator[Row]:
    """Figures are read from the tables that are listed below, or from measurements that are kept
    with the command that made them; the paper’s are quoted with their place. In part: something of
    the claim holds, or it was tried on less than the claim says. Less is needed: of what the paper
    says that it costs."""
    texts = Environment(undefined=StrictUndefined)
    texts.filters["show"] = show
    values = printed(results.paper)
    for name, measure in MEASURES.items():
        found = measure(results)
        written = TEXTS[name]
        yield {
            "key": name,
            "place": written["place"],
            "claim": texts.from_string(written["claim"]).render(values),
            "measured": found.text,
            "verdict": found.verdict,
            "why": written["why"],
            "files": ", ".join(found.files),
        }


def printed(paper: dict[str, Any]) -> dict[str, Any]:
    """What the texts of claims say of the paper's numbers."""
    times = paper["times"].values()
    ratios = {
        name: [row["arpack"] / row[name] for row in times] for name in ("all", "ddfem", "hcms_ec")
    }
    alone = [row["all"] for row in times]
    return {
        "paper": paper["blocks"],
        "factor": paper["blocks"]["average"]["error"] / paper["blocks"]["forests"]["error"],
        "times": {
            "least": min(ratios["all"]),
            "most": max(ratios["all"]),
            "ddfem_least": min(ratios["ddfem"]),
            "ddfem_most": max(ratios["ddfem"]),
            "hcms_ec_least": min(ratios["hcms_ec"]),
            "hcms_ec_most": max(ratios["hcms_ec"]),
            "all_least": min(alone),
            "all_most": max(alone),
        },
    }


@table(
    Column("solid", "Solid"),
    Column("paper_unknowns", "Paper: unknowns", "count"),
    Column("paper_arpack", "ARPACK", "seconds"),
    Column("paper_all", "DDFEM* + HCMS + EC", "seconds"),
    Column("paper_ratio", "Speed-up", "times"),
    Column("unknowns", "Here: unknowns", "count"),
    Column("slepc", "SLEPc", "seconds"),
    Column("cold_seconds", "cold", "seconds"),
    Column("warm_seconds", "warm", "seconds"),
    Column("cold", "Speed-up, cold", "times"),
    Column("warm", "warm", "times"),
    Column("error", "Frequencies, rms", "percent"),
    Column("note", "Note"),
)
def solids(results: Claims) -> Iterator[Row]:
    """Times of Fig. 11 as printed, and those measured here on meshes of about the paper’s unknowns.
    Both compute 256 modes in full; the machines are years apart."""
    full = results.in_full("methods") or results.of_run("methods")
    here = {row["model"]: row for row in full.rows}
    for name, printed_row in results.paper["times"].items():
        row = here.get(printed_row.get("here"))
        yield {
            "solid": name,
            "paper_unknowns": printed_row["unknowns"],
            "paper_arpack": float(printed_row["arpack"]),
            "paper_all": float(printed_row["all"]),
            "paper_ratio": printed_row["arpack"] / printed_row["all"],
            **({} if row is None else _measured(row)),
            "note": _note(printed_row, row),
        }


def _note(printed_row: Row, row: Row | None) -> str:
    """Why there are no times of a solid; empty if there are."""
    if row is not None:
        return ""
    return "not timed here" if "here" in printed_row else NO_MESH


def _measured(row: Row) -> Row:
    """What was measured of a solid."""
    cold, warm = row.get("ddfem_ec"), row.get("ddfem_ec_warm")
    slepc = row["slepc"]
    return {
        "unknowns": row["dof_fine"],
        "slepc": slepc,
        "cold_seconds": cold,
        "warm_seconds": warm,
        "cold": slepc / cold if cold else None,
        "warm": slepc / warm if warm else None,
        "error": row.get("ddfem_error"),
    }


@table(
    Column("file", "File"),
    Column("command", "Made by"),
    Column("commit", "Commit"),
    Column("date", "Date"),
    Column("machine", "Processor"),
)
def sources(results: Claims) -> Iterator[Row]:
    """Files that the figures above are read from, below the folder of this run or of the
    checkout."""
    for name in dict.fromkeys(results.read):
        conditions = results.read[name].conditions
        yield {
            "file": name,
            "command": _command(name),
            "commit": conditions.commit if conditions else None,
            "date": conditions.date if conditions else None,
            "machine": f"{conditions.processor} ({conditions.compiled_for})"
            if conditions
            else None,
        }
    for name, row in results.kept.items():
        record = row["provenance"]
        yield {
            "file": f"{MEASURED.name}: {name}",
            "command": record["command"],
            "commit": record["commit"],
            "date": record["date"][:10],
            "machine": f"{record['processor']} ({record['compiled_for']})",
        }


def _command(name: str) -> str:
    if f"/{FULL}/" in name:
        name = f"{FULL}/"
    return next(command for start, command in COMMANDS.items() if name.startswith(start))
