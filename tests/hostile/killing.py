"""Programs that are killed at some moment of their run, and run again to the end."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.patience import HANG_SECONDS
from tests.workflow_runs import CHECKOUT, PROFILE
from workflow.commands.digest import digest

MARK = "CARILLON_KILLED"
"""Environment variable that all processes of a run inherit."""
ORPHAN_SECONDS = 90.0
"""Within which what is left of a killed run has to end by itself, on a machine under load."""
TIMES = (
    *("seconds", "precompute", "phases", "spread", "speedup", "slow_runs"),
    *("load", "memory", "provenance"),
)
"""Parts of the names of what a benchmark finds different every time."""


@dataclass(frozen=True)
class Killed:
    """A command that is killed, and what it has to end with.

    Attributes
    ----------
    name : for people.
    command : after `python -m`, run in a folder of its own.
    results : files that have to say the same as those of a run that nothing has disturbed.
    victim : "all" kills every process, "first" the one that was started, "rank" rank 1.
    ranks : started under mpiexec if several.
    files : put into the folder first, by name.
    """

    name: str
    command: Sequence[object]
    results: Sequence[str]
    victim: str = "all"
    ranks: int = 1
    files: dict[str, Path | str] = field(default_factory=dict)

    def prepare(self, folder: Path) -> Path:
        """A new folder with its files."""
        folder.mkdir()
        for name, content in self.files.items():
            if isinstance(content, Path):
                shutil.copy(content, folder / name)
            else:
                (folder / name).write_text(content)
        return folder


@dataclass(frozen=True)
class Undisturbed:
    """What a run from beginning to end has taken and made."""

    seconds: float
    found: dict[str, str]


def run_undisturbed(killed: Killed, folder: Path) -> Undisturbed:
    """Run it once and leave it alone."""
    killed.prepare(folder)
    begin = time.monotonic()
    _finish(killed, folder)
    return Undisturbed(time.monotonic() - begin, contents(killed, folder))


def kill_and_repeat(killed: Killed, folder: Path, moment: float) -> dict[str, str]:
    """Kill a run after `moment` seconds, run the command again; what its results say then.

    Raises
    ------
    AssertionError
        If processes are left by the killed run, or by the second one, if that fails, or if it
        leaves anything unfinished.
    """
    killed.prepare(folder)
    mark = uuid.uuid4().hex
    run = _start(killed, folder, mark, subprocess.DEVNULL)
    with suppress(subprocess.TimeoutExpired):
        run.wait(moment)
    _kill(killed, run, mark)
    run.wait()
    require_none_left(mark)
    _finish(killed, folder)
    unfinished = [path for path in folder.rglob("*") if _is_unfinished(path)]
    assert not unfinished, f"left behind: {unfinished}"
    return contents(killed, folder)


def contents(killed: Killed, folder: Path) -> dict[str, str]:
    """What the results say, but for times: digests of HDF5 files, the text of others."""
    found = {}
    for name in killed.results:
        path = folder / name
        if path.suffix == ".h5":
            found[name] = digest(path)
        else:
            found[name] = json.dumps(_without_times(json.loads(path.read_text())))
    return found


def moments(seed: str, count: int) -> list[float]:
    """Shares of a run's time at which it is killed, the same ones for the same seed."""
    source = random.Random(seed)
    return [source.uniform(0.02, 1.0) for _ in range(count)]


def _without_times(value: Any) -> Any:
    if isinstance(value, dict):
        return {
            key: _without_times(part)
            for key, part in value.items()
            if not any(word in key for word in TIMES)
        }
    return [_without_times(part) for part in value] if isinstance(value, list) else value


def _is_unfinished(path: Path) -> bool:
    """Whether a file is one that a result is written to before it has its name, or a journal."""
    inside = ".snakemake" in path.parts
    return not inside and ("partial" in path.name or path.name.startswith(".")) and path.is_file()


def _start(killed: Killed, folder: Path, mark: str, output: Any) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", *map(str, killed.command)]
    if killed.ranks > 1:
        command[2:2] = ["mpi4py", "-m"]
        command = ["mpiexec", "--oversubscribe", "-n", str(killed.ranks), *command]
    environment = {
        **os.environ,
        MARK: mark,
        "PYTHONPATH": str(CHECKOUT),
        "OMP_NUM_THREADS": "1",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    }
    return subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def _finish(killed: Killed, folder: Path) -> None:
    """Run it to its end, after which nothing of it is left."""
    mark = uuid.uuid4().hex
    run = _start(killed, folder, mark, subprocess.PIPE)
    try:
        output, _ = run.communicate(timeout=HANG_SECONDS)
    except subprocess.TimeoutExpired:
        _kill_all(mark)
        output, _ = run.communicate()
        raise AssertionError(f"no end after {HANG_SECONDS:g} s:\n{output[-4000:]}") from None
    assert run.returncode == 0, f"exit status {run.returncode}:\n{output[-4000:]}"
    require_none_left(mark)


def _kill(killed: Killed, run: subprocess.Popen[str], mark: str) -> None:
    if killed.victim == "all":
        _kill_all(mark)
    victims = [run.pid] if killed.victim == "first" else []
    if killed.victim == "rank":
        ranks = [pid for pid in _marked(mark) if _variable(pid, "OMPI_COMM_WORLD_RANK") == "1"]
        victims = ranks or [run.pid]  # before there are ranks, who is to start them
    for victim in victims:
        with suppress(ProcessLookupError):
            os.kill(victim, signal.SIGKILL)


def _kill_all(mark: str) -> None:
    """End all processes, those too that are being started meanwhile."""
    while processes := list(_marked(mark)):
        for process in processes:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        time.sleep(0.01)


def require_none_left(mark: str) -> None:
    """Wait until the last process has ended whose environment has the mark, see `MARK`.

    Raises
    ------
    AssertionError
        If one does not end by itself; it is killed.
    """
    until = time.monotonic() + ORPHAN_SECONDS
    while left := list(_marked(mark)):
        if time.monotonic() > until:
            lines = [_read(process, "cmdline").replace("\0", " ") for process in left]
            _kill_all(mark)
            raise AssertionError(f"processes are left: {lines}")
        time.sleep(0.05)


def _marked(mark: str) -> Iterator[int]:
    for name in os.listdir("/proc"):
        if name.isdigit() and _variable(int(name), MARK) == mark:
            yield int(name)


def _variable(process: int, name: str) -> str | None:
    """Value of an environment variable of a process; None if it has ended or has none."""
    for entry in _read(process, "environ").split("\0"):
        key, _, value = entry.partition("=")
        if key == name:
            return value
    return None


def _read(process: int, name: str) -> str:
    with suppress(OSError):
        return Path("/proc", str(process), name).read_bytes().decode(errors="replace")
    return ""


def snakemake(*targets: str) -> list[object]:
    """Arguments of a run by the rules, on the file config.yaml."""
    start = ["snakemake", "-s", CHECKOUT / "Snakefile", "--profile", PROFILE, "--cores", 2]
    return [*start, "--configfile", "config.yaml", "--", *targets]
