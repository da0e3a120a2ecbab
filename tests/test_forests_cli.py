"""The commands of forests: results on standard output, mistakes in one line with status 2."""

import json

import pytest

from carillon import cli
from dataset_gen.generate import generate
from dataset_gen.objectives import DEFAULT_OBJECTIVE
from dataset_gen.shards import write_shard
from forests.__main__ import main


def run(*arguments):
    return cli.run("forests", lambda: main([str(a) for a in arguments]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("forests")
    for number in range(2):
        write_shard(folder / f"{number}.h5", generate(1500, 1, number, 2, progress=False))
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
    assert run("table", "--model", folder / "forests.h5", "--blocks", 30, "--json") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert len(rows) == 10
    errors = {(row["range_gpa"][0], row["method"]): row["mean_error_inertial"] for row in rows}
    for low in (0.0, 100.0):
        assert (
            errors[low, f"{DEFAULT_OBJECTIVE}, forests"]
            < errors[low, "Galerkin"]
            < errors[low, "average"]
        )
    assert run("table", "--model", folder / "forests.h5", "--blocks", 5) == 0
    assert f"{DEFAULT_OBJECTIVE}, forests" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("train", "0.h5"),
        ("train", "missing.h5", "--out", "new.h5"),
        ("train", "0.h5", "0.h5", "--out", "new.h5"),
        ("train", "0.h5", "--out", "missing/new.h5"),
        ("train", "0.h5", "--out", "new.h5", "--depth", "0"),
        ("train", "0.h5", "--out", "new.h5", "--transform", "cube"),
        ("train", "0.h5", "--out", "new.h5", "--prior", "-1"),
        ("train", "forests.h5", "--out", "new.h5"),
        ("table", "--model", "0.h5"),
        ("inspect", "0.h5"),
    ],
)
def test_bad_input_is_one_line_and_status_2(folder, arguments, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    assert run(*arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and len(captured.err.splitlines()) == 1
    assert not (folder / "new.h5").exists()
