"""Finite cells are drawn as what they are: the surface itself, which moves with them."""

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from carillon.drawing.solid import Skin
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.model import Solid
from solver.response.points import interpolation

LONGEST = 2.0
"""Spacings that an edge of a drawn triangle may measure."""
HALVINGS = 20
"""Times that an edge may be cut for it."""


def skin_of(model: Solid, surface: trimesh.Trimesh) -> Skin | None:
    """The surface [m] of a solid of finite cells; None of voxels, which are drawn themselves."""
    if not isinstance(model, FiniteCellModel):
        return None
    mesh = model.mesh
    vertices, faces = trimesh.remesh.subdivide_to_size(
        surface.vertices, surface.faces, LONGEST * mesh.edge, max_iter=HALVINGS
    )
    voxels = cKDTree(mesh.origin + mesh.edge * (mesh.grid + 0.5))
    distance, cells = voxels.query(np.asarray(vertices)[faces].mean(axis=1))
    # Loose pieces that are no part of the solid are not drawn.
    kept = distance <= LONGEST * mesh.edge
    weights = interpolation(model, vertices)
    return Skin(np.asarray(vertices), np.asarray(faces)[kept], weights, cells[kept])
