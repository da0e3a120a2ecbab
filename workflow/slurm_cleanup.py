"""Jobs of SLURM that a killed run has left in the queue.

Snakemake cancels its jobs when it is interrupted, which a process that was killed cannot do. They
would run on beside the jobs that the next run submits for the same files. The next run cancels them
first: what they have finished stands in journals, from which its own jobs go on.
"""

import re
import shutil
import subprocess
import time
from pathlib import Path

from carillon.command_line.progress import say

PATIENCE_SECONDS = 120.0
"""Time for which cancelled jobs are waited for before the run goes on."""

_FORMAT = "%A|%j|%k|%Z"  # number, name, comment, working directory
_RUN = re.compile(r"(.*_)?[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_POLL_SECONDS = 0.5


def cancel(folder: Path) -> None:
    """Cancel the jobs that Snakemake has submitted from `folder`, and wait for their end.

    Nothing happens where there is no SLURM. To be called only when no run is at work in `folder`.
    """
    if not (shutil.which("squeue") and shutil.which("scancel")):
        return
    numbers = jobs(folder)
    if not numbers:
        return
    subprocess.run(["scancel", *numbers], capture_output=True)
    say(
        f"cancelled {len(numbers)} jobs of SLURM that a killed run has left "
        f"({', '.join(numbers[:8])}{', ...' if len(numbers) > 8 else ''}); their work goes on from "
        "their journals"
    )
    until = time.monotonic() + PATIENCE_SECONDS
    while jobs(folder) and time.monotonic() < until:
        time.sleep(_POLL_SECONDS)


def jobs(folder: Path) -> list[str]:
    """Numbers of the jobs in the queue that Snakemake has submitted from `folder`."""
    asked = subprocess.run(
        ["squeue", "--me", "--noheader", f"--format={_FORMAT}"], capture_output=True, text=True
    )
    numbers = []
    for line in asked.stdout.splitlines():
        number, name, comment, place = line.split("|", 3)
        submitted_here = Path(place.strip()) == folder.resolve()
        if submitted_here and _RUN.fullmatch(name) and comment.startswith("rule_"):
            numbers.append(number)
    return list(dict.fromkeys(numbers))
