"""Core-hours that the jobs of a run have used, beside those that the estimate says for them.

Told at the end of a run, whose result it must not touch: what fails here is a warning. Nothing that
takes long to load is loaded before.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carillon.command_line.progress import say
from carillon.errors import UserError, one_line
from carillon.files.atomic import atomic_path

if TYPE_CHECKING:
    import pandas as pd

FILE = "core_hours.json"
"""File in the folder of results: a record of every run that finished jobs, in order."""
ALL = "total"
WIDTH = 28


def tell(workflow: Any, config: Mapping[str, Any], results: str | Path) -> None:
    """Tell what the jobs took that a run of Snakemake has finished, by rule, and write it down.

    Only jobs with a benchmark file count. Says nothing where there are none.
    """
    if workflow.touch:
        return
    try:
        jobs = finished_jobs(workflow)
        if jobs:
            record = compared(jobs, config)
            say(as_text(record))
            write(record, Path(results))
    except Exception as error:  # It is an extra, and the results are there.
        reason = str(error) if isinstance(error, UserError) else f"{type(error).__name__}: {error}"
        say(f"warning: the core-hours of this run are not told: {one_line(reason)}")


def finished_jobs(workflow: Any) -> list[dict[str, Any]]:
    """The jobs of `workflow.estimate.jobs.plan` that this run has finished, with `rule`, `seconds`.

    `cores` are those that a job had: of this machine, or asked of a cluster for all of its ranks.
    """
    from workflow.estimate.costs import benchmarked_seconds
    from workflow.estimate.jobs import described

    jobs = []
    for job in workflow.dag.finished_jobs:
        file = Path(job.benchmark or "")
        if not file.is_file():
            continue
        row = described(job) | {"rule": job.rule.name, "seconds": benchmarked_seconds(file)}
        ranks = job.resources.get("tasks") or 1
        if ranks > 1 and not workflow.local_exec:
            row["cores"] = ranks * job.resources["cpus_per_task"]
        jobs.append(row)
    return jobs


def compared(jobs: list[dict[str, Any]], config: Mapping[str, Any]) -> dict[str, Any]:
    """Core-hours of finished jobs and their estimate, by rule and in all.

    The estimate of a rule that was never measured is None; the total's ratio is of the others.
    """
    import pandas as pd

    from workflow.estimate.costs import load_medians, with_costs, with_work

    costs = with_costs(with_work(pd.DataFrame(jobs), config), load_medians())
    costs["used"] = costs["seconds"] * costs["cores"] / 3600.0
    costs["estimated"] = costs["core_hours"].where(costs["times"].notna())
    rules = [_summed(str(rule), same) for rule, same in costs.groupby("rule")]
    return {"finished": pd.Timestamp.now("UTC").isoformat(), "rules": [*rules, _summed(ALL, costs)]}


def _summed(name: str, jobs: pd.DataFrame) -> dict[str, Any]:
    known = jobs[jobs["estimated"].notna()]
    used, estimated = float(known["used"].sum()), float(known["estimated"].sum())
    return {
        "rule": name,
        "jobs": len(jobs),
        "core_hours": float(jobs["used"].sum()),
        "estimated_core_hours": estimated if len(known) else None,
        "ratio": used / estimated if len(known) else None,
    }


def as_text(record: Mapping[str, Any]) -> str:
    """A record as lines."""
    head = (
        f"{'core-hours of this run':<{WIDTH}}{'jobs':>6}{'used':>10}{'estimated':>11}{'ratio':>8}"
    )
    return "\n".join([head, *map(_line, record["rules"])])


def _line(row: Mapping[str, Any]) -> str:
    from workflow.estimate.summary import shown_number

    estimated, ratio = (
        "-" if row[name] is None else shown_number(row[name])
        for name in ("estimated_core_hours", "ratio")
    )
    used = shown_number(row["core_hours"])
    return f"{row['rule']:<{WIDTH}}{row['jobs']:>6,}{used:>10}{estimated:>11}{ratio:>8}"


def write(record: Mapping[str, Any], results: Path) -> None:
    """Add the record of a run to the file of all; one that cannot be read begins anew.

    Raises UserError if it cannot be written.
    """
    try:
        records = json.loads((results / FILE).read_text())["runs"]
    except (OSError, ValueError, LookupError, TypeError):
        records = []
    with atomic_path(results / FILE) as path:
        path.write_text(json.dumps({"runs": [*records, record]}, indent=2) + "\n")
