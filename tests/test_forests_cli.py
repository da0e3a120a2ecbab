"""The commands of forests: results on standard output."""

import json

import pytest

from dataset_gen.generate import generate
from dataset_gen.objectives import DEFAULT_OBJECTIVE
from dataset_gen.settings import ShardOptions
from forests.__main__ import main
from tests.shard_files import write_shard


def run(*arguments):
    return main([str(a) for a in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("forests")
    for number in range(2):
        write_shard(
            folder / f"{number}.h5", generate(ShardOptions(1500, 1, number, 2), progress=False)
        )
    shards = [folder / "0.h5", folder / "1.h5"]
    assert run("train", *shards, "--trees", 2, "--out", folder / "forests.h5") == 0
    return folder


def test_inspect_tells_what_was_trained(folder, capsys):
    assert run("inspect", folder / "forests.h5", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["trees"] == 2 and found["objective"] == DEFAULT_OBJECTIVE
    assert found["scores"]["training_samples"] == 1425
    assert run("inspect", folder / "forests.h5") == 0
    assert "2 x 2 trees" in capsys.readouterr().out


def test_table_compares_every_method_inside_and_outside_the_trained_range(folder, capsys):
    few = ("--model", folder / "forests.h5", "--blocks", 30, "--materials", 2)
    assert run("table", *few, "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    for range_gpa in ([0.0, 10.0], [100.0, 10_000.0]):
        error = {
            row["method"]: row["mean_error_inertial"]
            for row in rows
            if row["range_gpa"] == range_gpa
            and row["fill"] == "solid"
            and row["distribution"] == "uniform"
            and row["scaled_by"] == 1
        }
        assert error[f"{DEFAULT_OBJECTIVE}, forests"] < error["Galerkin"] < error["average"]
    assert run("table", *few) == 0
    assert f"{DEFAULT_OBJECTIVE}, forests" in capsys.readouterr().out


def test_a_result_is_kept_with_its_provenance(folder, tmp_path):
    few = ("--model", folder / "forests.h5", "--blocks", 5, "--materials", 2)
    out = tmp_path / "table.json"
    assert run("table", *few, "--out", out) == 0
    found = json.loads(out.read_text())
    assert found["result"][0]["method"] == "average"
    wanted = {"commit", "config_hash", "processor", "cores", "memory_bytes", "threads", "date"}
    assert wanted <= found["provenance"].keys()
    assert run("table", *few, "--out", tmp_path / "nowhere" / "table.json") == 2


def test_variants_are_compared_under_equal_storage(folder, capsys):
    few = ("--max-leaves", 60, "--min-leaf", 10)
    names = ("logarithms, linear splits", "ratios, variance splits (paper)", "the same, 1 tree")
    only = [word for name in names for word in ("--only", name)]
    assert run("variants", folder / "0.h5", folder / "1.h5", *few, *only, "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["variant"] for row in rows] == list(names)
    assert all(100 < row["leaves"] <= 6 * 60 for row in rows)
    ours, paper, _ = (row["scores"]["uniform 0..10 GPa"]["r2_log"] for row in rows)
    assert ours > paper


def test_learning_curve_falls_with_the_rows(folder, capsys):
    shards = (folder / "0.h5", folder / "1.h5")
    plot = folder / "curve.svg"
    assert run("curve", *shards, "--rows", "1e3,1e4", "--plot", plot, "--json") == 0
    few, more = json.loads(capsys.readouterr().out)
    assert (few["rows"], more["rows"]) == (1008, 10_000)
    errors = [row["scores"]["uniform 0..10 GPa"]["rms_log_solid"] for row in (few, more)]
    assert errors[1] < errors[0]
    assert plot.stat().st_size > 1000
    assert run("curve", *shards, "--rows", "1e3") == 0
    assert "rms error of log E" in capsys.readouterr().out


def test_forests_of_a_curve_are_kept_and_taken_up(tmp_path, capsys):
    data = ("--samples", 1000, "--rows", "2e3,8e3", "--folder", tmp_path / "curve")
    assert run("curve", *data, "--json") == 0
    first = json.loads(capsys.readouterr().out)
    assert sorted(path.name for path in (tmp_path / "curve").iterdir()) == [
        "forests-2000.h5",
        "forests-8000.h5",
    ]
    assert run("curve", *data, "--json") == 0
    assert json.loads(capsys.readouterr().out) == first
    assert run("curve", *data, "--min-leaf", 20) == 2
    assert "min_leaf 30 where 20 is asked for" in capsys.readouterr().err
