"""An estimate as plain values, and as people read it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from workflow.estimate.machine import Machine
from workflow.estimate.rates import Rates
from workflow.estimate.sizes import Size
from workflow.estimate.stages import Stage

HOUR = 3600.0
GIGABYTE_MB = 1000.0
SUMMED = ("jobs", "core_hours", "wall_hours", "kept_gb")

PAPER_COMPUTERS = 12
PAPER_HOURS = {"data generation": 240.0, "growing trees": 48.0, "fitting leaves": 12.0}
"""What the paper's section 8.1 says these took."""

_HEAD = f"{'stage':<25}{'jobs':>6}{'core-hours':>12}{'wall time':>11}{'memory':>10}{'files':>10}"


def plain(
    stages: Sequence[Stage], sizes: Mapping[str, Size], rates: Rates, machine: Machine
) -> dict[str, Any]:
    """Everything as plain values; each stage says under `basis` where its numbers come from."""
    rows = [_row(stage, machine) for stage in stages]
    totals: dict[str, Any] = {name: sum(row[name] for row in rows) for name in SUMMED}
    for name in ("memory_gb", "scratch_gb"):
        totals[name] = max(row[name] for row in rows)
    return {
        "machine": vars(machine),
        "solids": {name: vars(size) for name, size in sizes.items()},
        "stages": rows,
        "totals": totals,
        "cautions": [
            *(caution for stage in stages for caution in stage.cautions),
            *([rates.unmeasured] if rates.unmeasured else []),
        ],
        "rates": {
            "origin": rates.origin,
            "made": rates.made,
            "how": rates.how,
            "up_to": rates.up_to,
        },
    }


def _row(stage: Stage, machine: Machine) -> dict[str, Any]:
    basis = stage.basis
    return {
        "stage": stage.name,
        "target": stage.target,
        "jobs": stage.count,
        "core_hours": stage.core_hours,
        "wall_hours": machine.wall(stage.jobs) / HOUR,
        "longest_job_hours": max(jobs.seconds for jobs in stage.jobs) / HOUR,
        "memory_gb": stage.memory_mb / GIGABYTE_MB,
        "kept_gb": stage.kept_mb / GIGABYTE_MB,
        "scratch_gb": stage.scratch_mb / GIGABYTE_MB,
        "basis": {
            "jobs": "done by the job before" if stage.continues else "as the rules make them",
            "core_hours": f"cores that jobs occupy, used or not; {basis['seconds']}",
            "wall_hours": "jobs on the cores asked for, stages one after the other; "
            + basis["seconds"],
            "longest_job_hours": basis["seconds"],
            "memory_gb": f"peak of the largest job; {basis['memory']}",
            "kept_gb": basis["files"],
            "scratch_gb": basis["files"],
        },
    }


def as_text(found: Mapping[str, Any], name: str) -> str:
    """The result of `plain` as lines."""
    machine, totals = found["machine"], found["totals"]
    cores = machine["nodes"] * machine["cores_per_node"]
    lines = [
        f"{name} on {machine['nodes']} x {machine['cores_per_node']} = {cores:,} cores, "
        "nothing done yet",
        _HEAD,
        *(_line(row["stage"], row) for row in found["stages"]),
        _line("total", totals),
        "figures belong to target figures, all else to the default run; core-hours are those of "
        "the cores that jobs occupy;",
        "memory is that of the largest job; files stay, beside them there are up to "
        f"{_size(totals['scratch_gb'])} of journals for a while",
        "",
        f"rates of {found['rates']['origin']}",
    ]
    for solid, size in found["solids"].items():
        lines.append(
            f"{solid}: {size['fine']:,} unknowns, coarsened {size['coarse']:,}; {size['basis']}"
        )
    lines += [f"note: {caution}" for caution in found["cautions"]]
    return "\n".join(lines)


def _line(name: str, row: Mapping[str, Any]) -> str:
    return (
        f"{name:<25}{row['jobs']:>6,}{_number(row['core_hours']):>12}"
        f"{duration(row['wall_hours']):>11}{_size(row['memory_gb']):>10}{_size(row['kept_gb']):>10}"
    )


def beside_the_paper(stages: Sequence[Stage], machine: Machine) -> str:
    """The paper's training times beside those estimated, also on as many nodes as it used."""
    twelve = Machine(PAPER_COMPUTERS, machine.cores_per_node)
    told = []
    for stage in stages:
        if stage.name in PAPER_HOURS:
            here, there = (duration(m.wall(stage.jobs) / HOUR) for m in (machine, twelve))
            told.append(
                f"{stage.name} {here}, on twelve such nodes {there} (the paper: "
                f"{duration(PAPER_HOURS[stage.name])})"
            )
    return f"beside the paper's twelve computers: {'; '.join(told)}"


def duration(hours: float) -> str:
    """A duration in the unit that suits it.

    Examples
    --------
    >>> [duration(hours) for hours in (0.001, 0.1, 30.0, 240.0)]
    ['3.6 s', '6 min', '30 h', '10 d']
    """
    for unit, name in ((24.0, "d"), (1.0, "h"), (1.0 / 60.0, "min")):
        least = 2.0 * unit
        if hours >= least:
            return f"{_number(hours / unit)} {name}"
    return f"{_number(hours * HOUR)} s"


def _size(gigabytes: float) -> str:
    for unit, name in ((1e3, "TB"), (1.0, "GB"), (1e-3, "MB")):
        if gigabytes >= unit:
            return f"{_number(gigabytes / unit)} {name}"
    return "<1 MB" if gigabytes else "-"


def _number(value: float) -> str:
    """Two significant digits, or all before the point."""
    return f"{value:,.0f}" if value >= 10.0 else f"{value:.2g}"
