"""The rules: they lint, and runs are planned as promised, quickly, and without MPI.

Traces of MPI in the environment would reach every job.
"""

import os
import re
from subprocess import CompletedProcess

import pytest

from tests.programs import python
from tests.workflow_runs import CHECKOUT, PROFILE
from workflow import submission

_IMPORT = re.compile(r"(?m)^(?:from (?:carillon|workflow)|import (?:carillon|workflow))\b.*$")


@pytest.fixture
def printed(dry_run, tmp_path):
    """What is printed of a dry run of a configuration with its commands."""

    def run(config: str, *targets: str) -> CompletedProcess[str]:
        path = tmp_path / "config.yaml"
        path.write_text(config)
        done = dry_run(tmp_path, *targets, "-p", "--cores", 2, "--configfile", path)
        assert done.returncode == 0, done.stdout + done.stderr
        return done

    return run


def test_rules_import_neither_mpi_nor_petsc():
    files = [CHECKOUT / "Snakefile", *(CHECKOUT / "workflow" / "rules").glob("*.smk")]
    imports = [line for file in files for line in _IMPORT.findall(file.read_text())]
    check = "import sys; print(sorted({'mpi4py.MPI', 'petsc4py', 'slepc4py'} & set(sys.modules)))"
    done = python("-c", "\n".join([*imports, check]), cwd=CHECKOUT)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def test_default_run_is_planned_without_a_gap(plan):
    jobs = plan()
    models, shards = 4, 4
    assert jobs["generate_shard"] == shards
    assert jobs["find_modes"] == 7 * models
    assert jobs["compare_with_truth"] == 2 * models
    assert jobs["train_forests"] == jobs["tabulate_report"] == jobs["build_report"] == 1


def test_default_profile_is_read(dry_run, tmp_path):
    done = dry_run(tmp_path, "--profile", PROFILE)
    assert done.returncode == 0, done.stdout + done.stderr


def test_rules_lint():
    lint = CHECKOUT / ".ci" / "lint_rules.py"
    done = python(lint, cwd=CHECKOUT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_bad_value_on_the_command_line_stops_the_run_with_a_sentence(dry_run, tmp_path):
    done = dry_run(tmp_path, "--cores", 1, "--config", "poisson=0.7")
    assert done.returncode != 0
    output = done.stdout + done.stderr
    assert "poisson: found 0.7, expected below 0.5" in output
    assert "Traceback" not in output


def test_one_variant_of_a_model_tells_its_distance_and_all_have_one_mesh(printed):
    config = (
        "models:\n"
        "  bar: {mesh: 'builtin:bar', resolution: 16}\n"
        "  bell: {mesh: 'builtin:bell', resolution: 16, discretisation: finite-cell}\n"
    )
    done = printed(config, "validation")
    runs = [line.split() for line in done.stdout.splitlines() if "-m solver modes" in line]
    telling = {run[run.index("--out") + 1] for run in runs if "--no-estimate" not in run}
    assert telling == {f"results/models/{model}/hcms_ec.h5" for model in ("bar", "bell")}
    assert sum("--estimate" in run for run in runs) == 1
    undivided = ["--refine-to 0 " in " ".join(run) for run in runs]
    assert undivided == ["builtin:bell" in run for run in runs] and sum(undivided) == 3


MODELS = "models: {bar: {mesh: 'builtin:bar', resolution: 16}}\n"


@pytest.mark.parametrize("ranks", [1, 2])
def test_ranks_get_a_launcher_only_where_there_are_several(printed, ranks):
    config = f"{MODELS}solver: {{ranks: {ranks}, modes: 20}}\n"
    done = printed(config, "results/models/bar/truth.h5")
    assert ("mpiexec -n 2 python" in done.stdout + done.stderr) == (ranks == 2)


RANKED = f"{MODELS}solver: {{ranks: 4, cores: 8, modes: 20, launcher: srun}}\n"
TRUTH = "results/models/bar/truth.h5"


def test_threads_of_ranks_are_those_of_the_cores_that_snakemake_has_here(printed):
    """Two cores for four ranks, which asked for two each."""
    assert "$(( 2 > 4 ? 2 / 4 : 1 ))" in printed(RANKED, TRUTH).stdout


def test_ranks_of_a_job_have_the_threads_asked_for_on_a_small_first_node(printed):
    job = printed(RANKED, TRUTH, "--mode", "remote").stdout
    assert "OMP_NUM_THREADS=2 srun -n 4 --cpus-per-task=2 python" in job


@pytest.mark.parametrize(("cores", "expected"), [(None, 1), (16, 16)])
def test_a_job_counts_the_cores_of_the_run_and_not_those_of_its_node(cores, expected, monkeypatch):
    monkeypatch.setattr("os.environ", {})
    node = 64
    assert submission.cores_of_run(node, in_job=True) == 1
    assert submission.cores_of_run(cores, in_job=False) == expected
    assert submission.cores_of_run(node, in_job=True) == expected


def test_jobs_on_one_rank_have_no_mpi(printed):
    done = printed(MODELS, TRUTH)
    assert "tasks=1" in done.stdout and "mpi=" not in done.stdout


@pytest.mark.parametrize("by_srun", [True, False])
def test_an_mpiexec_in_a_job_knows_the_nodes_that_the_executor_hides(by_srun, monkeypatch):
    places = {"SLURM_NODELIST": "n[1-3]", "SLURM_TASKS_PER_NODE": "1(x3)"}
    monkeypatch.setattr("os.environ", {"SLURM_JOB_ID": "7", **places})
    submission.hand_on_places(not by_srun)
    for name in places:
        del os.environ[name]
    submission.hand_on_places(not by_srun)
    assert ({name: os.environ.get(name) for name in places} == places) != by_srun


def test_a_job_of_another_cluster_has_no_nodes_to_hand_on(monkeypatch):
    monkeypatch.setattr("os.environ", {})
    submission.hand_on_places(True)
    assert os.environ == {}


def test_every_try_gets_twice_the_memory_for_each_rank(printed):
    def memory(attempt: int) -> set[tuple[str, int]]:
        found = printed(RANKED, TRUTH, "--attempt", attempt).stdout
        return {(name, int(n)) for name, n in re.findall(r"(mem_mb\w*)=(\d+)", found)}

    first, second = memory(1), memory(2)
    assert {name for name, _ in first} == {"mem_mb", "mem_mb_per_cpu"}
    assert second == {(name, 2 * megabytes) for name, megabytes in first}


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
def test_moduli_and_workers_of_shards_reach_the_command(printed, dataset, distribution, expected):
    done = printed(f"{MODELS}dataset: {dataset}\n", f"results/dataset/{distribution}-0.h5")
    assert expected in done.stdout + done.stderr
