"""PETSc, as it is loaded here: without settings from files, and without its own signal of pipes.

PETSc reads `.petscrc` and `petscrc` in the present folder, which may be a stranger's: options there
can load libraries and write files anywhere. It is told to skip them, and `~/.petscrc` with them;
options of the variable PETSC_OPTIONS and of the command line hold. Of a `petsc.cfg` there petsc4py
would learn where its compiled part is: it is loaded in another folder.

PETSc takes the signal of a pipe that nobody reads any more for a crash, says so in ten lines and
ends all ranks: of what is printed into `... | head`, of an answer to a page that is gone, or of
word to a process that has just ended.  Python ignores the signal and raises BrokenPipeError, which
programs can deal with.
"""

import signal
import sys
import threading

import petsc4py

from carillon.processes.present_folder import elsewhere
from carillon.processes.threads import look_for_libraries

if "petsc4py.PETSc" not in sys.modules:  # else whoever has loaded it has chosen
    with elsewhere():
        petsc4py.init(["-skip_petscrc"])

from petsc4py import PETSc

__all__ = ["PETSc", "leave_pipes_to_python"]


def leave_pipes_to_python() -> None:
    """Have the signal of a broken pipe handled as Python had it, which PETSc does not ask.

    Nothing changes in a thread other than the main one, where Python allows no such change.
    """
    if hasattr(signal, "SIGPIPE") and threading.current_thread() is threading.main_thread():
        # What Python knows of: it has not heard of PETSc's own.
        signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE) or signal.SIG_IGN)


leave_pipes_to_python()
look_for_libraries()
