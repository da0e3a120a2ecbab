"""Compile the kernels once, side by side, so that jobs that start together need not each do it.

They are kept beside the source, or where NUMBA_CACHE_DIR says, for the processor that this runs on
and beside those for others. A second call does nothing, unless a source has changed since.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from llvmlite import binding

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
"""Folder of records of what was compiled, one for each group and kind of processor."""

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
            with atomic_path(_record(name)) as temporary:
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
        return _record(group).read_text() == wanted
    except OSError:
        return False


def _record(group: str) -> Path:
    kind = hashlib.sha256(json.dumps(_kind()).encode()).hexdigest()[:8]
    return DONE / f"{group}-{kind}.json"


def _kind() -> list[str | None]:
    """The processor that is compiled for, and the folder of kernels."""
    features = os.environ.get("NUMBA_CPU_FEATURES", binding.get_host_cpu_features().flatten())
    return [compiled_for(), features, os.environ.get("NUMBA_CACHE_DIR")]


def sources() -> str:
    """The kind of processor, and every source with its time and size, by which kernels are kept."""
    files = sorted(
        path
        for folder in map(Path, rooms.folders())
        for each in PACKAGES
        for path in (folder / each).rglob("*.py")
    )
    stamps = [[str(path), path.stat().st_mtime_ns, path.stat().st_size] for path in files]
    return json.dumps([_kind(), stamps])
