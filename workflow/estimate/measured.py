"""What jobs of former runs took, from Snakemake's benchmark files: medians by rule and variant.

`python -m workflow.estimate.measured results results-tiny` prints the table that comes along.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from carillon.errors import UserError
from carillon.processes.threads import allowed_cores
from workflow import settings
from workflow.estimate.plan import RESULTS, plan
from workflow.estimate.work import with_work

PACKAGED = Path(__file__).with_name("measured.csv")
"""Medians of a run with the preset `laptop` and one with `tiny`, on two cores of an AMD EPYC, and
for `generate_shard` one shard of 400,000 samples, since the runs' own do little but start."""

KEY = ["kind", "variant"]
MEDIANS = ["work", "seconds", "content", "megabytes"]
START = 1.5
"""Time that a job of any rule takes to start [s]."""


def load_measured(folders: Iterable[str | Path] = ()) -> pd.DataFrame:
    """Medians by kind and variant; those of former results in `folders` replace the packaged ones.

    Columns are `jobs`, their number; medians of `work` and of its `seconds`, of `content` and of
    the `megabytes` of its files; and `off`, the largest factor between the seconds of a job and
    those that the medians tell for its work.

    Raises
    ------
    UserError
        If a folder holds no results of a run.
    """
    table = pd.read_csv(PACKAGED, keep_default_na=False).set_index(KEY)
    own = [_finished_jobs(Path(folder)) for folder in folders]
    return medians(pd.concat(own)).combine_first(table) if own else table


def medians(jobs: pd.DataFrame) -> pd.DataFrame:
    """The table of `load_measured` from jobs and what they took."""
    table = jobs.assign(jobs=1).groupby(KEY).agg({"jobs": "sum"} | dict.fromkeys(MEDIANS, "median"))
    ratio = jobs["seconds"].to_numpy() / expected_seconds(jobs, table).to_numpy()
    off = pd.Series(ratio, jobs.index).map(lambda each: max(each, 1.0 / each))
    return table.assign(off=jobs.assign(off=off).groupby(KEY)["off"].max())


def expected_seconds(jobs: pd.DataFrame, table: pd.DataFrame) -> pd.Series:
    """Seconds of every job by its work; not a number for a kind that was not measured."""
    known = jobs[KEY].join(table, on=KEY)
    return START + (known["seconds"] - START).clip(lower=0.0) * jobs["work"] / known["work"]


def expected_megabytes(jobs: pd.DataFrame, table: pd.DataFrame) -> pd.Series:
    """Megabytes of every job's files; not a number for a kind that was not measured."""
    known = jobs[KEY].join(table, on=KEY)
    return known["megabytes"] * jobs["content"] / known["content"]


def _finished_jobs(folder: Path) -> pd.DataFrame:
    """The jobs of a run with benchmark files in its folder of results, and what they took."""
    config = settings.complete([folder / "config.yaml"])
    jobs = with_work(plan(config, allowed_cores()), config)
    jobs = jobs[[bool(name) and _below(folder, name).is_file() for name in jobs["benchmark"]]]
    if jobs.empty:
        raise UserError(f"{folder}: holds no benchmark files, expected results of a run")
    return jobs.assign(
        seconds=[_seconds(_below(folder, name)) for name in jobs["benchmark"]],
        megabytes=[_megabytes(folder, names) for names in jobs["outputs"]],
    )


def _below(folder: Path, planned: str) -> Path:
    return folder / Path(planned).relative_to(RESULTS)


def _seconds(file: Path) -> float:
    try:
        return float(pd.read_csv(file, sep="\t", nrows=1)["s"].iloc[0])
    except (ValueError, LookupError, OSError):
        raise UserError(f"{file}: expected a benchmark file of Snakemake") from None


def _megabytes(folder: Path, planned: list[str]) -> float:
    files = [_below(folder, name) for name in planned]
    return sum(file.stat().st_size for file in files if file.is_file()) / 1e6


if __name__ == "__main__":
    jobs = pd.concat([_finished_jobs(Path(folder)) for folder in sys.argv[1:]])
    print(medians(jobs).round(3).to_csv(), end="")
