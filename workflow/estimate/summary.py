"""What the jobs of a configuration take: by stage, and in all."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from workflow.estimate.costs import STAGES
from workflow.estimate.jobs import TARGETS

FAR = 5.0
"""Multiple of the measured work from which on an estimate is said to be far beyond it."""
SUMMED = ["jobs", "core_hours", "wall_hours", "kept_gb"]
HEADER = f"{'stage':<25}  jobs  core-hours  wall time    memory     files"
RECKONED = """\
figures belong to target figures, all else to {}
core-hours are of the cores that jobs occupy: what the median job of earlier runs took, scaled by
the size of solids and data, times the jobs of Snakemake's dry run; in all this may be off by a
factor of three, single jobs by more
memory is the most that the largest job may take (resources), not what it takes; files stay, and
data take as much again in journals while they are drawn"""


def summarised(jobs: pd.DataFrame, cores: int) -> dict[str, Any]:
    """The jobs of `with_costs` by stage on so many cores, with totals of the default run and all.

    Figures are a stage by themselves; the rules of a stage run one after the other.
    """
    stages = jobs["stage"].where(jobs["target"] == TARGETS[0], TARGETS[1])
    rows = []
    for stage in (*STAGES, TARGETS[1]):
        same = jobs[stages == stage]
        rules = same.groupby(same["kind"].str.split(" ").str[0])
        if len(same):
            row = {
                "stage": stage,
                "target": same["target"].iloc[0],
                "jobs": len(same),
                "core_hours": same["core_hours"].sum(),
                "wall_hours": sum(
                    max(each["hours"].max(), each["core_hours"].sum() / cores) for _, each in rules
                ),
                "longest_job_hours": same["hours"].max(),
                "memory_gb": same["memory_gb"].max(),
                "kept_gb": same["kept_gb"].sum(),
                **_of_ranks(same),
            }
            rows.append(row)
    return {
        "stages": rows,
        "totals": _totals(rows),
        "run_totals": _totals([row for row in rows if row["target"] == TARGETS[0]]),
        "cautions": list(_cautions(jobs)),
    }


def _of_ranks(jobs: pd.DataFrame) -> dict[str, Any]:
    """Most ranks of a job, and least and greatest `rank_speed_up` of the jobs with several."""
    several = jobs[(jobs["ranks"] > 1) & (jobs["rank_speed_up"] != 1.0)]
    if several.empty:
        return {"ranks": 1, "rank_speed_up": [1.0, 1.0]}
    gains = several["rank_speed_up"]
    return {
        "ranks": int(several["ranks"].max()),
        "rank_speed_up": [float(gains.min()), float(gains.max())],
    }


def _totals(rows: list[dict[str, Any]]) -> dict[str, Any]:
    sums = {name: sum(row[name] for row in rows) for name in SUMMED}
    return sums | {"memory_gb": max(row["memory_gb"] for row in rows)}


def _cautions(jobs: pd.DataFrame) -> Iterator[str]:
    """What is not measured, or far beyond what is."""
    for kind, same in jobs[~jobs["known"]].groupby("kind"):
        yield (
            f"{kind}: not measured; the {same['minutes'].max():g} min that each of its jobs may "
            "take are counted, an upper bound"
        )
    for stage, most in jobs.groupby("stage")["times"].max().items():
        if most > FAR:
            yield f"{stage}: the largest job is {most:,.0f} times the work that was measured"


def as_text(result: Mapping[str, Any], title: str) -> str:
    """The result of the command as lines."""
    nodes, cores = result["machine"].values()
    run_name = result["run_name"]
    rows = [row for row in result["stages"] if row["target"] == TARGETS[0]]
    figures = result["stages"][len(rows) :]
    rows.append({**result["run_totals"], "stage": f"total of {run_name}"})
    if figures:
        rows += [*figures, {**result["totals"], "stage": "total with figures"}]
    return "\n".join(
        [
            f"{title} on {nodes} x {cores} = {nodes * cores:,} cores, nothing done yet",
            HEADER,
            *map(_line, rows),
            RECKONED.format(run_name),
            *(_ranks_line(row) for row in result["stages"] if row["ranks"] > 1),
            *(f"note: {caution}" for caution in result["cautions"]),
        ]
    )


def _line(row: Mapping[str, Any]) -> str:
    hours = f"{shown_number(row['core_hours']):>12}{duration(row['wall_hours']):>11}"
    return (
        f"{row['stage']:<25}{row['jobs']:>6,}{hours}{_size(row['memory_gb']):>10}"
        f"{_size(row['kept_gb']):>10}"
    )


def _ranks_line(row: Mapping[str, Any]) -> str:
    least, most = (f"{gain:.1f}" for gain in row["rank_speed_up"])
    gain = least if least == most else f"{least} to {most}"
    return f"{row['stage']}: on {row['ranks']} ranks {gain} times as fast as on one, by a model"


def duration(hours: float) -> str:
    """A duration in the unit that suits it.

    Examples
    --------
    >>> [duration(hours) for hours in (0.001, 0.1, 30.0, 240.0)]
    ['3.6 s', '6 min', '30 h', '10 d']
    """
    for unit, name in ((24.0, "d"), (1.0, "h"), (1.0 / 60.0, "min")):
        if hours >= 2.0 * unit:
            return f"{shown_number(hours / unit)} {name}"
    return f"{shown_number(3600.0 * hours)} s"


def _size(gigabytes: float) -> str:
    for unit, name in ((1e3, "TB"), (1.0, "GB"), (1e-3, "MB")):
        if gigabytes >= unit:
            return f"{shown_number(gigabytes / unit)} {name}"
    return "<1 MB" if gigabytes else "-"


def shown_number(value: float) -> str:
    """Two significant digits, or all before the point.

    Examples
    --------
    >>> [shown_number(value) for value in (0.0123, 3.0, 1234.5)]
    ['0.012', '3', '1,234']
    """
    return f"{value:,.0f}" if value >= 10.0 else f"{value:.2g}"
