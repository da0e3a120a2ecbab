"""Programs run by forking a process that has imported them already.

Starting Python and importing MPI, PETSc, numba and the rooms takes seconds, running into a mistake
milliseconds. `python -m tests.zygote` imports everything, initialises nothing, and forks
for every job that it reads as a line of JSON; the fork is bounded in time, memory and size of
files, has a session of its own, and ends with everything that it has started.
"""

import atexit
import ctypes
import gc
import importlib
import json
import os
import resource
import runpy
import select
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NoReturn

from tests.programs import CHECKOUT

ROOMS = ("carillon", "dataset_gen", "forests", "solver", "sound", "studio", "workflow")
WITHOUT_MPI = ("dataset_gen", "forests", "tests.hostile.configure", "snakemake")
"""Programs that import no MPI unless they are started on several ranks."""
MARK = "CARILLON_HOSTILE_JOB"
"""Environment variable by which processes that a job has started are known."""
NOBODY = 65534
GRACE_SECONDS = 60.0
"""Within which what a job has started has to end after it, on a machine under load."""
IDLE_SECONDS = 15.0
"""After which a job of which nothing runs, nor wants to, is said to sleep for ever."""

# As `MPI_Init` of one process takes it: no daemon, no search for networks.
_ALONE = {
    "OMPI_MCA_ess_singleton_isolated": "1",
    "OMPI_MCA_orte_create_session_dirs": "0",
    "OMPI_MCA_btl": "self",
    "OMPI_MCA_pml": "ob1",
    "OMPI_MCA_mtl": "^ofi,psm2",
    "OMPI_MCA_osc": "^ucx,rdma",
}
_LATER = (
    *("sound.design.optimise", "sound.export.faust", "sound.export.gltf", "sound.export.embedded"),
    *("sound.rendering.render", "sound.project.project", "sound.project.design_file"),
    "studies.scaling.plot",
    *("snakemake.cli", "snakemake.utils", "soundfile", "igl", "trimesh"),
    *("scipy.signal", "scipy.optimize"),
    *("networkx", "multiprocessing.pool", "matplotlib.pyplot"),
    *("scipy.ndimage", "scipy.cluster.vq", "scipy.sparse.csgraph"),
    *("carillon.fem.finite_cells.build", "dataset_gen.objectives.fitting"),
)
"""What the programs import when they need it."""


@dataclass(frozen=True)
class Limits:
    """Of a job and each process that it starts: seconds of processor time, bytes."""

    cpu_seconds: int = 60
    address_space: int = 6 << 30
    file_size: int = 1 << 28


@dataclass(frozen=True)
class Job:
    """One run of `python -m ROOM ARGUMENTS...`; `plain` takes the rights of root away."""

    room: str
    arguments: Sequence[str]
    folder: str
    environment: Mapping[str, str] = field(default_factory=dict)
    limits: Limits = field(default_factory=Limits)
    plain: bool = False


@dataclass(frozen=True)
class Outcome:
    """How a job ended.

    `status` is the exit status, or minus the signal; `slept` tells that it had to be ended since
    it waited for something; `left` are command lines of processes that outlived it.
    """

    status: int
    stdout: str
    stderr: str
    cpu_seconds: float
    peak_bytes: int
    slept: bool
    left: tuple[str, ...]


class Zygote:
    """The forking process, as its user sees it; `variables` are what all programs find."""

    def __init__(self, variables: Mapping[str, str] = {}) -> None:
        environment = {
            **os.environ,
            **variables,
            **_ALONE,
            "PYTHONPATH": str(CHECKOUT),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "MPLBACKEND": "agg",
        }
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.zygote"],
            cwd=CHECKOUT,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._answer() == {"ready": True}

    def run(self, job: Job) -> Outcome:
        """Run a job to its end."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(asdict(job)) + "\n")
        self._process.stdin.flush()
        found = self._answer()
        return Outcome(left=tuple(found.pop("left")), **found)

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"the zygote has ended, status {self._process.wait()}")
        answer: dict[str, Any] = json.loads(line)
        return answer


# The forking process ------------------------------------------------------------------------------


def _serve() -> None:
    """Fork for each line of standard input, answer each with a line."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print is no answer
    ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)  # PR_SET_CHILD_SUBREAPER: orphans come here
    libraries = _import_all()
    _load_kernels()
    gc.collect()
    gc.freeze()
    print(json.dumps({"ready": True}), file=answers, flush=True)
    for number, line in enumerate(sys.stdin):
        described = json.loads(line)
        job = Job(**{**described, "limits": Limits(**described["limits"])})
        mark = f"{os.getpid()}-{number}"
        pipes = [os.pipe(), os.pipe()]
        child = os.fork()
        if child == 0:
            os.close(answers.fileno())
            _be(job, mark, libraries, [write for _, write in pipes])
        for _, write in pipes:
            os.close(write)
        printed = [_Printed(read) for read, _ in pipes]
        print(json.dumps(_ended(child, mark, printed)), file=answers, flush=True)


def _import_all() -> tuple[Any, Any, Any]:
    """MPI, PETSc and SLEPc, loaded without being initialised, after all that the rooms import."""
    import mpi4py

    mpi4py.rc.initialize = mpi4py.rc.finalize = False
    from mpi4py import MPI
    from petsc4py.lib import ImportPETSc
    from slepc4py.lib import ImportSLEPc

    PETSc, SLEPc = ImportPETSc(), ImportSLEPc()
    programs = importlib.import_module("carillon.__main__")
    for name in (*(each.module for each in programs.commands().values()), *_LATER):
        importlib.import_module(name)
    del sys.modules["carillon.__main__"]
    assert not MPI.Is_initialized()
    return MPI, PETSc, SLEPc


def _load_kernels() -> None:
    """Numba's own tables, which take it a third of a second, and the kernels that models take.

    No file of HDF5 may be opened here: forks that then fail to write one crash.
    """
    from solver.analysis.problem import ProblemOptions, build_problem

    build_problem(ProblemOptions("builtin:box", 6, coarsen="average"))
    build_problem(ProblemOptions("builtin:box", 6, discretisation="finite-cell"))


def _be(job: Job, mark: str, libraries: tuple[Any, Any, Any], pipes: list[int]) -> NoReturn:
    """What the fork does: become the program and end as it does."""
    status = 1
    try:
        os.setsid()
        _redirect(pipes)
        _bound(job)
        MPI, PETSc, SLEPc = libraries
        if job.room in WITHOUT_MPI:
            del sys.modules["mpi4py"]  # by which they tell that nobody else needs it
        else:
            MPI.Init_thread(MPI.THREAD_MULTIPLE)
            PETSc._initialize([job.room, "-skip_petscrc"])
            SLEPc._initialize()
            importlib.import_module("carillon.processes.petsc").leave_pipes_to_python()
        for name in _ALONE:
            os.environ.pop(name, None)  # those that the program starts may be several ranks
        os.environ.update({MARK: mark, **job.environment})
        sys.argv = [job.room, *job.arguments]
        status = run_room(job.room)
        atexit._run_exitfuncs()
        if MPI.Is_initialized() and not MPI.Is_finalized():
            MPI.Finalize()
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(Exception):
            sys.stdout.flush()
        with suppress(Exception):
            sys.stderr.flush()
        ctypes.CDLL(None).fflush(None)  # what libraries print
        os._exit(status)


def run_room(room: str) -> int:
    """Exit status of `python -m ROOM`, run here with the words of sys.argv."""
    try:
        runpy.run_module(room, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    return 0


def _redirect(pipes: list[int]) -> None:
    for number, opened in enumerate([os.open(os.devnull, os.O_RDONLY), *pipes]):
        os.dup2(opened, number)
        os.close(opened)
    sys.stdin = open(0, closefd=False)
    sys.stdout = open(1, "w", closefd=False)
    sys.stderr = open(2, "w", buffering=1, errors="backslashreplace", closefd=False)


def _bound(job: Job) -> None:
    limits = job.limits
    os.chdir(job.folder)
    os.umask(0o022)
    for what, most in (
        (resource.RLIMIT_CPU, limits.cpu_seconds),
        (resource.RLIMIT_AS, limits.address_space),
        (resource.RLIMIT_FSIZE, limits.file_size),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(what, (most, most))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # as Python does at its start
    if job.plain and os.geteuid() == 0:
        os.setgroups([])
        os.setresgid(NOBODY, NOBODY, NOBODY)
        os.setresuid(NOBODY, NOBODY, NOBODY)


class _Printed:
    """What a job prints; a pipe, since files are bounded."""

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self._pieces: list[bytes] = []
        os.set_blocking(handle, False)

    def fileno(self) -> int:
        return self._handle

    def read(self) -> bool:
        """Take what there is; False if there will be no more."""
        with suppress(BlockingIOError):
            while piece := os.read(self._handle, 1 << 16):
                self._pieces.append(piece)
            return False
        return True

    def text(self) -> str:
        """All of it, shortened if it is megabytes."""
        self.read()
        os.close(self._handle)
        return b"".join(self._pieces)[: 1 << 20].decode(errors="replace")


def _ended(child: int, mark: str, printed: list[_Printed]) -> dict[str, Any]:
    """Wait for a job, or until it sleeps for ever, then end what it has left."""
    handle = os.pidfd_open(child)
    used, since = -1.0, time.monotonic()
    slept = False
    watched: list[Any] = [handle, *printed]
    while not slept:
        ready = select.select(watched, [], [], 0.5)[0]
        if handle in ready:
            break
        for pipe in ready:
            if not pipe.read():
                watched.remove(pipe)
        ticks = _ticks(child, mark)
        if ticks != used:
            used, since = ticks, time.monotonic()
        slept = time.monotonic() - since > IDLE_SECONDS
    os.close(handle)
    if slept:
        os.kill(child, signal.SIGKILL)
    _, code, resources = os.wait4(child, 0)
    left = _end_others(child, mark)
    return {
        "status": os.waitstatus_to_exitcode(code),
        "cpu_seconds": resources.ru_utime + resources.ru_stime,
        "peak_bytes": resources.ru_maxrss * 1024,
        "stdout": printed[0].text(),
        "stderr": printed[1].text(),
        "slept": slept,
        "left": [] if slept else left,
    }


def _ticks(session: int, mark: str) -> float:
    """Processor time of the processes of a job; not a number if one is about to run."""
    total = 0.0
    for process in _processes(session, mark):
        with suppress(OSError):
            fields = _status(process)
            total += float("nan") if fields[0] in b"RD" else int(fields[11]) + int(fields[12])
    return total


def _status(process: int) -> list[bytes]:
    """Fields of /proc/PID/stat from the state on."""
    return Path("/proc", str(process), "stat").read_bytes().rpartition(b") ")[2].split()


def _end_others(session: int, mark: str) -> list[str]:
    """Command lines of processes that do not end by themselves in time; they are ended."""
    if not _has_children():  # orphans come here
        return []
    until = time.monotonic() + GRACE_SECONDS
    while others := list(_processes(session, mark)):
        if time.monotonic() > until:
            lines = [_command_line(process) for process in others]
            for process in others:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            _reap()
            return lines
        time.sleep(0.02)
        _reap()
    return []


def _has_children() -> bool:
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return False
    return True


def _reap() -> None:
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _processes(session: int, mark: str) -> Iterator[int]:
    """Processes of a session, and those elsewhere that have inherited the mark."""
    entry = f"{MARK}={mark}".encode()
    for name in os.listdir("/proc"):
        if not name.isdigit() or int(name) == os.getpid():
            continue
        with suppress(OSError):
            fields = _status(int(name))
            if fields[0] == b"Z":
                continue
            if int(fields[3]) == session:
                yield int(name)
            elif entry in Path("/proc", name, "environ").read_bytes().split(b"\0"):
                yield int(name)


def _command_line(process: int) -> str:
    with suppress(OSError):
        return Path("/proc", str(process), "cmdline").read_text().replace("\0", " ").strip()
    return "?"


if __name__ == "__main__":
    _serve()
