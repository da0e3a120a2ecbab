"""What a process that is no rank of several has to do before MPI is loaded.

Open MPI starts a daemon for a process that no launcher started, in case it should spawn ranks,
which nothing here does; to leave it out saves a tenth of a second or more.

All such processes of a user share a directory, which each makes and removes in steps.  Where one
begins as another ends, what it has just made may be gone, and it aborts; so commands, and what
they start, get one each.

`srun` without `--mpi` starts a process as the only task of a step and hands it no way to find other
ranks. Open MPI sees the step, looks for the way, and aborts; without the step's number it starts as
a single rank.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, MutableMapping

_STEP = ("SLURM_STEP_ID", "SLURM_STEPID")
_LAUNCHERS = ("PMIX_", "PMI_", "OMPI_COMM_WORLD_")
_SETTINGS = "PMIX_MCA_"
"""Of PMIx, which it leaves to processes that a lone one starts."""
_DIRECTORY = "OMPI_MCA_orte_top_session_dir"
_OWN = "carillon-mpi"


def start_without_daemon(environment: MutableMapping[str, str]) -> None:
    """Have Open MPI start no daemon for a process that was not started as an MPI rank.

    Examples
    --------
    >>> environment = {}
    >>> start_without_daemon(environment)
    >>> environment
    {'OMPI_MCA_ess_singleton_isolated': '1'}
    """
    if not _launched(environment):
        environment.setdefault("OMPI_MCA_ess_singleton_isolated", "1")


def keep_apart(environment: MutableMapping[str, str], process: int) -> None:
    """Have Open MPI give a process that was not started as an MPI rank a directory of its own.

    A directory that the user has chosen stays.

    Examples
    --------
    >>> environment = {"TMPDIR": "/scratch"}
    >>> keep_apart(environment, 17)
    >>> directory = environment["OMPI_MCA_orte_top_session_dir"]
    >>> directory.startswith("/scratch/carillon-mpi."), directory.endswith(".17")
    (True, True)
    """
    if _launched(environment) or not _is_own(environment.get(_DIRECTORY, _OWN)):
        return
    folder = environment.get("OMPI_MCA_orte_tmpdir_base") or environment.get("TMPDIR") or "/tmp"
    name = f"{_OWN}.{os.uname().nodename}.{os.getuid()}.{process}"
    environment[_DIRECTORY] = os.path.join(folder, name)


def stay_apart(environment: MutableMapping[str, str], process: int) -> None:
    """Likewise of a process whose parent, or one before it, has a directory of its own.

    Examples
    --------
    >>> environment = {}
    >>> stay_apart(environment, 17)
    >>> environment
    {}
    """
    if _DIRECTORY in environment:
        keep_apart(environment, process)


def leave_nothing(environment: Mapping[str, str], process: int) -> None:
    """Remove the directory of a process that was started from here, and was killed."""
    directory = environment.get(_DIRECTORY, "")
    if _is_own(directory):  # that of this process, beside which its children's are
        shutil.rmtree(f"{directory.rpartition('.')[0]}.{process}", ignore_errors=True)


def _is_own(directory: str) -> bool:
    return os.path.basename(directory).startswith(_OWN)


def leave_lone_step(environment: MutableMapping[str, str]) -> None:
    """Forget the step of a process that is its only task and was not started as an MPI rank.

    Examples
    --------
    >>> environment = {"SLURM_STEP_ID": "0", "SLURM_STEP_NUM_TASKS": "1"}
    >>> leave_lone_step(environment)
    >>> environment
    {'SLURM_STEP_NUM_TASKS': '1'}
    """
    if environment.get("SLURM_STEP_NUM_TASKS") != "1":
        return
    if not _launched(environment):
        for name in _STEP:
            environment.pop(name, None)


def _launched(environment: MutableMapping[str, str]) -> bool:
    return any(
        name.startswith(_LAUNCHERS) and not name.startswith(_SETTINGS) for name in environment
    )
