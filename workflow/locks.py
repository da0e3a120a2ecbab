"""Locks that a killed run has left behind.

Snakemake locks the files of a run by notes in `.snakemake/locks`, which a process that was killed
cannot take away. The kernel's lock on a file ends with its process: every run holds one, shared,
and whoever gets it alone knows that the notes of a run that did not end properly are stale.
"""

import atexit
import fcntl
import json
import os
import socket
from pathlib import Path
from typing import Any, TextIO

from carillon.command_line.progress import say

FOLDER = Path(".snakemake")
_held: list[TextIO] = []


def take(folder: Path = FOLDER) -> bool:
    """Hold the lock of a run until this process ends; remove what a killed one has left.

    Returns whether no other run is at work, on this machine or another.

    Locks of a run on another machine stay, as some network file systems keep the kernel's locks to
    one machine; `snakemake --unlock` removes them.

    `folder`: Snakemake's folder in the working directory.
    """
    folder.mkdir(exist_ok=True)
    file = (folder / "carillon.run").open("a+")
    _held.append(file)
    alone = False
    try:
        if _is_alone(file):
            alone = _clean(folder, file)
            _sign(file)
        fcntl.flock(file, fcntl.LOCK_SH)
    except OSError:  # A file system without locks: Snakemake's own have to do.
        pass
    return alone


def _is_alone(file: TextIO) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _clean(folder: Path, file: TextIO) -> bool:
    """Remove the locks of the run that has signed and did not end properly, if it ran here.

    Returns whether it did not sign on another machine, where it may be at work still.
    """
    owner = _signature(file)
    locks = list((folder / "locks").glob("*.lock"))
    if locks and owner.get("host") == socket.gethostname():
        for lock in locks:
            lock.unlink(missing_ok=True)
        say(f"removed the lock of a run that was killed (process {owner['process']})")
    return owner.get("host", socket.gethostname()) == socket.gethostname()


def _signature(file: TextIO) -> dict[str, Any]:
    file.seek(0)
    try:
        signature = json.loads(file.read() or "{}")
    except ValueError:  # Cut off when the machine died.
        return {}
    return signature if isinstance(signature, dict) else {}


def _sign(file: TextIO) -> None:
    """Write down whose lock it is; struck out when the process ends properly."""
    file.truncate(0)
    json.dump({"host": socket.gethostname(), "process": os.getpid()}, file)
    file.flush()
    atexit.register(file.truncate, 0)
