"""Display of modes in a notebook: frequencies, residuals, the solid as it moves."""

from typing import Any

import numpy as np

from carillon.notebook.card import Markup, card, hertz, table
from carillon.notebook.chart import Axis, range_of, stems
from carillon.notebook.solid import solid
from carillon.notebook.voxels import voxel_triangles
from solver.files.modes_file import ModesFile
from solver.refinement.errors import FROM_FINE, FROM_SOLID, in_words
from solver.response.points import voxel_motion

MOST_MOVING = 6
"""Modes that the solid is shown in."""
MOST_ROWS = 8
"""Modes that the table lists."""
LEAST_RESIDUAL = 1e-16
"""Residual that smaller ones are drawn as."""


def modes_html(file: ModesFile) -> str:
    """A card of modes: what was achieved, elastic frequencies with their residuals, shapes."""
    rigid, count = file.model.rigid_modes, len(file.frequencies)
    head = f"{count - rigid} elastic modes" if count > rigid else f"{count} rigid modes"
    return card(head, _achieved(file), _moving(file), _residuals(file), _table(file))


def _achieved(file: ModesFile) -> list[str]:
    told = file.attributes
    facts = [f"{file.model.n_dofs:,} unknowns"]
    if len(file.frequencies) > file.model.rigid_modes:
        low, high = file.frequencies[file.model.rigid_modes], file.frequencies[-1]
        facts.append(f"{hertz(low)} to {hertz(high)} Hz")
    facts.append(f"residuals up to {file.residuals.max():.1e}")
    if "eigenvalue_error_estimate" in told:
        facts.append(f"eigenvalues to about {told['eigenvalue_error_estimate']:.0e}")
    if "inertia_count" in told:
        facts.append(_counted(told))
    if "method" in told:
        timings = told.get("timings")
        seconds = sum(timings.values()) if isinstance(timings, dict) else 0.0
        facts.append(
            f"by {told['method']}" + (f" in {seconds:.3g}\N{NO-BREAK SPACE}s" if seconds else "")
        )
    for prefix, what in ((FROM_FINE, "the fine solid's"), (FROM_SOLID, "the solid's")):
        if f"{prefix}_rms" in told:
            facts.append(f"expected distance from {what} {in_words(told, prefix)}")
    return facts


def _counted(told: dict[str, Any]) -> str:
    counted, expected = told["inertia_count"], told.get("inertia_expected")
    if counted == expected:
        return "no mode is missing, by inertia"
    return f"{counted} modes counted by inertia, {expected} found"


def _moving(file: ModesFile) -> Markup | None:
    rigid = file.model.rigid_modes
    if file.modes is None or not file.modes.shape[1]:
        return None
    # Of a solid of which rigid modes alone are known, these.
    first = rigid if len(file.frequencies) > rigid else 0
    chosen = range(first, min(first + MOST_MOVING, len(file.frequencies)))
    moved = voxel_motion(file.model, file.modes[:, list(chosen)])
    motions = [column.reshape(-1, 3) for column in moved.T]
    shown = voxel_triangles(file.mesh, motions=motions, up="z" if file.up else None)
    names = [f"mode {number + 1}" for number in chosen]
    return solid(shown, "The solid in its modes", names, "light where it moves most")


def _residuals(file: ModesFile) -> Markup | None:
    rigid = file.model.rigid_modes
    frequencies, ratios = file.frequencies[rigid:], file.residuals[rigid:]
    if len(frequencies) < 2:
        return None
    heights = np.maximum(ratios, LEAST_RESIDUAL)
    low, high = range_of(heights)
    x = Axis("frequency [Hz]", 0.0, float(frequencies[-1]))
    y = Axis(
        "residual", 10.0 ** np.floor(np.log10(low)), 10.0 ** np.ceil(np.log10(2.0 * high)), True
    )
    return stems(x, y, frequencies, heights)


def _table(file: ModesFile) -> Markup | None:
    rigid, count = file.model.rigid_modes, len(file.frequencies)
    chosen = range(rigid, min(count, rigid + MOST_ROWS))
    if not chosen:
        return None
    rows = [(f"{n + 1}", f"{file.frequencies[n]:,.2f}", f"{file.residuals[n]:.1e}") for n in chosen]
    more = count - chosen.stop
    return table(("mode", "Hz", "residual"), rows, f"and {more} more" if more else "")
