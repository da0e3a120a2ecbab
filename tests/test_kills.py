"""SIGKILL at any moment: the same command run again ends as if nothing had happened.

When a run is killed hangs on the clock, and each run is made twice: all of this is nightly.
"""

import time

import pytest

from tests.hostile import summary
from tests.hostile.killing import Killed, kill_and_repeat, moments, run_undisturbed, snakemake
from tests.hostile.zoo import CONFIGURATION

pytestmark = pytest.mark.nightly

SHARDS = ("results/dataset/uniform-0.h5", "results/dataset/uniform-1.h5")
FORESTS, TRUTH = "results/forests/forests.h5", "results/models/bar/truth.h5"
GENERATE = "dataset_gen generate --samples 30000 --out shard.h5".split()
WORKERS = [*GENERATE, "--workers", 2]
TRAIN = "forests train shard.h5 --trees 2 --depth 8 --out forests.h5".split()
MADE = (
    "forests train --samples 300000 --keep-minutes 0.005 --trees 1 --max-leaves 300 --workers 2"
    " --structure-rows 50000 --out forests.h5"
).split()
MODES = "solver modes builtin:box --resolution 8 --modes 20 --out modes.h5".split()
# MUMPS, the default on several ranks, repeats itself but for the last digits.
ON_RANKS = [*MODES, "--linear-solver", "icc-pcg"]
BENCHMARK = (
    "solver benchmark builtin:bar --resolution 10 --modes 12 --runs 1 --no-arpack --out row.json"
).split()
DESIGN = "sound design project.yaml --evaluations 4 --restart --workers 2 --out design.h5".split()

NUMBERS = {
    "generate": 7,
    "generate by workers": 3,
    "train": 3,
    "train, samples made": 4,
    "modes": 8,
    "modes, one rank": 6,
    "modes, mpiexec": 5,
    "benchmark": 4,
    "design": 3,
    "design, its first process": 2,
    "rules": 3,
    "rules, Snakemake alone": 2,
}
"""Kills of each command, 50 in all."""


@pytest.fixture(scope="module")
def commands(zoo):
    shard = {"shard.h5": zoo.folder / "shard.h5"}
    project = {name: zoo.folder / name for name in ("project.yaml", "metal.wav", "wood.wav")}
    rules = {"config.yaml": CONFIGURATION}
    results = (*SHARDS, FORESTS, TRUTH)
    found = [
        Killed("generate", GENERATE, ["shard.h5"]),
        Killed("generate by workers", WORKERS, ["shard.h5"], "first"),
        Killed("train", TRAIN, ["forests.h5"], files=shard),
        Killed("train, samples made", MADE, ["forests.h5"]),
        Killed("modes", MODES, ["modes.h5"]),
        Killed("modes, one rank", ON_RANKS, ["modes.h5"], "rank", ranks=2),
        Killed("modes, mpiexec", ON_RANKS, ["modes.h5"], "first", ranks=2),
        Killed("benchmark", BENCHMARK, ["row.json"]),
        Killed("design", DESIGN, ["design.h5"], files=project),
        Killed("design, its first process", DESIGN, ["design.h5"], "first", files=project),
        Killed("rules", snakemake(FORESTS, TRUTH), results, files=rules),
        Killed("rules, Snakemake alone", snakemake(FORESTS, TRUTH), results, "first", files=rules),
    ]
    assert [each.name for each in found] == list(NUMBERS)
    return {each.name: each for each in found}


@pytest.fixture(scope="module")
def undisturbed(commands, tmp_path_factory):
    """How a command runs that nothing disturbs, found out once for equal ones."""
    known = {}

    def of(name):
        key = (tuple(commands[name].command), commands[name].ranks)
        if key not in known:
            folder = tmp_path_factory.mktemp("undisturbed") / "run"
            known[key] = run_undisturbed(commands[name], folder)
        return known[key]

    return of


def kills():
    """Every kill: the command's name and the share of its time after which it is killed."""
    for name, count in NUMBERS.items():
        for number, moment in enumerate(moments(name, count)):
            yield pytest.param(name, moment, id=f"{name} {number}")


def test_there_are_fifty_kills():
    assert sum(NUMBERS.values()) == 50


@pytest.mark.parametrize(("name", "moment"), list(kills()))
def test_a_killed_run_ends_as_one_undisturbed(
    name, moment, commands, undisturbed, tmp_path, record_property
):
    before = undisturbed(name)
    begin = time.monotonic()
    try:
        found = kill_and_repeat(commands[name], tmp_path / "run", moment * before.seconds)
        assert found == before.found
    finally:
        record_property(summary.KILL, [name, time.monotonic() - begin])
