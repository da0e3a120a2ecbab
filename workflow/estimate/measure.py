"""Rates from the benchmark files of small runs, which jobs have to themselves, one core each."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from carillon.command_line.progress import say
from carillon.errors import UserError, one_line
from carillon.files.yaml_input import read_own_yaml
from carillon.processes.cores import allowed_cores, blas_name, memory_bytes
from carillon.records import provenance
from dataset_gen.objectives import SAMPLED
from workflow import settings
from workflow.estimate.laws import QUANTITIES, fit, known_of
from workflow.estimate.plan import TARGETS, plan
from workflow.estimate.rates import VERSION
from workflow.estimate.sizes import sizes_of

RUNS = Path(__file__).with_name("runs.yaml")
SHARED = "find_modes hcms_ec"
"""Law of the jobs that tell how far more cores shorten a solver run."""
BUSY = 0.5
"""Cores that other work may take while this is measured."""
LONGEST = 400
"""Characters of what a program that failed said last."""


def measure() -> dict[str, Any]:
    """Rates of this machine, see `workflow/schemas/rates.schema.yaml`, from runs of some minutes.

    Raises
    ------
    UserError
        If a program fails.
    """
    made, cores = _made(), allowed_cores()
    with TemporaryDirectory() as name:
        say("measuring: fits of every objective")
        speeds = json.loads(_run(["dataset_gen", "benchmark", "--json"], Path(name)))
        fits = {**speeds["objectives"], SAMPLED: speeds["fits_per_second"]["sampled"]}
        done: list[pd.DataFrame] = []
        runs = read_own_yaml(RUNS)
        for number, values in enumerate(runs, 1):
            say(f"measuring: run {number} of {len(runs)}")
            done.append(finished(Path(name, f"run-{number}"), values, fits))
        share = 1.0 if cores == 1 else None
        if cores > 1 and made["load"] <= BUSY:
            say("measuring: more cores")
            wide = finished(Path(name, "wide"), values, fits, cores, SHARED)
            share = measured_share(done[1], done[-1], wide, cores)
    return {
        "schema": VERSION,
        "made": made,
        "fits_per_second": fits,
        "laws": laws_from(done[1], pd.concat(done[2:])),
        "serial_share": share,
    }


def finished(
    folder: Path,
    values: Mapping[str, Any],
    fits_per_second: Mapping[str, float],
    cores: int = 1,
    law: str = "",
) -> pd.DataFrame:
    """Jobs of a run that is made in a folder, by the benchmark files that they leave.

    Columns are `law`, `rule`, `sizes` and the quantities of laws. Only jobs of one law are shown,
    and run with what they need, if it is named.
    """
    folder.mkdir()
    file = folder / "config.json"
    file.write_text(json.dumps({**values, "solver": {**values.get("solver", {}), "cores": cores}}))
    jobs = plan(settings.complete([file]), cores)
    jobs["sizes"] = sizes_of(jobs, fits_per_second)
    jobs["law"] = [known_of(job.rule, job.variant)["law"] for job in jobs.itertuples()]
    timed = (jobs["benchmark"] != "") & (jobs["target"] == TARGETS[0])
    jobs = jobs[timed & (jobs["law"] == (law or jobs["law"]))]
    profile = settings.FOLDER / "profiles" / "default"
    options = ["--profile", str(profile), "--cores", str(cores), "--configfile", str(file)]
    targets = [files[0] for files in jobs["outputs"]]
    _run(["snakemake", "-s", str(settings.FOLDER / "Snakefile"), *options, "--", *targets], folder)
    took = pd.concat(pd.read_csv(folder / name, sep="\t") for name in jobs["benchmark"])
    kept = [sum((folder / name).stat().st_size for name in files) for files in jobs["outputs"]]
    return jobs[["law", "rule", "sizes"]].assign(
        seconds=took["s"].to_numpy(float),
        # Snakemake cannot tell the memory of a job that is over at once.
        memory_mb=1.048576 * took["max_rss"].fillna(0.0).to_numpy(float),
        files_mb=np.array(kept) / 1e6,
    )


def laws_from(least: pd.DataFrame, jobs: pd.DataFrame) -> dict[str, Any]:
    """Laws of jobs, which start as the least of them do."""
    laws = {}
    for (law, rule), same in jobs.groupby(["law", "rule"]):
        bounds = {name: known_of(rule)[name] for name in QUANTITIES}
        starts = least.loc[least["law"] == law, list(QUANTITIES)].min() * [1.0, 1.0, 0.0]
        sizes = {size for each in bounds.values() for size in each} - {"fits"}
        laws[law] = {
            **{name: fit(bounds[name], same["sizes"], same[name], starts[name]) for name in bounds},
            "up_to": {size: max(job[size] for job in same["sizes"]) for size in sorted(sizes)}
            | ({} if "serial" in known_of(rule) else {"cores": allowed_cores()}),
            "jobs": len(same),
        }
    return laws


def measured_share(
    start: pd.DataFrame, alone: pd.DataFrame, wide: pd.DataFrame, cores: int
) -> float:
    """Share of the solver runs on one core that they take beyond what their cores explain."""
    seconds = [run.loc[run["law"] == SHARED, "seconds"].sum() for run in (alone, wide)]
    begin = len(wide) * start.loc[start["law"] == SHARED, "seconds"].min()
    share = (seconds[1] - begin) / (seconds[0] - begin)
    return float(np.clip((cores * share - 1.0) / (cores - 1.0), 0.0, 1.0))


def _run(words: list[str], folder: Path) -> str:
    """Output of a Python module that runs in a folder."""
    environment = os.environ | {"PYTHONPATH": str(settings.FOLDER.parent)}
    done = subprocess.run(
        [sys.executable, "-m", *words], cwd=folder, env=environment, capture_output=True, text=True
    )
    if done.returncode:
        raise UserError(f"python -m {words[0]}: failed ({one_line(done.stderr[-LONGEST:])})")
    return done.stdout


def _made() -> dict[str, Any]:
    """Where, when and beside how much other work, without the name of the machine."""
    return {
        "commit": provenance.commit(),
        "date": datetime.now(UTC).date().isoformat(),
        "processor": provenance.processor(),
        "cores": allowed_cores(),
        "memory_gb": round(memory_bytes() / 1e9, 1),
        "load": round(os.getloadavg()[0], 1),
        "blas": blas_name(),
        "versions": provenance.versions(),
    }
