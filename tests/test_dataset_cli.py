"""The commands of dataset_gen: results on standard output, mistakes in one line with status 2."""

import json

import pytest

from carillon import cli
from dataset_gen.__main__ import main


def run(*arguments):
    return cli.run("dataset_gen", lambda: main([str(a) for a in arguments]))


def test_generate_then_inspect(tmp_path, capsys):
    out = tmp_path / "a.h5"
    assert run("generate", "--samples", 40, "--seed", 1, "--out", out) == 0
    capsys.readouterr()
    assert run("inspect", out, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["samples"] == [0, 40] and found["objective"] == "factored"
    assert found["converged"] == 1.0
    assert run("inspect", out) == 0
    assert "samples 0..39 of seed 1" in capsys.readouterr().out


def test_benchmark_reports_every_objective(capsys, monkeypatch):
    monkeypatch.setattr("dataset_gen.objectives.sampled_energy.DIRECTIONS", 50)
    assert run("benchmark", "--samples", 8, "--json") == 0
    rates = json.loads(capsys.readouterr().out)["fits_per_second"]
    assert set(rates) >= {"energy", "energy, sampled", "chen2015", "hybrid", "factored"}
    assert all(rate > 0 for rate in rates.values())


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("generate", "--out", "a.h5"),
        ("generate", "--samples", "many", "--out", "a.h5"),
        ("generate", "--samples", "0", "--out", "a.h5"),
        ("generate", "--samples", "9", "--seed", "-1", "--out", "a.h5"),
        ("generate", "--samples", "9", "--shard", "2", "--shards", "2", "--out", "a.h5"),
        ("generate", "--samples", "9", "--objective", "best", "--out", "a.h5"),
        ("generate", "--samples", "9", "--poisson", "0.5", "--out", "a.h5"),
        ("generate", "--samples", "9", "--workers", "0", "--out", "a.h5"),
        ("generate", "--samples", "9", "--out", "missing/a.h5"),
        ("inspect", "missing.h5"),
        ("benchmark", "--samples", "0"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(*arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and len(captured.err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
