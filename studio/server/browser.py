"""Opens the page in the person's browser, without showing its token to others on the machine."""

import os
import sys
import threading
import webbrowser
from html import escape
from pathlib import Path

from carillon.command_line.progress import say

NAME = "open-studio.html"
"""File that leads to the page; in the workspace, as some browsers may read in homes alone."""


def open_page(url: str, folder: Path) -> Path | None:
    """Open an address with a token; the file in a folder that leads there, to be removed later.

    The address is not given to the browser itself: command lines are seen by all on a machine.
    Only the file's owner may read it.
    """
    if not _has_screen():
        return None
    path = folder / NAME
    refresh = f'<meta http-equiv="refresh" content="0;url={escape(url)}">'
    try:
        path.unlink(missing_ok=True)
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w") as stream:
            stream.write(f'<!doctype html><meta charset="utf-8">{refresh}')
    except OSError as error:
        say(f"no browser was opened ({error.strerror}); open the address above")
        return None
    threading.Thread(target=_open, args=(path.as_uri(),), daemon=True).start()
    return path


def _has_screen() -> bool:
    """Whether a browser with windows can be expected; one of text would take the terminal."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    return not sys.platform.startswith("linux") or any(os.environ.get(each) for each in screens)


def _open(address: str) -> None:
    """Some browsers keep whoever opens them waiting."""
    try:
        opened = webbrowser.open(address)
    except webbrowser.Error:
        opened = False
    if not opened:
        say("no browser was found; open the address above")
