"""The table of claims, and the one of files that its figures are from."""

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
        finding = measure(results)
        written = TEXTS[name]
        yield {
            "key": name,
            "place": written["place"],
            "claim": texts.from_string(written["claim"]).render(values),
            "measured": finding.text,
            "verdict": finding.verdict,
            "why": written["why"],
            "files": ", ".join(finding.files),
        }


def printed(paper: dict[str, Any]) -> dict[str, Any]:
    """What the texts of claims say of the paper's numbers."""
    times = paper["times"].values()
    values = {"all_": [row["all"] for row in times]}
    for name, prefix in {"all": "", "ddfem": "ddfem_", "hcms_ec": "hcms_ec_"}.items():
        values[prefix] = [row["arpack"] / row[name] for row in times]
    ends = {"least": min, "most": max}
    return {
        "paper": paper["blocks"],
        "factor": paper["blocks"]["average"]["error"] / paper["blocks"]["forests"]["error"],
        "times": {f"{of}{end}": f(values[of]) for of in values for end, f in ends.items()},
    }


@table(
    Column("solid", "Solid"),
    Column("paper_unknowns", "Paper: unknowns", "count"),
    Column("paper_arpack", "ARPACK", "seconds"),
    Column("paper_all", "DDFEM* + HCMS + EC", "seconds"),
    Column("paper_ratio", "Speed-up", "times"),
    Column("unknowns", "Here: unknowns", "count", source="dof_fine"),
    Column("slepc", "SLEPc", "seconds"),
    Column("cold_seconds", "cold", "seconds", source="ddfem_ec"),
    Column("warm_seconds", "warm", "seconds", source="ddfem_ec_warm"),
    Column("cold", "Speed-up, cold", "times"),
    Column("warm", "warm", "times"),
    Column("error", "Frequencies, rms", "percent", source="ddfem_error"),
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
            "note": "" if row else "not timed here" if "here" in printed_row else NO_MESH,
        }


def _measured(row: Row) -> Row:
    row = dict.fromkeys(("ddfem_ec", "ddfem_ec_warm", "ddfem_error")) | row
    times = {"cold": row["ddfem_ec"], "warm": row["ddfem_ec_warm"]}
    return row | {key: row["slepc"] / time if time else None for key, time in times.items()}


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
        row = {"file": name, "command": _command(name), "commit": None, "date": None}
        conditions = results.read[name].conditions
        machine = conditions and "{processor} ({compiled_for})".format(**conditions)
        yield {**row, **(conditions or {}), "machine": machine}
    for name, row in results.kept.items():
        record = row["provenance"]
        machine = f"{record['processor']} ({record['compiled_for']})"
        about = {"file": f"{MEASURED.name}: {name}", "date": record["date"][:10]}
        yield {**record, **about, "machine": machine}


def _command(name: str) -> str:
    if f"/{FULL}/" in name:
        name = f"{FULL}/"
    return next(command for start, command in COMMANDS.items() if name.startswith(start))
