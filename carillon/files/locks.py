"""Locks that die with their process: who comes second is told so, instead of doing work twice.

A network file system may keep locks to one machine, or have none; and a machine that was cut off
writes late what it had to write. Against both, a file that may have another writer is not gone on
with: a copy takes its place (`take_over`), and the other writer's late bytes go to the old file.
"""

import errno
import logging
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from carillon.errors import UserError
from carillon.files import system
from carillon.files.atomic import sync_folder, temporary_name
from carillon.files.paths import cause, require_writable

logger = logging.getLogger(__name__)

PIECE = 1 << 24
"""Bytes that are copied at a time."""
_NO_LOCKS = (errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK, errno.EINVAL)


@contextmanager
def locked(path: str | Path) -> Iterator[None]:
    """Hold the result `path` for this process alone, while it works out what to write there.

    For results that a later run goes on from. The lock is a file beside `path`, removed at the end;
    what a killed process has left is taken over by the next one. Raises UserError if another
    process holds it, or it cannot be made.
    """
    path = require_writable(path)
    name = Path(f"{path.parent}/.{path.name}.lock")
    file = take(name, f"{path}: another process is working on it; wait for it, or name another")
    try:
        yield
    finally:
        remove_and_close(name, file)


def remove_and_close(name: Path, file: int) -> None:
    """Remove the file `name` from `take` and give it back; who waits for it makes another one."""
    if system.RENAMES_OPEN:
        name.unlink(missing_ok=True)
        os.close(file)
    else:
        os.close(file)
        with suppress(OSError):  # another process has opened it since
            name.unlink(missing_ok=True)


def take(name: Path, refusal: str, patient: bool = False) -> int:
    """Open the file `name`, made if need be, for this process alone; closing it gives it back.

    Who removes the file does so by `remove_and_close`. If another process has it, the `patient`
    wait until that has ended. Raises UserError with the sentence `refusal` if another process has
    it; if it cannot be opened or is no regular file, but a link, pipe or device.
    """
    flags = os.O_RDWR | os.O_CREAT | system.REGULAR
    while True:
        try:
            file = os.open(name, flags, 0o666)
        except OSError as error:
            if error.errno == errno.ELOOP:
                raise UserError(f"{name}: cannot be written (it is a link); remove it") from None
            raise UserError(f"{name}: cannot be written ({cause(error)})") from None
        try:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                raise UserError(f"{name}: is no regular file, remove it")
            _lock(name, file, refusal, patient)
            if is_at(name, file):
                return file
        except BaseException:
            os.close(file)
            raise
        os.close(file)  # who had it before has finished and removed it


def _lock(name: Path, file: int, refusal: str, patient: bool) -> None:
    try:
        system.lock(file)
    except BlockingIOError:
        if not patient:
            raise UserError(refusal) from None
        logger.warning(f"{name}: is held by another process; waiting until that has ended")
        system.lock(file, wait=True)
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise UserError(f"{name}: cannot be locked ({cause(error)})") from None
        logger.warning(f"{name}: this file system has no locks; write no result twice at a time")


def is_at(name: Path, file: int) -> bool:
    """Whether the open file is the one that is called `name`."""
    with suppress(FileNotFoundError):
        return os.path.samestat(os.lstat(name), os.fstat(file))
    return False


def is_replaced(name: Path, file: int) -> bool:
    """Whether another file than the open one is called `name`; an absent one may come back."""
    try:
        return not os.path.samestat(os.lstat(name), os.fstat(file))
    except OSError:
        return False


def is_exclusive(file: int) -> bool:
    """Whether the lock of a file from `take` keeps out the other processes of this machine."""
    try:
        system.lock(file)
    except OSError:
        return False
    return True


def machine() -> str | None:
    """Name of this start of the kernel, which keeps all locks of a machine; None if it has none."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return None


def take_over(name: Path, file: int, length: int) -> int:
    """Put a copy of the first `length` bytes in the place of a file from `take`, which it closes.

    Returns the copy, locked, which no other process has open. Raises UserError if it cannot be
    made; the file then stays as it was, and open. On Windows it is the file itself, cut off: there
    the lock keeps out the processes of other machines, too.
    """
    if not system.RENAMES_OPEN:
        os.ftruncate(file, length)
        return file
    start, end = temporary_name(name.name)
    try:
        copy, temporary = tempfile.mkstemp(prefix=start, suffix=end, dir=name.parent)
        try:
            with suppress(OSError):  # a file system without locks
                system.lock(copy)
            os.fchmod(copy, stat.S_IMODE(os.fstat(file).st_mode))
            done = 0
            while piece := system.read_at(file, min(PIECE, length - done), done):
                done += system.write_at(copy, piece, done)
            os.fsync(copy)
            os.replace(temporary, name)
        except BaseException:
            os.close(copy)
            with suppress(OSError):
                os.unlink(temporary)
            raise
    except OSError as error:
        raise UserError(f"{name}: cannot be taken over ({cause(error)})") from None
    sync_folder(name.parent)
    os.close(file)
    return copy
