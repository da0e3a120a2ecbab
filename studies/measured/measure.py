"""Errors of models of solids whose frequencies were measured, and those that are expected."""

import tempfile
from argparse import ArgumentTypeError
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import yaml

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.errors import ConvergenceError, UserError
from carillon.fem.model import RIGID_MODES
from carillon.parameters import option, parameters
from carillon.parameters.quantities import between
from solver.analysis.problem import ProblemOptions
from solver.refinement.errors import FROM_SOLID
from studies.accuracy.expected import elastic_hertz, expected_errors, solved_solid
from studies.measured.data_files import is_file, solid_names
from studies.measured.solid import MeasuredSolid, read_solid
from studies.measured.verdict import verdict

WITHOUT, CELLS, VOXELS = "without", "finite-cell", "voxel"
"""Models: polynomials over the whole solid, and the discretisations."""
LOWER = 2
"""Difference of degrees by which the polynomials are judged."""


def names_of_solids(text: str) -> tuple[str, ...]:
    """Names of solids, or paths of data files of others, joined by commas."""
    names, known = tuple(dict.fromkeys(text.split(","))), solid_names()
    unknown = [name for name in names if name not in known and not is_file(name)]
    if unknown:
        raise ArgumentTypeError(
            f"{unknown[0]!r} is unknown, expected some of {', '.join(known)}, joined by "
            "commas, or data files (.yaml)"
        )
    return names


@parameters
class MeasuredOptions:
    """What is measured."""

    solids: tuple[str, ...] = option(
        (),
        "solids of the study or data files of others, joined by commas (default: all of the study)",
        read=names_of_solids,
        metavar="NAMES",
    )
    finer: Annotated[float, between(0.1, 10.0)] = option(
        1.0, "multiple of the resolutions that the data files ask for"
    )
    refine_to: Annotated[float, between(1e-4, 1.0)] = option(
        0.002, "expected error down to which finite cells are divided"
    )


def measure_solids(options: MeasuredOptions) -> dict[str, Any]:
    """Measure solids.

    Returns plain values: `solids`, see `measured`, and the options.
    """
    names = options.solids or tuple(solid_names())
    # What is wrong with a file is told before anything is computed.
    solids = {Path(name).stem: read_solid(name) for name in names}
    return {
        "finer": options.finer,
        "refine_to": options.refine_to,
        "solids": [measured(*each, options) for each in track(list(solids.items()), "solids")],
    }


def measured(name: str, solid: MeasuredSolid, options: MeasuredOptions) -> dict[str, Any]:
    """A solid and its `models`, as plain values; without models of a mesh if it is left out."""
    models = []
    if solid.degrees is not None:
        models.append(_without_a_mesh(solid))
    if solid.is_run:
        with tempfile.TemporaryDirectory() as folder:
            models += [_meshed(solid, kind, options, Path(folder)) for kind in (CELLS, VOXELS)]
    return {
        "solid": name,
        "title": solid.title,
        "kind": solid.kind,
        "fitted": solid.material.fitted,
        "constants": solid.material.constants,
        "uncertainty": solid.frequencies.uncertainty,
        "why": solid.frequencies.why,
        "reference": solid.source.reference,
        "read_in": solid.source.read_in,
        "conditions": solid.conditions,
        "supports": solid.supports,
        "left_out": solid.left_out,
        "hertz": _plain(solid.hertz),
        "others": {by: _plain(solid.others_hertz(by)) for by in solid.frequencies.others},
        "models": models,
    }


def _without_a_mesh(solid: MeasuredSolid) -> dict[str, Any]:
    found, fewer = solid.without_a_mesh(), solid.without_a_mesh(LOWER)
    # What lower degrees change is more than what higher ones would.
    expected = np.abs(fewer / found - 1.0)
    sizes = {"degrees": solid.degrees}
    return {"model": WITHOUT, **sizes, **rated(solid, found, _rms(expected), expected)}


def _meshed(
    solid: MeasuredSolid, kind: str, options: MeasuredOptions, folder: Path
) -> dict[str, Any]:
    resolution = max(2, round(options.finer * solid.resolution))
    start = {"model": kind, "resolution": resolution}
    count = len(solid.hertz)
    # In units of the longest side, as a mesh file without one.
    surface = solid.geometry.surface()
    unit = float(surface.extents.max())
    mesh_file, regions = folder / "solid.stl", folder / "regions.yaml"
    surface.apply_scale(1.0 / unit).export(mesh_file)
    regions.write_text(yaml.safe_dump(solid.composition))
    described = ProblemOptions(
        str(mesh_file), resolution, discretisation=kind, unit=unit, regions=str(regions)
    )
    refine_to = options.refine_to if kind == CELLS else None
    try:
        solved = solved_solid(described, RIGID_MODES + count, refine_to)
    except (UserError, ConvergenceError) as error:
        return {**start, "problem": str(error)}
    assert solved.model is not None
    found = elastic_hertz(solved, count)
    errors = expected_errors(solved) if kind == CELLS else None
    mesh = solved.achieved.get(f"{FROM_SOLID}_rms")
    start["unknowns"] = solved.model.n_dofs
    solved.modes.destroy()
    if errors is not None:
        mesh = _rms(errors[:count])
    return {**start, **rated(solid, found, mesh, errors)}


def rated(
    solid: MeasuredSolid, found: Array, mesh: float | None, expected: Array | None
) -> dict[str, Any]:
    """Frequencies (n,) [Hz] of a model, their errors, and the verdict.

    `mesh` is the rms error that is expected of the model, and `expected` (k,) that of each of the
    first frequencies; None where nothing is expected.
    """
    errors = found / solid.hertz - 1.0
    worst = int(np.nanargmax(np.abs(errors)))
    rms = _rms(errors)
    return {
        "hertz": found.tolist(),
        "rms": rms,
        "mean": float(np.nanmean(errors)),
        "worst": float(errors[worst]),
        "worst_number": worst + 1,
        "compared": int(np.isfinite(errors).sum()),
        "mesh": mesh,
        "expected": None if expected is None else expected[: len(found)].tolist(),
        "verdict": None if mesh is None else verdict(rms, mesh, solid.frequencies.uncertainty),
    }


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.nanmean(errors**2)))


def _plain(values: Array) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]


LABELS = {WITHOUT: "No mesh", CELLS: "Finite cells", VOXELS: "Voxels"}


def as_text(result: dict[str, Any]) -> str:
    """The result in columns."""
    lines = [
        f"{'':<44}{'unknowns':>9}{'rms':>8}{'mean':>9}{'worst':>9}{'mesh':>8}{'data':>8}",
    ]
    for solid in result["solids"]:
        if not solid["models"]:
            lines.append(f"{solid['title']:<44}  {solid['left_out']}")
        lines += [_line(solid, model) for model in solid["models"]]
    return "\n".join(lines)


def _line(solid: dict[str, Any], model: dict[str, Any]) -> str:
    start = f"{solid['title'][:30]:<31}{LABELS[model['model']]:<13}"
    if "problem" in model:
        return f"{start}  {model['problem']}"
    unknowns = f"{model['unknowns']:9,}" if "unknowns" in model else f"{'':9}"
    mesh = f"{model['mesh']:8.2%}" if model["mesh"] is not None else f"{'-':>8}"
    return (
        f"{start}{unknowns}{model['rms']:8.2%}{model['mean']:+9.2%}{model['worst']:+9.2%}{mesh}"
        f"{solid['uncertainty']:8.2%}  {model['verdict'] or ''}"
    )
