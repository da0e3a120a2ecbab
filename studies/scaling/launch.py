"""Runs on several numbers of ranks, each started under mpiexec."""

import json
import logging
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import shorten
from typing import Any

from carillon.command_line.progress import track
from carillon.errors import UserError
from carillon.processes.children import run_child
from carillon.processes.threads import allowed_cores

logger = logging.getLogger(__name__)

LAUNCHER = "mpiexec"
MOST_RANKS = 1024
"""Ranks that a study of scaling starts."""
RANKS_OF_CORE = 16
"""Most ranks for each core of the machines they run on."""
ANY_RANKS = {
    # Open MPI binds ranks to cores, refuses root and more ranks than cores, unless told otherwise.
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "PRTE_MCA_hwloc_default_binding_policy": "none",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}
"""Variables that let any number of ranks run; other MPIs take no notice."""


def measure_each(
    arguments: Mapping[int, Sequence[str]],
) -> tuple[list[dict[str, Any]], dict[int, str]]:
    """Run `solver scaling ARGUMENTS` on each number of ranks, with one thread a rank.

    Raises UserError if there is no mpiexec, or all runs fail.

    `arguments`: by number of ranks; of a run that measures the ranks it is started on.

    Returns
    -------
    tuple[list[dict[str, Any]], dict[int, str]]
        What the runs found, and what those that failed said, by number of ranks.
    """
    launcher = shutil.which(LAUNCHER)
    if launcher is None:
        raise UserError(f"no {LAUNCHER} on PATH; install MPI, or start the ranks by hand")
    results: list[dict[str, Any]] = []
    failed: dict[int, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for ranks, given in track(arguments.items(), "ranks", total=len(arguments)):
            out = Path(folder) / f"{ranks}.json"
            command = [launcher, "-n", str(ranks), sys.executable, "-m", "mpi4py", "-m", "solver"]
            command += ["scaling", *given, "--here", "--out", str(out)]
            environment = {**ANY_RANKS, **os.environ, "OMP_NUM_THREADS": "1"}
            failure = failure_of(run_child(command, environment))
            if failure is None:
                results.append(json.loads(out.read_text()))
                logger.info(f"{ranks} ranks: {results[-1]['seconds']:.2f} s")
            else:
                failed[ranks] = failure
                logger.warning(f"the run on {ranks} ranks failed: {failure}")
    if not results:
        ranks, failure = next(iter(failed.items()))
        raise UserError(f"the run on {ranks} ranks failed: {failure}")
    return results, failed


def require_ranks(ranks: int, environment: Mapping[str, str] = os.environ) -> None:
    """Check that so many ranks may share the cores of this machine, or of a SLURM job's nodes.

    Raises UserError if not.
    """
    nodes = environment.get("SLURM_JOB_NUM_NODES", "1")
    cores = allowed_cores() * (int(nodes) if nodes.isdecimal() else 1)
    most = min(MOST_RANKS, RANKS_OF_CORE * cores)
    if ranks > most:
        raise UserError(
            f"{ranks:,} ranks on {cores} cores, expected at most {most:,}; the model tells about "
            "more without running them"
        )


def failure_of(done: subprocess.CompletedProcess[str]) -> str | None:
    """What a run that has ended said if it failed, in one sentence."""
    if done.returncode == 0:
        return None
    lines = [line for line in done.stderr.splitlines() if re.search(r"\w", line)]
    said = [line for line in lines if line.startswith(("solver", "carillon"))]
    return said[0] if said else shorten(f"exit status {done.returncode} {' '.join(lines)}", 300)
