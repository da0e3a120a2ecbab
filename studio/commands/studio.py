"""`carillon studio`: design a sound in the browser.

Opens a page on this machine on which points of a solid are picked, clips dropped on them, and any
point is struck while a material is sought that sounds like the clips. It ends with Ctrl-C; what
was designed is kept in the workspace.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from carillon.command_line.progress import say
from carillon.errors import UserError, one_line
from carillon.parameters import option, parameters
from carillon.parameters.command_line import add_options, collect
from carillon.parameters.quantities import MetresPerUnit, UpAxis, WallThickness, between

if TYPE_CHECKING:
    import socket

    from studio.server.guard import Keys

EXAMPLES = """examples:
  carillon studio
  carillon studio builtin:bell
  carillon studio jug.stl --unit mm --up y
  carillon studio pan.yaml --port 8620 --no-browser
  carillon studio --export page.html design.h5
"""
PACKAGES = ("starlette", "uvicorn", "websockets")
"""Packages that the studio's server alone needs."""
REQUIREMENTS = "workflow/envs/requirements-studio.txt"
WORKSPACE = "carillon-studio"
"""Folder of projects where no file is opened whose own folder it is."""
BUILTIN = "builtin:"
LOOPBACK_HOST = "127.0.0.1"


@parameters
class StudioOptions:
    """What is opened, and where it is served."""

    what: str | None = option(
        None,
        "project (YAML), mesh, design (.h5) or builtin:NAME to begin with (default: choose there)",
        metavar="FILE",
    )
    workspace: str | None = option(
        None,
        "folder of projects, made if it is not there (default: that of FILE, else "
        f"{WORKSPACE}); no other is read or written",
        metavar="FOLDER",
    )
    unit: MetresPerUnit | None = option(
        None, "unit of a mesh that is opened: m, cm, mm, um or in, or metres (default: m)"
    )
    up: UpAxis | None = option(
        None,
        "axis of a mesh that is opened that points up, and becomes z (default: y of glTF, else z)",
    )
    wall: WallThickness | None = option(
        None, "thickness of a wall that follows a mesh that is opened (0.8mm)", metavar="LENGTH"
    )
    port: Annotated[int, between(1, 65535)] | None = option(
        None,
        "port to listen on (default: the first free one from 8620 on)",
    )
    host: str = option(
        LOOPBACK_HOST,
        "address to listen on (default 127.0.0.1, which other machines cannot reach)",
        metavar="ADDRESS",
    )
    no_browser: bool = option(False, "open no browser, only say where the page is")
    export: str | None = option(
        None,
        "serve nothing: write a finished design (FILE) as a page that needs no server",
        metavar="PAGE.html",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, StudioOptions, positional=("what",))


def run(arguments: argparse.Namespace) -> int:
    """Serve the page, or write one."""
    options = collect(StudioOptions, arguments)
    if options.export is not None:
        return _export(options.export, options.what)
    _require_packages()
    from studio.server.guard import Keys
    from studio.server.serve import listen, serve

    # Before all else: a port in use is told at once.
    with listen(options.host, options.port) as listener:
        from studio.session import open_studio

        workspace = _workspace(options)
        studio = open_studio(options.what, workspace, _mesh_settings(options))
        keys = Keys()
        with _launching(options, listener, keys, workspace) as tell:
            serve(studio, listener, options.host, keys, ready=tell)
    say("the studio has ended")
    return 0


def _mesh_settings(options: StudioOptions) -> dict[str, Any]:
    """Settings of the mesh that is opened; those that are not given are left out."""
    given = {"unit": options.unit, "up": options.up, "wall": options.wall}
    settings: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
    if options.wall is not None:
        settings["discretisation"] = "finite-cell"
    return settings


@contextmanager
def _launching(
    options: StudioOptions, listener: socket.socket, keys: Keys, workspace: Path
) -> Iterator[Callable[[], None]]:
    """A function that says where the page is, and opens it; in the end what leads there goes."""
    from studio.server.browser import open_page
    from studio.server.guard import is_loopback
    from studio.server.serve import address_of

    url = f"{address_of(listener, options.host)}?token={keys.token}"
    file: Path | None = None

    def tell() -> None:
        nonlocal file
        if not is_loopback(options.host):
            say(
                "other machines can reach this studio, and what is sent is not encrypted; from "
                "such an address browsers give no sound, either; a tunnel to this machine (ssh -L) "
                "needs no --host"
            )
        # Standard output, for programs that start the studio.
        print(url, flush=True)
        say(f"the studio is at this address, its projects are in {workspace}; Ctrl-C ends it")
        if not options.no_browser:
            file = open_page(url, workspace)

    try:
        yield tell
    finally:
        if file is not None:
            file.unlink(missing_ok=True)


def _workspace(options: StudioOptions) -> Path:
    named = options.workspace
    if named is None:
        is_file = options.what is not None and not options.what.startswith(BUILTIN)
        folder = Path(options.what).parent if is_file and options.what else Path(WORKSPACE)
        if not is_file and folder.is_symlink():
            raise UserError(
                f"{folder}: is a link, expected a folder or nothing; name where it leads by "
                "--workspace, or remove it"
            )
    else:
        folder = Path(named)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return folder.resolve(strict=True)
    except (OSError, ValueError) as error:
        said = one_line(str(error))
        raise UserError(
            f"{folder}: is no folder for projects ({said}); name another by --workspace"
        ) from None


def _export(page: str, design: str | None) -> int:
    if design is None:
        raise UserError(f"--export {page}: name the design to write: --export {page} design.h5")
    from sound.outputs import require_output
    from sound.project.design_file import read_design

    out = require_output(page, (".html", ".htm"), [design])
    finished = read_design(design)
    from studio.standalone import write_page

    write_page(out, finished)
    print(f"{out}: {out.stat().st_size / 1e6:.1f} MB, opens in any browser")
    return 0


def _require_packages() -> None:
    for package in PACKAGES:
        try:
            import_module(package)
        except ImportError as error:
            raise UserError(
                f"{package} cannot be loaded ({one_line(str(error))}); install what the studio "
                f"needs by pip install -r {REQUIREMENTS}, or 'carillon[studio]'"
            ) from None
