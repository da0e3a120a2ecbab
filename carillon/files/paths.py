"""What may be read and what may be written to: regular files, by names that everything can hold."""

import errno
import os
import stat
import tempfile
import unicodedata
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from carillon.errors import UserError

LONGEST_NAME = 200
"""Longest name of a file in bytes; file systems take 255, of which temporary names need some."""

_OTHER_KINDS = (
    (stat.S_ISDIR, "folder"),
    (stat.S_ISLNK, "link"),
    (stat.S_ISCHR, "device"),
    (stat.S_ISBLK, "device"),
    (stat.S_ISFIFO, "pipe"),
    (stat.S_ISSOCK, "socket"),
)
_NO_ROOM = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG)


def user() -> int:
    """Number of this user; 0, which `lstat` tells of all files there, where users have none."""
    return os.geteuid() if hasattr(os, "geteuid") else 0


def is_own(status: os.stat_result, is_kind: Callable[[int], bool]) -> bool:
    """Whether what `lstat` tells of is of a kind, as by `stat.S_ISDIR`, and this user's."""
    return is_kind(status.st_mode) and status.st_uid == user()


def first_line(error: BaseException) -> str:
    """What an error says, up to the first line break."""
    lines = str(error).strip("'\"").splitlines()
    return lines[0] if lines else type(error).__name__


def cause(error: OSError) -> str:
    """What the operating system said, in one line, and what to do if there is no room left."""
    text = error.strerror if error.errno and error.strerror else first_line(error)
    if error.errno and error.errno in _NO_ROOM:
        text = os.strerror(error.errno)
        return f"{text}; make room and run the same command again"
    return text


def require_file(path: str | Path, what: str) -> Path:
    """Check that there is a regular file to read, not a folder, device or pipe, which may not end.

    `what`: what it should be, for messages: "a mesh". Raises UserError if there is none.
    """
    path = Path(path)
    try:
        mode = path.stat().st_mode
        if stat.S_ISREG(mode):
            open(path, "rb").close()  # whether that is allowed
    except FileNotFoundError:
        raise UserError(f"{path}: no such file, expected {what}") from None
    except (OSError, ValueError) as error:  # ValueError: a null byte
        said = cause(error) if isinstance(error, OSError) else str(error)
        raise UserError(f"{path}: cannot be read ({said}), expected {what}") from None
    if not stat.S_ISREG(mode):
        raise UserError(f"{path}: is a {kind_of_mode(mode)}, expected {what}")
    return path


def require_writable(path: str | Path, inputs: Iterable[str | Path] = ()) -> Path:
    """Check, before hours of work, that a result can be written to `path`.

    What is there already may only be a regular file, which will be replaced, or a symbolic link to
    one: then the link stays and the file that it names is replaced, or made if it is missing.
    `inputs`: files that are read for the result, which must not replace them; what is no file among
    them does not matter. Raises UserError if the name is no name for a file or that of an input,
    the folder is missing or not writable, or something else than a regular file is there: a folder,
    device, pipe or socket.
    """
    if str(path).endswith(("/", os.sep)):
        raise UserError(f"{path}: names a folder, expected the name of a file to write")
    path = Path(path)
    require_plain(path)
    for each in inputs:
        with suppress(OSError, ValueError):
            if os.path.samefile(each, path):
                raise UserError(f"{path}: is an input and would be replaced; name another file")
    try:
        folder = target_of(path).parent
        if not folder.is_dir():
            raise UserError(
                f"{path}: cannot be written, the folder {folder} does not exist; create it first"
            )
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise UserError(
            f"{path}: cannot be written ({cause(error)}); name a folder you may write to"
        ) from None
    return path


def require_plain(path: Path) -> None:
    """Check that a name is one that terminals, file systems and formats of text can hold.

    Raises UserError if it has line breaks, control characters, bytes that are no text, or is too
    long.
    """
    text = str(path)
    if any(unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp") for c in text):
        raise UserError(
            f"{ascii(text)}: holds line breaks, control characters or bytes that are no text, "
            "expected a plain file name"
        )
    length = len(path.name.encode())
    if length > LONGEST_NAME:
        raise UserError(
            f"{path.name[:40]}...: a name of {length:,} bytes, expected at most {LONGEST_NAME}"
        )


def target_of(path: Path) -> Path:
    """The file that writing to `path` makes or replaces, symbolic links followed.

    Raises UserError if something else than a regular file is there, and OSError if that cannot be
    found out.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:  # nothing there, a link to nothing, or no folder
        return Path(os.path.realpath(path)) if path.is_symlink() else path
    if not stat.S_ISREG(mode):
        raise UserError(f"{path}: is a {kind_of_mode(mode)}, expected the name of a file to write")
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def kind_of_mode(mode: int) -> str:
    """Kind of a file by its mode, in a word: "folder", "link", "pipe", or "file"."""
    return next((name for is_such, name in _OTHER_KINDS if is_such(mode)), "file")


def by_stem(paths: Iterable[str | Path]) -> dict[str, str]:
    """Names of files by their stems, or by themselves where stems are equal.

    Examples
    --------
    >>> by_stem(["a/bell.h5", "a/pan.h5"])
    {'bell': 'a/bell.h5', 'pan': 'a/pan.h5'}
    >>> by_stem(["a/bell.h5", "b/bell.h5"])
    {'a/bell.h5': 'a/bell.h5', 'b/bell.h5': 'b/bell.h5'}
    """
    names = list(dict.fromkeys(map(str, paths)))
    stems = [Path(name).stem for name in names]
    return dict(zip(stems if len(set(stems)) == len(stems) else names, names, strict=True))
