"""A throw-away SLURM cluster on this machine (test support)."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.once import once
from tests.patience import HANG_SECONDS
from tests.programs import checkout_environment, run
from tests.workflow_runs import CHECKOUT

SCRIPT = CHECKOUT / "slurm" / "test-cluster.sh"
PROFILE = CHECKOUT / "slurm"
FOLDERS = os.environ["PATH"].split(os.pathsep)
DAEMONS = os.pathsep.join((*FOLDERS, "/usr/local/sbin", "/usr/sbin", "/sbin"))
"""Where SLURM's daemons are, although not every root looks there."""
PLAIN = os.pathsep.join(folder for folder in FOLDERS if not folder.endswith("sbin"))
"""Where a root by cron, or by su without -, looks."""
QUICK = (
    *("--slurm-no-account", "--slurm-init-seconds-before-status-checks", "1"),
    *("--max-status-checks-per-second", "1", "--latency-wait", "20"),
    "--slurm-keep-successful-logs",
)
"""Options for jobs of seconds: the profile is for jobs of hours."""
PATIENT_RANKS = {"OMPI_MCA_mpi_yield_when_idle": "1"}
"""Ranks let others work while they wait: nodes of one machine have more cores than it has."""
IMPOSSIBLE = ("has a SLURM already", "several nodes need")
"""Words of the script where the machine does not allow a cluster."""


@dataclass(frozen=True)
class Cluster:
    """A running cluster.

    Attributes
    ----------
    folder : what its daemons write.
    """

    folder: Path

    def fail(self, *node: str) -> None:
        """Let a node die with all of its jobs; without a name the one that is this machine."""
        control("fail", self.folder, *node)

    def repair(self, *node: str) -> None:
        """Bring the node back, and start what it lost soon; SLURM would wait two minutes."""
        control("repair", self.folder, *node)
        self.start_waiting_jobs()

    def unplug(self, node: str) -> None:
        """Cut a node off from the others."""
        control("unplug", self.folder, node)

    def plug(self, node: str) -> None:
        """Connect it again."""
        control("plug", self.folder, node)

    def start_waiting_jobs(self) -> None:
        """Start jobs soon that were put back into the queue."""
        # A node that has just killed them, or has yet to be told that they are dead, refuses them.
        time.sleep(5)
        waiting = ["squeue", "--noheader", "--states=PENDING", "--format=%A"]
        for job in run(*waiting).stdout.split():
            subprocess.run(["scontrol", "update", f"JobId={job}", "StartTime=now"], check=True)

    def on(self, node: str, *words: object, **options: Any) -> subprocess.CompletedProcess[str]:
        """Run a program on a node, in the same folder; options are those of `run`."""
        return run("bash", SCRIPT, "on", self.folder, node, *words, **options)

    def files_of(self, node: str) -> Path:
        """The root folder of a node, as this process sees it."""
        process, _ = (self.folder / f"{node}.init").read_text().split()
        return Path("/proc", process, "root")

    def restart_controller(self, pause: float) -> None:
        """Leave the cluster without slurmctld for some seconds."""
        process = Path("/proc", (self.folder / "slurmctld.pid").read_text().strip())
        os.kill(int(process.name), signal.SIGTERM)
        while process.exists():
            time.sleep(0.1)
        time.sleep(pause)
        subprocess.run([str(shutil.which("slurmctld", path=DAEMONS))], check=True)

    def shorten(self) -> None:
        """Leave the running jobs a minute, counted from their start."""
        running = ["squeue", "--noheader", "--states=RUNNING", "--format=%A"]
        for job in run(*running).stdout.split():
            subprocess.run(["scontrol", "update", f"JobId={job}", "TimeLimit=1"], check=True)

    def log(self) -> str:
        """What slurmd has to say, that of all nodes."""
        logs = sorted((self.folder / "log").glob("slurmd-*.log"))
        return "".join(log.read_text() for log in logs)

    def ended(self) -> list[dict[str, str]]:
        """Jobs that ended, in order; SLURM's names of what it records, such as NodeList."""
        record = self.folder / "log" / "jobs.txt"
        lines = record.read_text().splitlines() if record.exists() else []
        return [dict(re.findall(r"(\w+)=(\S*)", line)) for line in lines]

    def ends(self) -> list[str]:
        """How jobs ended, one state each, in order."""
        return [job["JobState"] for job in self.ended()]


def control(*arguments: object, **variables: str) -> None:
    """Run the cluster's script, with more variables in its environment."""
    done = run("bash", SCRIPT, *arguments, env={**os.environ, "PATH": PLAIN, **variables})
    if done.returncode:
        raise RuntimeError(f"{SCRIPT.name} {arguments[0]}: {done.stderr}")


@contextmanager
def running(folder: Path, together: Path, *options: object, **variables: str) -> Iterator[Cluster]:
    """A cluster until the body ends: a machine has room for one at a time.

    SLURM is installed where it is missing; the test is skipped where a cluster is impossible.

    Parameters
    ----------
    folder
        Of the cluster.
    together
        Folder of all processes of this session of tests, which all nodes see.
    options
        Of the script's action `start`.
    variables
        Of the environment of the script.
    """
    if os.geteuid() != 0:
        pytest.skip("a SLURM cluster can only be started by root")
    if not shutil.which("slurmctld", path=DAEMONS) and not shutil.which("apt-get"):
        pytest.skip("no SLURM here, and no apt-get to install it by")
    with once(together / "slurm-cluster"):
        control("install")
        try:
            # It is stopped as well if this process is killed.
            control(
                *("start", folder, "--while", os.getpid(), *options),
                **{"SHARED": str(together), **variables},
            )
        except RuntimeError as error:
            if not any(words in str(error) for words in IMPOSSIBLE):
                raise
            pytest.skip(str(error))
        try:
            yield Cluster(folder)
        finally:
            control("stop", folder)


def submit(
    folder: Path,
    *words: object,
    options: Sequence[object] = (),
    before: Sequence[object] = (),
    **variables: str,
) -> subprocess.Popen[str]:
    """Start one of the job scripts, or another command, by `sbatch --wait` in a folder.

    Parameters
    ----------
    words
        The script and its arguments.
    options
        Of `sbatch`.
    before
        A command that runs `sbatch`, in place of this process.
    variables
        Of the environment of the jobs.

    Returns
    -------
    A process that ends with the jobs; what they print stands in the files `slurm-*.out`.
    """
    environment = checkout_environment(PYTHON=sys.executable, **PATIENT_RANKS) | variables
    return subprocess.Popen(
        [
            str(word)
            for word in (*before, "sbatch", "--wait", f"--chdir={folder}", *options, *words)
        ],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def batch(folder: Path, *words: object, options: Sequence[object] = ()) -> None:
    """Run what `submit` starts to a good end."""
    process = submit(folder, *words, options=options)
    said, _ = process.communicate(timeout=HANG_SECONDS)
    assert process.returncode == 0, said + logs(folder)


def logs(folder: Path) -> str:
    """What the jobs that were submitted in a folder have printed."""
    return "".join(path.read_text() for path in sorted(folder.glob("slurm-*.out")))


def snakemake(folder: Path, *options: object, **variables: str) -> subprocess.Popen[str]:
    """Start Snakemake with the SLURM profile; its output goes to FOLDER/snakemake.log.

    `variables`: more of the environment.
    """
    command = [sys.executable, "-m", "snakemake", "-s", CHECKOUT / "Snakefile"]
    with (folder / "snakemake.log").open("w") as log:
        return subprocess.Popen(
            [str(part) for part in (*command, "--profile", PROFILE, *QUICK, *options)],
            cwd=folder,
            env=checkout_environment(**PATIENT_RANKS, **variables),
            stdout=log,
            stderr=subprocess.STDOUT,
            text=True,
        )


def finish(process: subprocess.Popen[str], folder: Path) -> str:
    """Output of a run that has to end well."""
    log = folder / "snakemake.log"
    try:
        process.wait(HANG_SECONDS)
    except subprocess.TimeoutExpired:
        jobs = run("squeue", "--long").stdout
        pytest.fail(f"it hangs:\n{log.read_text()[-6000:]}{jobs}")
    finally:
        process.kill()
    output = log.read_text()
    assert process.returncode == 0, output[-6000:]
    return output
