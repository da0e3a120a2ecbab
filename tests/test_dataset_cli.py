"""The commands of dataset_gen: results on standard output, mistakes in one line with status 2."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from dataset_gen.__main__ import main
from dataset_gen.commands import generate as program
from dataset_gen.commands import inspect as summary
from dataset_gen.generate import generate
from dataset_gen.objectives import DEFAULT_OBJECTIVE, OBJECTIVES
from dataset_gen.objectives.quadratic import MODULUS_FLOOR
from dataset_gen.settings import ShardOptions
from dataset_gen.shards import iterate_shard
from tests.shard_files import write_shard


def run(*arguments):
    return main([str(a) for a in arguments])


def test_generate_then_inspect(tmp_path, capsys):
    out = tmp_path / "a.h5"
    assert run("generate", "--samples", 40, "--seed", 1, "--out", out) == 0
    captured = capsys.readouterr()
    assert captured.out == "" and len(captured.err.splitlines()) == 1
    assert "training rows/s" in captured.err and "peak memory" in captured.err
    assert run("inspect", out, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["samples"] == [0, 40] and found["objective"] == DEFAULT_OBJECTIVE
    assert found["converged"] == 1.0 and found["failures"] == 0
    assert run("inspect", out) == 0
    captured = capsys.readouterr()
    assert "samples 0..39 of seed 1" in captured.out
    assert "training rows/s" in captured.err


def test_inspect_counts_what_is_there(tmp_path, capsys):
    shard = generate(ShardOptions(2990, 7, distribution="log-uniform"), progress=False)
    converged = shard.converged.copy()
    converged[:299] = False
    write_shard(tmp_path / "a.h5", replace(shard, converged=converged))
    found = summary.describe(tmp_path / "a.h5")
    filled = shard.fine[shard.fine > 0]
    middle = np.quantile(shard.residual, 0.5, method="lower")
    assert found["samples"] == [0, 2990] and found["distribution"] == "log-uniform"
    assert found["range"] == [0.01, 1000.0]
    assert (found["smallest_modulus"], found["largest_modulus"]) == (filled.min(), filled.max())
    assert found["smallest_coarse_modulus"] == shard.coarse.min()
    assert found["largest_coarse_modulus"] == shard.coarse.max()
    assert found["failures"] == 299 and found["converged"] == 0.9
    assert found["partly_void"] == (shard.fine == 0).any(axis=1).mean()
    assert abs(found["median_residual"] - middle) <= summary.RESIDUAL_STEP
    floor = MODULUS_FLOOR * shard.fine.max(axis=1, keepdims=True)
    assert found["at_floor"] == (shard.coarse <= floor * (1 + 1e-9)).mean()
    assert "did not converge 299 (10.00%)" in summary.as_text(found)


def test_inspect_does_not_depend_on_the_pieces(tmp_path, monkeypatch):
    write_shard(tmp_path / "a.h5", generate(ShardOptions(3000, 7), progress=False))
    whole = summary.describe(tmp_path / "a.h5")
    monkeypatch.setattr(summary, "iterate_shard", partial(iterate_shard, rows=170))
    assert summary.describe(tmp_path / "a.h5") == whole


def test_generate_again_does_nothing_and_otherwise_is_refused(tmp_path, capsys):
    command = ("generate", "--samples", 40, "--out", tmp_path / "a.h5")
    assert run(*command) == 0
    capsys.readouterr()
    assert run(*command, "--workers", 2) == 0
    assert "nothing to do" in capsys.readouterr().err
    assert run(*command, "--distribution", "log-uniform") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "exists with distribution uniform where log-uniform is asked for" in line


def test_an_interrupt_is_a_line_and_the_same_command_goes_on(tmp_path, capsys, monkeypatch):
    def interrupted(plan, tasks):
        yield plan.work(0)
        raise KeyboardInterrupt

    monkeypatch.setattr(program, "engine_of", lambda workers: interrupted)
    command = ("generate", "--samples", 9000, "--objective", "inertial", "--out", tmp_path / "a.h5")
    assert run(*command) == 130
    assert "goes on from here" in capsys.readouterr().err
    monkeypatch.undo()
    assert run(*command) == 0
    assert "going on after 8,192 of 9,000 samples" in capsys.readouterr().err


def test_one_shard_of_very_many_samples_is_made(tmp_path):
    many = ("--samples", 10**18, "--shards", 10**17, "--shard", 10**16)
    assert run("generate", *many, "--objective", "inertial", "--out", tmp_path / "a.h5") == 0
    assert summary.describe(tmp_path / "a.h5")["samples"] == [10**17, 10**17 + 10]


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr("studies.fits.measure.RUNS", 2)
    monkeypatch.setattr("studies.fits.measure.MATRIX", 64)


def test_benchmark_reports_every_objective(capsys, quick):
    assert run("benchmark", "--samples", 8, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["objective"] == DEFAULT_OBJECTIVE
    assert set(found["fits_per_second"]) == {"closed_form", "sampled"}
    assert set(found["objectives"]) == set(OBJECTIVES)
    assert found["rows_per_fit"] == 8 and found["threads"] == 1 and found["samples"] == 8
    rates = found["fits_per_second"]
    assert rates["closed_form"] == found["objectives"][DEFAULT_OBJECTIVE]
    assert found["speedup"] == rates["closed_form"] / rates["sampled"]
    for name in ("closed_form", "sampled"):
        least, largest = found["spread"][name]
        assert 0 < least <= rates[name] <= largest
    assert found["flops_per_fit"] > 1e5
    assert found["gflops"] == pytest.approx(1e-9 * found["flops_per_fit"] * rates["closed_form"])
    assert found["peak_fraction"] == found["gflops"] / found["gflops_peak"]
    assert found["gflops_dgemm"] > 0 and found["processor"]


def test_benchmark_of_one_objective_as_text_and_iterative_without_operations(capsys, quick):
    assert run("benchmark", "--samples", 8, "--objective", "inertial") == 0
    text = capsys.readouterr().out
    assert "inertial" in text and "operations per fit" in text and "oversampled" not in text
    assert run("benchmark", "--samples", 8, "--objective", "energy", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["objectives"]) == ["energy"] and found["objective"] == "energy"
    assert found["flops_per_fit"] is None and found["peak_fraction"] is None
