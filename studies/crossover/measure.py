"""Solve a case by every method, each run in processes of its own; a run that fails is a result."""

import json
import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.fem.model import RIGID_MODES
from carillon.processes.children import run_child
from solver.analysis.faster_method import FEWEST_UNKNOWNS
from solver.analysis.options import SolverOptions
from studies.crossover.config import Launch
from studies.crossover.methods import CHOICES, METHODS, PLAIN, REFERENCE
from studies.crossover.rank import FILES
from studies.scaling.launch import ANY_RANKS, LAUNCHER, failure_of
from workflow.arguments import options

Row = dict[str, Any]
NO_SOLUTION = ("start", "solid", "inertia", "verification", "estimate", "writing", "other")
"""Phases of a run that are no part of its solution: they make the solid, or check the modes."""
WARM_UP = ["builtin:bar", "--resolution", "12", "--modes", "20", "--no-estimate"]
"""What every method solves first, untimed, so that its kernels are compiled."""
LATE = "it was ended after {:g} s"
LONG = 0.1
"""Share of the time limit above which a run is not repeated."""


@dataclass(frozen=True)
class Runner:
    """What runs `carillon modes` on the ranks of a launch."""

    launch: Launch
    cores: int
    """Cores of a node."""
    seconds: float
    """Wall time after which a run is ended [s]."""
    folder: Path
    """Where runs keep their files meanwhile; all nodes see it."""

    def run(self, words: Sequence[str]) -> Row:
        """One run of `carillon modes WORDS`.

        Returns plain values: `seconds` of the solution and `whole_seconds` of the processes [s];
        `processor_seconds` of all ranks; `peak_memory_bytes` of the largest; cores of this machine
        that `others` have used meanwhile, None if the ranks are on several; `unknowns` and
        `frequencies` [Hz]. Of a run that failed, only the `problem` in one sentence.
        """
        threads = self.launch.threads_of(self.cores)
        if threads == 0:
            return {"problem": f"it was not run: too few cores, {self.cores} on each node"}
        environment = {**ANY_RANKS, **os.environ, "OMP_NUM_THREADS": str(threads)}
        with TemporaryDirectory(dir=self.folder) as place:
            several = ["-m", "mpi4py"] if self.launch.ranks > 1 else []
            rank = [sys.executable, *several, "-m", "studies.crossover.rank", place]
            out = ["--out", f"{place}/modes.h5", "--json"]
            begun, busy = time.perf_counter(), _busy_seconds()
            try:
                command = [*launcher_words(self.launch), *rank, "modes", *words, *out]
                done = run_child(command, environment, self.seconds)
            except UserError as error:
                return {"problem": str(error)}
            except subprocess.TimeoutExpired:
                return {"problem": LATE.format(self.seconds)}
            whole, busy = time.perf_counter() - begun, _busy_seconds() - busy
            problem = failure_of(done)
            if problem is not None:
                return {"problem": problem}
            used = [json.loads(each.read_text()) for each in Path(place).glob(FILES)]
        summary = json.loads(done.stdout[done.stdout.index("{") :])
        phases = summary["phases_by_rank"].items()
        own = sum(each["processor_seconds"] for each in used)
        return {
            "unknowns": summary["n_dofs"],
            "took": summary["method"],
            "threads": threads,
            "seconds": sum(
                max(each["seconds"]) for name, each in phases if name not in NO_SOLUTION
            ),
            "whole_seconds": whole,
            "processor_seconds": own or None,
            "others": max(busy - own, 0.0) / whole if self.launch.nodes == 1 else None,
            "peak_memory_bytes": max((each["peak_memory_bytes"] for each in used), default=None),
            "frequencies": summary["frequencies_hz"],
        }


def launcher_words(launch: Launch) -> list[str]:
    """The words that start the ranks; none for a single one.

    Raises UserError if the program is not on PATH.
    """
    if launch.launcher is None and launch.ranks == 1:
        return []
    words = shlex.split(launch.launcher or f"{LAUNCHER} -n {launch.ranks}")
    program = shutil.which(words[0])
    if program is None:
        raise UserError(f"no {words[0]} on PATH; install it, or name another launcher")
    return [program, *words[1:]]


def choice_of_auto(modes: int, tolerance: float, unknowns: int) -> str:
    """Name of the method that `--method auto` is for a solid of few unknowns.

    Examples
    --------
    >>> choice_of_auto(20, 1e-6, 30), choice_of_auto(20, 1e-6, 3000)
    ('hcms_ec', 'lanczos')
    """
    chosen = SolverOptions(modes=modes, tolerance=tolerance).with_method(unknowns)
    return CHOICES[chosen.method]


def _busy_seconds() -> float:
    """Processor seconds that all cores of this machine have been busy, by any process."""
    user, nice, system, _, _, irq, softirq, steal = Path("/proc/stat").read_text().split()[1:9]
    ticks = sum(map(int, (user, nice, system, irq, softirq, steal)))
    return ticks / os.sysconf("SC_CLK_TCK")


def measure_case(runner: Runner, solid: Sequence[str], part: Mapping[str, Any]) -> list[Row]:
    """All runs of a solid on the ranks of a launch.

    Parameters
    ----------
    solid
        Words of `carillon modes` that describe the solid.
    part
        The study's part of the configuration.

    Returns
    -------
    list[Row]
        A run a row, see `Runner.run`, with `modes`, `tolerance`, `method`, whether `auto` chooses
        it, the largest relative `error` of its eigenvalues against those of the `reference`, and
        whether that `reached` the tolerance.
    """
    # Methods with a limit come last, when the others have told how many unknowns there are.
    methods = sorted(part["methods"], key=part["most_unknowns"].__contains__)
    single = Runner(Launch(ranks=1), runner.cores, runner.seconds, runner.folder)
    for name in methods:
        single.run([*WARM_UP, *options(METHODS[name].options)])
    rows: list[Row] = []
    for modes in part["modes"]:
        found: list[Row] = []
        for name in methods:
            found += _runs_of(runner, solid, modes, name, part, [*rows, *found])
        known = next((row["unknowns"] for row in found if "unknowns" in row), 0)
        choices = {
            tolerance: _choice(runner, solid, modes, tolerance, known)
            for tolerance in part["tolerances"]
        }
        rows += _judged(found, choices)
    return rows


def _choice(
    runner: Runner, solid: Sequence[str], modes: int, tolerance: float, unknowns: int
) -> str | None:
    """Name of the method that `auto` takes; None if that cannot be told.

    That of a large solid depends on the work of its factorisation, and is what a run takes.
    """
    if unknowns < FEWEST_UNKNOWNS:
        return choice_of_auto(modes, tolerance, unknowns) if unknowns else None
    row = runner.run([*solid, *options({"modes": modes, "tolerance": tolerance})])
    return CHOICES.get(row.get("took", ""))


def _runs_of(
    runner: Runner,
    solid: Sequence[str],
    modes: int,
    name: str,
    part: Mapping[str, Any],
    before: Sequence[Row],
) -> list[Row]:
    """Runs of one method to every tolerance, the largest first."""
    known = next((row["unknowns"] for row in before if "unknowns" in row), 0)
    most = part["most_unknowns"].get(name, known)
    late = LATE.format(runner.seconds)
    last: Row = {}
    rows = []
    for tolerance in sorted(part["tolerances"], reverse=True):
        how = {"modes": modes, "tolerance": tolerance, **METHODS[name].options}
        if known > most:
            last = {"problem": f"it was not run: a limit of {most:,} unknowns is set for it"}
        elif last.get("problem", "").endswith(late):
            last = {"problem": f"it was not run: to a larger tolerance {late}"}
        elif name != PLAIN or not last:  # whose result does not depend on the tolerance
            last = _fastest_of(part["runs"], runner, [*solid, *options(how)])
        rows.append({"modes": modes, "tolerance": tolerance, "method": name, **last})
        spent = last.get("problem") or f"{last['seconds']:.2f} s"
        say(f"{METHODS[name].label}, {modes} modes to {tolerance:g}: {spent}")
    return rows


def _fastest_of(count: int, runner: Runner, words: Sequence[str]) -> Row:
    """The fastest of several runs, or the first if it failed or takes long."""
    best = runner.run(words)
    for _ in range(count - 1):
        if best.get("whole_seconds", np.inf) < LONG * runner.seconds:
            best = min(best, runner.run(words), key=lambda row: row.get("seconds", np.inf))
    return best


def _judged(rows: list[Row], choices: Mapping[float, str | None]) -> list[Row]:
    """The rows of one number of modes with what is said of their errors, see `measure_case`.

    The reference is SLEPc's run to the smallest tolerance, or else that of any other method.
    `choices` are the methods that `auto` takes, by tolerance.
    """
    solved = [row for row in rows if "problem" not in row]
    if not solved:
        return rows
    rank = {REFERENCE: 0, PLAIN: 2}
    best = min(solved, key=lambda row: (rank.get(row["method"], 1), row["tolerance"]))
    exact = np.square(best["frequencies"])[RIGID_MODES:]
    # SLEPc is given a residual, whose square is about the error of the eigenvalue.
    doubt = 0.0 if best["method"] == REFERENCE else best["tolerance"]
    judged = []
    for row in rows:
        row = {**row, "unknowns": best["unknowns"]}
        row["auto"] = row["method"] == choices.get(row["tolerance"])
        row.pop("took", None)
        frequencies = row.pop("frequencies", None)
        if frequencies is not None:
            error = float(np.abs(np.square(frequencies)[RIGID_MODES:] / exact - 1.0).max())
            row |= {"error": error, "reached": error <= row["tolerance"] + doubt}
            row["reference"] = METHODS[best["method"]].label
        judged.append(row)
    return judged
