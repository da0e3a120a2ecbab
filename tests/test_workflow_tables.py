"""Benchmark tables: their conditions in every form, and CSV files that programs can read."""

import csv
import json
from types import SimpleNamespace

import pytest

from carillon.processes.memory import memory_bytes
from carillon.records.measurement import measured
from studies.base.conditions import LABELS, ONE_COLD_RUN, Conditions, conditions
from studies.base.numbers import MISSING
from studies.base.table import Column, Table, read_csv_table, read_table, write_table
from workflow import settings
from workflow.report.study import REPORT

CONFIG = {
    "title": "A run",
    "results_dir": "results",
    "mesh_folder": "meshes",
    "solver": {"modes": 30},
}


def record(**changes) -> dict:
    """Provenance of a measurement."""
    return measured({"modes": 30}, ranks=2, threads=1) | changes


def table(shared: Conditions | None) -> Table:
    return Table(
        "demo",
        "What it shows.",
        [
            Column("model", "Solid"),
            Column("mode", "Mode", "count"),
            Column("seconds", "Time", "seconds", "s"),
            Column("value", "Value"),
            Column("value_kind", "Kind", shown=False),
        ],
        [
            {
                "model": "bell #1, big",
                "mode": 7,
                "seconds": 0.5,
                "value": 0.25,
                "value_kind": "share",
            },
            {"model": "bar", "mode": 8, "seconds": None, "value": "none", "value_kind": "text"},
        ],
        ["model", "mode"],
        shared,
    )


SHARED = conditions({"bell": record(), "bar": record()}, CONFIG, ONE_COLD_RUN)


def test_a_measurement_tells_machine_ranks_threads_and_date():
    measurement = record()
    assert (
        measurement["memory_bytes"] > 1e8
        and measurement["threads"] == 1
        and measurement["ranks"] == "2"
    )
    assert measurement["date"].endswith("+00:00")
    assert measured({}, ranks=[1, 2, 4])["ranks"] == "1, 2, 4"


def test_memory_is_what_the_control_group_allows(tmp_path):
    limit = tmp_path / "memory.max"
    limit.write_text("1000000\n")
    assert memory_bytes(limit) == 1_000_000
    limit.write_text("max\n")
    assert memory_bytes(limit) == memory_bytes(tmp_path / "absent") > 1e8


def test_conditions_that_all_rows_share_are_told_once():
    assert SHARED is not None and not SHARED["differing"]
    assert MISSING not in SHARED.texts.values()
    assert set(SHARED.texts) == set(LABELS) - {"differing"}
    assert SHARED["configuration"] == settings.config_hash(CONFIG)


def test_conditions_that_differ_between_rows_are_said_to():
    records = {
        "bell": record(date="2026-01-30T10:00:00+00:00"),
        "bar": record(processor="Another", date="2026-02-01T10:00:00+00:00"),
    }
    differing = conditions(records, CONFIG, ONE_COLD_RUN)
    assert differing["differing"] == "processor"
    assert "(bell); Another (bar)" in differing["processor"]
    assert "not the same for all rows: processor" in differing.headline
    assert differing["date"] == "2026-01-30 to 2026-02-01"


def test_no_results_no_conditions():
    assert conditions({}, CONFIG, ONE_COLD_RUN) is None


def test_the_hash_of_a_configuration_does_not_depend_on_folders():
    elsewhere = CONFIG | {"results_dir": "x", "mesh_folder": "y", "baseline": "z"}
    assert settings.config_hash(elsewhere) == settings.config_hash(CONFIG)
    assert settings.config_hash(CONFIG | {"solver": {"modes": 31}}) != settings.config_hash(CONFIG)
    assert "baseline" not in settings.resolved(elsewhere)


@pytest.mark.parametrize("shared", [SHARED, None])
def test_a_table_survives_its_files(tmp_path, shared):
    write_table(table(shared), tmp_path)
    assert read_table(tmp_path / "demo.json") == table(shared)
    read = read_csv_table(tmp_path / "demo.csv")
    assert (read.rows, read.keys, read.conditions) == (
        table(shared).rows,
        ["model", "mode"],
        shared,
    )
    assert [column.kind for column in read.columns] == [c.kind for c in table(shared).columns]


def test_conditions_stand_in_every_form(tmp_path):
    write_table(table(SHARED), tmp_path)
    markdown = (tmp_path / "demo.md").read_text()
    assert (
        json.loads((tmp_path / "demo.json").read_text())["conditions"]["commit"] == SHARED["commit"]
    )
    lines = (tmp_path / "demo.csv").read_text().splitlines()
    for key, text in SHARED.texts.items():
        assert f"# {key}: {text}" in lines
        assert f"{LABELS[key]}: {text}" in markdown


def test_programs_skip_what_the_csv_file_says_about_itself(tmp_path):
    write_table(table(SHARED), tmp_path)
    with (tmp_path / "demo.csv").open() as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    assert [row["seconds [s]"] for row in rows] == ["0.5", ""]
    assert rows[0]["model"] == "bell #1, big"
    assert (tmp_path / "demo.csv").read_text().startswith("# keys: model, mode\n# kinds: text, ")


def test_pandas_reads_the_csv_file(tmp_path):
    pandas = pytest.importorskip("pandas")
    write_table(table(SHARED), tmp_path)
    frame = pandas.read_csv(tmp_path / "demo.csv", comment="#")
    assert list(frame["mode"]) == [7, 8]


def test_scaling_keeps_the_slowest_run_beside_the_fastest():
    run = {"ranks": 2, "n_dofs": 900, "subdomains": 4, "seconds": 1.0, "slowest_seconds": 1.5}
    run |= {"repeats": 3, "oversubscribed": False, "cores": 2, "peak_memory_bytes": [5.0, 7.0]}
    modelled = {"ranks": 4, "n_dofs": 900, "subdomains": 4, "total": 0.6}
    beside = {**modelled, "ranks": 2, "total": 0.8}
    model = {"rows": [beside, modelled], "fit": "The model differs by up to 20%."}
    bell = {"strong": {"runs": [run], "model": model}, "weak": None, "provenance": {}}
    results = SimpleNamespace(scaling={"bell": bell}, titles={"bell": "A bell"}, config=CONFIG)
    table = REPORT.entries["scaling"](results)
    measured_row, modelled_row = table.rows
    assert (measured_row["measured"], measured_row["measured_max"]) == (1.0, 1.5)
    assert measured_row["peak_memory"] == 7.0 and measured_row["note"] == "measured"
    assert modelled_row.get("measured") is None and modelled_row["modelled"] == 0.6
    assert measured_row["misfit"] == pytest.approx(-0.2) and modelled_row["misfit"] is None
    assert "A bell, strong scaling: The model differs by up to 20%." in table.caption
    assert table.conditions["runs"].startswith("3")
