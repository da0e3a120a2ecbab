"""Compile the kernels once, side by side, so that jobs that start together need not each do it.

They are kept beside the source, or where NUMBA_CACHE_DIR says, for the processor that this runs on.
A second call does nothing, unless a source or the processor has changed since.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.files.atomic import atomic_path
from carillon.processes import rooms
from carillon.processes.threads import allowed_cores
from carillon.records.provenance import compiled_for

EXAMPLES = """examples:
  compile
  compile training spectra blocks
"""

PACKAGES = ("carillon", "dataset_gen", "forests", "solver")
DONE = Path(__file__).parent / "__pycache__"
"""File that records what was compiled."""

GROUPS = {
    "training": (
        "dataset_gen generate --samples 200 --out shard.h5",
        "forests train shard.h5 --out forests.h5",
    ),
    "spectra": (
        "solver modes builtin:bar --resolution 12 --modes 20 --method hcms --estimate --out a.h5",
        "solver modes builtin:bar --resolution 12 --modes 20 --coarsen ddfem --out b.h5",
    ),
    "blocks": ("forests table --blocks 8 --materials 2",),
    "studies": (
        "solver modes builtin:fork --resolution 12 --modes 12 --refine-to 0.001"
        " --discretisation finite-cell --out divided.h5",
        "solver modes builtin:comb --resolution 12 --modes 12 --no-estimate"
        " --discretisation finite-cell --out open.h5",
        "solver objectives builtin:box --resolution 6 --modes 20",
    ),
}
"""Commands that between them run every kernel: of the default run, and of the studies."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"{', '.join(GROUPS)}; or all")


def run(arguments: argparse.Namespace) -> None:
    """Run the groups that are not compiled yet, each on one thread."""
    for name in arguments.groups:
        if name not in GROUPS:
            raise UserError(f"no group {name!r} of kernels, expected {', '.join(GROUPS)}")
    requested = sources()
    groups = [name for name in arguments.groups or GROUPS if not compiled(name, requested)]
    if not groups:
        return
    say(f"compiling kernels of {', '.join(groups)}: once, in about a minute")
    with ThreadPoolExecutor(allowed_cores()) as pool:
        list(pool.map(_compile, groups))
    # Sources that have changed meanwhile are compiled again next time.
    for name in groups:
        with suppress(OSError, UserError):
            DONE.mkdir(exist_ok=True)
            with atomic_path(DONE / f"{name}.json") as temporary:
                temporary.write_text(requested)


def _compile(group: str) -> None:
    path = [*rooms.folders(), os.environ.get("PYTHONPATH")]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(filter(None, path)),
        "OMP_NUM_THREADS": "1",
    }
    with tempfile.TemporaryDirectory() as folder:
        for command in GROUPS[group]:
            words = [sys.executable, "-m", *command.split()]
            done = subprocess.run(
                words, cwd=folder, env=environment, capture_output=True, text=True, check=False
            )
            if done.returncode:
                last = (done.stderr.strip().splitlines() or ["no message"])[-1]
                raise UserError(f"kernels of {group} are not compiled: {command}: {last}")


def compiled(group: str, wanted: str) -> bool:
    """Whether a group was compiled from these sources, see `sources`."""
    try:
        return (DONE / f"{group}.json").read_text() == wanted
    except OSError:
        return False


def sources() -> str:
    """The processor, and every source with its time and size, as compiled kernels are kept by."""
    files = sorted(
        path
        for folder in map(Path, rooms.folders())
        for each in PACKAGES
        for path in (folder / each).rglob("*.py")
    )
    stamps = [[str(path), path.stat().st_mtime_ns, path.stat().st_size] for path in files]
    return json.dumps([compiled_for(), os.environ.get("NUMBA_CACHE_DIR"), stamps])
