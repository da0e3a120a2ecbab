"""Distances from the solid that spectra expect, beside those from a much finer lattice."""

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.errors import ConvergenceError, UserError
from carillon.fem.geometry import load_surface, surface_name
from carillon.fem.geometry.builtin import BUILTINS, THIN, TRIALS
from carillon.fem.model import RIGID_MODES
from carillon.parameters import option, parameters
from solver.analysis.problem import ProblemOptions
from solver.refinement.errors import FROM_SOLID
from solver.verification.matching import frequency_errors
from studies.accuracy.expected import elastic_hertz, expected_errors, solved_solid
from studies.accuracy.solids import ANGLES

ELASTIC = 30
"""Frequencies compared."""
MODES = RIGID_MODES + ELASTIC
OBJECTS = tuple(f"builtin:{name}" for name in (*BUILTINS, *THIN, *TRIALS))

WAYS = {
    "cells": ("finite-cell", None),
    "divided": ("finite-cell", 0.01),
    "voxels": ("voxel", None),
}
"""Discretisation, and the expected error down to which its cells are divided."""
REFERENCE = 0.002
"""Expected error down to which the cells of a reference are divided."""
FACTOR = 3.0
"""An expected error that is wrong by no more counts as right."""


@parameters
class DistanceStudyOptions:
    """What is measured."""

    resolution: Annotated[int, Ge(4)] = option(32, "lattice spacings along the longest side")
    reference: Annotated[int, Ge(6)] = option(48, "those of the spectra that count as true")
    turned: bool = option(False, "each solid also turned by 25, 35 and 15 degrees")


def measure_distances(objects: tuple[str, ...], options: DistanceStudyOptions) -> dict[str, Any]:
    """Expected and true errors of the first frequencies of solids, by every way.

    Raises UserError if an object is no use, or the reference's lattice is not finer.

    `objects`: mesh files or built-in objects.

    Returns plain values: `solids`, each with its reference and `ways`; `right`, of every way the
    number of expected errors within a factor of `FACTOR` and of all.
    """
    if options.reference <= options.resolution:
        raise UserError(
            f"--reference {options.reference} is no finer than --resolution {options.resolution}"
        )
    with tempfile.TemporaryDirectory() as folder:
        meshes = list(_meshes(objects, options.turned, Path(folder)))
        solids = [_measured(name, mesh, options) for name, mesh in track(meshes, "solids")]
    return {
        "elastic_modes": ELASTIC,
        "resolution": options.resolution,
        "factor": FACTOR,
        "solids": solids,
        "right": {way: _right(solids, way) for way in WAYS},
    }


def _meshes(objects: tuple[str, ...], turned: bool, folder: Path) -> Iterator[tuple[str, str]]:
    """Names and meshes of the solids; turned ones lie in a folder."""
    from trimesh.transformations import euler_matrix

    for mesh in objects:
        surface, name = load_surface(mesh), surface_name(mesh)
        yield name, mesh
        if turned:
            path = folder / f"turned-{name}.stl"
            surface.apply_transform(euler_matrix(*np.radians(ANGLES))).export(path)
            yield path.stem, str(path)


def _measured(name: str, mesh: str, options: DistanceStudyOptions) -> dict[str, Any]:
    described = ProblemOptions(mesh, options.resolution, discretisation="finite-cell")
    try:
        truth = solved_solid(replace(described, resolution=options.reference), MODES, REFERENCE)
    except (UserError, ConvergenceError) as error:
        return {"solid": name, "problem": str(error), "ways": {}}
    assert truth.model is not None
    left = expected_errors(truth)
    # Half of what the reference expects of itself is taken off, the other half is doubt.
    hertz = elastic_hertz(truth, ELASTIC) * (1.0 - 0.5 * left)
    truth.modes.destroy()
    ways = {way: _rated(described, way, hertz) for way in WAYS}
    reference = {"unknowns": truth.model.n_dofs, "doubt": 0.5 * float(np.sqrt(np.mean(left**2)))}
    return {"solid": name, "reference": reference, "ways": ways}


def _rated(described: ProblemOptions, way: str, hertz: Array) -> dict[str, Any]:
    discretisation, refine_to = WAYS[way]
    try:
        solved = solved_solid(replace(described, discretisation=discretisation), MODES, refine_to)
    except (UserError, ConvergenceError) as error:
        return {"problem": str(error)}
    assert solved.model is not None
    true = frequency_errors(elastic_hertz(solved, ELASTIC) / hertz - 1.0, MODES).rms
    solved.modes.destroy()
    return {
        "unknowns": solved.model.n_dofs,
        "rms": true,
        "expected": solved.achieved.get(f"{FROM_SOLID}_rms"),
    }


def _right(solids: list[dict[str, Any]], way: str) -> dict[str, int]:
    """Number of expected errors within the factor, of all that there are."""
    rated = [solid["ways"][way] for solid in solids if "expected" in solid["ways"].get(way, {})]
    ratios = [each["expected"] / each["rms"] for each in rated if each["expected"] is not None]
    right = sum(1.0 / FACTOR <= ratio <= FACTOR for ratio in ratios)
    return {"within": right, "of": len(ratios)}


def as_text(result: dict[str, Any]) -> str:
    """The result in columns."""
    lines = [
        f"rms errors of {result['elastic_modes']} elastic frequencies at resolution "
        f"{result['resolution']}: expected of the spectrum itself / against the reference",
        f"{'':<22}" + "".join(f"{way:>18}" for way in WAYS) + f"{'reference':>12}",
    ]
    for solid in result["solids"]:
        if "problem" in solid:
            lines.append(f"{solid['solid']:<22}  {solid['problem']}")
            continue
        shown = "".join(f"{_shown(solid['ways'][way]):>18}" for way in WAYS)
        lines.append(f"{solid['solid']:<22}{shown}{solid['reference']['doubt']:>11.2%}")
    counts = "".join(f"{'{within} of {of}'.format(**result['right'][way]):>18}" for way in WAYS)
    lines.append(f"{f'within a factor of {FACTOR:g}':<22}{counts}")
    return "\n".join(lines)


def _shown(way: dict[str, Any]) -> str:
    if way.get("expected") is None:
        return "-"
    return f"{way['expected']:.2%} / {way['rms']:.2%}"
