"""A run of Snakemake whose nodes fail, or that another run meets: it ends as any other."""

import re
import signal
import sys

import pytest

from dataset_gen.journal import journal_of
from tests import slurm_cluster, workflow_runs
from tests.patience import wait_for
from tests.programs import CHECKOUT, checkout_environment
from tests.submitted_shards import COUNT, node_with, three_nodes, wait_for_end, workers
from workflow.commands.digest import digest

pytestmark = [pytest.mark.slurm, pytest.mark.mpi, pytest.mark.nightly]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory, together):
    """A cluster of three nodes."""
    with three_nodes(tmp_path_factory, together) as found:
        yield found


RUN = f"""\
models: {{bar: {{mesh: 'builtin:bar', resolution: 12}}}}
dataset: {{samples: 300000, distributions: [uniform], shards: {COUNT}, objective: chen2015}}
forests: {{trees: 1, depth: 6, ranks: {COUNT}, structure_rows: 16000}}
solver: {{cores: {2 * COUNT}, launcher: LAUNCHER}}
"""
RUN_SHARDS = [f"results/dataset/uniform-{shard}.h5" for shard in range(COUNT)]
RUN_FORESTS = "results/forests/forests.h5"


@pytest.fixture(scope="module")
def undisturbed_run(tmp_path_factory):
    """Folder of a run without SLURM, with as many ranks."""
    folder = tmp_path_factory.mktemp("local")
    (folder / "config.yaml").write_text(RUN.replace("LAUNCHER", "mpiexec --oversubscribe"))
    options = (RUN_FORESTS, "--cores", 2, "--configfile", "config.yaml")
    done = workflow_runs.snakemake(folder, *options)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_the_terminal_of_a_run_tells_which_job_lost_which_node(cluster, undisturbed_run, tmp_path):
    """Its forests are those of a run that nothing disturbed."""
    failures = cluster.ends().count("NODE_FAIL")
    (tmp_path / "config.yaml").write_text(RUN.replace("LAUNCHER", "null"))
    process = slurm_cluster.snakemake(tmp_path, RUN_FORESTS, "--configfile", "config.yaml")
    shard = tmp_path / RUN_SHARDS[1]
    journal = journal_of(shard)
    wait_for(lambda: journal.exists() and journal.stat().st_size > 10_000, "shard 1", process)
    for worker in workers(RUN_SHARDS[1], tmp_path):
        worker.send_signal(signal.SIGSTOP)
    (node,) = {node_with(cluster, worker) for worker in workers(RUN_SHARDS[1], tmp_path)}
    cluster.fail(node)
    wait_for_end(cluster, "NODE_FAIL", failures)
    told = rf"job \d+_\d on {node} was stopped by SLURM and is back in the queue; {node} is down"
    log = tmp_path / "snakemake.log"
    wait_for(lambda: re.search(told, log.read_text()), "the sentence", process)
    cluster.start_waiting_jobs()
    cluster.repair(node)
    slurm_cluster.finish(process, tmp_path)
    for file in (*RUN_SHARDS, RUN_FORESTS):
        assert digest(tmp_path / file) == digest(undisturbed_run / file)


def test_a_second_run_in_the_same_folder_leaves_the_jobs_of_the_first_alone(
    cluster, undisturbed_run, tmp_path
):
    """It is started on another machine."""
    (tmp_path / "config.yaml").write_text(RUN.replace("LAUNCHER", "null"))
    options = (RUN_SHARDS[0], "--configfile", "config.yaml")
    process = slurm_cluster.snakemake(tmp_path, *options)
    wait_for(lambda: workers(RUN_SHARDS[0], tmp_path), "the job", process)
    for worker in workers(RUN_SHARDS[0], tmp_path):
        worker.send_signal(signal.SIGSTOP)
    words = [sys.executable, "-m", "snakemake", "-s", CHECKOUT / "Snakefile"]
    words += ["--profile", slurm_cluster.PROFILE, *slurm_cluster.QUICK]
    second = cluster.on("n1", *words, *options, cwd=tmp_path, env=checkout_environment())
    assert second.returncode != 0 and "cannot be locked" in second.stderr, second.stderr
    for worker in workers(RUN_SHARDS[0], tmp_path):
        worker.send_signal(signal.SIGCONT)
    slurm_cluster.finish(process, tmp_path)
    assert digest(tmp_path / RUN_SHARDS[0]) == digest(undisturbed_run / RUN_SHARDS[0])
