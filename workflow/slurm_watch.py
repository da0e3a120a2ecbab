"""What happens to a run's jobs of SLURM, told on the terminal while it happens.

Snakemake tells that a job has failed, but not on which node, and nothing of a job that SLURM puts
back into the queue when its node fails. The commands of `workflow.patient_slurm` keep what `squeue`
has answered; a thread of the run compares one answer with the next.
"""

import subprocess
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from carillon.command_line.progress import say
from workflow import patient_slurm

POLL_SECONDS = 1.0
"""Time between two looks at the files."""
_AT_WORK = ("RUNNING", "COMPLETING", "SUSPENDED", "STAGE_OUT")
_WAITING = ("PENDING", "REQUEUED", "REQUEUE_HOLD", "CONFIGURING")
_GOOD = ("COMPLETED", "CANCELLED")
_LATER = "BeginTime"
"""Reason of a job that SLURM has put back into the queue, where it stays for two minutes."""
_ADVICE = {
    "BadConstraints": "no node has the memory, cores or nodes that it asks for: ask for less by "
    "`resources` in the configuration"
}
"""What to do about a job that failed for one of these reasons of SLURM's."""


@dataclass(frozen=True)
class Fate:
    """State of a job, where it is, and why."""

    state: str
    nodes: str
    reason: str

    @property
    def at_work(self) -> bool:
        """Whether the job runs."""
        return self.state in _AT_WORK


def read_fates(answer: str) -> dict[str, Fate]:
    """Fates by the job's number, from an answer of `squeue`."""
    rows = (line.split("|", 3) for line in answer.splitlines() if line.count("|") >= 3)
    return {number.strip(): Fate(state, nodes, reason) for number, state, nodes, reason in rows}


def sentence(number: str, before: Fate, now: Fate) -> str | None:
    """What has befallen a job between two answers, a sentence if it is worth one.

    Examples
    --------
    >>> at_work = Fate("RUNNING", "n2", "None")
    >>> sentence("7", at_work, Fate("PENDING", "", "BeginTime"))
    'job 7 on n2 was stopped by SLURM and is back in the queue'
    >>> sentence("7", at_work, Fate("OUT_OF_MEMORY", "n2", "OutOfMemory"))
    'job 7 on n2 has failed: OUT_OF_MEMORY (OutOfMemory)'
    >>> sentence("7", Fate("PENDING", "", "Resources"), Fate("PENDING", "", "BeginTime"))
    'job 7 was stopped by SLURM and is back in the queue, unless it was submitted with --begin'
    >>> sentence("7", at_work, Fate("COMPLETED", "n2", "None"))
    """
    if before.at_work and now.state in _WAITING:
        return f"job {number} on {before.nodes} was stopped by SLURM and is back in the queue"
    if now.reason == _LATER and before.reason != _LATER:
        return (
            f"job {number} was stopped by SLURM and is back in the queue, unless it was submitted "
            "with --begin"
        )
    if before.at_work and now.at_work and before.nodes != now.nodes:
        return f"job {number} on {before.nodes} was stopped by SLURM and runs again on {now.nodes}"
    if before.state != now.state and now.state not in (*_AT_WORK, *_WAITING, *_GOOD):
        nodes = now.nodes or before.nodes
        place, advice = f" on {nodes}" if nodes else "", _ADVICE.get(now.reason)
        more = f"; {advice}" if advice else ""
        return f"job {number}{place} has failed: {now.state} ({now.reason}){more}"
    return None


class Watch:
    """What is new about the jobs of a run.

    Parameters
    ----------
    folder
        Of the commands of `workflow.patient_slurm`; what they have said so far is not told again.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._last: dict[Path, dict[str, Fate]] = {}
        self._log = folder / patient_slurm.LOG
        self._known = self._log.stat().st_size if self._log.exists() else 0
        self._lock = threading.Lock()
        for file in self._answers():
            self._last[file] = read_fates(file.read_text())

    def start(self) -> None:
        """Tell what is new until the process ends."""
        threading.Thread(target=self._keep_telling, daemon=True).start()

    def tell(self) -> None:
        """Tell what is new since the last time; nothing if the folder does not answer."""
        with self._lock, suppress(OSError):
            for line in self._lines():
                say(f"SLURM: {line}")
            for file in self._answers():
                self._tell_fates(self._last.get(file, {}), fates := read_fates(file.read_text()))
                self._last[file] = self._last.get(file, {}) | fates

    def _tell_fates(self, before: Mapping[str, Fate], now: Mapping[str, Fate]) -> None:
        for number, fate in now.items():
            earlier = before.get(number, Fate("PENDING", "", ""))
            if text := sentence(number, earlier, fate):
                nodes = earlier.nodes or fate.nodes
                say(f"SLURM: {text}{_state_of(nodes) if nodes else ''}")

    def _lines(self) -> list[str]:
        """New lines of the log of the patient commands."""
        if not self._log.exists():
            return []
        with self._log.open() as file:
            file.seek(self._known)
            text = file.read()
            whole = text[: text.rfind("\n") + 1]
        self._known += len(whole.encode())
        return whole.splitlines()

    def _answers(self) -> list[Path]:
        return sorted(self._folder.glob(f"*.{patient_slurm.FATES_ENDING}"))

    def _keep_telling(self) -> None:
        pause = threading.Event()
        while not pause.wait(POLL_SECONDS):
            self.tell()


def _state_of(nodes: str) -> str:
    """What is wrong with nodes in the controller's eyes; empty if nothing is."""
    words = ["sinfo", "--noheader", f"--nodes={nodes}", "--states=down,drain,fail"]
    try:
        done = subprocess.run(
            [*words, "--format=%N is %T (%E)"], capture_output=True, text=True, timeout=10
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    lines = sorted(set(done.stdout.splitlines()))
    return f"; {', '.join(lines)}" if lines else ""
