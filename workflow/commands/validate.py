"""`carillon validate`: the rules of the validation, on one solid that is named."""

import argparse
import re
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import yaml

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.fem.geometry import surface_name
from carillon.fem.geometry.size import sizes_in_words
from carillon.fem.materials import NAMES as MATERIALS
from carillon.files.atomic import atomic_path
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect, reader
from carillon.parameters.fields import parameters_of
from carillon.parameters.quantities import NonNegative, Point, Positive, Workers, between
from carillon.parameters.sentences import ParameterError, Place
from carillon.processes.threads import allowed_cores
from solver.analysis.problem import ProblemOptions, build_problem
from solver.coarsening.forest import load_forest
from solver.correction.criteria import EIGENVALUE_TOLERANCE
from solver.response.surface import surface_of
from studies.base.table import read_table
from workflow.configuration.run import ProvedTolerance, TolerancesSection
from workflow.configuration.solids import ModelModes
from workflow.configuration.whole import completed
from workflow.disk_space import make_folder, require_own
from workflow.report.findings import headline
from workflow.settings import DEFAULT_FORESTS
from workflow.snakemake_run import run_target

CONFIGURATION = "validate.yaml"
"""File in the folder of the results that the run is started with."""
FAILED = 1
"""Exit status if a criterion is missed."""
LONGEST_NAME = 64
"""Longest name of a model in characters; a title may be longer."""
TOLERANCES = tuple(parameters_of(TolerancesSection))
"""Names of the limits of the criteria."""


def _tolerance(text: str) -> tuple[str, float]:
    """Argument type: NAME=VALUE."""
    name, _, value = text.partition("=")
    if name not in TOLERANCES:
        raise argparse.ArgumentTypeError(
            f"{text!r} names no tolerance, expected NAME=VALUE with one of {', '.join(TOLERANCES)}"
        )
    return name, reader(Positive)(value)


def _point(what: str) -> Any:
    words = f"point of the surface that is {what}, in mesh units (default: chosen)"
    return option(None, words, metavar=("X", "Y", "Z"))


@parameters
class ValidateOptions:
    """What a validation needs beside the solid."""

    out: str = option(REQUIRED, "folder of all results", metavar="FOLDER")
    name: str | None = option(None, "name of the solid's page (default: that of the mesh)")
    modes: ModelModes = option(256, "rigid included")
    mass_damping: NonNegative | None = option(
        None, "Rayleigh damping [1/s] (default: of a plastic)"
    )
    stiffness_damping: NonNegative | None = option(
        None, "Rayleigh damping [s] (default: of a plastic)"
    )
    tolerance: ProvedTolerance = option(
        EIGENVALUE_TOLERANCE,
        "relative error of an eigenvalue that HCMS + EC is corrected to, and from which the limits "
        "of the criteria follow",
    )
    ranks: Annotated[int, between(1, 4096)] = option(1, "MPI ranks of every solver run")
    forest: str | None = option(None, "forests to coarsen by (default: those of the package)")
    cores: Workers = option(allowed_cores(), "cores to use (default: all)")
    strike: Point | None = _point("struck")
    observed: Point | None = _point("watched")
    tolerances: tuple[tuple[str, float], ...] | None = option(
        None,
        f"limits of the criteria: {', '.join(TOLERANCES)}",
        read=_tolerance,
        several=True,
        metavar="NAME=VALUE",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.description = (
        "Compute the modes of one solid in several ways, prove and compare them, and build a page "
        "that says how far they can be trusted. The same command goes on where it was stopped. "
        "Finite cells are those of `modes --refine-to 0`, undivided, so that all ways are about "
        "one mesh. "
        f"Exit status 0 if all criteria are met, {FAILED} if one is missed."
    )
    own = ("coarsen", "forest", "objective", "lumped")
    add_options(parser, ProblemOptions, leave_out=own, positional=("mesh",))
    add_options(parser, ValidateOptions)


def run(arguments: argparse.Namespace) -> int:
    """Validate one solid; returns the exit status.

    Raises UserError if the solid cannot be made, or the run fails.
    """
    config = configuration(arguments)
    try:
        completed(config)
    except ParameterError as error:
        raise UserError(f"{_option(error.place)}: {error.reason}") from None
    say("reading the mesh, making its voxels", sys.stderr.isatty())
    size = _checked_size(arguments)
    name = next(iter(config["models"]))
    folder = Path(arguments.out).resolve()
    make_folder(folder)
    require_own(folder)
    with atomic_path(folder / CONFIGURATION) as temporary:
        temporary.write_text(yaml.safe_dump(config, sort_keys=False))
    say(size)
    run_target("validation", folder / CONFIGURATION, arguments.cores, folder / "validate.log")
    page = folder / "validation" / f"{name}.html"
    criteria, told = (
        read_table(folder / "validation" / "tables" / f"{name}-{table}.json").rows
        for table in ("criteria", "solid")
    )
    missed = [row for row in criteria if row["verdict"] != "met"]
    print(headline(len(criteria), len(missed)))
    for row in missed:
        print(f"  {row['label']}: {row['shown']}, required {row['required']}")
    print(told[0]["told"])
    print(page)
    return FAILED if missed else 0


def _option(place: Place) -> str:
    """The argument that a value of the configuration is from."""
    keys = [str(key) for key in place if isinstance(key, str)]
    if "mesh" in keys or "tolerances" in keys:
        return "mesh" if "mesh" in keys else "--tolerances"
    last = {"results_dir": "out", "title": "name", "model": "forest"}.get(keys[-1], keys[-1])
    return f"--{last.replace('_', '-')}"


def configuration(arguments: argparse.Namespace) -> dict[str, Any]:
    """Configuration of a run with this one solid; what it leaves out takes the defaults."""
    given = vars(arguments)
    keys = (
        *("resolution", "discretisation", "wall", "wall_side", "unit", "up", "fill"),
        "components",
        *("density", "modes", "seed"),
    )
    named = arguments.material in MATERIALS
    title = arguments.name or surface_name(arguments.mesh)
    is_builtin = arguments.mesh.startswith(BUILTIN_PREFIX)
    model = {
        "title": title,
        "mesh": arguments.mesh if is_builtin else _path(arguments.mesh),
        "regions": _path(arguments.regions) if arguments.regions else None,
        "fix": list(arguments.fix or []),
        "material": arguments.material if named else _path(arguments.material),
        **{key: given[key] for key in (*keys, "strike", "observed")},
    }
    damping = {key: given[key] for key in ("mass_damping", "stiffness_damping")}
    validation = {key: value for key, value in damping.items() if value is not None}
    # Lower-case letters, digits and hyphens.
    name = re.sub(r"[^a-z0-9]+", "-", title.lower())[:LONGEST_NAME].strip("-") or "solid"
    return {
        "title": f"Validation of {title}",
        "results_dir": _path(arguments.out),
        "mesh_folder": "",
        "poisson": arguments.poisson,
        "models": {name: model},
        "solver": {"tolerance": arguments.tolerance, "ranks": arguments.ranks},
        "forests": {"model": _path(arguments.forest) if arguments.forest else DEFAULT_FORESTS},
        "validation": {"tolerances": dict(arguments.tolerances or []), **validation},
    }


def _path(text: str) -> str:
    return str(Path(text).resolve())


def _checked_size(arguments: argparse.Namespace) -> str:
    """Sizes of mesh and voxels, made once to tell all that is wrong before anything runs."""
    solid = build_problem(collect(ProblemOptions, arguments))
    load_forest(arguments.forest, *solid.regions.ratios)
    for name in ("strike", "observed"):
        point = getattr(arguments, name)
        if point is not None:
            surface_of(solid.model).nearest(arguments.unit * np.array(point), name)
    sizes = sizes_in_words(solid.extents, solid.voxel_extents)
    return f"{sizes}: {solid.fine.n_cells:,} voxels, {solid.fine.n_dofs:,} unknowns"
