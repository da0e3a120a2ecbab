"""The journal of a shard under way: finished tasks in order, on disk, owned by one process.

A line that says what the file is, then frames: a tag of four letters, the length of the content, a
CRC-32 of all three, the content. The first frame holds the settings; `ENVI` frames say which
software and machine the work that follows was done on, `OWNR` frames which process has the journal
from there on, `TASK` frames hold the rows of one task. A frame that is cut off or whose checksum
differs ends the journal; what follows it is thrown away.

Who finds a journal whose owner's end is not certain, as on another machine, goes on with a copy in
its place; the other owner finds out at its next task and stops.
"""

import json
import logging
import os
import socket
import struct
import time
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from carillon.errors import UserError, one_line
from carillon.files import system
from carillon.files.atomic import sync_folder
from carillon.files.locks import (
    is_at,
    is_exclusive,
    is_replaced,
    machine,
    remove_and_close,
    take,
    take_over,
)
from carillon.files.paths import cause
from carillon.processes.slurm_job import is_restarted
from dataset_gen.settings import settings_from
from dataset_gen.tasks import ShardPlan

logger = logging.getLogger(__name__)

SYNC_SECONDS = 1.0
"""Work that is lost with a machine that loses power; a process that is killed loses none of it."""
_TITLE = b"Carillon journal of a shard, 1\n"
_FRAME = struct.Struct("<4sQI")
_PLAN, _ENVIRONMENT, _OWNER, _TASK = b"PLAN", b"ENVI", b"OWNR", b"TASK"


def journal_of(path: Path) -> Path:
    """Name of the journal of the shard `path`."""
    return path.parent / f".{path.name}.journal"


def discard_journal(path: Path) -> None:
    """Remove a journal left beside the finished shard `path`, unless somebody uses it."""
    if journal_of(path).exists():
        with suppress(UserError):
            file = _locked(journal_of(path))
            remove_and_close(journal_of(path), file)


class Journal:
    """The journal beside the shard `path`, locked and ready to be continued.

    A job that SLURM has started again waits for another process that works on the shard. Raises
    UserError if another process works on the shard, or the journal cannot be written, is damaged at
    its beginning, or belongs to other settings.

    Attributes
    ----------
    tasks
        Tasks it holds, the first ones of the plan.
    environments
        Where the work was done, one record for each change.
    """

    def __init__(self, path: Path, plan: ShardPlan, environment: dict[str, Any]) -> None:
        self.path = journal_of(path)
        self.plan = plan
        self.tasks = 0
        self.environments: list[dict[str, Any]] = []
        self._shard = path
        self._synced = time.monotonic()
        self._owner: dict[str, Any] = {}
        # A node that was cut off may still run this very job.
        self._file = _locked(self.path, patient=is_restarted())
        try:
            self._end = self._read()
            self._own()
            if environment not in self.environments[-1:]:
                self._append(_ENVIRONMENT, json.dumps(environment).encode())
                self.environments.append(environment)
            self.sync()
            sync_folder(self.path.parent)
        except BaseException:
            self.close(remove=os.fstat(self._file).st_size == 0)
            raise

    @property
    def rows(self) -> int:
        """Samples it holds."""
        return self.plan.rows(self.tasks)

    def append(self, work: bytes) -> None:
        """Add the result of the next task.

        Raises UserError if it cannot be written, or another process has taken the journal over; all
        earlier tasks are kept.
        """
        if is_replaced(self.path, self._file):
            raise UserError(
                f"{self._shard}: {_owner_at(self.path)} has taken it over, with the samples that "
                "were done by then; wait for that one"
            )
        self._append(_TASK, work)
        self.tasks += 1
        if time.monotonic() - self._synced > SYNC_SECONDS:
            self.sync()

    def sync(self) -> None:
        """Bring all that was appended to disk."""
        try:
            os.fsync(self._file)
        except OSError as error:
            raise self._failure(error) from None
        self._synced = time.monotonic()

    def work(self) -> Iterator[bytes]:
        """Results of all tasks in order."""
        for tag, content, _ in self._frames():
            if tag == _TASK:
                yield content

    def close(self, remove: bool = False) -> None:
        """Give up the lock, and the journal if it is to be removed, unless it is another's now."""
        if remove and is_at(self.path, self._file):
            remove_and_close(self.path, self._file)
        else:
            os.close(self._file)

    def _read(self) -> int:
        """Read what is there; position after the last good frame, 0 for a new journal."""
        frames = self._frames()
        tag, content, end = next(frames, (b"", b"", 0))
        if tag != _PLAN:
            self._require_new()
            return 0
        self._require_same_plan(content)
        for tag, content, position in frames:
            if tag == _ENVIRONMENT:
                self.environments.append(json.loads(content))
            elif tag == _OWNER:
                self._owner = json.loads(content)
            elif tag == _TASK and len(content) == self.plan.size(self.tasks):
                self.tasks += 1
            else:
                break
            end = position
        lost = os.fstat(self._file).st_size - end
        if lost:
            logger.warning(
                f"{self.path}: the last {lost:,} bytes are damaged or incomplete, done again"
            )
        return end

    def _own(self) -> None:
        """Make the journal this process's alone, cut off after the last good frame, and say so."""
        here = machine()
        if here and self._owner.get("machine") == here and is_exclusive(self._file):
            os.ftruncate(self._file, self._end)
        else:
            self._file = take_over(self.path, self._file, self._end)
        if self._end == 0:
            self._write(self._beginning())
        owner = {"host": socket.gethostname(), "process": os.getpid(), "machine": here}
        self._append(_OWNER, json.dumps(owner).encode())

    def _require_new(self) -> None:
        """An older journal may only be cut off within its beginning."""
        beginning = self._beginning()
        existing = system.read_at(self._file, len(beginning) + 1, 0)
        if len(existing) > len(beginning) or not _TITLE.startswith(existing[: len(_TITLE)]):
            raise UserError(
                f"{self.path}: is no journal or damaged at its beginning, so that the work in it "
                "cannot be used; remove it to begin again"
            )

    def _beginning(self) -> bytes:
        return _TITLE + _framed(_PLAN, json.dumps(self._plan_values()).encode())

    def _plan_values(self) -> dict[str, Any]:
        return {"task_rows": self.plan.task_rows, "settings": self.plan.settings.as_dict()}

    def _require_same_plan(self, content: bytes) -> None:
        values = json.loads(content)
        try:
            begun = ShardPlan(settings_from(values["settings"]), int(values["task_rows"]))
        except (KeyError, TypeError, ValueError) as error:
            raise UserError(
                f"{self.path}: was begun by another version of Carillon ({error}); remove it to "
                "begin again"
            ) from None
        different = begun.settings.difference(self.plan.settings)
        if different is None and begun.task_rows != self.plan.task_rows:
            different = f"tasks of {begun.task_rows} samples where {self.plan.task_rows} are usual"
        if different is not None:
            raise UserError(
                f"{self._shard}: was begun with {different}; finish it with the settings it was "
                f"begun with, remove {self.path}, or choose another name"
            )

    def _frames(self) -> Iterator[tuple[bytes, bytes, int]]:
        return _frames(self._file)

    def _append(self, tag: bytes, content: bytes) -> None:
        self._write(_framed(tag, content))

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        done = 0
        try:
            while done < len(view):
                done += system.write_at(self._file, view[done:], self._end + done)
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, self._end)
            raise self._failure(error) from None
        self._end += len(view)

    def _failure(self, error: OSError) -> UserError:
        return UserError(
            f"{self.path}: could not be written ({cause(error)}); {self.rows:,} of "
            f"{self.plan.settings.count:,} samples are kept"
        )


def _frames(file: int, *tags: bytes) -> Iterator[tuple[bytes, bytes, int]]:
    """Tag, content and end of every good frame from the beginning on; only of `tags` if given."""
    size = os.fstat(file).st_size
    position = len(_TITLE)
    if system.read_at(file, position, 0) != _TITLE:
        return
    while size - position >= _FRAME.size:
        tag, length, checksum = _FRAME.unpack(system.read_at(file, _FRAME.size, position))
        position += _FRAME.size
        if length > size - position:
            return
        wanted = not tags or tag in tags
        content = _read(file, length, position) if wanted else b""
        position += length
        if wanted:
            if checksum != _checksum(tag, content):
                return
            yield tag, content, position


def _owner_at(journal: Path) -> str:
    """The process that has a journal, as far as that says so; nothing else is waited for."""
    owner: dict[str, Any] = {}
    with suppress(OSError, ValueError):
        file = os.open(journal, os.O_RDONLY | system.REGULAR)
        try:
            for _, content, _ in _frames(file, _OWNER):
                owner = json.loads(content)
        finally:
            os.close(file)
    if {"process", "host"} <= set(owner):
        return f"process {owner['process']} on {one_line(str(owner['host']))}"
    return "another process"


def _checksum(tag: bytes, content: bytes) -> int:
    return zlib.crc32(content, zlib.crc32(tag + len(content).to_bytes(8, "little")))


def _framed(tag: bytes, content: bytes) -> bytes:
    return _FRAME.pack(tag, len(content), _checksum(tag, content)) + content


def _read(file: int, length: int, position: int) -> bytes:
    """`length` bytes, fewer only at the end of the file."""
    pieces = []
    while length > 0 and (piece := system.read_at(file, length, position)):
        pieces.append(piece)
        length -= len(piece)
        position += len(piece)
    return b"".join(pieces)


def _locked(journal: Path, patient: bool = False) -> int:
    return take(
        journal,
        f"{journal}: {_owner_at(journal)} is generating this shard; wait for it, or choose another "
        "name",
        patient,
    )
