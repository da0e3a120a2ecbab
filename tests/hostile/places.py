"""What can stand where a file is expected: folders, pipes, sockets, links, devices."""

import os
import socket
import stat
from pathlib import Path

from tests.hostile.cases import Place

_DEVICES = {"null": 3, "zero": 5, "full": 7}
KINDS = ("folder", "pipe", "socket", "link", *_DEVICES)
"""Of places; a link may lead to itself."""


def put_place(path: Path, place: Place) -> None:
    """Make it."""
    match place.kind:
        case "folder":
            path.mkdir()
            path.chmod(place.rights)
        case "pipe":
            os.mkfifo(path)
        case "link":
            path.symlink_to(place.target)
        case "socket":
            _bind(path)
        case kind:
            _make_device(path, kind)


def _bind(path: Path) -> None:
    here = os.getcwd()
    with socket.socket(socket.AF_UNIX) as listener:
        os.chdir(path.parent)  # names of sockets are short
        try:
            listener.bind(path.name)
        finally:
            os.chdir(here)


def _make_device(path: Path, kind: str) -> None:
    """A device of memory of our own, since root could replace that of the machine."""
    try:
        os.mknod(path, stat.S_IFCHR, os.makedev(1, _DEVICES[kind]))
        path.chmod(0o666)
    except PermissionError:  # who cannot make one cannot replace one either
        path.symlink_to(f"/dev/{kind}")
