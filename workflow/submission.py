"""What jobs of a cluster get beside the rules: cores, nodes, and their command line.

Snakemake hands the command line of a run on to its jobs in double quotes, in which a shell looks
for `$`, backticks, quotes and backslashes.  Of a configuration that is but the name of its file.
"""

import json
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from carillon.errors import UserError

_SPECIAL = re.compile(r"""["'$`\\\n]""")
_PLAIN = re.compile(r"[\w@%+=:,./-]*", re.ASCII)
_CORES, _ALLOCATION = "CARILLON_RUN_CORES", "CARILLON_SLURM_ALLOCATION"
_PLACES = (
    *("SLURM_NODELIST", "SLURM_JOB_NODELIST", "SLURM_NNODES", "SLURM_JOB_NUM_NODES"),
    *("SLURM_NTASKS", "SLURM_NPROCS", "SLURM_TASKS_PER_NODE", "SLURM_JOB_CPUS_PER_NODE"),
)
"""Variables that tell `mpiexec` the nodes of a job of SLURM and how many ranks each takes."""


def cores_of_run(cores: int | None, in_job: bool) -> int:
    """Cores of a run; its jobs on a cluster count the same, whatever the node has that they got.

    Else a job would start more threads than there are cores that were asked for it.

    Parameters
    ----------
    cores
        Cores that Snakemake may use here; None if it was not told, as on a cluster.
    in_job
        Whether Snakemake runs in a job of a cluster, with the environment of the run.
    """
    count = int(os.environ.get(_CORES, 1)) if in_job else cores or 1
    os.environ[_CORES] = str(count)
    return count


def hand_on_places(starts_ranks: bool) -> None:
    """Let an `mpiexec` in a job of SLURM know the job's nodes; called in each process of the job.

    The executor removes SLURM's variables before it starts the process that runs the rule, where
    `srun` would misread them. Their copy is put back there if something else `starts_ranks`.
    """
    here = {name: os.environ[name] for name in _PLACES if name in os.environ}
    if here:
        os.environ[_ALLOCATION] = json.dumps(here)
    elif starts_ranks:
        os.environ.update(json.loads(os.environ.get(_ALLOCATION, "{}")))


def require_plain(paths: Iterable[str | Path], given: Mapping[str, Any]) -> None:
    """Check before jobs are submitted that their scripts can hold what they are started with.

    Raises UserError if a path has a character that means something within double quotes, or a value
    one that does without quotes.

    Parameters
    ----------
    paths
        Of the rules, the working directory and configuration files.
    given
        Values of the configuration that the command line gives.
    """
    for path in map(str, paths):
        if _SPECIAL.search(path):
            raise UserError(
                f"{path!r}: jobs of a cluster cannot be given a path with quotes, $, backticks, "
                "backslashes or line breaks; rename it, or run without --executor"
            )
    for key, value in given.items():
        if not _PLAIN.fullmatch(str(value)):
            raise UserError(
                f"--config {key}={value}: jobs of a cluster cannot be given a value with blanks or "
                "quotes; write it into the configuration file"
            )
