"""Compile once what the suite runs, before its processes begin: `python -m tests.warm_up`.

Compiled kernels are kept beside the source. Without this, every process that starts before the
first one has finished compiles the same again, up to a minute of processor time each.
A second call does nothing, unless a source has changed since, or the processor.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from llvmlite import binding

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGES = ("carillon", "dataset_gen", "forests", "solver")
DONE = Path(__file__).parent / "__pycache__" / "warm_up.json"
"""What was compiled, beside what is kept of it."""
TRAINING = (
    "dataset_gen generate --samples 200 --out shard.h5",
    "forests train shard.h5 --out forests.h5",
)
SPECTRA = (
    "solver modes builtin:bar --resolution 12 --modes 20 --coarsen ddfem --out modes.h5",
    "solver objectives builtin:box --resolution 6 --modes 20",
)
CELLS = (
    "solver modes builtin:bar --resolution 12 --modes 20 --out voxels.h5",
    "solver modes builtin:fork --resolution 12 --modes 12 --refine-to 0.001"
    " --discretisation finite-cell --out divided.h5",
    "solver modes builtin:comb --resolution 12 --modes 12 --no-estimate"
    " --discretisation finite-cell --out open.h5",
)


def main() -> int:
    """Run the lists of commands side by side, on one thread each; 0 if all ended well."""
    wanted = sources()
    if DONE.exists() and DONE.read_text() == wanted:
        return 0
    with tempfile.TemporaryDirectory() as folder:
        python = shlex.quote(sys.executable)
        scripts = [
            " && ".join(f"{python} -m {each}" for each in commands)
            for commands in (TRAINING, SPECTRA, CELLS)
        ]
        environment = {**os.environ, "PYTHONPATH": str(CHECKOUT), "OMP_NUM_THREADS": "1"}
        options = {"cwd": folder, "env": environment, "stdout": subprocess.DEVNULL}
        running = [subprocess.Popen(each, shell=True, **options) for each in scripts]
        status = max(process.wait() for process in running)
    if status == 0:
        DONE.parent.mkdir(exist_ok=True)
        DONE.write_text(wanted)
    return status


def sources() -> str:
    """The processor, and every source with its time and size, as compiled kernels are kept by."""
    files = sorted(path for each in PACKAGES for path in (CHECKOUT / each).rglob("*.py"))
    stamps = [[str(path), path.stat().st_mtime_ns, path.stat().st_size] for path in files]
    return json.dumps([binding.get_host_cpu_name(), os.environ.get("NUMBA_CACHE_DIR"), stamps])


if __name__ == "__main__":
    sys.exit(main())
