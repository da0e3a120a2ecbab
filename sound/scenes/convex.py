"""Convex parts of a solid, for the collisions of rigid bodies.

CoACD (Wei et al. 2022, Approximate convex decomposition for 3D meshes with collision-aware
concavity and tree search) cuts closed surfaces.  It runs in a process of its own, since it prints,
cannot be interrupted, and crashes on unexpected surfaces.
"""

import hashlib
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import metadata
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from carillon.arrays import Array, Integers, Surface
from carillon.errors import UserError
from carillon.files.cache import remembered
from carillon.files.datasets import INTEGER, read, refused
from carillon.files.hdf5 import create_h5, open_h5
from carillon.limits import require_within
from carillon.processes.children import run_child
from carillon.processes.memory import spare_the_machine
from sound.scenes.cuttable import (
    GRIDS,
    HOLLOW,
    JITTER,
    MOST_FACES,
    Cuttable,
    coarser,
    components,
    is_convex,
    remeshed,
)
from sound.scenes.packages import REQUIREMENTS

MOST_VERTICES = 64
"""Greatest number of vertices of a hull; more slow the engine down."""
SEARCH = {
    "resolution": 500,
    "mcts_nodes": 10,
    "mcts_iterations": 60,
    "mcts_max_depth": 2,
}
"""Effort of CoACD's search for cuts; its defaults take three times as long for a few parts
fewer."""
CONCAVITIES = (0.01, 1.0)
"""Bounds of `concavity`; below them CoACD hardly ends."""
_KIND, _SCHEMA = "convex parts", 1  # counted up, too, when other parts are found than before
_DIRECTIONS = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if way > (0, 0, 0)])
"""Directions of a cube's edges, diagonals of faces, and diagonals, one sense each."""


def convex_parts(
    vertices: Array, faces: Integers, concavity: float = 0.05, seed: int = 0
) -> list[Array]:
    """Vertices (n, 3) [m] of convex hulls that together fill a solid; a convex one has one hull.

    Closed components of the surface are cut one by one.  If a component is open, the solid is the
    inside by winding numbers on a grid, see `GRIDS`.  Parts are kept in the user's cache.  Hulls
    have at most `MOST_VERTICES` and reach beyond the solid by about `concavity`, over half its
    longest side; CoACD's search has a seed.

    Raises UserError if the surface encloses nothing, `concavity` is out of bounds, CoACD is not
    installed, or it fails.
    """
    import trimesh

    require_within(f"concavity {concavity:g}", concavity, CONCAVITIES)
    surface = trimesh.Trimesh(vertices, faces)
    solids = components(trimesh.Trimesh(vertices, faces, process=False))
    if solids and all(map(is_convex, solids)):
        return [hull_of(solid.vertices) for solid in solids]
    key = _key(vertices, faces, concavity, seed)
    return remembered(
        "convex", key, lambda: _cut(solids or remeshed(surface), concavity, seed), _read, _write
    )


def _cut(solids: Sequence[Surface], concavity: float, seed: int) -> list[Array]:
    from scipy.spatial import QhullError

    whole = [solid.vertices for solid in solids if is_convex(solid)]
    hollow = [coarser(solid) for solid in solids if not is_convex(solid)]
    longest = np.ptp(np.concatenate([solid.bounds for solid in solids]), axis=0).max()
    hulls = []
    for part in whole + _searched(hollow, concavity * longest / 2.0, seed):
        with suppress(QhullError):  # a part as flat as rounding errors
            hulls.append(hull_of(part))
    return hulls


def hull_of(points: Array) -> Array:
    """At most `MOST_VERTICES` of the points (p, 3) that span their hull best.

    Each point added is the one farthest outside of the hull of those before.
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
    """Points (p, 3) of CoACD's parts, whose hulls reach `reach` [m] beyond a solid.

    CoACD has one thread, as with several the order of the parts depends on which one is faster.
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
    """In the child process: read solids, cut them by CoACD, write the parts."""
    import coacd

    spare_the_machine()
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


def _key(vertices: Array, faces: Integers, concavity: float, seed: int) -> str:
    """Hash of all that the parts depend on; raises UserError if CoACD is not installed."""
    try:
        version = metadata.version("coacd")
    except metadata.PackageNotFoundError:
        raise UserError(
            "CoACD, which cuts hollow solids into convex parts, is not installed; "
            f"pip install -r {REQUIREMENTS}"
        ) from None
    constants = (HOLLOW, GRIDS, MOST_FACES, JITTER, MOST_VERTICES, SEARCH)
    settings = (version, constants, concavity, seed)
    digest = hashlib.sha256(repr(settings).encode())
    digest.update(np.asarray(vertices, dtype="<f8").tobytes())
    digest.update(np.asarray(faces, dtype="<i8").tobytes())
    return digest.hexdigest()


def _read(path: Path) -> list[Array]:
    with open_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        counts = read(file, "counts", (None,), INTEGER)
        vertices = read(file, "vertices", (None, 3))
        few, many = counts.min(initial=MOST_VERTICES), counts.max(initial=0)
        if few < 4 or many > MOST_VERTICES or counts.sum() != len(vertices):
            raise refused(file, "holds parts that are no hulls")
        return np.split(vertices, np.cumsum(counts)[:-1])


def _write(path: Path, parts: Sequence[Array]) -> None:
    with create_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        file["counts"] = [len(part) for part in parts]
        file["vertices"] = np.concatenate(parts)


if __name__ == "__main__":
    _search(*sys.argv[1:])
