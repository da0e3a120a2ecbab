"""The paper's claims: every one is measured, and verdicts follow from the tables."""

import pytest
import yaml

from studies.base.table import Column, Table, read_csv_table, write_table
from studies.claims.findings import IN_PART, LESS, NOT, REPRODUCED, UNMEASURED, Finding
from studies.claims.measures import MEASURES
from studies.claims.results import REFERENCE, Claims
from studies.claims.study import CLAIMS
from studies.claims.tables import TEXTS
from tests.workflow_runs import CHECKOUT

KEPT = CHECKOUT / REFERENCE
STRIKE = {"method": "DDFEM* + HCMS + EC", "difference": 0.4, "distance_decibels": 3.0}
EXACT = {"method": "HCMS + EC", "difference": 1e-6, "distance_decibels": 1e-5}


def table(name: str, rows: list[dict]) -> Table:
    keys = dict.fromkeys(key for row in rows for key in row)
    return Table(name, "", [Column(key, key) for key in keys], rows)


@pytest.fixture
def run(tmp_path):
    """Folder of a run of one solid; the tables that the reference has are its own."""
    validation = tmp_path / "validation" / "tables"
    for folder in (tmp_path / "tables", validation):
        folder.mkdir(parents=True)
    (tmp_path / "config.yaml").write_text(yaml.safe_dump({"models": {"bell": {"title": None}}}))
    for name in ("blocks", "training", "convergence", "methods"):
        kept = read_csv_table(KEPT / "tables" / f"{name}.csv")
        write_table(kept, tmp_path / "tables")
    write_table(table("design", [{"cold": 12.0, "warm": 90.0}]), tmp_path / "tables")
    shapes = [{"method": "HCMS", "likeness": 0.99}, {"method": "HCMS + EC", "likeness": 1.0}]
    write_table(table("bell-shapes", shapes), validation)
    write_table(table("bell-responses", [EXACT, STRIKE]), validation)
    return tmp_path


def found(run, name: str) -> Finding:
    return MEASURES[name](Claims(run / CLAIMS.folder))


def changed(run, name: str, change) -> None:
    """Change the rows of a table of the run."""
    part = "validation/tables" if "bell" in name else "tables"
    before = Claims(run / CLAIMS.folder)._table(run / part / f"{name}.json")
    for row in before.rows:
        change(row)
    write_table(before, run / part)


def test_every_claim_is_measured_and_told():
    assert list(MEASURES) == list(TEXTS)
    for text in TEXTS.values():
        assert set(text) == {"place", "claim", "why"}


def test_the_reference_tells_what_the_paper_s_averaging_comes_to(run):
    blocks = found(run, "blocks")
    assert blocks.verdict == NOT
    assert "0.796" in blocks.text and "0.636" in blocks.text
    total = found(run, "total")
    assert "26× to 53× cold, 118× to 234× warm" in total.text
    assert total.verdict != REPRODUCED
    assert found(run, "each").verdict == NOT
    for name in ("shapes", "scaling", "convergence", "interactive"):
        assert found(run, name).verdict == REPRODUCED, name
    for name in ("storage", "training"):
        assert found(run, name).verdict == LESS, name


def test_verdicts_follow_the_tables(run):
    def better(row):
        if row["method"].endswith(", forests"):
            row["kind0_nodal"] = 0.796 / 914
            row["kind1_nodal"] = 0.5

    changed(run, "blocks", better)
    assert found(run, "blocks").verdict == REPRODUCED
    assert found(run, "scaling").verdict == NOT
    folder = run / "validation" / "tables"
    for difference, verdict in ((0.05, REPRODUCED), (0.4, IN_PART), (1.2, NOT)):
        rows = [EXACT, {**STRIKE, "difference": difference}]
        write_table(table("bell-responses", rows), folder)
        assert found(run, "response").verdict == verdict
    changed(run, "bell-shapes", lambda row: row.update(likeness=0.8))
    assert found(run, "shapes").verdict == NOT
    changed(run, "design", lambda row: row.update(warm=1200.0))
    assert found(run, "total").verdict == IN_PART


def test_what_a_run_did_not_measure_is_said(run, monkeypatch):
    monkeypatch.setattr("studies.claims.results.REFERENCE", "absent")
    monkeypatch.setattr(Claims, "kept", {})
    for name in ("convergence", "methods", "design"):
        empty = Table(name, "", [Column("model", "Solid")])
        write_table(empty, run / "tables")
    for name in ("convergence", "total", "each", "interactive"):
        assert found(run, name).verdict == UNMEASURED
    write_table(table("bell-responses", [EXACT]), run / "validation" / "tables")
    assert found(run, "response").verdict == UNMEASURED


def test_the_page_names_the_dragons_and_what_made_each_table(run):
    claims = Claims(run / CLAIMS.folder)
    tables = CLAIMS.made(claims)
    text = CLAIMS.build(claims, tables)
    assert "Asian Dragon, Chinese Dragon" in text
    assert "This run has no scene from both" in text
    commands = {row["file"]: row["command"] for row in tables["sources"].rows}
    assert commands["tables/blocks.json"].startswith("snakemake")
    assert commands[f"{REFERENCE}/paper/tables/methods.csv"] == "snakemake figures"
    assert all(row["command"] for row in tables["sources"].rows)
    read = {file for row in tables["claims"].rows for file in row["files"].split(", ")}
    known = {file.replace("bell-", "MODEL-") for file in commands} | {"measured.json"}
    assert read <= known


def test_a_scene_from_both_modes_is_shown_where_it_is(run):
    write_table(
        table("scene_spectra", [{"title": "coarse", "distance_decibels": 2.5}]), run / "tables"
    )
    claims = Claims(run / CLAIMS.folder)
    tables = CLAIMS.made(claims)
    assert 'data-table="scene_spectra"' in CLAIMS.build(claims, tables)
    assert "coarse 2.5 dB" in found(run, "scene").text
    sources = {row["file"]: row["command"] for row in tables["sources"].rows}
    assert sources["tables/scene_spectra.json"] == "snakemake scene_spectra"
