"""Short runs of the programs on this machine, and the rates that follow from them.

Every program is run as the rules run it, on one core unless said, and charged its processor time,
which other work on the machine disturbs least.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from carillon import provenance
from carillon.errors import UserError
from carillon.measurement import memory_bytes
from carillon.progress import say
from carillon.runtime import allowed_cores, blas_name
from dataset_gen.objectives import DEFAULT_OBJECTIVE, SAMPLED
from forests.comparison.combinations import combinations
from forests.training.moments import ENTRIES
from workflow.estimate.composition import Composition
from workflow.estimate.rates import VERSION, Cost, Law
from workflow.estimate.sizes import Solid, size_of

ROOT = Path(__file__).resolve().parents[2]

SAMPLES, FEW_SAMPLES = 1 << 20, 1 << 13
"""Samples of the shards that are timed."""

ROWS, FEW_ROWS = 2_000_000, 250_000
"""Rows that splits are chosen from in the trees that are timed: some of the shard, all over it."""

LEAVES, FEW_LEAVES = 50_000, 2_000
MIN_LEAF = 4

UNIT_LEAVES = 1000
"""Leaves of a tree that `leaf_seconds_per_row` is for."""

SUM_BYTES = 8 * (ENTRIES + 3)
"""Memory of a leaf's sums; what its regression takes is there for one tree at a time."""

BLOCKS, FEW_BLOCKS = 1000, 100
MATERIALS = 6

SOLID = "builtin:bell"
SMALL, LARGE = 24, 48
"""Resolutions of the solid that is solved."""

FEW_MODES, MODES = 64, 256

METHODS = {
    "slepc": "--method slepc",
    "arpack": "--method arpack",
    "hcms": "--method hcms --corrections 0",
    "hcms_ec": "--method hcms --tol 1e-7",
}

READERS = {
    "compare": ("hcms_ec slepc", "", 1),
    "audit": ("slepc hcms hcms_ec", "--out audit.json", 0),
    "respond": ("slepc hcms hcms_ec", "--out response.h5", 1),
}
"""Programs that read modes: whose, what they write, and the power of the modes in their cost."""

MEGABYTE = 1e6
LEAST = 1e-3
"""Smallest difference of two runs [s] or [MB] that is taken for more than noise."""


@dataclass(frozen=True)
class Run:
    """A program that ended: processor time and wall time [s], largest memory [MB], its output."""

    seconds: float
    wall: float
    memory_mb: float
    output: str


def run_module(folder: Path, arguments: str, threads: int = 1) -> Run:
    """Run `python -m ARGUMENTS` in `folder`.

    Raises
    ------
    UserError
        If it fails.
    """
    command = [sys.executable, "-m", *arguments.split()]
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "PYTHONPATH": str(ROOT)}
    begin = time.perf_counter()
    with open(folder / "said", "w+") as said:
        process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=said, text=True
        )
        assert process.stdout is not None
        output = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        lines = said.read().splitlines()
    if process.returncode:
        raise UserError(f"python -m {arguments}: failed ({lines[-1] if lines else 'no word'})")
    seconds = usage.ru_utime + usage.ru_stime
    wall = time.perf_counter() - begin
    return Run(seconds, wall, 1024 * usage.ru_maxrss / MEGABYTE, output)


class Bench:
    """All measurements, each made when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.numbers: dict[str, float] = {}
        self.load = 0.0
        self.serial_share: float | None = None

    def _run(self, arguments: str, threads: int = 1) -> Run:
        return run_module(self.folder, arguments, threads)

    # Data

    def fits(self) -> dict[str, float]:
        """Fits per second by objective."""
        found = json.loads(self._run("dataset_gen benchmark --json").output)
        return {**found["objectives"], SAMPLED: found["fits_per_second"]["sampled"]}

    def data(self, fits: dict[str, float]) -> None:
        """Shards: drawing, writing and reading samples."""
        options = f"--objective {DEFAULT_OBJECTIVE} --out"
        few = self._run(f"dataset_gen generate --samples {FEW_SAMPLES} {options} few.h5")
        many = self._run(f"dataset_gen generate --samples {SAMPLES} {options} data.h5")
        read = [self._run(f"dataset_gen inspect {name}.h5") for name in ("few", "data")]
        between = SAMPLES - FEW_SAMPLES
        fitted = (many.seconds - few.seconds) / between
        self.numbers |= {
            "draw_seconds": max(0.0, fitted - 1.0 / fits[DEFAULT_OBJECTIVE]),
            "inspect_seconds": _more(read[0].seconds, read[1].seconds) / between,
            "shard_bytes": (self.folder / "data.h5").stat().st_size / SAMPLES,
            "fitting_start_seconds": max(0.0, few.seconds - FEW_SAMPLES * fitted),
            "fitting_mb": many.memory_mb,
        }

    def compile(self) -> None:
        """Run the other programs once on next to nothing: the first run of all compiles them."""
        self._run(
            "forests train few.h5 --trees 1 --max-leaves 50 --structure-rows 50000 --out x.h5"
        )
        self._run("forests table --blocks 10 --materials 2")
        self._solve("hcms_ec", SMALL, 12)

    # Trees

    def trees(self) -> None:
        """One tree on different rows and leaves."""
        few = self._grow("few", FEW_ROWS, FEW_LEAVES)
        rows = self._grow("rows", ROWS, FEW_LEAVES)
        leaves = self._grow("leaves", ROWS, LEAVES)
        more_rows, more_leaves = ROWS - FEW_ROWS, LEAVES - FEW_LEAVES
        memory = _more(few.memory_mb, rows.memory_mb)
        self.numbers |= {
            "growing_seconds_per_row": _more(few.seconds, rows.seconds) / more_rows,
            "growing_seconds_per_leaf": _more(rows.seconds, leaves.seconds) / more_leaves,
            "growing_bytes_per_row": MEGABYTE * memory / more_rows,
        }

    def _grow(self, name: str, rows: int, leaves: int) -> Run:
        """Grow a tree of void and one of filled origins; told is the latter, the dearer one."""
        options = f"--trees 1 --structure-rows {rows} --max-leaves {leaves} --min-leaf {MIN_LEAF}"
        for tree in (0, 1):
            done = self._run(f"forests grow data.h5 {options} --tree {tree} --out {name}-{tree}.h5")
        return done

    def leaves(self) -> None:
        """Leaves of few and many, in one tree and in three."""
        options = f"--structure-rows {FEW_ROWS} --max-leaves {FEW_LEAVES} --min-leaf {MIN_LEAF}"
        three, memory, _ = self._fit(f"--trees 3 {options}")
        one, _, few = self._fit(f"--trees 1 {options} --structure few-0.h5 few-1.h5")
        large = f"--trees 1 --structure-rows {ROWS} --max-leaves {LEAVES} --min-leaf {MIN_LEAF}"
        many, more_memory, leaves = self._fit(f"{large} --structure leaves-0.h5 leaves-1.h5")
        a_tree = _more(one, three) / 2.0
        prepare = max(0.0, one - a_tree)
        growth = max(0.0, math.log((many - prepare) / a_tree) / math.log(leaves / few))
        rows = 8 * SAMPLES
        per_leaf = MEGABYTE * _more(memory, more_memory) / (leaves - few)
        self.numbers |= {
            "prepare_seconds_per_row": prepare / rows,
            "leaf_seconds_per_row": a_tree * (2 * UNIT_LEAVES / few) ** growth / rows,
            "leaf_growth": growth,
            "leaf_bytes": max(0.0, 2.0 * (per_leaf - SUM_BYTES)),
            "training_mb": memory,
        }

    def _fit(self, options: str) -> tuple[float, float, int]:
        """Seconds and memory [MB] of fitting leaves, the faster of two times; and their number."""
        seconds = []
        for _ in range(2):
            done = self._run(f"forests train data.h5 {options} --out model.h5")
            model = json.loads(self._run("forests inspect model.h5 --json").output)
            undisturbed = min(1.0, done.seconds / done.wall)
            seconds.append(undisturbed * model["provenance"]["leaves_seconds"])
        return min(seconds), done.memory_mb, model["leaves"]

    def table(self) -> None:
        """Table of errors on single blocks."""
        few = self._run(f"forests table --blocks {FEW_BLOCKS} --materials 2")
        blocks = self._run(f"forests table --blocks {BLOCKS} --materials 2")
        combined = self._run(f"forests table --blocks {FEW_BLOCKS} --materials {MATERIALS}")
        more = combinations(MATERIALS) - combinations(2)
        self.numbers |= {
            "table_seconds_per_block": _more(few.seconds, blocks.seconds) / (BLOCKS - FEW_BLOCKS),
            "table_seconds_per_combination": _more(few.seconds, combined.seconds) / more,
            "table_mb": max(blocks.memory_mb, combined.memory_mb),
        }

    # Solver

    def laws(self) -> dict[str, Cost]:
        """Costs of the methods and of what reads their modes, over unknowns and modes."""
        self.start = self._solve("slepc", 12, 12, "builtin:bar")
        self.numbers |= {"start_seconds": self.start.seconds, "start_mb": self.start.memory_mb}
        sizes = ((SMALL, FEW_MODES), (SMALL, MODES), (LARGE, FEW_MODES))
        found = {
            method: self._cost({size: self._solve(method, *size) for size in sizes})
            for method in ("slepc", "hcms", "hcms_ec")
        }
        found["arpack"] = self._like(found["slepc"], self._solve("arpack", SMALL, FEW_MODES))
        for reader, (_, _, power) in READERS.items():
            larger = sizes[1] if power else sizes[2]
            found[reader] = self._proportional(reader, sizes[0], larger, power)
        return found

    def shares(self, laws: dict[str, Cost]) -> None:
        """What more cores shorten, and what the composed programs cost."""
        self.load = os.getloadavg()[0]
        solid = f"{SOLID} --resolution {SMALL} --modes {FEW_MODES}"
        size = size_of(Solid(SOLID, SMALL))
        composition = Composition(laws)
        corrected = composition.seconds("hcms_ec", size.fine, FEW_MODES)
        timing = composition.timing(size, FEW_MODES, {"runs": 1, "slow_runs": 1})
        runs = {
            "timing_ratio": (f"benchmark {solid} --runs 1 --out row.json", timing),
            "convergence_ratio": (f"convergence {solid} --steps 3 --out row.json", corrected),
            "scaling_ratio": (f"scaling {solid} --ranks 1 --here --out row.json", corrected),
        }
        for name, (arguments, composed) in runs.items():
            done = self._run(f"solver {arguments}")
            self.numbers[name] = _more(self.start.seconds, done.seconds) / composed
        large = size_of(Solid(SOLID, LARGE)).fine
        alone = composition.seconds("hcms_ec", large, FEW_MODES)
        self.serial_share = self._serial_share(alone)

    def _serial_share(self, alone: float) -> float | None:
        """Share of a run of so many seconds on one core that more cores do not shorten.

        None on a machine that is busy with something else, where that cannot be measured.
        """
        cores = allowed_cores()
        if cores == 1:
            return 1.0
        if self.load > cores - 0.5:
            return None
        walls = [self._solve("hcms_ec", LARGE, FEW_MODES, threads=cores).wall for _ in range(2)]
        share = (_more(self.start.seconds, min(walls)) / alone - 1.0 / cores) / (1.0 - 1.0 / cores)
        return min(1.0, max(0.0, share))

    def _solve(
        self, method: str, resolution: int, modes: int, mesh: str = SOLID, threads: int = 1
    ) -> Run:
        solid = f"{mesh} --resolution {resolution} --material smooth --modes {modes}"
        out = f"{method}-{resolution}-{modes}.h5"
        return self._run(f"solver modes {solid} {METHODS[method]} --out {out}", threads)

    def _proportional(
        self, reader: str, small: tuple[int, int], large: tuple[int, int], power: int
    ) -> Cost:
        """Cost in proportion to unknowns x modes^power, from modes of two sizes."""
        methods, writes, _ = READERS[reader]
        runs = []
        for resolution, modes in (small, large):
            files = " ".join(f"{name}-{resolution}-{modes}.h5" for name in methods.split())
            runs.append(self._run(f"solver {reader} {files} {writes}"))
        amounts = [
            size_of(Solid(SOLID, resolution)).fine * modes**power
            for resolution, modes in (small, large)
        ]
        more = amounts[1] - amounts[0]
        seconds = _more(runs[0].seconds, runs[1].seconds) / more
        memory = _more(runs[0].memory_mb, runs[1].memory_mb) / more
        return Cost(Law(seconds, 1.0, power), Law(memory, 1.0, power))

    def _cost(self, runs: dict[tuple[int, int], Run]) -> Cost:
        """Powers of unknowns and modes through runs by resolution and modes."""
        points = [
            (size_of(Solid(SOLID, resolution)).fine, modes, *self._beyond_start(run))
            for (resolution, modes), run in runs.items()
        ]
        seconds, memory = ([(*point[:2], point[column]) for point in points] for column in (2, 3))
        return Cost(power_law(seconds), power_law(memory))

    def _like(self, cost: Cost, run: Run) -> Cost:
        """Cost as another one, in proportion to a run of the small solid with few modes."""
        fine = size_of(Solid(SOLID, SMALL)).fine
        seconds, _ = self._beyond_start(run)
        ratio = seconds / cost.seconds(fine, FEW_MODES)
        return Cost(replace(cost.seconds, factor=ratio * cost.seconds.factor), cost.memory_mb)

    def _beyond_start(self, run: Run) -> tuple[float, float]:
        """Seconds and memory [MB] beyond those of a run without work."""
        return (
            _more(self.start.seconds, run.seconds),
            _more(self.start.memory_mb, run.memory_mb),
        )


def power_law(points: list[tuple[int, int, float]]) -> Law:
    """Law through three points (unknowns, modes, value), exact in logarithms.

    Examples
    --------
    >>> law = power_law([(100, 10, 6.0), (200, 10, 12.0), (100, 20, 6.0)])
    >>> round(law.unknowns, 6), round(law.modes, 6)
    (1.0, 0.0)
    """
    n, k, value = np.log(np.array(points, dtype=float)).T
    factor, unknowns, modes = np.linalg.solve(np.column_stack([np.ones(3), n, k]), value)
    return Law(float(np.exp(factor)), float(unknowns), float(modes))


def _more(less: float, more: float) -> float:
    """What a larger run takes more than a smaller one; noise may not make it nothing."""
    return max(more - less, LEAST)


def measure() -> dict[str, Any]:
    """Run all benchmarks here, in about three minutes.

    Returns
    -------
    dict[str, Any]
        Plain values, see `workflow/schemas/rates.schema.yaml`.

    Raises
    ------
    UserError
        If a program fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        found: dict[str, Any] = {}

        steps: dict[str, Callable[[], Any]] = {
            "fits of every objective": lambda: found.update(fits=bench.fits()),
            "shards": lambda: bench.data(found["fits"]),
            "compiling": bench.compile,
            "trees": bench.trees,
            "leaves": bench.leaves,
            "errors on single blocks": bench.table,
            "solver": lambda: found.update(laws=bench.laws()),
            "solver, composed programs": lambda: bench.shares(found["laws"]),
        }
        begin = time.perf_counter()
        for number, (name, step) in enumerate(steps.items(), 1):
            say(f"measuring {number} of {len(steps)}: {name} ({time.perf_counter() - begin:.0f} s)")
            step()
    return {
        "schema": VERSION,
        "made": _made(bench.load),
        "numbers": bench.numbers,
        "serial_share": bench.serial_share,
        "fits_per_second": found["fits"],
        "laws": {name: _plain(cost) for name, cost in found["laws"].items()},
        "up_to": {
            "samples": SAMPLES,
            "rows": ROWS,
            "leaves": LEAVES,
            "unknowns": size_of(Solid(SOLID, LARGE)).fine,
            "modes": MODES,
            "cores": allowed_cores(),
        },
        "how": _how(),
    }


def _plain(cost: Cost) -> dict[str, Any]:
    return {"seconds": vars(cost.seconds), "memory_mb": vars(cost.memory_mb)}


def _made(load: float) -> dict[str, Any]:
    """Where, when and beside how much other work, without the name of the machine."""
    return {
        "commit": provenance.commit(),
        "date": datetime.now(UTC).date().isoformat(),
        "processor": provenance.processor(),
        "cores": allowed_cores(),
        "memory_gb": round(memory_bytes() / 1e9, 1),
        "load": round(load, 1),
        "blas": blas_name(),
        "versions": provenance.versions(),
    }


def _how() -> dict[str, str]:
    small, large = (size_of(Solid(SOLID, resolution)).fine for resolution in (SMALL, LARGE))
    return {
        "start": "a solver run on a bar of some hundred unknowns",
        "data": f"dataset_gen benchmark for the fits, dataset_gen generate on {FEW_SAMPLES:,} and "
        f"{SAMPLES:,} samples for all else",
        "trees": f"forests grow of a tree of filled origins on {FEW_ROWS:,} and {ROWS:,} rows, to "
        f"{FEW_LEAVES:,} and {LEAVES:,} leaves; linear between and beyond",
        "leaves": f"forests train on {8 * SAMPLES:,} rows, one and three trees a forest, "
        f"{FEW_LEAVES:,} and {LEAVES:,} leaves a tree; a power of the leaves",
        "table": f"forests table on {FEW_BLOCKS:,} and {BLOCKS:,} blocks, with 2 and {MATERIALS} "
        "base materials",
        "solver": f"solver modes on the {SOLID.removeprefix('builtin:')} of {small:,} and "
        f"{large:,} unknowns, {FEW_MODES} and {MODES} modes; powers of both",
    }
