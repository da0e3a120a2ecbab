"""The rule that generates shards hands the configuration on."""

import sys

import pytest

from tests.programs import CHECKOUT, checkout_environment, run

MODELS = "models: {bar: {mesh: 'builtin:bar', resolution: 16}}\n"


@pytest.mark.parametrize(
    ("dataset", "distribution", "expected"),
    [
        ("{}", "uniform", "--distribution uniform --workers 1 --out"),
        (
            "{distributions: [log-uniform], ranges: {log-uniform: [0.1, 50]}, workers: 2}",
            "log-uniform",
            "--distribution log-uniform --low 0.1 --high 50 --workers 2 --out",
        ),
    ],
)
def test_moduli_and_workers_reach_the_command(tmp_path, dataset, distribution, expected):
    config = tmp_path / "config.yaml"
    config.write_text(f"{MODELS}dataset: {dataset}\n")
    command = [sys.executable, "-m", "snakemake", "-s", CHECKOUT / "Snakefile", "-n", "-p"]
    command += [f"results/dataset/{distribution}-0.h5", "--cores", 2, "--configfile", config]
    done = run(*command, cwd=tmp_path, env=checkout_environment())
    assert done.returncode == 0, done.stdout + done.stderr
    assert expected in done.stdout + done.stderr
