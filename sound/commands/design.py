"""`carillon design`: a material for a project."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, replace
from importlib import import_module
from typing import TYPE_CHECKING

from carillon.command_line.counts import counted
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.files.locks import locked
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from sound.commands.common_options import SearchOptions
from sound.commands.design_progress import BuildLine, SearchLine
from sound.commands.design_summary import sentences, summarise
from sound.design.interrupts import ended_by_interrupts

if TYPE_CHECKING:
    from sound.design.preparation import DesignProblem
    from sound.project.design import Design
    from sound.project.project import Project
    from sound.project.settings import OptimiserSettings

ENDINGS = (".h5", ".hdf5")
"""Endings of the names of designs."""
SLOW = ("trimesh", "sound.design.optimise")
"""Modules that take seconds to load and that `--help` does not need."""


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
    if project.build.is_asked and not options.watch:
        _say_too_thin(problem)
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
    progress = SearchLine()
    if options.watch:
        result = design_on(edited, problem, initial, out, progress.show)
    else:
        result = optimise(problem, initial, lambda each: write_design(out, each), progress.show)
    progress.end()
    if not options.watch:
        write_design(out, result)
        if project.build.is_asked:
            result = _built(problem, result)
        else:
            result = with_verdict(result)
        write_design(out, result)
    elif project.build.is_asked:
        say("the design is a continuous field still: --watch leaves out what project.build asks")
    summary = summarise(result)
    print(json.dumps(summary) if options.json else sentences(out, result, summary))
    return 0


def _say_too_thin(problem: DesignProblem) -> None:
    """Say that parts cannot be printed, as far as it is known before the search."""
    from sound.building.restriction import known_width
    from sound.project.build import too_thin

    if fault := too_thin(known_width(problem)):
        say(f"warning: {fault}")


def _built(problem: DesignProblem, design: Design) -> Design:
    """The design in real materials, with what that costs."""
    from sound.building.cost_of_build import with_cost_of_build
    from sound.building.restriction import built

    progress = BuildLine()
    result = built(problem, design, progress.show)
    progress.end()
    return with_cost_of_build(design, result)


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


def _require_one_rank() -> None:
    from carillon.processes.mpi import MPI

    if MPI.COMM_WORLD.size > 1:
        raise UserError(
            f"started on {MPI.COMM_WORLD.size} MPI ranks; run it once, its workers share the cores"
        )
