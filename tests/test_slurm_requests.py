"""What jobs ask SLURM for is right on any number of nodes, and is what is estimated."""

import argparse
import re

import pytest

from tests import slurm_cluster, slurm_standin
from tests.programs import python
from tests.workflow_runs import CHECKOUT
from workflow import patient_slurm
from workflow.commands.estimate import load
from workflow.estimate.jobs import plan

pytestmark = pytest.mark.nightly(unless=("slurm", "workflow"))

RANKS, CORES = 3, 8
OF_RANK, OF_JOB = 901, 777
CONFIG = f"""\
models: {{bar: {{mesh: 'builtin:bar', resolution: 16}}}}
forests: {{model: default}}
solver: {{ranks: {RANKS}, cores: {CORES}, modes: 20}}
resources:
  find_modes: {{memory_mb: {OF_RANK}}}
  time_methods: {{memory_mb: {OF_RANK}}}
  rate_forests: {{memory_mb: {OF_JOB}}}
"""
TRUTH = "results/models/bar/truth.h5"
TIMES = "results/models/bar/methods.json"
ALONE = "rate_forests"
"""Rule without ranks."""


def asked(arguments: list[str]) -> argparse.Namespace:
    """What a job of `sbatch` gets."""
    parser = argparse.ArgumentParser(allow_abbrev=False)
    for option in ("--mem", "--mem-per-cpu", "--ntasks", "--cpus-per-task"):
        parser.add_argument(option, type=int)
    parser.add_argument("--exclusive", action="store_true")
    return parser.parse_known_args(arguments)[0]


@pytest.fixture(scope="module")
def requests(tmp_path_factory):
    """What the job of each rule asks for; the jobs do nothing."""
    folder, slurm = (tmp_path_factory.mktemp(name) for name in ("run", "slurm"))
    (folder / "config.yaml").write_text(CONFIG)
    options = ["--profile", slurm_cluster.PROFILE, *slurm_cluster.QUICK, "--retries", "0"]
    options += [TRUTH, TIMES, "results/forests/table.json", "--configfile", "config.yaml"]
    variables = {
        **slurm_standin.install(slurm, "idle"),
        "PYTHONPATH": str(CHECKOUT),
        patient_slurm.PAUSE: "0.2",
    }
    done = python(
        "-m", "snakemake", "-s", CHECKOUT / "Snakefile", *options, cwd=folder, env=variables
    )
    found: dict[str, argparse.Namespace] = {}
    for arguments in slurm_standin.submitted(slurm):
        rule = re.findall(r"--target-jobs \W*(\w+):", arguments[-1] + arguments[-2])[0]
        found[rule] = asked(arguments)
    assert len(found) == 3, done.stdout + done.stderr
    return found


def test_ranks_get_their_memory_on_any_number_of_nodes(requests):
    job = requests["find_modes"]
    assert job.mem is None
    assert (job.ntasks, job.cpus_per_task) == (RANKS, CORES // RANKS)
    of_rank = job.mem_per_cpu * job.cpus_per_task
    assert OF_RANK <= of_rank < OF_RANK + job.cpus_per_task


def test_a_job_without_ranks_asks_for_its_memory(requests):
    job = requests[ALONE]
    assert job.mem_per_cpu is None and job.ntasks == 1
    assert job.mem == OF_JOB


def test_a_job_with_a_node_of_its_own_is_not_asked_for_memory_by_each_of_its_cores(requests):
    job = requests["time_methods"]
    assert job.exclusive and job.mem_per_cpu is None and job.mem == RANKS * OF_RANK


def test_the_estimate_tells_the_memory_that_is_asked_for(requests, tmp_path):
    (tmp_path / "config.yaml").write_text(CONFIG)
    jobs = plan(load(tmp_path / "config.yaml"), CORES).set_index("kind")
    job = requests["find_modes"]
    assert jobs.loc["find_modes truth", "memory_mb"] == (
        job.mem_per_cpu * job.cpus_per_task * job.ntasks
    )
    assert jobs.loc[ALONE, "memory_mb"] == requests[ALONE].mem
