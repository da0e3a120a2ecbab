"""A throw-away SLURM cluster on this machine (test support)."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

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


@dataclass(frozen=True)
class Cluster:
    """A running cluster of one node.

    Attributes
    ----------
    folder : what its daemons write.
    """

    folder: Path

    def fail(self) -> None:
        """Let the node die, with all of its jobs."""
        control("fail", self.folder)

    def repair(self) -> None:
        """Bring the node back, and start what it lost soon; SLURM would wait two minutes."""
        control("repair", self.folder)
        # Until the node has been told that the jobs are dead, it would kill them again.
        time.sleep(5)
        waiting = ["squeue", "--noheader", "--states=PENDING", "--format=%A"]
        for job in run(*waiting).stdout.split():
            subprocess.run(["scontrol", "update", f"JobId={job}", "StartTime=now"], check=True)

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
        """What slurmd has to say."""
        return (self.folder / "log" / "slurmd.log").read_text()

    def ends(self) -> list[str]:
        """How jobs ended, one state each, in order."""
        record = self.folder / "log" / "jobs.txt"
        return re.findall(r"JobState=(\S+)", record.read_text()) if record.exists() else []


def control(*arguments: object) -> None:
    """Run the cluster's script."""
    done = run("bash", SCRIPT, *arguments, env={**os.environ, "PATH": PLAIN})
    if done.returncode:
        raise RuntimeError(f"{SCRIPT.name} {arguments[0]}: {done.stderr}")


def started(folder: Path) -> Cluster:
    """Install SLURM where it is missing and start a cluster; skip where that is impossible."""
    if os.geteuid() != 0:
        pytest.skip("a SLURM cluster can only be started by root")
    if not shutil.which("slurmctld", path=DAEMONS) and not shutil.which("apt-get"):
        pytest.skip("no SLURM here, and no apt-get to install it by")
    control("install")
    try:
        control("start", folder)
    except RuntimeError as error:
        if "has a SLURM already" not in str(error):
            raise
        pytest.skip(str(error))
    return Cluster(folder)


def snakemake(folder: Path, *options: object) -> subprocess.Popen[str]:
    """Start Snakemake with the SLURM profile; its output goes to FOLDER/snakemake.log."""
    command = [sys.executable, "-m", "snakemake", "-s", CHECKOUT / "Snakefile"]
    with (folder / "snakemake.log").open("w") as log:
        return subprocess.Popen(
            [str(part) for part in (*command, "--profile", PROFILE, *QUICK, *options)],
            cwd=folder,
            env=checkout_environment(),
            stdout=log,
            stderr=subprocess.STDOUT,
            text=True,
        )
