"""The job of SLURM that a process belongs to."""

import os
from collections.abc import Mapping


def job_and_node(environment: Mapping[str, str] = os.environ) -> str | None:
    """Number of the job and name of the node; None outside of jobs.

    Examples
    --------
    >>> array = {"SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": "2"}
    >>> job_and_node({"SLURM_JOB_ID": "9", "SLURMD_NODENAME": "n3"} | array)
    'job 7_2 on n3'
    >>> job_and_node({})
    """
    number = environment.get("SLURM_JOB_ID")
    if number is None:
        return None
    if "SLURM_ARRAY_TASK_ID" in environment:
        parent = environment.get("SLURM_ARRAY_JOB_ID", number)
        number = f"{parent}_{environment['SLURM_ARRAY_TASK_ID']}"
    node = environment.get("SLURMD_NODENAME")
    return f"job {number} on {node}" if node else f"job {number}"


def is_restarted(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether SLURM has started this job before: its node failed, or it was preempted.

    Examples
    --------
    >>> is_restarted({"SLURM_RESTART_COUNT": "1"}), is_restarted({})
    (True, False)
    """
    return environment.get("SLURM_RESTART_COUNT", "0") not in ("", "0")
