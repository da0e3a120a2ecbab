"""`carillon design`: a material for a project."""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from carillon.command_line.counts import counted
from carillon.command_line.progress import LINE_SECONDS, say
from carillon.errors import UserError
from carillon.fem.geometry.size import lengths_in_words
from carillon.files.locks import locked
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from sound.commands.common_options import SearchOptions
from sound.design.interrupts import ended_by_interrupts
from sound.design.objective import fall

if TYPE_CHECKING:
    from sound.design.search import Search
    from sound.project.design import Design
    from sound.project.project import Project
    from sound.project.settings import OptimiserSettings

ENDINGS = (".h5", ".hdf5")
"""Endings of the names of designs."""
SLOW = ("trimesh", "sound.design.optimise")
"""Modules that take seconds to load and that `--help` does not need."""
_COSTS = ("cost_start", "cost", "frequency_cost", "amplitude_cost")
_EFFORT = ("seconds", "evaluations", "evaluations_per_minute", "workers", "method", "ended_by")
_ENDINGS = {
    "met": "; ended early: its frequencies are met, and the cost falls no more",
    "interrupt": "; ended on request",
}
"""End of the summary's first line by what ended a search, empty if that was its budget."""
FAR_DAMPINGS = 1.5
"""Factor by which the dampings of a material are, in the median, far from those of the clips."""
STIFFEST, SOFTEST = 1.2e12, 1e6
"""Young's moduli [Pa] of diamond and of soft rubber."""
ERASE = "\x1b[2K"
"""Erases the line of a terminal."""
SHOWN_EVERY = 1.0
"""Time between two progress lines on a terminal [s]."""


@parameters
class DesignOptions:
    """What is designed, and where it is written."""

    project: str = option(REQUIRED, "project file (YAML)")
    out: str = option(REQUIRED, "file to write (.h5); goes on if it exists")
    initial_design: str | None = option(
        None, "design of the same mesh to go on from, its targets aside", metavar="DESIGN"
    )
    fine_check: bool | None = option(
        None,
        "check on the fine solid what the coarse search finds, and let it aim at what is right "
        "there, not as the project says",
    )
    restart: bool = option(False, "begin anew, even if --out exists")
    watch: bool = option(
        False,
        "go on until interrupted, take up edits of the project, and write the sound of every "
        "target beside --out whenever it gets better",
    )
    json: bool = option(False, "print the outcome as JSON")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, DesignOptions, positional=("project",))
    add_options(parser, SearchOptions)


def run(arguments: argparse.Namespace) -> int:
    """Search, unless another process does so and writes to the same file."""
    with ended_by_interrupts():
        for module in SLOW:
            import_module(module)
    options = collect(DesignOptions, arguments)
    with locked(options.out):
        return _search(options, collect(SearchOptions, arguments))


def _search(options: DesignOptions, settings: SearchOptions) -> int:
    from sound.commands.watching import EditedProject, design_on
    from sound.design.optimise import optimise
    from sound.design.preparation import prepare, require_same_voxels
    from sound.outputs import require_output
    from sound.project.design_file import read_design, write_design
    from sound.project.project import load_project
    from sound.rendering.verdict import with_verdict

    _require_one_rank()
    if options.watch and (settings.seconds or settings.evaluations):
        raise UserError("--watch goes on until interrupted; leave out --seconds and --evaluations")

    def load() -> Project:
        return _with_settings(load_project(options.project), settings, options)

    edited = EditedProject(options.project, load)
    project = edited.project
    inputs = filter(None, [options.project, project.solid.mesh, project.solid.forest])
    out = require_output(options.out, ENDINGS, inputs)
    initial = None
    if options.initial_design is not None:
        initial = read_design(options.initial_design)
    elif out.exists() and not options.restart:
        initial = read_design(out)
    say("preparing: partials of the clips, voxels, modes of the solid", sys.stderr.isatty())
    problem = prepare(project)
    if initial is not None:
        require_same_voxels(problem, initial)
        so_far = initial.history["evaluations"][-1:].sum()
        say(
            f"{options.initial_design or out}: going on after "
            f"{counted(int(so_far), 'evaluation')}, {_budget(project.optimiser, ' more')}"
        )
    elif not options.watch:
        count = "1 process" if problem.workers == 1 else f"{problem.workers} processes"
        say(f"searching on {count}, {_budget(project.optimiser)}", sys.stderr.isatty())
    progress = _SearchProgress()
    if options.watch:
        result = design_on(edited, problem, initial, out, progress.show)
    else:
        result = optimise(problem, initial, lambda each: write_design(out, each), progress.show)
    progress.end()
    if not options.watch:
        write_design(out, result)
        result = with_verdict(result)
        write_design(out, result)
    summary = summarise(result)
    print(json.dumps(summary) if options.json else _sentences(out, result, summary))
    return 0


def _with_settings(project: Project, settings: SearchOptions, options: DesignOptions) -> Project:
    """The project with the command's settings for its optimiser; without a budget if it watches."""
    from sound.project.project import with_optimiser

    budget = project.optimiser
    if options.watch:
        budget = replace(budget, seconds=None, evaluations=None)
    elif settings.evaluations is not None and settings.seconds is None:
        budget = replace(budget, seconds=None)
    project = replace(project, optimiser=budget)
    return with_optimiser(project, **asdict(settings), fine_check=options.fine_check)


def _budget(optimiser: OptimiserSettings, more: str = "") -> str:
    limits = []
    if optimiser.seconds is not None:
        limits.append(f"{optimiser.seconds:g} s of processor time")
    if optimiser.evaluations is not None:
        limits.append(counted(optimiser.evaluations, "evaluation"))
    return f"for {' or '.join(limits)}{more}" if limits else "until it is interrupted"


class _SearchProgress:
    """A line with cost and time: in place on a terminal, one a minute in a log."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._due = time.monotonic() + (0.0 if self._terminal else LINE_SECONDS)

    def show(self, search: Search) -> None:
        """Print progress, if it is due."""
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + (SHOWN_EVERY if self._terminal else LINE_SECONDS)
        entry, first = search.history[-1], search.history[0]
        cost = entry.cost
        text = (
            f"{search.own_seconds:6.1f} s  {counted(search.own_evaluations, 'evaluation')}  "
            f"cost {cost.total:9.4g} ({fall(first.cost.total, cost.total):.1%} less)  "
            f"frequencies {cost.frequency:8.3g}  amplitudes {cost.amplitude:8.3g}"
        )
        if search.checks:
            best = min(search.checks, key=lambda check: check.cost)
            text += (
                f"  rms {best.coarse_rms_cents:.1f} cents coarse, {best.fine_rms_cents:.1f} fine"
            )
        if self._terminal:
            say(f"{ERASE}{text}", end="\r")
        else:
            say(text)

    def end(self) -> None:
        """Erase the line on a terminal."""
        if self._terminal:
            say(ERASE, end="\r")


def summarise(design: Design) -> dict[str, Any]:
    """The outcome as plain values."""
    from sound.design.pitch import cents, rms_off_partials

    evidence, targets = design.evidence, design.targets
    which = targets.sounding
    off = np.abs(cents(design.frequencies, targets.frequencies))[which]
    assert design.damping is not None
    ratios = (design.damping.dampings / targets.dampings)[which]
    loss = design.damping.loss_factors
    return {
        **{key: evidence[key] for key in _COSTS},
        "fall": fall(evidence["cost_start"], evidence["cost"]),
        **{key: evidence[key] for key in _EFFORT},
        "extents_m": np.ptp(design.surface_vertices, axis=0).tolist(),
        "modes": len(design.frequencies),
        # Two modes of one frequency may have one partial.
        "partials": len(np.unique(targets.frequencies[which])),
        "left_out_hz": [] if targets.left_out is None else targets.left_out.tolist(),
        "left_out_share_of_loudness": targets.left_out_share,
        "targets": [strike.name for strike in design.strikes],
        "target_distances_m": [strike.distance for strike in design.strikes],
        "frequency_error_median_cents": float(np.median(off)),
        "frequency_error_max_cents": float(off.max()),
        "coarse_rms_cents": rms_off_partials(design.coarse_frequencies, targets),
        "fine_rms_cents": None
        if design.fine is None
        else rms_off_partials(design.frequencies, targets),
        "checks": evidence["checks"],
        "young_min_pa": float(design.young.min()),
        "young_max_pa": float(design.young.max()),
        "density_kg_per_m3": design.model.density,
        "poisson": design.model.poisson,
        "damping_source": design.settings.get("damping", {}).get("source"),
        "damping_ratios": ratios.tolist(),
        "regions": _regions(design),
        "loss_factors": [] if loss is None else np.unique(loss).tolist(),
        "mass_damping_per_second": design.damping.mass_per_second,
        "residual_max": evidence["residual_max"],
        "verdict": evidence.get("verdict"),
    }


def _regions(design: Design) -> list[dict[str, Any]]:
    """What the regions of a design have become, in their order."""
    table = design.model.regions
    rows = np.zeros(len(design.young), int) if design.fine_region is None else design.fine_region
    found = []
    for name in dict.fromkeys(table.names):
        own = [row for row, each in enumerate(table.names) if each == name]
        young = design.young[np.isin(rows, own)]
        if not len(young):  # Cells are of it in parts only.
            continue
        found.append(
            {
                "name": name,
                "young_min_pa": float(young.min()),
                "young_max_pa": float(young.max()),
                "density_kg_per_m3": float(table.density[own[0]]),
                "poisson": table.laws[own[0]].poisson,
            }
        )
    return found


def _sentences(out: Path, design: Design, summary: dict[str, Any]) -> str:
    return "\n".join(
        [
            f"cost {summary['cost_start']:.4g} -> {summary['cost']:.4g} ({summary['fall']:.1%} "
            f"less) in {summary['seconds']:.1f} s and "
            f"{counted(summary['evaluations'], 'evaluation')} "
            f"({summary['evaluations_per_minute']:,.0f} a minute, "
            f"{counted(summary['workers'], 'worker')})"
            f"{_ENDINGS.get(summary['ended_by'], '')}",
            f"frequencies of {counted(summary['partials'], 'partial')} among "
            f"{counted(summary['modes'], 'mode')}: "
            f"median error {summary['frequency_error_median_cents']:.1f} cents, worst "
            f"{summary['frequency_error_max_cents']:.1f} cents; "
            f"residuals of the modes up to {summary['residual_max']:.1e}",
            *_left_out_sentence(summary),
            _rms_sentence(summary),
            *_material_sentences(design, summary),
            _damping_sentence(summary),
            *([summary["verdict"]["sentence"]] if summary["verdict"] else []),
            f"design: {out}; solid {lengths_in_words(summary['extents_m'])}",
        ]
    )


def _left_out_sentence(summary: dict[str, Any]) -> list[str]:
    hertz = summary["left_out_hz"]
    if not hertz:
        return []
    listed = ", ".join(f"{each:.0f}" for each in hertz)
    share = summary["left_out_share_of_loudness"]
    return [
        f"left out, since no mode can have them: partials at {listed} Hz, {share:.0%} of loudness"
    ]


def _rms_sentence(summary: dict[str, Any]) -> str:
    coarse, fine = summary["coarse_rms_cents"], summary["fine_rms_cents"]
    if fine is None:
        return f"from their targets (rms): {coarse:.1f} cents"
    return (
        f"from their targets (rms): {coarse:.1f} cents on the coarse solid, {fine:.1f} on the fine "
        f"one, by {counted(len(summary['checks']), 'check')}"
    )


def _material_sentences(design: Design, summary: dict[str, Any]) -> list[str]:
    regions = summary["regions"]
    lines = []
    for each in regions:
        low, high = (each[f"young_{end}_pa"] / 1e9 for end in ("min", "max"))
        ratio = "its own elasticity along each axis"
        if each["poisson"] is not None:
            ratio = f"Poisson's ratio {each['poisson']:.3g}"
        name = f"{each['name']}: " if len(regions) > 1 else ""
        density = each["density_kg_per_m3"]
        lines.append(
            f"{name}Young's modulus {low:.3g} to {high:.3g} GPa, density {density:.4g} kg/m^3, "
            f"{ratio}"
        )
    low, high = design.young.min(), design.young.max()
    least, most = design.settings["material"]["young_bounds"] or (low, high)
    beyond = np.mean((design.young < 0.999 * least) | (design.young > 1.001 * most))
    if beyond:
        lines[-1] += f"; {beyond:.1%} of the voxels are beyond young_bounds"
    if high > STIFFEST or low < SOFTEST:
        than = "stiffer than diamond" if high > STIFFEST else "softer than rubber"
        lines.append(
            f"warning: that is {than}; look at the size of the solid, or let its density give way "
            "(young_bounds below material)"
        )
    return lines


def _damping_sentence(summary: dict[str, Any]) -> str:
    low, median, high = np.quantile(summary["damping_ratios"], (0.25, 0.5, 0.75))
    factors, by = summary["loss_factors"], "the regions' own damping"
    if factors:
        by = f"loss factors of {min(factors):.2g} to {max(factors):.2g}"
    text = (
        f"dampings by {by}: {median:.2f} of "
        f"the clips' (median), half of them {low:.2f} to {high:.2f}"
    )
    far = max(median, 1.0 / median) > FAR_DAMPINGS
    if summary["damping_source"] == "material" and far:
        rings = "shorter" if median > 1.0 else "longer"
        text += (
            f"; it rings {rings} than its clips: take their dampings (damping: {{source: clips}}), "
            "another damping of the regions, or more regions of the damping"
        )
    return text


def _require_one_rank() -> None:
    from mpi4py import MPI

    if MPI.COMM_WORLD.size > 1:
        raise UserError(
            f"started on {MPI.COMM_WORLD.size} MPI ranks; run it once, its workers share the cores"
        )
