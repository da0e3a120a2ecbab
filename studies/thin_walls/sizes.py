"""Errors over size: finite cells, divided and whole, and quadratic tetrahedra of one solid."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from carillon.fem.model import RIGID_MODES
from solver.verification.matching import frequency_errors
from studies.thin_walls.cells import MODES, tried_cells
from studies.thin_walls.references import COUNT, StoredReference
from studies.thin_walls.solids import TURNED, WalledSolid
from studies.thin_walls.tetrahedra import quadratic_tetrahedra

CELLS, WHOLE, TETRAHEDRA = "finite-cell", "whole cells", "quadratic tetrahedra"
"""Discretisations: cells divided as by default, cells none of which is, and the rival."""
FINER = (0.625, 0.875, 1.25, 1.75)
"""Resolutions relative to that of the table of all solids."""
UNKNOWNS = (8_000, 16_000, 32_000, 60_000)
"""Aims of the unknowns of tetrahedra."""
LEVELS = len(FINER)
UNKNOWNS_OF_EDGE = 21.0
"""Unknowns of quadratic tetrahedra in a thin wall, times squared edge over area of the surface."""


def over_size(
    solid: WalledSolid, reference: StoredReference, resolution: int, levels: int, tetrahedra: bool
) -> Iterator[dict[str, Any]]:
    """So many sizes of each discretisation of the turned solid, coarsest first.

    They are plain values with `discretisation`, `spacing` [m] between neighbouring nodes,
    `unknowns`, `seconds` and errors, or the `problem`.
    """
    longest = float(solid.surface().extents.max())
    for kind, refine_to in ((CELLS, None), (WHOLE, 0.0)):
        for factor in FINER[:levels]:
            finer = round(factor * resolution)
            found = tried_cells(solid, TURNED, reference, finer, refine_to=refine_to)
            yield {"discretisation": kind, "spacing": longest / finer, **found}
    for unknowns in UNKNOWNS[:levels] if tetrahedra else ():
        yield {"discretisation": TETRAHEDRA, **tried_tetrahedra(solid, reference, unknowns)}


def tried_tetrahedra(
    solid: WalledSolid, reference: StoredReference, unknowns: int
) -> dict[str, Any]:
    """Tetrahedra of about so many unknowns, or the `problem` with them."""
    edge = float(np.sqrt(UNKNOWNS_OF_EDGE * solid.surface().area / unknowns))
    try:
        found = quadratic_tetrahedra(solid.parts(), edge, COUNT)
    except Exception as error:  # Gmsh's own.
        return {"spacing": 0.5 * edge, "problem": f"Gmsh: {error}"}
    hertz = np.sqrt(np.maximum(found.values[RIGID_MODES:], 0.0)) / (2.0 * np.pi)
    errors = frequency_errors(hertz / reference.hertz - 1.0, MODES)
    return {
        "spacing": found.spacing,
        "unknowns": found.unknowns,
        "seconds": found.build_seconds + found.solve_seconds,
        "rms": errors.rms,
        "worst": errors.worst,
        "worst_mode": errors.worst_mode,
    }
