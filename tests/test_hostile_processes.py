"""Hostile inputs as people start programs: processes of their own, two ranks, Snakemake itself."""

import pytest

from tests.hostile.suite import snapshot
from tests.hostile.zoo import CONFIGURATION
from tests.workflow_runs import PROFILE, snakemake

ALONE = {
    "no command": "dataset_gen",
    "a broken shard": "forests inspect ZOO/shard-cut.h5",
    "a bomb": "sound design ZOO/bomb.yaml --out o.h5",
    "a clip of 1e300": "sound extract ZOO/huge.wav --out o.json",
    "moduli of petabytes": "solver modes builtin:box --resolution 4 --material ZOO/claims.npy "
    "--out o.h5",
    "a configuration that is a clip": "workflow estimate --configfile ZOO/metal.wav",
}
RANKS = {
    "no such option": "solver modes builtin:box --resolution 4 --fast --out o.h5",
    "no mesh": "solver modes nowhere.obj --resolution 4 --out o.h5",
    "complex moduli": "solver modes builtin:box --resolution 4 --material ZOO/complex.npy "
    "--out o.h5",
    "broken initial modes": "solver modes builtin:box --resolution 4 --modes 12 "
    "--initial-modes ZOO/modes-cut.h5 --out o.h5",
    "damaged shards": "forests train ZOO/shard-flipped.h5 --out o.h5",
    "no such split": "dataset_gen generate --samples 10 --shard 3 --shards 2 --out o.h5",
}


OFTEN = ("damaged shards", "builtin:bar$(touch x)", "$(touch x)")
"""Of those below that start several processes, what is tried with every change."""


def some(names):
    """The names as parameters, nightly but for `OFTEN`."""
    return [
        pytest.param(name, id=name, marks=[] if name in OFTEN else pytest.mark.nightly)
        for name in names
    ]


def words_of(command, zoo):
    return command.replace("ZOO", str(zoo.folder)).split()


def assert_refused(done, room, folder):
    said = [line for line in done.stderr.splitlines() if line.startswith(room)]
    assert done.returncode == 2, done.stderr
    assert len(said) == 1, done.stderr
    assert "Traceback" not in done.stderr
    assert not done.stdout
    assert snapshot(folder) == {}


@pytest.mark.parametrize("name", ALONE)
def test_alone(name, zoo, start_cli, tmp_path):
    room, *words = words_of(ALONE[name], zoo)
    done = start_cli(room, *words, cwd=tmp_path)
    assert_refused(done, room, tmp_path)
    assert done.stderr.count("\n") == 1


@pytest.mark.mpi
@pytest.mark.parametrize("name", some(RANKS))
def test_on_two_ranks_it_is_said_once_and_both_end(name, zoo, mpiexec, tmp_path):
    room, *words = words_of(RANKS[name], zoo)
    assert_refused(mpiexec(2, room, *words, cwd=tmp_path), room, tmp_path)


@pytest.mark.parametrize(
    "mesh", some(["builtin:bar$(touch x)", "builtin:bar; touch x", "nowhere.obj"])
)
def test_snakemake_refuses_a_mesh(mesh, tmp_path):
    (tmp_path / "c.yaml").write_text(CONFIGURATION.replace("'builtin:bar'", f"'{mesh}'"))
    done = snakemake(
        tmp_path, "--cores", "1", "--configfile", "c.yaml", "--", "results/models/bar/truth.h5"
    )
    assert done.returncode == 1
    assert "Traceback" not in done.stderr and "mesh" in done.stderr + done.stdout
    assert {path.name for path in tmp_path.iterdir()} <= {"c.yaml", ".snakemake"}


@pytest.mark.parametrize("launcher", some(["mpiexec; touch x;", "$(touch x)", "mpiexec | touch x"]))
def test_a_launcher_is_no_other_command(launcher, tmp_path):
    text = CONFIGURATION.replace("cores: 1", f'cores: 2, ranks: 2, launcher: "{launcher}"')
    (tmp_path / "c.yaml").write_text(text)
    options = ["--cores", "2", "--configfile", "c.yaml", "--", "results/models/bar/truth.h5"]
    assert snakemake(tmp_path, *options).returncode == 1
    assert not (tmp_path / "x").exists()


def test_snakemake_takes_odd_names(zoo, tmp_path):
    """All that a shell could stumble over, in the names of a folder and of a mesh."""
    folder = "my results; $(touch x) 'a' {b}"
    text = CONFIGURATION.replace("'builtin:bar'", f'"{zoo.folder}/my box.obj"')
    (tmp_path / "c.yaml").write_text(f'results_dir: "{folder}"\n{text.replace("20", "8")}')
    target = f"{folder}/models/bar/truth.h5"
    done = snakemake(
        tmp_path, "--profile", PROFILE, "--cores", "1", "--configfile", "c.yaml", "--", target
    )
    made = {path.name for path in tmp_path.iterdir()}
    assert made <= {"c.yaml", ".snakemake", folder}, done.stderr
    if done.returncode:
        said = done.stdout + done.stderr
        assert "results_dir" in said and "Traceback" not in said, said
    else:
        assert (tmp_path / target).is_file()
