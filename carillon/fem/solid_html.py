"""Display of a solid in a notebook, coloured by its moduli."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carillon.notebook.card import card

if TYPE_CHECKING:
    from carillon.fem.model import Solid

ALIKE = 1e-6
"""Relative range up to which moduli are told as one."""


def solid_html(solid: Solid) -> str:
    """A card of a solid: its size and mass, and its cells in the colours of their moduli."""
    from carillon.notebook.solid import solid as viewer
    from carillon.notebook.voxels import voxel_triangles

    young = solid.young.reshape(solid.mesh.n_cells, -1).mean(axis=1)
    low, high = 1e-9 * float(young.min()), 1e-9 * float(young.max())
    is_one = high - low <= ALIKE * high
    facts = [
        f"{len(solid.connectivity):,} elements",
        f"{solid.n_dofs:,} unknowns",
        f"{solid.mass:.4g} kg",
        f"Young's modulus {high:.3g} GPa" if is_one else f"moduli {low:.3g} to {high:.3g} GPa",
        "free" if solid.supports is None else "held",
    ]
    shown = voxel_triangles(solid.mesh, None if is_one else young)
    caption = "" if is_one else "stiff parts are light"
    return card("Solid", facts, viewer(shown, "The solid", caption=caption))
