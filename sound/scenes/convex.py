"""Convex parts that together fill a solid: what engines of rigid bodies collide.

CoACD (Wei et al. 2022, Approximate convex decomposition for 3D meshes with collision-aware
concavity and tree search) cuts closed surfaces.  It runs in a process of its own: it prints, it
cannot be interrupted, and of what it does not expect it dies.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import metadata
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carillon.children import run_child
from carillon.errors import UserError
from carillon.files import create_h5, open_h5
from carillon.limits import require_within

if TYPE_CHECKING:  # Its import takes long, and a scene may have no solid of a mesh.
    import trimesh

Array = NDArray[np.float64]
Faces = NDArray[np.integer]

MOST_VERTICES = 64
"""Of a hull; engines slow down with them."""
HOLLOW = 0.02
"""Share of its hull that a solid may leave empty and still be taken for convex."""
CELLS = 40
"""Of the grid, along the longest side, in which what is not closed is made into a solid."""
MOST_FACES = (800, 1600)
"""Of a surface that is cut; finer ones are made coarser before, as coarse as goes well."""
JITTER = 1e-4
"""By which vertices are displaced at random for that, over the longest side.

In a plane triangles fold over each other, as nothing speaks against it, unless vertices are off it.
"""
EDGES_AT_ONCE = 256
"""Of which it is tried whether they go through triangles."""
SEARCH = {
    "resolution": 500,
    "mcts_nodes": 10,
    "mcts_iterations": 60,
    "mcts_max_depth": 2,
}
"""How hard CoACD searches for cuts; its defaults take thrice as long for a few parts fewer."""
REQUIREMENTS = "workflow/envs/requirements-scenes.txt"
CONCAVITIES = (0.01, 1.0)
"""Bounds of how far hulls may reach; with less CoACD hardly comes to an end."""
_KIND, _SCHEMA = "convex parts", 1  # counted up, too, when other parts are found than before
_DIRECTIONS = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if way > (0, 0, 0)])
"""Of edges, diagonals of faces, and diagonals of a cube, one way each."""


class Cuttable(NamedTuple):
    """A closed surface, and whether CoACD shall see to it that it crosses itself nowhere.

    Attributes
    ----------
    surface
        Of a solid.
    preprocessing
        "off", or "auto": CoACD then takes for crossing, too, what merely is narrow, and makes a
        surface of its own of that, which is thicker and takes far longer to cut.
    """

    surface: trimesh.Trimesh
    preprocessing: str


def convex_parts(
    vertices: Array, faces: Faces, concavity: float = 0.05, seed: int = 0
) -> list[Array]:
    """Convex hulls that together fill a solid.

    Closed parts of the surface that are not connected are cut one by one.  If one is not closed,
    the solid is what is inside by winding numbers, on a grid of `CELLS` along the longest side.
    What was cut once is in the user's cache.

    Parameters
    ----------
    vertices : (V, 3) [m]
        Of the surface.
    faces : (F, 3)
        Vertices of triangles.
    concavity : float [1]
        About how far hulls may reach beyond the solid, over half its longest side.
    seed : int
        Of CoACD's search.

    Returns
    -------
    hulls : list of (n, 3) [m]
        Vertices of each, `MOST_VERTICES` at most; one hull for a solid that is convex.

    Raises
    ------
    UserError
        If the surface encloses nothing, `concavity` is out of bounds, CoACD is not installed, or
        it fails.
    """
    import trimesh

    require_within(f"concavity {concavity:g}", concavity, CONCAVITIES)
    surface = trimesh.Trimesh(vertices, faces)
    solids = _components(surface)
    if solids and all(map(_is_convex, solids)):
        return [hull_of(solid.vertices) for solid in solids]
    path = _cache() / f"{_key(vertices, faces, concavity, seed)}.h5"
    with suppress(UserError, OSError):
        return _read(path)
    parts = _cut(solids or _remeshed(surface), concavity, seed)
    with suppress(UserError, OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        _write(path, parts)
    return parts


def _components(surface: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Closed surfaces of a solid: its pieces, or all at once if it has cavities.

    None if something is open, or inside out.
    """
    pieces = list(surface.split(only_watertight=False))
    if all(map(_is_solid, pieces)):
        return pieces
    return [surface] if _is_solid(surface) else []


def _is_solid(surface: trimesh.Trimesh) -> bool:
    closed = surface.is_watertight and surface.is_winding_consistent
    return bool(closed and _volume(surface) > 0.0)


def _volume(surface: trimesh.Trimesh) -> float:
    """Volume [m^3], negative if the surface is inside out; without warnings if it is flat."""
    return float(np.linalg.det(surface.triangles).sum()) / 6.0


def _is_convex(solid: trimesh.Trimesh) -> bool:
    return bool(_volume(solid) >= (1.0 - HOLLOW) * solid.convex_hull.volume)


def _remeshed(surface: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Closed surfaces about the inside of one that is open, inside out or runs through itself.

    Raises
    ------
    UserError
        If nothing is inside.
    """
    solids = _components(_boundary(surface)) if surface.area > 0.0 else []
    if not solids:
        raise UserError(
            f"the surface encloses nothing that {CELLS} cells along its longest side would show; "
            "close it, or make its walls thicker"
        )
    return solids


def _boundary(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """The closed surface between points of a grid that are inside and those that are outside."""
    import igl
    import trimesh

    low, high = surface.bounds
    edge = float(np.max(high - low)) / CELLS
    counts = np.ceil((high - low) / edge).astype(int) + 3
    z, y, x = np.meshgrid(*(np.arange(n) for n in counts[::-1]), indexing="ij")
    points = low + edge * (np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1) - 1.0)
    distances = _distances(surface, points)
    return trimesh.Trimesh(*igl.marching_cubes(distances, points, *map(int, counts), 0.0)[:2])


def _distances(surface: trimesh.Trimesh, points: Array) -> Array:
    """Distances (p,) of points (p, 3) from a surface, negative within it."""
    import igl

    turned = surface.faces[:, ::-1] if _volume(surface) < 0.0 else surface.faces
    vertices = np.ascontiguousarray(surface.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(turned, dtype=np.int64)
    sign = igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    return np.asarray(igl.signed_distance(points, vertices, faces, sign)[0])


def _coarser(solid: trimesh.Trimesh) -> Cuttable:
    """A solid of few faces that crosses itself nowhere, or else the solid as it is."""
    for faces in MOST_FACES:
        if len(solid.faces) <= faces:
            break
        fewer = _decimated(solid, faces)
        if _is_solid(fewer) and not _crosses_itself(fewer):
            return Cuttable(fewer, "off")
    return Cuttable(solid, "auto")


def _decimated(solid: trimesh.Trimesh, faces: int) -> trimesh.Trimesh:
    """By collapsing edges that matter least (Garland and Heckbert 1997)."""
    import igl
    import trimesh

    noise = np.random.default_rng(0).standard_normal(solid.vertices.shape)
    vertices = np.asfortranarray(solid.vertices + JITTER * np.max(solid.extents) * noise)
    given = np.asfortranarray(solid.faces, dtype=np.int32)
    return trimesh.Trimesh(*igl.qslim(vertices, given, faces, block_intersections=True)[:2])


def _crosses_itself(surface: trimesh.Trimesh) -> bool:
    """Whether an edge goes through a triangle that it does not end at."""
    parts = max(1, len(surface.edges_unique) // EDGES_AT_ONCE)
    return any(
        _cross(surface, edges).any() for edges in np.array_split(surface.edges_unique, parts)
    )


def _cross(surface: trimesh.Trimesh, edges: Faces) -> NDArray[np.bool_]:
    """Of edges (e, 2) and triangles on whose two sides their ends are, whether they meet."""
    first, along, across = np.moveaxis(surface.triangles, 1, 0)
    along, across = along - first, across - first
    normals = np.cross(along, across)
    begin, end = (surface.vertices[edges[:, side]] for side in range(2))
    above, below = (at @ normals.T - (first * normals).sum(axis=1) for at in (begin, end))
    touch = (edges[:, None, :, None] == surface.faces[:, None, :]).any(axis=(2, 3))
    edge, face = np.nonzero((above * below < 0.0) & ~touch)
    share = above[edge, face] / (above[edge, face] - below[edge, face])
    meeting = begin[edge] + share[:, None] * (end - begin)[edge] - first[face]
    unit = normals[face] / (normals[face] ** 2).sum(axis=1, keepdims=True)
    u = (np.cross(meeting, across[face]) * unit).sum(axis=1)
    v = (np.cross(along[face], meeting) * unit).sum(axis=1)
    return np.asarray((u > 0.0) & (v > 0.0) & (u + v < 1.0))


def _cut(solids: Sequence[trimesh.Trimesh], concavity: float, seed: int) -> list[Array]:
    """Hulls of convex solids, and of the parts of the others."""
    from scipy.spatial import QhullError

    whole = [solid.vertices for solid in solids if _is_convex(solid)]
    hollow = [_coarser(solid) for solid in solids if not _is_convex(solid)]
    longest = np.ptp(np.concatenate([solid.bounds for solid in solids]), axis=0).max()
    hulls = []
    for part in whole + _searched(hollow, concavity * longest / 2.0, seed):
        with suppress(QhullError):  # a part as flat as rounding errors
            hulls.append(hull_of(part))
    return hulls


def hull_of(points: Array) -> Array:
    """At most `MOST_VERTICES` of the points (p, 3), by which their hull is kept best.

    One by one those are taken that are farthest outside of the hull of those taken before.
    """
    from scipy.spatial import ConvexHull

    corners: Array = np.asarray(points)[ConvexHull(points).vertices]
    if len(corners) <= MOST_VERTICES:
        return corners
    along = corners @ _DIRECTIONS.T
    taken = list(dict.fromkeys([*along.argmin(axis=0), *along.argmax(axis=0)]))
    hull = ConvexHull(corners[taken], incremental=True)
    while len(taken) < MOST_VERTICES:
        heights = corners @ hull.equations[:, :3].T + hull.equations[:, 3]
        taken.append(heights.max(axis=1).argmax())
        hull.add_points(corners[taken[-1:]])
    return corners[taken]


def _searched(solids: Sequence[Cuttable], reach: float, seed: int) -> list[Array]:
    """Points (p, 3) of the parts that CoACD finds; their hulls reach `reach` [m] beyond a solid.

    It has one thread: of several the order of the parts would depend on which one is faster.
    """
    with TemporaryDirectory() as folder:
        task, result = Path(folder, "task.npz"), Path(folder, "result.npz")
        arrays = {f"vertices {n}": solid.surface.vertices for n, solid in enumerate(solids)}
        arrays |= {f"faces {n}": solid.surface.faces for n, solid in enumerate(solids)}
        modes = np.array([solid.preprocessing for solid in solids])
        np.savez(task, reach=reach, seed=seed, modes=modes, **arrays)
        command = [sys.executable, "-m", __name__, str(task), str(result)]
        done = run_child(command, {**os.environ, "OMP_NUM_THREADS": "1"})
        if done.returncode != 0:
            said = done.stderr.strip().splitlines() or [f"status {done.returncode}"]
            raise UserError(
                f"the surface could not be cut into convex parts (CoACD: {said[-1]}); repair it, "
                "or name one with fewer triangles"
            )
        with np.load(result) as parts:
            return [parts[name] for name in parts.files]


def _search(task: str, result: str) -> None:
    """What the process of its own does: read solids, let CoACD cut them, write the parts."""
    import coacd

    coacd.set_log_level("error")
    parts: list[Array] = []
    with np.load(task) as given:
        reach, seed = float(given["reach"]), int(given["seed"])
        for n, mode in enumerate(given["modes"]):
            vertices = given[f"vertices {n}"]
            threshold = min(2.0 * reach / np.ptp(vertices, axis=0).max(), 1.0)
            mesh = coacd.Mesh(vertices, given[f"faces {n}"])
            settings = {"threshold": threshold, "preprocess_mode": str(mode), "seed": seed}
            parts += [points for points, _ in coacd.run_coacd(mesh, **settings, **SEARCH)]
    np.savez(result, *parts)


def _cache() -> Path:
    from platformdirs import user_cache_path

    from sound.clips.cache import PLACE

    named = os.environ.get(PLACE)
    return (Path(named).absolute() if named else user_cache_path("carillon")) / "convex"


def _key(vertices: Array, faces: Faces, concavity: float, seed: int) -> str:
    """Hash of all that the parts depend on.

    Raises
    ------
    UserError
        If CoACD is not installed.
    """
    try:
        version = metadata.version("coacd")
    except metadata.PackageNotFoundError:
        raise UserError(
            "CoACD, which cuts hollow solids into convex parts, is not installed; "
            f"pip install -r {REQUIREMENTS}"
        ) from None
    constants = (HOLLOW, CELLS, MOST_FACES, JITTER, MOST_VERTICES, SEARCH)
    settings = (version, constants, concavity, seed)
    digest = hashlib.sha256(repr(settings).encode())
    digest.update(np.asarray(vertices, dtype="<f8").tobytes())
    digest.update(np.asarray(faces, dtype="<i8").tobytes())
    return digest.hexdigest()


def _read(path: Path) -> list[Array]:
    with open_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        ends = np.cumsum(file["counts"][()])
        return np.split(file["vertices"][()], ends[:-1])


def _write(path: Path, parts: Sequence[Array]) -> None:
    with create_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        file["counts"] = [len(part) for part in parts]
        file["vertices"] = np.concatenate(parts)


if __name__ == "__main__":
    _search(*sys.argv[1:])
