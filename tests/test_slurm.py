"""On a real SLURM: the same bits as anywhere else, and nothing that a cluster does loses work."""

import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import h5py
import psutil
import pytest
from numpy.testing import assert_allclose

from carillon.fem.model import RIGID_MODES
from solver.files.modes_file import read_modes
from tests import slurm_cluster, workflow_runs
from tests.patience import wait_for, words_of
from tests.workflow_runs import CHECKOUT
from workflow import slurm_cleanup
from workflow.commands.digest import digest

pytestmark = [pytest.mark.slurm, pytest.mark.mpi, pytest.mark.nightly]

SAMPLES, SHARDS = 3000, 2
SMALL = f"""\
models: {{bar: {{mesh: 'builtin:bar', resolution: 12, material: two-region}}}}
dataset: {{samples: {SAMPLES}, distributions: [uniform], shards: {SHARDS}}}
forests: {{trees: 1, depth: 6, ranks: 2}}
solver: {{modes: 16, ranks: 2, cores: 2, launcher: LAUNCHER}}
"""
MODES = "results/models/bar/ddfem_hcms_ec.h5"
UNCORRECTED = "results/models/bar/hcms.h5"
FORESTS = "results/forests/forests.h5"
DATASET = [f"results/dataset/uniform-{shard}.h5" for shard in range(SHARDS)]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory, together):
    """A cluster of this machine alone."""
    with slurm_cluster.running(tmp_path_factory.mktemp("slurm"), together) as found:
        yield found


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """Folder of a run without SLURM."""
    folder = tmp_path_factory.mktemp("local")
    (folder / "config.yaml").write_text(SMALL.replace("LAUNCHER", "mpiexec --oversubscribe"))
    wanted = (MODES, UNCORRECTED, "--cores", 2, "--configfile", "config.yaml")
    done = workflow_runs.snakemake(folder, *wanted)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def remote(cluster, tmp_path_factory):
    """Folder of a run by jobs of SLURM: an array of shards, then MPI jobs."""
    folder = tmp_path_factory.mktemp("remote")
    (folder / "config.yaml").write_text(SMALL.replace("LAUNCHER", "null"))
    wanted = (MODES, UNCORRECTED, "--configfile", "config.yaml")
    slurm_cluster.finish(slurm_cluster.snakemake(folder, *wanted), folder)
    return folder


def test_jobs_of_slurm_find_the_same_bits_as_a_local_run(local, remote):
    for file in (*DATASET, FORESTS, UNCORRECTED):
        assert digest(remote / file) == digest(local / file), file


def test_jobs_of_slurm_find_the_same_modes_but_for_what_mumps_leaves_open(local, remote):
    """It adds in the order of arrival: docs/reproducibility.md."""
    found, expected = (read_modes(str(folder / MODES)) for folder in (remote, local))
    elastic = slice(RIGID_MODES, None)
    assert_allclose(found.eigenvalues[elastic], expected.eigenvalues[elastic], rtol=1e-10)
    assert found.mesh.n_dofs == expected.mesh.n_dofs and found.attributes["fine_blocks"] > 0


@pytest.mark.system
def test_jobs_were_an_array_and_mpi_jobs(remote):
    assert "Submitted array job" in (remote / "snakemake.log").read_text()
    logs = list((remote / ".snakemake" / "slurm_logs" / "rule_find_modes").rglob("*.log"))
    assert len(logs) == 2
    started = "srun --mpi=pmix -n 2 --cpus-per-task=1 python -m mpi4py -m solver modes"
    for log in logs:
        assert started in log.read_text()
    with h5py.File(remote / MODES) as modes:
        assert modes.attrs["ranks"] == 2


@pytest.mark.system
def test_array_by_hand_yields_identical_shards(cluster, remote, tmp_path):
    arguments = f"--samples {SAMPLES} --shards {SHARDS} --seed 0 --distribution uniform"
    slurm_cluster.batch(
        tmp_path,
        *(CHECKOUT / "slurm" / "shards.sbatch", "uniform-%a.h5", *arguments.split()),
        options=[f"--array=0-{SHARDS - 1}", "--ntasks=2", "--mem-per-cpu=500M"],
    )
    for file in DATASET:
        assert digest(tmp_path / Path(file).name) == digest(remote / file)


def test_jobs_of_a_killed_run_are_cancelled_by_the_next(cluster, tmp_path):
    """Its job hangs; the next run's own goes on from the journal, and nobody else's ends."""
    (tmp_path / "config.yaml").write_text(LONG.format(samples=SAMPLES))
    shard = tmp_path / DATASET[0]
    options = (DATASET[0], "--configfile", "config.yaml")
    other = subprocess.run(
        ["sbatch", "--parsable", "--wrap", "sleep 3600", "--mem=10", "--job-name=other"],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()
    killed = slurm_cluster.snakemake(tmp_path, *options)
    wait_for(lambda: worker(shard), "the job", killed)
    os.kill(worker(shard), signal.SIGSTOP)
    (left,) = slurm_cleanup.jobs(tmp_path)
    killed.kill()
    killed.wait()
    output = slurm_cluster.finish(slurm_cluster.snakemake(tmp_path, *options), tmp_path)
    assert f"cancelled 1 jobs of SLURM that a killed run has left ({left})" in output
    assert "CANCELLED" in cluster.ends() and slurm_cleanup.jobs(tmp_path) == []
    queue = subprocess.run(["squeue", "--noheader", "--format=%A"], capture_output=True, text=True)
    assert queue.stdout.split() == [other]
    subprocess.run(["scancel", other], check=True)
    arguments = f"--samples {SAMPLES} --objective chen2015 --out undisturbed.h5"
    subprocess.run(
        [sys.executable, "-m", "dataset_gen", "generate", *arguments.split()],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        check=True,
        capture_output=True,
    )
    assert digest(shard) == digest(tmp_path / "undisturbed.h5")


LONG = """\
models: {{bar: {{mesh: 'builtin:bar', resolution: 12}}}}
dataset: {{samples: {samples}, distributions: [uniform], shards: 1, objective: chen2015}}
"""
LONG_SAMPLES = 600_000


def worker(shard: Path) -> int | None:
    """Process of this run that makes a shard; None if there is none.

    Another run, in a clean root beside this one, makes a shard of the same name.
    """
    for process in psutil.process_iter():
        words = words_of(process)
        if words[1:4] == ["-m", "dataset_gen", "generate"] and shard.name in " ".join(words):
            with suppress(psutil.Error):
                if Path(process.cwd(), words[words.index("--out") + 1]) == shard:
                    return int(process.pid)
    return None


def test_a_job_outlives_all_that_befalls_it(cluster, tmp_path):
    """Out of memory, a dead node, a controller that is away, a stuck process, a time limit."""
    (tmp_path / "config.yaml").write_text(LONG.format(samples=LONG_SAMPLES))
    shard = tmp_path / DATASET[0]
    journal = shard.with_name(f".{shard.name}.journal")

    def runs() -> bool:
        return worker(shard) is not None and journal.exists() and journal.stat().st_size > before

    run = slurm_cluster.snakemake(
        tmp_path,
        *(DATASET[0], "--configfile", "config.yaml", "--set-resources"),
        # Too little for a Python with its packages at the first try.
        *("generate_shard:mem_mb=60 if attempt == 1 else 1000", "generate_shard:runtime=60"),
    )
    try:
        wait_for(lambda: "exceeded memory limit" in cluster.log(), "out of memory", run)
        before = 1000
        wait_for(runs, "the second try", run)
        os.kill(worker(shard), signal.SIGSTOP)
        done = journal.stat().st_size
        cluster.fail()
        wait_for(lambda: worker(shard) is None, "the end of its processes", run)
        wait_for(lambda: "NODE_FAIL" in cluster.ends(), "the node's death", run)
        cluster.repair()
        before = done
        wait_for(runs, "the requeued job", run)
        cluster.restart_controller(pause=3)
        # A process that hangs, as on a file system that does not answer, until its time is up.
        os.kill(worker(shard), signal.SIGSTOP)
        cluster.shorten()
        wait_for(lambda: "TIMEOUT" in cluster.ends(), "the time limit", run)
    except AssertionError as error:
        run.kill()
        raise AssertionError((tmp_path / "snakemake.log").read_text()[-6000:]) from error
    assert len(re.findall(r"submitted with SLURM jobid", slurm_cluster.finish(run, tmp_path))) == 3
    undisturbed = tmp_path / "undisturbed.h5"
    subprocess.run(
        [sys.executable, "-m", "dataset_gen", "generate", "--samples", str(LONG_SAMPLES)]
        + ["--objective", "chen2015", "--workers", "2", "--out", str(undisturbed)],
        cwd=CHECKOUT,
        check=True,
        capture_output=True,
    )
    assert digest(shard) == digest(undisturbed)
