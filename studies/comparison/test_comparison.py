"""Two folders of results side by side: what moved, what differs, and what one of them lacks."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from studies.base.conditions import Repeats, conditions
from studies.base.table import Column, Table, read_csv_table, write_table
from studies.comparison.comparison import Comparison, compare
from studies.comparison.folders import read_folder
from studies.comparison.noise import SAME, Value, verdict
from studies.comparison.reference import write_reference
from tests.pages import Page, assert_self_contained
from tests.workflow_runs import CHECKOUT, TINY
from workflow.__main__ import main

CONFIG = {"title": "A run", "results_dir": "a", "mesh_folder": "m", "solver": {"modes": 30}}
RECORD = {
    "processor": "A processor",
    "cores": 2,
    "memory_bytes": 8e9,
    "ranks": "1",
    "threads": 2,
    "blas": "openblas 0.3",
    "versions": json.dumps({"numpy": "1.26", "scipy": "1.17"}),
    "commit": "abc",
    "date": "2026-01-30T10:00:00+00:00",
}


def spreads(**changes: float) -> Table:
    """Times of two methods on a solid; `changes` are factors by method."""
    rows = []
    for method, seconds in (("SLEPc", 4.0), ("HCMS", 1.0)):
        ends = {"": 1.0, "_min": 0.9, "_max": 1.2}
        scaled = seconds * changes.get(method, 1.0)
        times = {f"seconds{end}": scaled * factor for end, factor in ends.items()}
        rows.append({"model": "bell", "method": method, **times, "error": 0.02})
    return Table(
        "spreads",
        "Times.",
        [
            Column("model", "Solid"),
            Column("method", "Method"),
            *(Column(f"seconds{end}", "Time", "seconds", "s") for end in ("", "_min", "_max")),
            Column("error", "Error", "percent"),
        ],
        rows,
        ["model", "method"],
    )


def write(
    folder: Path, *tables: Table, config: dict = CONFIG, record: dict = RECORD, part: str = "tables"
) -> Path:
    """A folder of results with these tables, all measured under the same conditions."""
    (folder / part).mkdir(parents=True)
    shared = conditions({"bell": record}, config, Repeats("5", "in columns"))
    for table in tables:
        write_table(replace(table, conditions=shared), folder / part)
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    return folder


def compared(before: Path, now: Path) -> Comparison:
    return compare(read_folder(before), read_folder(now))


def run(*arguments: object) -> int:
    return main(["compare", *map(str, arguments)])


@pytest.fixture
def before(tmp_path):
    return write(tmp_path / "before", spreads())


def test_equal_folders_have_not_moved(before, tmp_path, capsys):
    now = shutil.copytree(before, tmp_path / "now")
    comparison = compared(before, now)
    assert len(comparison.cells) == 4 and comparison.moved.empty
    assert comparison.only_before == comparison.only_now == []
    assert run(before, now, "--fail-on-move", "--out", tmp_path / "out") == 0
    assert "4 numbers compared: none moved" in capsys.readouterr().out
    assert "are the same." in (tmp_path / "out" / "comparison.html").read_text()


def test_a_slowed_method_is_slower_and_a_faster_one_faster(before, tmp_path, capsys):
    now = write(tmp_path / "now", spreads(HCMS=1.5, SLEPc=0.5))
    cells = compared(before, now).moved
    moved = dict(zip(cells["row"], cells["verdict"]))
    assert moved == {"bell, SLEPc": "faster", "bell, HCMS": "slower"}
    assert run(before, now) == 0
    output = capsys.readouterr().out
    assert "1 slower, 1 faster" in output
    assert "slower: tables/spreads, bell, HCMS, Time: 1.00 s (0.90 s … 1.20 s) -> " in output
    assert run(before, now, "--fail-on-move") == 1
    assert run(now, before, "--fail-on-move") == 1
    assert run(before, write(tmp_path / "better", spreads(HCMS=0.5)), "--fail-on-move") == 0


def test_moves_within_the_spread_are_noise(before, tmp_path):
    assert compared(before, write(tmp_path / "now", spreads(HCMS=1.25, SLEPc=0.8))).moved.empty


@pytest.mark.parametrize(
    ("kind", "old", "new", "expected"),
    [
        ("seconds", Value(1.0), Value(1.4), SAME),
        ("seconds", Value(1.0), Value(1.6), "slower"),
        ("seconds", Value(0.01), Value(0.1), SAME),
        ("seconds", Value(1.0, 0.99, 1.01), Value(1.08, 1.07, 1.09), SAME),
        ("times", Value(4.0, 3.9, 4.1), Value(3.0, 2.9, 3.1), "slower"),
        ("times", Value(4.0), Value(1.0), SAME),
        ("percent", Value(0.03), Value(0.0302), SAME),
        ("percent", Value(-0.03), Value(0.04), "less accurate"),
        ("percent", Value(2e-7), Value(5e-7), SAME),
        ("percent", Value(2e-7), Value(8e-7), "less accurate"),
        ("small", Value(1e-14), Value(8e-10), SAME),
        ("small", Value(1e-14), Value(1e-6), "less accurate"),
        ("angle", Value(1.2), Value(0.3), "more accurate"),
        ("score", Value(0.99), Value(0.98), "less accurate"),
        ("bytes", Value(1000), Value(2000), "larger"),
        ("hertz", Value(440.0), Value(441.0), "changed"),
        ("count", Value(7), Value(8), "changed"),
        ("text", Value("30 / 30"), Value("29 / 30"), "changed"),
        ("percent", Value(None), Value(0.1), "new"),
        ("percent", Value(0.1), Value(None), "gone"),
        ("percent", Value(float("nan")), Value(float("nan")), SAME),
    ],
)
def test_every_kind_of_number_has_its_own_noise(kind, old, new, expected):
    assert verdict(kind, old, new) == expected


def test_rows_columns_and_tables_of_one_side_are_listed(before, tmp_path, capsys):
    table = spreads()
    fewer = replace(table, rows=table.rows[:1], columns=table.columns[:-1])
    other = replace(table, name="other")
    now = write(tmp_path / "now", fewer, other)
    comparison = compared(before, now)
    assert comparison.only_now == ["table tables/other"]
    assert "tables/spreads: row bell, HCMS" in comparison.only_before
    assert "tables/spreads: column error" in comparison.only_before
    assert run(before, now) == 0
    assert "Only in this run: 1, such as table tables/other" in capsys.readouterr().out


def test_conditions_and_keys_that_differ_come_first(before, tmp_path):
    config = CONFIG | {"results_dir": "elsewhere", "solver": {"modes": 40}}
    versions = json.dumps({"numpy": "2.0", "scipy": "1.17"})
    record = RECORD | {"processor": "Another", "versions": versions, "commit": "def"}
    now = write(tmp_path / "now", spreads(HCMS=2.0), config=config, record=record)
    assert run(before, now, "--out", tmp_path / "out") == 0
    text = (tmp_path / "out" / "comparison.md").read_text()
    for line in (
        "| Processor | A processor | Another |",
        "| numpy | 1.26 | 2.0 |",
        "| Commit | abc | def |",
        "| solver.modes | 30 | 40 |",
    ):
        assert line in text and text.index(line) < text.index("| slower |")
    assert "scipy" not in text and "results_dir" not in text
    assert "Not the same: Processor;" in text


def test_the_reference_that_is_kept_names_no_folder_of_a_machine():
    for file in (CHECKOUT / "results" / "reference").rglob("*.*"):
        assert not re.search(r"(^|[\s,=\"'])/\w+/", file.read_text(), re.MULTILINE), file


def test_a_reference_of_text_serves_as_baseline(tmp_path):
    results = write(tmp_path / "results", spreads())
    write(tmp_path / "other", spreads(), part="paper/tables")
    shutil.copytree(tmp_path / "other" / "paper", results / "paper")
    write_table(replace(spreads(), name="times"), results / "tables")
    (results / "benchmarks" / "models").mkdir(parents=True)
    (results / "benchmarks" / "models" / "bell.tsv").write_text("s\th:m:s\n2.5\t0:00:02\n")
    write_reference(results, "generic")
    reference = results / "reference" / "generic"
    assert not list(reference.rglob("*.json"))
    assert "| models | 2.50 s |" in (reference / "README.md").read_text()
    assert (reference / "tables" / "times.md").is_file()
    comparison = compared(reference, results)
    assert len(comparison.cells) == 12 and comparison.moved.empty and not comparison.only_now
    slower = write(tmp_path / "slower", spreads(HCMS=1.5))
    assert list(compared(reference, slower).moved["verdict"]) == ["slower"]
    assert list(compared(slower, reference).moved["verdict"]) == ["faster"]


def test_all_forms_say_the_same(before, tmp_path, capsys):
    now = write(tmp_path / "now", spreads(HCMS=1.5))
    out = tmp_path / "out"
    assert run(before, now, "--json", "--out", out) == 0
    (moved,) = json.loads(capsys.readouterr().out)["moved"]
    assert (moved["row"], moved["verdict"], moved["now"]) == ("bell, HCMS", "slower", 1.5)
    rows = read_csv_table(out / "comparison.csv").rows
    assert [row["verdict"] for row in rows].count("slower") == 1 and len(rows) == 4
    page = Page(out / "comparison.html")
    assert_self_contained(page)
    assert page.tables["tables/spreads-moved"][-1][2][0] == "slower"
    assert (
        "| bell, HCMS | Time | slower | 1.00 s (0.90 s … 1.20 s) | 1.50 s"
        in (out / "comparison.md").read_text()
    )


def test_folders_that_cannot_be_compared_are_answered_in_a_sentence(before, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    unlike = write(tmp_path / "unlike", replace(spreads(), name="other"))
    broken = write(tmp_path / "broken", spreads())
    (broken / "tables" / "spreads.json").write_text('{"name": "spreads"}')
    for folder, said in (
        (tmp_path / "nowhere", "there is no such folder"),
        (tmp_path / "empty", "holds no tables"),
        (unlike, "have no table and row in common"),
        (broken, "is no table of this version"),
    ):
        assert run(before, folder) == 2
        output = capsys.readouterr().err
        assert said in output and str(folder) in output and "Traceback" not in output


def test_the_target_wants_a_baseline_before_anything_runs(dry_run, tmp_path):
    words = ["compare", "--cores", 1, "--configfile", TINY]
    done = dry_run(tmp_path, *words, "--config", "baseline=nowhere")
    assert done.returncode != 0
    assert "baseline: nowhere: there is no such folder" in done.stdout + done.stderr
    done = dry_run(tmp_path, *words)
    assert done.returncode != 0
    assert "baseline: names no folder" in done.stdout + done.stderr
