"""What a process that is no rank of several has to do before MPI is loaded.

Open MPI starts a daemon for a process that no launcher started, in case it should spawn ranks,
which nothing here does; to leave it out saves a tenth of a second or more.

`srun` without `--mpi` starts a process as the only task of a step and hands it no way to find other
ranks. Open MPI sees the step, looks for the way, and aborts; without the step's number it starts as
a single rank.
"""

from __future__ import annotations

from collections.abc import MutableMapping

_STEP = ("SLURM_STEP_ID", "SLURM_STEPID")
_LAUNCHERS = ("PMIX_", "PMI_", "OMPI_COMM_WORLD_")


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
    return any(name.startswith(_LAUNCHERS) for name in environment)
