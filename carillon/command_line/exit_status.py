"""How every command-line program of Carillon ends: cleanly, with one sentence when input is bad."""

import json
import os
import select
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TextIO

from carillon.command_line import logs
from carillon.command_line.progress import say
from carillon.errors import ConvergenceError, UserError, one_line
from carillon.files.paths import cause
from carillon.processes import extras
from carillon.processes.slurm_job import job_and_node

EXIT_BAD_INPUT = 2
EXIT_NOT_CONVERGED = 3
EXIT_INTERRUPTED = 130
LONGEST_WAIT = 10.0
"""Seconds that a rank waits for the others that raise an error of all ranks."""
REPORT = "CARILLON_ERRORS"
"""Environment variable with the name of a file, to which programs append their errors.

A line of the file is a sentence in JSON; who starts programs need not look for it in what they say.
"""

Comm = Any
"""mpi4py's communicator; this module does without MPI."""


def run(program: str, main: Callable[[], int | None], comm: Comm = None) -> int:
    """Call `main` and turn errors meant for the user into a sentence and an exit status.

    In a job of SLURM the sentence names the job and the node.
    That is 0; 2 for bad input, or lack of memory or room; 3 if a solver missed its tolerance; 130
    for an interrupt from the keyboard.

    Parameters
    ----------
    comm
        Ranks that all run the program, if there may be several.  Errors that all of them raise
        are told by the first one, and every rank returns; after any other the job is aborted, so
        that nobody waits for a rank that is gone.

    """
    _require_streams()
    logs.show()
    try:
        try:
            status = main() or 0
        except SystemExit:  # argparse has printed its help
            _flush()
            raise
        _flush()
        return status
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, BrokenPipeError) and _nobody_reads():
            _drop(sys.stdout)
            return 0
        status, sentence = meaning(error)
        if sentence is None:
            if comm is None or comm.size == 1:
                raise
            traceback.print_exc()
        collective = getattr(error, "collective", False)
        if sentence is not None and (comm is None or comm.rank == 0 or not collective):
            where = job_and_node()
            begin = f"{program} (in {where})" if where else program
            said = "\n".join(f"{begin}: {line}" for line in sentence.split("\n"))
            say(said)
            report(said)
    _drop_unwritten()
    if comm is not None and comm.size > 1:
        if collective:
            # The first rank that ends has the others killed, maybe before the sentence is out.
            everyone, last = comm.Ibarrier(), time.monotonic() + LONGEST_WAIT
            while not everyone.Test() and time.monotonic() < last:
                time.sleep(0.01)
        else:
            comm.Abort(status)
    return status


def report(sentence: str) -> None:
    """Append a sentence to the file that `REPORT` names, if it names one that can be written."""
    path = os.environ.get(REPORT)
    if path:
        with suppress(OSError), open(path, "a", encoding="utf-8") as file:
            file.write(json.dumps(sentence) + "\n")


def meaning(error: BaseException) -> tuple[int, str | None]:
    """Exit status of an error, and a sentence for the user; None if it is a fault of the program's.

    Several faults of what the user gave are a sentence and a line each.
    What the operating system refuses (files, room, processes) is never the program's fault.
    """
    match error:
        case UserError():
            return EXIT_BAD_INPUT, str(error)
        case ConvergenceError():
            return EXIT_NOT_CONVERGED, str(error)
        case KeyboardInterrupt():
            return EXIT_INTERRUPTED, "interrupted"
        case MemoryError():
            said = one_line(str(error))
            return EXIT_BAD_INPUT, (
                f"out of memory{f' ({said})' if said else ''}; ask for a lower resolution, fewer "
                "modes or fewer workers, or use a machine with more"
            )
        case ModuleNotFoundError():
            lack = extras.lack(error)
            return (1, None) if lack is None else (EXIT_BAD_INPUT, lack)
        case OSError():
            where = f"{error.filename}: " if error.filename is not None else ""
            return EXIT_BAD_INPUT, one_line(f"{where}{cause(error)}")
        case _:
            return 1, None


def _require_streams() -> None:
    """Occupy what is closed of standard input, output and error.

    Else the next file to be opened takes its number, and what libraries print goes into it.
    Names that are no text are shown with escapes.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is not None and hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="backslashreplace")


def _flush() -> None:
    if sys.stdout is not None:
        sys.stdout.flush()


def _nobody_reads() -> bool:
    """Whether standard output is a pipe whose reader has seen enough, as in `... | head`."""
    if not hasattr(select, "poll"):  # Windows
        return True
    poll = select.poll()
    with suppress(OSError, ValueError):
        poll.register(sys.stdout.fileno(), 0)
        return any(events & select.POLLERR for _, events in poll.poll(0))
    return False


def _drop_unwritten() -> None:
    """Give up what output and errors do not take, so that Python does not complain at its end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except (OSError, ValueError):
            _drop(stream)


def _drop(stream: TextIO) -> None:
    with suppress(OSError, ValueError):  # no file, as in tests
        number = stream.fileno()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, number)
        os.close(nowhere)
