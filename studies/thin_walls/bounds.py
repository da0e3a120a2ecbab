"""Frequencies of finite cells are bounds from above: lowest ratios to references over lattices."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge

from carillon.arrays import Array, Surface
from carillon.command_line.progress import track
from carillon.errors import ConvergenceError, UserError
from carillon.fem.finite_cells.build import covering
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry.grid import Grid
from carillon.fem.model import RIGID_MODES
from carillon.fem.regions import Regions
from carillon.parameters import option, parameters
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from studies.accuracy.solids import DENSITY, POISSON, YOUNG
from studies.thin_walls.references import COUNT, read_references
from studies.thin_walls.solids import STRAIGHT, TURNED, WalledSolid

STEPS = 4
"""Spacings that shifted lattices have more along each axis, and are shifted by at most."""
SHIFTS = (0.0, 1.0 / 3.0, 2.0 / 3.0)
"""Shifts of the lattice along all axes, in `STEPS` of its spacings."""
ALLOWED = 0.001
"""Share by which a frequency may be below the reference, besides its doubt."""
SIZES = (0.5, 0.7, 0.85, 1.0)
"""Resolutions relative to the largest."""


@parameters
class BoundOptions:
    """What is measured."""

    resolution: Annotated[int, Ge(8)] = option(
        32, f"the finest lattice; the others have {', '.join(map(str, SIZES[:-1]))} of it"
    )
    turned: bool = option(False, "solids turned against the lattice")


def measure_bounds(solids: Mapping[str, WalledSolid], options: BoundOptions) -> dict[str, Any]:
    """Lowest ratios of frequencies of undivided cells to the references, over lattices.

    Returns plain values: `lattices`, an entry each with its `lowest` ratio and the `mode` that has
    it, or the `problem`; the `doubts` of the references, and what is `allowed` besides.
    """
    references = {name: each for name, each in read_references().items() if name in solids}
    position = TURNED if options.turned else STRAIGHT
    sizes = [round(size * options.resolution) for size in SIZES]
    lattices = [
        {"solid": name, **found}
        for name, reference in track(list(references.items()), "solids")
        for found in _over_lattices(solids[name].surface(position), name, sizes, reference.hertz)
    ]
    return {
        "elastic_modes": COUNT,
        "position": position,
        "allowed": ALLOWED,
        "doubts": {name: each.doubt for name, each in references.items()},
        "titles": {name: solids[name].title for name in references},
        "lattices": lattices,
    }


def _over_lattices(
    surface: Surface, name: str, resolutions: list[int], exact: Array
) -> Iterator[dict[str, Any]]:
    for resolution in resolutions:
        for shift in SHIFTS:
            lattice = {"resolution": resolution, "shift": shift}
            try:
                yield {**lattice, **lowest_ratio(surface, name, resolution, shift, exact)}
            except (UserError, ConvergenceError) as error:
                yield {**lattice, "problem": str(error)}


def lowest_ratio(
    surface: Surface, name: str, resolution: int, shift: float, exact: Array
) -> dict[str, Any]:
    """Unknowns, and the lowest ratio of a frequency to the exact one (k,) [Hz] with its mode.

    Raises UserError if the lattice is no use to the solid.
    """
    cover = covering(surface, resolution, name=name)
    if shift:
        cover = covering(surface, resolution, name=name, grid=shifted(cover.grid, shift))
    young = np.full(cover.cells.mesh.n_cells, YOUNG)
    model = finite_cell_model(cover.cells, young, Regions.one(POISSON, DENSITY))
    modes = modal_analysis(model, SolverOptions(modes=RIGID_MODES + len(exact)), MPI.COMM_SELF)
    elastic = modes.values[modes.rigid :]
    modes.destroy()
    ratios = np.sqrt(np.maximum(elastic, 0.0)) / (2.0 * np.pi) / exact[: len(elastic)]
    mode = RIGID_MODES + 1 + int(ratios.argmin())
    return {"unknowns": model.n_dofs, "lowest": float(ratios.min()), "mode": mode}


def shifted(grid: Grid, shift: float) -> Grid:
    """The lattice with `STEPS` spacings more along each axis, shifted down by a share of them.

    Examples
    --------
    >>> grid = shifted(Grid(np.zeros(3), 0.1, (4, 4, 8)), 0.5)
    >>> grid.origin.round(9).tolist(), grid.shape
    ([-0.2, -0.2, -0.2], (8, 8, 12))
    """
    nx, ny, nz = (size + STEPS for size in grid.shape)
    return Grid(grid.origin - shift * STEPS * grid.edge, grid.edge, (nx, ny, nz))


def is_too_low(lattice: Mapping[str, Any], doubts: Mapping[str, float]) -> bool:
    """Whether a frequency is further below the reference than its doubt and `ALLOWED` explain."""
    return "lowest" in lattice and lattice["lowest"] < 1.0 - ALLOWED - doubts[lattice["solid"]]


def as_text(result: dict[str, Any]) -> str:
    """The result in columns."""
    lines = [
        f"{'':<24}{'doubt':>9}{'lattices':>9}{'lowest ratio':>14}{'mode':>6}{'at':>5}{'shift':>7}"
    ]
    for name, title in result["titles"].items():
        lattices = [each for each in result["lattices"] if each["solid"] == name]
        rated = [each for each in lattices if "lowest" in each]
        start = f"{title:<24}{result['doubts'][name]:9.1e}{len(rated):>6}/{len(lattices)}"
        if not rated:
            lines.append(f"{start}  {lattices[0]['problem']}")
            continue
        low = min(rated, key=lambda each: each["lowest"])
        mark = "  too low" if is_too_low(low, result["doubts"]) else ""
        lines.append(
            f"{start}{low['lowest']:14.5f}{low['mode']:6}{low['resolution']:5}{low['shift']:7.2f}"
            f"{mark}"
        )
    return "\n".join(lines)
