"""Surfaces of struck objects: read from a mesh file or made by code."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import numpy as np
import trimesh

from carillon.errors import UserError
from solver.geometry.builtin import builtin_surface

BUILTIN_PREFIX = "builtin:"

# A box thinner than this fraction of its longest side holds no solid that voxels could show.
FLATNESS = 1e-6


def load_surface(mesh: str, unit: float = 1.0) -> trimesh.Trimesh:
    """Load a triangle surface in metres.

    Parameters
    ----------
    mesh : path of a file that trimesh reads (obj, stl, ply, off, glb, ...; the objects of a scene
        are concatenated), or ``builtin:NAME`` for a built-in object.
    unit : metres per unit of the mesh's coordinates; built-in objects are in metres already, so
        for them it is a scale factor.

    Returns
    -------
    Surface with vertices in metres. It need not be closed or manifold.

    Raises
    ------
    UserError
        If the file is missing, not readable as a mesh, without faces, flat, or holds coordinates
        that are not finite; if `unit` is not positive; if the built-in name is unknown.
    """
    if not (math.isfinite(unit) and unit > 0):
        raise UserError(f"unit {unit:g}: expected a positive number of metres per mesh unit")
    if mesh.startswith(BUILTIN_PREFIX):
        surface = builtin_surface(mesh.removeprefix(BUILTIN_PREFIX))
    else:
        surface = _read(Path(mesh))
        _require_solid(mesh, surface)
    if unit != 1.0:
        surface.apply_scale(unit)
    return surface


def surface_name(mesh: str) -> str:
    """Short name of a mesh for messages and files: ``builtin:bell`` -> ``bell``, a path -> stem."""
    return mesh.removeprefix(BUILTIN_PREFIX) if mesh.startswith(BUILTIN_PREFIX) else Path(mesh).stem


def _read(path: Path) -> trimesh.Trimesh:
    if not path.is_file():
        raise UserError(
            f"{path}: no such file, expected a mesh (obj, stl, ply, off, glb, ...) or builtin:NAME"
        )
    formats = sorted(trimesh.available_formats())
    if path.suffix.lstrip(".").lower() not in formats:
        raise UserError(
            f"{path}: the mesh format {path.suffix or '(no ending)'!r} is unknown; "
            f"convert the mesh to one of {', '.join(formats)}"
        )
    # trimesh logs warnings about odd files; the person gets one sentence instead.
    logger = logging.getLogger("trimesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        loaded = trimesh.load(path, process=False)
        if isinstance(loaded, trimesh.Scene):
            loaded = loaded.to_geometry() if loaded.geometry else trimesh.Trimesh()
    except Exception as error:  # parsers of a dozen formats raise anything
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise UserError(
            f"{path}: could not be read as a mesh ({reason}); check or export the file again"
        ) from None
    finally:
        logger.setLevel(level)
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0:
        raise UserError(
            f"{path}: has no faces, expected the triangles of a surface; export it as a mesh"
        )
    return loaded


def _require_solid(mesh: str, surface: trimesh.Trimesh) -> None:
    used = np.asarray(surface.vertices)[np.unique(surface.faces)]
    bad = int(np.count_nonzero(~np.isfinite(used).all(axis=1)))
    if bad:
        raise UserError(
            f"{mesh}: {bad:,} of {len(used):,} vertices have coordinates that are not finite; "
            f"export the mesh again"
        )
    extents = np.ptp(used, axis=0)
    if extents.min() <= FLATNESS * extents.max():
        raise UserError(
            f"{mesh}: is flat, its bounding box measures "
            f"{' x '.join(f'{side:g}' for side in extents)}, expected a surface around a solid; "
            f"give the object a thickness"
        )
