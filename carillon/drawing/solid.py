"""Pictures of hexahedral meshes and their motion, for reports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from carillon.fem.geometry.faces import boundary_faces, corner_values
from carillon.fem.geometry.hexmesh import HexMesh
from carillon.fem.geometry.turning import upright_rotation

if TYPE_CHECKING:
    import scipy.sparse as sp
    from mpl_toolkits.mplot3d import Axes3D
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

PLAIN = (0.90, 0.80, 0.64)
"""Colour of a body that shows no values."""
VIEW = (22.0, -58.0)
"""Elevation and azimuth of the eye [degrees]."""
DRAWN_AMPLITUDE, ARROW_LENGTH = 0.08, 0.22
"""Shares of the object's diagonal: the largest displacement that is drawn, and an arrow."""
SMOOTHING_RINGS = 4
"""Rings of neighbours over which normals are averaged to show the shape behind the voxels."""


@dataclass(frozen=True, eq=False)
class Skin:
    """Triangles that are drawn in the place of a mesh's own faces."""

    vertices: np.ndarray
    """(v, 3) positions [m]."""
    faces: np.ndarray
    """(f, 3) triangles, wound either way."""
    weights: sp.csr_matrix | None = None
    """(v, n) interpolation from the nodes of the solid; None if nothing moves."""
    cells: np.ndarray | None = None
    """(f,) the cell that each triangle belongs to; None if cells have no values."""

    def seen(self, nodal: np.ndarray) -> np.ndarray:
        """Values (v, k) at the vertices, from those (n, k) of the nodes."""
        assert self.weights is not None
        return np.asarray(self.weights @ nodal)


def draw(
    ax: Axes3D,
    mesh: HexMesh,
    displacement: np.ndarray | None = None,
    values: np.ndarray | None = None,
    scale: float | str = "auto",
    up: str | None = None,
    view: tuple[float, float] = VIEW,
    cmap: str = "viridis",
    limits: tuple[float, float] | None = None,
    skin: Skin | None = None,
) -> Poly3DCollection:
    """Draw the surface of a mesh, deformed if asked for, lit from the upper left.

    Returns the polygons, with the values as their array, so that ``figure.colorbar`` accepts them.

    Raises ValueError if an array's shape does not fit.

    Parameters
    ----------
    ax
        Axes made with ``projection="3d"``.
    mesh
        Fine or coarse mesh.
    displacement : (n, 3) or (3 n,)
        Displacement of the nodes of the mesh, or of those that a skin moves with, any unit.
    values : (n,) or (m,)
        Per node or per cell, shown in colour; without them a deformed body is coloured by the
        length of its displacement and a body at rest is plain.
    scale
        Factor of the displacement, or ``"auto"``: the largest is drawn as `DRAWN_AMPLITUDE` of the
        object's diagonal.
    up
        Axis that points upwards, see `UpAxis`; None asks `guess_up`.
    view
        Elevation and azimuth of the eye [degrees].
    cmap
        Name of a matplotlib colour map.
    limits
        Values at both ends of the colour map; their range by default.
    skin
        What is drawn instead of the faces of the cells, in the same place, size and light.

    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    turn = upright_rotation(up or guess_up(mesh))
    if displacement is not None:
        displacement = np.asarray(displacement, dtype=float).reshape(-1, 3)
        nodes = mesh.n_nodes
        if skin is not None and skin.weights is not None:
            nodes = skin.weights.shape[1]
        if len(displacement) != nodes:
            raise ValueError(f"{len(displacement)} displacements for {nodes} nodes")
        if skin is not None:
            displacement = skin.seen(displacement)
        if values is None:
            values = np.linalg.norm(displacement, axis=1)
    motion = _drawn_motion(mesh, displacement, scale)
    quads, cell = boundary_faces(mesh)
    points = (mesh.nodes + (motion if skin is None else 0.0)) @ turn.T
    if skin is None:
        corners = corner_values(mesh, points, quads, cell)
        light = _light(corners, quads, view)
    else:
        corners = ((skin.vertices + motion) @ turn.T)[skin.faces]
        light = _light_of_triangles(corners, view)

    if values is None:
        colours = np.tile(PLAIN, (len(corners), 1))
    else:
        of_faces = (quads, cell) if skin is None else (skin.faces, skin.cells)
        face_values = _face_values(mesh, values, *of_faces, skin)
        low, high = limits or (float(face_values.min()), float(face_values.max()))
        mapping = ScalarMappable(Normalize(low, high if high > low else low + 1.0), cmap)
        colours = mapping.to_rgba(face_values)[:, :3]
    colours = np.clip(colours * light[:, None], 0, 1)

    # Edges show voxels; those of triangles show nothing, but would leave gaps.
    edges = colours * 0.86 if skin is None else colours
    polygons = Poly3DCollection(corners, facecolors=colours, edgecolors=edges)
    polygons.set_linewidth(0.25)
    if values is not None:
        # Kept for a colour bar; the lit colours above stay as they are.
        polygons.set_norm(mapping.norm)
        polygons.set_cmap(cmap)
        polygons.set_array(face_values)
        polygons._face_is_mapped = polygons._edge_is_mapped = False
        polygons.update_scalarmappable = lambda: None
    ax.add_collection3d(polygons)
    # Nodes of cut cells lie outside the solid, and may move as nothing that is seen does.
    still = skin is None or displacement is None
    _frame(ax, points[np.unique(quads)] if still else corners.reshape(-1, 3), view)
    return polygons


def mark(
    ax: Axes3D,
    mesh: HexMesh,
    point: np.ndarray,
    colour: str,
    inward: np.ndarray | None = None,
    up: str | None = None,
) -> None:
    """Mark a point (3,) [m] of a drawn mesh: by an arrow that pushes `inward`, else by a ring."""
    from matplotlib.lines import Line2D
    from mpl_toolkits.mplot3d import proj3d

    turn = upright_rotation(up or guess_up(mesh))
    tip = proj3d.proj_transform(*(turn @ point), ax.get_proj())[:2]
    if inward is None:
        line = Line2D([tip[0]], [tip[1]], color=colour, marker="o", fillstyle="none", zorder=10)
        line.set(markersize=13, markeredgewidth=2.4, clip_on=False)
        ax.add_line(line)
        return
    length = ARROW_LENGTH * np.linalg.norm(np.ptp(mesh.nodes, axis=0))
    end = proj3d.proj_transform(*(turn @ (point - length * inward)), ax.get_proj())[:2]
    style = {"color": colour, "arrowstyle": "-|>", "linewidth": 3.0, "mutation_scale": 18}
    ax.annotate("", tip, end, annotation_clip=False, arrowprops=style, zorder=10)


def view_of(mesh: HexMesh, outward: np.ndarray, up: str | None = None) -> tuple[float, float]:
    """Elevation and azimuth [degrees] from where the sides that look `outward` (d, 3) are seen."""
    azimuths = VIEW[1] + np.arange(0.0, 360.0, 15.0)
    seen = [looks_at(mesh, outward, (VIEW[0], azimuth), up).min() for azimuth in azimuths]
    return VIEW[0], float(azimuths[int(np.argmax(seen))])


def looks_at(
    mesh: HexMesh, outward: np.ndarray, view: tuple[float, float], up: str | None = None
) -> np.ndarray:
    """Cosines (d,) between directions `outward` (d, 3) and the one that the eye is in."""
    turned = outward @ upright_rotation(up or guess_up(mesh)).T
    return np.asarray(turned @ _direction(*np.radians(view)))


def guess_up(mesh: HexMesh) -> str:
    """Axis on which the object stands firmly: ``"y"`` or ``"z"``, the two customs of mesh files.

    Firm is a low centre of mass over a wide footprint of the lowest cells; ``"z"`` if in doubt.
    """
    firmness = {axis: _firmness(mesh, "xyz".index(axis)) for axis in "yz"}
    return "y" if firmness["y"] > 1.05 * firmness["z"] else "z"


def _firmness(mesh: HexMesh, axis: int) -> float:
    height = mesh.grid[:, axis] - mesh.grid[:, axis].min() + 0.5
    foot = np.delete(mesh.grid[height < 2], axis, axis=1)
    centre = np.delete(mesh.grid.mean(axis=0), axis)
    reach = np.minimum(foot.max(axis=0) - centre, centre - foot.min(axis=0)).min() + 0.5
    return float(reach / height.mean())


def _drawn_motion(
    mesh: HexMesh, displacement: np.ndarray | None, scale: float | str
) -> np.ndarray | float:
    if displacement is None:
        return 0.0
    if scale != "auto":
        return float(scale) * displacement
    largest = np.linalg.norm(displacement, axis=1).max()
    diagonal = np.linalg.norm(np.ptp(mesh.nodes, axis=0))
    return displacement * (DRAWN_AMPLITUDE * diagonal / largest if largest > 0 else 0.0)


def _face_values(
    mesh: HexMesh,
    values: np.ndarray,
    faces: np.ndarray,
    cells: np.ndarray | None,
    skin: Skin | None,
) -> np.ndarray:
    values = np.asarray(values, dtype=float)
    if values.shape == (mesh.n_nodes if skin is None else len(skin.vertices),):
        return np.asarray(values[faces].mean(axis=1))
    if values.shape == (mesh.n_cells,) and cells is not None:
        return np.asarray(values[cells])
    raise ValueError(
        f"values have shape {values.shape}, expected ({mesh.n_nodes},) per node, or vertex, or "
        f"({mesh.n_cells},) per cell"
    )


def _light_of_triangles(corners: np.ndarray, view: tuple[float, float]) -> np.ndarray:
    """Brightness of triangles (f, 3, 3), whichever side of them is seen."""
    normal = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    away = normal @ _direction(*np.radians(view)) < 0.0
    return _brightness(np.where(away[:, None], -normal, normal), view)


def _light(corners: np.ndarray, quads: np.ndarray, view: tuple[float, float]) -> np.ndarray:
    """Brightness of each face (q,): ambient, key and fill light.

    The face's own normal shows the voxels; the normal averaged over `SMOOTHING_RINGS` rings of
    neighbours shows the shape that they approximate. Their sum shows both.
    """
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal = _unit(normal)
    smooth = normal
    for _ in range(SMOOTHING_RINGS):
        at_nodes = np.zeros((quads.max() + 1, 3))
        np.add.at(at_nodes, quads, smooth[:, None, :])
        smooth = _unit(_unit(at_nodes)[quads].mean(axis=1))
    return _brightness(_unit(normal + 1.2 * smooth), view)


def _brightness(normal: np.ndarray, view: tuple[float, float]) -> np.ndarray:
    azimuth = np.radians(view[1])
    key = _direction(np.radians(48.0), azimuth - np.radians(40.0))
    fill = _direction(np.radians(15.0), azimuth + np.radians(50.0))
    return 0.45 + 0.57 * np.clip(normal @ key, 0, 1) + 0.13 * np.clip(normal @ fill, 0, 1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


def _direction(elevation: float, azimuth: float) -> np.ndarray:
    across = np.cos(elevation)
    return np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)])


def _frame(ax: Axes3D, points: np.ndarray, view: tuple[float, float]) -> None:
    low, high = points.min(axis=0), points.max(axis=0)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    elevation, azimuth = np.radians(view)
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    upwards = _direction(elevation + np.pi / 2, azimuth)
    seen = (points - (low + high) / 2) @ np.stack([right, upwards], axis=1)
    # matplotlib scales the box by its diagonal; fill the frame with what is seen of it instead.
    zoom = 0.42 * np.linalg.norm(high - low) / max(np.abs(seen).max(), 1e-300)
    ax.set_box_aspect(np.maximum(high - low, 1e-12), zoom=zoom)
    ax.set_proj_type("persp", focal_length=1.6)
    ax.view_init(elev=view[0], azim=view[1])
    ax.set_axis_off()
