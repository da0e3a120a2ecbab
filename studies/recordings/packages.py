"""Packages of Debian that hold recordings, brought and unpacked without being installed."""

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.files.paths import cause

SOUNDS = {
    "hydrogen-drumkits": "usr/share/hydrogen/data/drumkits",
    "sonic-pi-samples": "usr/share/sonic-pi/samples",
}
"""The packages, and where their sounds lie."""
CONTROL = "control"
"""File in the folder of an unpacked package that tells its name and version."""
_PROGRAMS = ("apt-get", "dpkg-deb")


def bring(folder: Path) -> list[Path]:
    """Bring every package that `folder` does not hold yet; their folders.

    No rights of root are needed, and nothing is installed. A package is there as a whole or not at
    all.

    Raises UserError if this machine has no apt-get or dpkg-deb, a package cannot be had, or not be
    unpacked.
    """
    missing = [package for package in SOUNDS if not (folder / package / CONTROL).is_file()]
    if missing:
        _require_programs(missing, folder)
    for package in missing:
        say(f"bringing {package}")
        try:
            _bring(package, folder)
        except OSError as error:
            raise UserError(
                f"{folder}: {package} cannot be put there ({cause(error)}); name another folder"
            ) from None
    return [folder / package for package in SOUNDS]


def _require_programs(missing: Sequence[str], folder: Path) -> None:
    absent = [program for program in _PROGRAMS if shutil.which(program) is None]
    if absent:
        raise UserError(
            f"this machine has no {' and no '.join(absent)} (not Debian or Ubuntu), which bring "
            f"{' and '.join(missing)}; run this on one that has, and copy {folder} from there"
        )


def _bring(package: str, folder: Path) -> None:
    # Beside its place, so that it gets there at once, and nothing is left of what fails.
    with tempfile.TemporaryDirectory(dir=folder.resolve(), prefix=".partial-") as name:
        aside = Path(name)
        _run(
            ["apt-get", "-q", "download", package],
            aside,
            f"{package} cannot be had from the archive of packages",
            "look after the network, and that apt-get update has been run",
        )
        (archive,) = aside.glob("*.deb")
        unpacked = aside / "unpacked"
        broken = f"{package} cannot be unpacked"
        _run(["dpkg-deb", "-x", str(archive), str(unpacked)], aside, broken, "run it again")
        about = _run(["dpkg-deb", "-f", str(archive)], aside, broken, "run it again")
        (unpacked / CONTROL).write_text(about)
        place = folder / package
        shutil.rmtree(place, ignore_errors=True)
        unpacked.rename(place)


def _run(command: Sequence[str], folder: Path, failed: str, advice: str) -> str:
    """What a program printed.

    Raises UserError if it fails: `failed`, what it said last, `advice`.
    """
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        said = [line for line in done.stderr.splitlines() if line.strip()] or ["no reason given"]
        raise UserError(f"{failed} ({said[-1].removeprefix('E: ').strip()}); {advice}")
    return done.stdout
