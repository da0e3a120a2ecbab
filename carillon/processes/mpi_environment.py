"""What a process that is no rank of several has to do before MPI is loaded.

Open MPI starts a daemon for a process that no launcher started, in case it should spawn ranks,
which nothing here does; to leave it out saves a tenth of a second or more. It looks for networks,
too, which takes two tenths, and listens on all of them: whoever connects can make the process wait.
Such a process needs none, and ranks of one machine talk through its memory.

All such processes of a user share a directory, which each makes and removes in steps.  Where one
begins as another ends, what it has just made may be gone, and it aborts; so commands, and what
they start, get one each.

`srun` without `--mpi` starts the tasks of a step and hands them no way to find each other. Open MPI
sees the step, looks for the way, and aborts; without the step's number it starts as a single rank.
Likewise `mpiexec` of another MPI. Such ranks do not know each other, and are told so.
"""

import os
import platform
import shutil
import stat
from collections.abc import Iterator, Mapping, MutableMapping
from contextlib import contextmanager, suppress

from carillon.files.paths import is_own, user
from carillon.files.system import may_write
from carillon.processes.loading import while_loading

_STEP = ("SLURM_STEP_ID", "SLURM_STEPID")
_LAUNCHERS = ("PMIX_", "PMI_", "OMPI_COMM_WORLD_")
_SETTINGS = "PMIX_MCA_"
"""Variables of PMIx that it leaves to processes which a lone one starts."""
_MPIEXEC = "rank {} of {}", "the mpiexec of the MPI that mpi4py was built with"
_SEVERAL = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK", *_MPIEXEC),
    ("MV2_COMM_WORLD_SIZE", "MV2_COMM_WORLD_RANK", *_MPIEXEC),
    ("PMI_SIZE", "PMI_RANK", *_MPIEXEC),
    ("MPI_LOCALNRANKS", "MPI_LOCALRANKID", *_MPIEXEC),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID", "task {} of {} of a Slurm step", "srun --mpi=pmix"),
)
"""Variables by which launchers tell how many processes they have started, and which one this is."""
_TRANSPORT, _WAYS = "OMPI_MCA_pml", "OMPI_MCA_btl"
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


def keep_off_networks() -> None:
    """Have Open MPI, if it is loaded later, neither look for networks nor listen on them."""
    while_loading("mpi4py.MPI", lambda: without_networks(os.environ))


@contextmanager
def without_networks(environment: MutableMapping[str, str]) -> Iterator[None]:
    """Have Open MPI neither look for networks nor listen on them while it is loaded in the body.

    Ranks on one machine keep to its memory. Of ranks on several nothing changes, nor of what the
    user has chosen. Ranks that the process starts later look for networks as usual.

    Examples
    --------
    >>> environment = {}
    >>> with without_networks(environment):
    ...     environment
    {'OMPI_MCA_pml': 'ob1', 'OMPI_MCA_btl': 'self'}
    >>> environment
    {}
    >>> environment = {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_LOCAL_SIZE": "2"}
    >>> with without_networks(environment):
    ...     environment["OMPI_MCA_btl"]
    'self,vader'
    """
    chosen = {}
    launched = _launched(environment)
    # Other transports than this one do not take these ways.
    if environment.get(_TRANSPORT, "ob1") == "ob1" and (
        not launched or _on_one_machine(environment)
    ):
        chosen = {_TRANSPORT: "ob1", _WAYS: "self,vader" if launched else "self"}
    own = {name: value for name, value in chosen.items() if name not in environment}
    environment.update(own)
    try:
        yield
    finally:
        for name in own:
            environment.pop(name, None)


def keep_apart(environment: MutableMapping[str, str], process: int) -> None:
    """Have Open MPI give a process that was not started as an MPI rank a directory of its own.

    A directory that the user has chosen stays. Others are in a folder for temporary files that can
    be written, or else in the present one, under a name that nobody can guess and take before.
    """
    if _launched(environment) or not _is_own(environment.get(_DIRECTORY, _OWN)):
        return
    folder = _temporary_folder(environment)
    environment[_DIRECTORY] = f"{os.path.join(folder, _name(process))}{os.urandom(8).hex()}"


def _name(process: int) -> str:
    return f"{_OWN}.{platform.node()}.{user()}.{process}."


def _temporary_folder(environment: Mapping[str, str]) -> str:
    given = (environment.get("OMPI_MCA_orte_tmpdir_base"), environment.get("TMPDIR"))
    folders = [*filter(None, given), "/tmp", "/var/tmp", "/dev/shm"]
    for each in folders:
        if os.path.isdir(each) and may_write(each):
            return each
    try:
        return os.getcwd()
    except OSError:  # it was removed
        return folders[0]


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
    if not _is_own(directory):
        return
    # Beside that of this process.
    with suppress(OSError), os.scandir(os.path.dirname(directory)) as entries:
        for entry in entries:
            named = entry.name.startswith(_name(process))
            if named and is_own(entry.stat(follow_symlinks=False), stat.S_ISDIR):
                shutil.rmtree(entry.path, ignore_errors=True)


def _is_own(directory: str) -> bool:
    return os.path.basename(directory).startswith(_OWN)


def leave_lonely_step(environment: MutableMapping[str, str]) -> None:
    """Forget the step of a process that was not started as an MPI rank, one task of it or several.

    Examples
    --------
    >>> environment = {"SLURM_STEP_ID": "0", "SLURM_STEP_NUM_TASKS": "1"}
    >>> leave_lonely_step(environment)
    >>> environment
    {'SLURM_STEP_NUM_TASKS': '1'}
    """
    if not _launched(environment):
        for name in _STEP:
            environment.pop(name, None)


def started_ranks(environment: Mapping[str, str]) -> int:
    """How many ranks a launcher of MPI has started, this one among them; 1 without a launcher.

    Tasks of a step of SLURM's are none: `srun` starts programs that know nothing of MPI, too.

    Examples
    --------
    >>> started_ranks({"OMPI_COMM_WORLD_SIZE": "4"}), started_ranks({"SLURM_STEP_NUM_TASKS": "4"})
    (4, 1)
    """
    sizes = (environment.get(size, "") for size, _, of, _ in _SEVERAL if of == _MPIEXEC[0])
    return max((int(size) for size in sizes if size.isdigit()), default=1)


def lonely_among(environment: Mapping[str, str]) -> str | None:
    """What to tell a process that has found no other ranks, if it was started as one of several.

    Without MPI, each of them would do all the work and write the same file.
    """
    for size, rank, of, remedy in _SEVERAL:
        count = environment.get(size, "")
        if count.isdigit() and int(count) > 1:
            return (
                f"this process is {of.format(environment.get(rank, '?'), count)}, but MPI finds no "
                "other; each does all the work by itself and writes the same files: start them by "
                f"{remedy}"
            )
    return None


@contextmanager
def no_rank(environment: MutableMapping[str, str]) -> Iterator[None]:
    """Hide in the body what a launcher told a rank: a process started there is none.

    Examples
    --------
    >>> environment = {"OMPI_COMM_WORLD_RANK": "1", "HOME": "/"}
    >>> with no_rank(environment):
    ...     environment
    {'HOME': '/'}
    >>> sorted(environment)
    ['HOME', 'OMPI_COMM_WORLD_RANK']
    """
    hidden = {name: environment.pop(name) for name in list(environment) if _tells_rank(name)}
    try:
        yield
    finally:
        environment.update(hidden)


def _tells_rank(name: str) -> bool:
    return name.startswith(_LAUNCHERS) and not name.startswith(_SETTINGS)


def _launched(environment: Mapping[str, str]) -> bool:
    return any(map(_tells_rank, environment))


def _on_one_machine(environment: Mapping[str, str]) -> bool:
    """Whether all ranks of a launcher are on this machine, as far as it tells.

    `mpiexec` starts its daemon on each other node by a step of SLURM's that has one node, so that
    what it tells itself goes before what SLURM tells.
    """
    size, here = (environment.get(f"OMPI_COMM_WORLD_{name}SIZE") for name in ("", "LOCAL_"))
    if size is not None and here is not None:
        return size == here
    return environment.get("SLURM_STEP_NUM_NODES") == "1"
