"""The estimate by stages, as plain values and as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, StrictUndefined

from workflow.estimate.costs import Machine, serial_share
from workflow.estimate.laws import KNOWN, QUANTITIES, Rates
from workflow.estimate.plan import TARGETS
from workflow.estimate.solids import Size

SUMMED, LARGEST = ["jobs", "core_hours", "wall_hours", "kept_gb"], ["memory_gb", "scratch_gb"]


def plain(
    jobs: pd.DataFrame, solids: Mapping[str, Size], rates: Rates, machine: Machine
) -> dict[str, Any]:
    """The jobs of `costs` by stage; each stage says under `basis` where its numbers come from."""
    by_stage = dict(list(jobs.groupby("stage")))
    stages = [by_stage[name] for name in KNOWN["stages"] if name in by_stage]
    rows = pd.DataFrame([_row(same, rates, machine) for same in stages])
    cautions = [caution for same in stages for caution in _cautions(same, rates)]
    made, laws = rates["made"], rates["laws"]
    if rates["serial_share"] is None:
        cautions.append(KNOWN["cautions"]["busy"].format(share=serial_share(rates), **made))
    return {
        "machine": machine._asdict(),
        "solids": {name: size._asdict() for name, size in solids.items()},
        "stages": rows.to_dict("records"),
        "totals": _totals(rows),
        "run_totals": _totals(rows[rows["target"] == TARGETS[0]]),
        "cautions": cautions,
        "rates": {
            "origin": KNOWN["origin"].format(**made),
            "made": made,
            "how": {name: f"{law['jobs']} jobs of measured runs" for name, law in laws.items()},
            "up_to": {name: law["up_to"] for name, law in laws.items()},
        },
    }


def _totals(rows: pd.DataFrame) -> dict[str, Any]:
    """What stages take together."""
    return {
        **{name: rows[name].sum().item() for name in SUMMED},
        **{name: rows[name].max() for name in LARGEST},
    }


def _row(jobs: pd.DataFrame, rates: Rates, machine: Machine) -> dict[str, Any]:
    """What the jobs of a stage take together."""
    at_a_time = machine.slots(jobs["granted"].min())
    basis = {name: _basis(jobs, rates, name) for name in QUANTITIES}
    return {
        "stage": jobs["stage"].iloc[0],
        "target": jobs["target"].iloc[0],
        "jobs": len(jobs),
        "core_hours": jobs["core_hours"].sum(),
        "wall_hours": wall_hours(jobs, machine),
        "longest_job_hours": jobs["hours"].max(),
        "memory_gb": jobs["memory_gb"].max(),
        "kept_gb": jobs["kept_gb"].sum(),
        "scratch_gb": jobs["journal_gb"].nlargest(at_a_time).sum(),
        "basis": {name: text.format(**basis) for name, text in KNOWN["basis"].items()},
    }


def wall_hours(jobs: pd.DataFrame, machine: Machine) -> float:
    """Wall time of jobs whose rules run one after the other."""
    rules = jobs.groupby("rule")
    return sum(machine.wall(zip(same["hours"], same["granted"])) for _, same in rules)


def _basis(jobs: pd.DataFrame, rates: Rates, quantity: str) -> str:
    parts = []
    for name in sorted(set(jobs["law"]) - {""}):
        law = rates["laws"][name][quantity]
        powers = "".join(f" x {size}^{power:.2f}" for size, power in law["powers"].items())
        parts.append(f"{name} on one core {law['start']:.2g} + {law['factor']:.2g}{powers}")
    others = jobs.loc[jobs["law"] == "", "local"]
    parts += [f"{serial_share(rates):.0%} of a solver run stays on more cores"] if parts else []
    parts += ["others as a solver run without work, files not counted"] if others.any() else []
    parts += ["not measured: the limit of the rule, an upper bound"] if not others.all() else []
    return "; ".join(parts)


def _cautions(jobs: pd.DataFrame, rates: Rates) -> Iterator[str]:
    """What is not measured, or far beyond what is, in a stage."""
    stage, texts = jobs["stage"].iloc[0], KNOWN["cautions"]
    for rule, same in jobs[(jobs["law"] == "") & ~jobs["local"]].groupby("rule"):
        yield texts["unmeasured"].format(rule=rule, minutes=same["minutes"].max())
    beyond: dict[str, tuple[float, ...]] = {}
    for job in jobs[jobs["law"] != ""].itertuples():
        for size, most in rates["laws"][job.law]["up_to"].items():
            value = job.granted if size == "cores" else job.sizes[size]
            beyond[size] = max(beyond.get(size, (0.0,)), (value / most, value, most))
    for size, (times, value, most) in beyond.items():
        if times > KNOWN["far"]:
            numbers = {"size": size.replace("_", " "), "value": value, "most": most, "times": times}
            yield texts["cores" if size == "cores" else "beyond"].format(stage=stage, **numbers)
    long = jobs[(jobs["rule"] == "generate_shard") & (jobs["hours"] > KNOWN["long"])]
    for job in long.head(1).itertuples():
        shards = job.sizes["shards"] * job.hours
        yield texts["shards"].format(stage=stage, hours=job.hours, shards=shards)


def as_text(values: Mapping[str, Any], name: str) -> str:
    """The result of `plain` as lines, see `estimate.txt.j2`."""
    environment = Environment(trim_blocks=True, undefined=StrictUndefined)
    environment.filters |= {"number": _number, "duration": duration, "size": _size}
    template = environment.from_string(Path(__file__).with_name("estimate.txt.j2").read_text())
    return template.render({"name": name, "paper": "", **values}).rstrip()


def beside_the_paper(jobs: pd.DataFrame, machine: Machine) -> str:
    """The paper's training times beside those estimated, also on as many nodes as it used."""
    parts = []
    for stage, took in KNOWN["paper"].items():
        same = jobs[jobs["stage"] == stage]
        machines = (machine, Machine(12, machine.cores_per_node))
        here, there = (duration(wall_hours(same, each)) for each in machines)
        parts.append(f"{stage} {here}, on twelve such nodes {there} (the paper: {took})")
    return f"beside the paper's twelve computers: {'; '.join(parts)}"


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
