"""What the jobs of a configuration take: by stage, in all, and how far off it may be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import pandas as pd

from workflow.estimate.measured import KEY, expected_megabytes, expected_seconds
from workflow.estimate.plan import TARGETS
from workflow.estimate.work import STAGES

OTHER_SECONDS = 4.0
"""Time of a job without a benchmark file, such as one that draws a picture [s]."""

FAR = 5.0
"""Multiple of the measured work from which on an estimate is said to be far beyond it."""

SUMMED = ["jobs", "core_hours", "wall_hours", "kept_gb"]
HEADER = f"{'stage':<25}  jobs  core-hours  wall time    memory     files"
RECKONED = """\
figures belong to target figures, all else to {run_name}
core-hours are of the cores that jobs occupy: what the median job of earlier runs took, scaled by
the size of solids and data, times the jobs of Snakemake's dry run; in all this may be off by a
factor of three, and single jobs of those runs were by one of {off:.0f}, where they compiled kernels
memory is the most that the largest job may take (resources), not what it takes; files stay, and
data take as much again in journals while they are drawn"""


class Machine(NamedTuple):
    """Equal nodes."""

    nodes: int
    cores_per_node: int

    @property
    def cores(self) -> int:
        """All cores."""
        return self.nodes * self.cores_per_node


def with_costs(jobs: pd.DataFrame, measured: pd.DataFrame) -> pd.DataFrame:
    """The jobs of `with_work` with `known`, `core_hours`, `hours`, `memory_gb` and `kept_gb`.

    A job that is not known takes a few seconds, or the limit of its rule if that has one.
    """
    seconds = expected_seconds(jobs, measured)
    limits = (60.0 * jobs["minutes"].astype(float)).fillna(OTHER_SECONDS)
    hours = seconds.fillna(limits) / 3600.0
    return jobs.assign(
        known=seconds.notna() | jobs["minutes"].isna(),
        hours=hours,
        core_hours=hours * jobs["cores"],
        memory_gb=jobs["memory_mb"].astype(float).fillna(0.0) / 1000.0,
        kept_gb=expected_megabytes(jobs, measured).fillna(0.0) / 1000.0,
    )


def summarised(jobs: pd.DataFrame, measured: pd.DataFrame, machine: Machine) -> dict[str, Any]:
    """The jobs of `with_costs` by stage, with totals of the default run and of all."""
    stages = jobs["stage"].where(jobs["target"] == TARGETS[0], TARGETS[1])
    order = [*STAGES, TARGETS[1]]
    by_stage = sorted(jobs.groupby(stages), key=lambda each: order.index(each[0]))
    rows = pd.DataFrame([{"stage": name, **_row(same, machine)} for name, same in by_stage])
    used = measured[measured.index.isin(pd.MultiIndex.from_frame(jobs[KEY]))]
    return {
        "machine": machine._asdict(),
        "stages": rows.to_dict("records"),
        "totals": _totals(rows),
        "run_totals": _totals(rows[rows["target"] == TARGETS[0]]),
        "cautions": list(_cautions(jobs, measured)),
        "measured": used.reset_index().to_dict("records"),
        "off": used["off"].max(),
    }


def _row(jobs: pd.DataFrame, machine: Machine) -> dict[str, Any]:
    """What the jobs of a stage take together; its rules run one after the other."""
    rules = jobs.groupby("rule")
    return {
        "target": jobs["target"].iloc[0],
        "jobs": len(jobs),
        "core_hours": jobs["core_hours"].sum(),
        "wall_hours": sum(
            max(same["hours"].max(), same["core_hours"].sum() / machine.cores) for _, same in rules
        ),
        "longest_job_hours": jobs["hours"].max(),
        "memory_gb": jobs["memory_gb"].max(),
        "kept_gb": jobs["kept_gb"].sum(),
    }


def _totals(rows: pd.DataFrame) -> dict[str, Any]:
    return {name: rows[name].sum().item() for name in SUMMED} | {
        "memory_gb": rows["memory_gb"].max()
    }


def _cautions(jobs: pd.DataFrame, measured: pd.DataFrame) -> Iterator[str]:
    """What is not measured, or far beyond what is."""
    for rule, same in jobs[~jobs["known"]].groupby("rule"):
        minutes = same["minutes"].max()
        yield (
            f"{rule}: not measured; the {minutes:g} min that each of its jobs may take are "
            "counted, an upper bound"
        )
    times = jobs["work"] / jobs.join(measured["work"], on=KEY, rsuffix="_measured")["work_measured"]
    for stage, most in times.groupby(jobs["stage"]).max().items():
        if most > FAR:
            yield f"{stage}: the largest job is {most:,.0f} times the work that was measured"


def as_text(result: Mapping[str, Any], title: str) -> str:
    """The result of `summarised` as lines."""
    nodes, cores = result["machine"].values()
    run_name = result["run_name"]
    rows = [row for row in result["stages"] if row["target"] == TARGETS[0]]
    rows.append({**result["run_totals"], "stage": f"total of {run_name}"})
    further = [row for row in result["stages"] if row["target"] != TARGETS[0]]
    if further:
        rows += [*further, {**result["totals"], "stage": "total with figures"}]
    return "\n".join(
        [
            f"{title} on {nodes} x {cores} = {nodes * cores:,} cores, nothing done yet",
            HEADER,
            *map(_line, rows),
            RECKONED.format(run_name=run_name, off=result["off"]),
            *(f"note: {caution}" for caution in result["cautions"]),
        ]
    )


def _line(row: Mapping[str, Any]) -> str:
    hours = f"{_number(row['core_hours']):>12}{duration(row['wall_hours']):>11}"
    return (
        f"{row['stage']:<25}{row['jobs']:>6,}{hours}{_size(row['memory_gb']):>10}"
        f"{_size(row['kept_gb']):>10}"
    )


def duration(hours: float) -> str:
    """A duration in the unit that suits it.

    Examples
    --------
    >>> [duration(hours) for hours in (0.001, 0.1, 30.0, 240.0)]
    ['3.6 s', '6 min', '30 h', '10 d']
    """
    for unit, name in ((24.0, "d"), (1.0, "h"), (1.0 / 60.0, "min")):
        if hours >= 2.0 * unit:
            return f"{_number(hours / unit)} {name}"
    return f"{_number(3600.0 * hours)} s"


def _size(gigabytes: float) -> str:
    for unit, name in ((1e3, "TB"), (1.0, "GB"), (1e-3, "MB")):
        if gigabytes >= unit:
            return f"{_number(gigabytes / unit)} {name}"
    return "<1 MB" if gigabytes else "-"


def _number(value: float) -> str:
    """Two significant digits, or all before the point."""
    return f"{value:,.0f}" if value >= 10.0 else f"{value:.2g}"
