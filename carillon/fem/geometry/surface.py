"""Surfaces of struck objects: read from a mesh file or made by code."""

import codecs
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from trimesh.resolvers import FilePathResolver

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.fem.geometry.builtin import builtin_surface
from carillon.fem.geometry.gltf import plain_gltf
from carillon.fem.geometry.orientation import turned_alike
from carillon.fem.geometry.plain_files import obj_of_off, plain_obj, require_plain_ply, whole_stl
from carillon.fem.geometry.scene_parts import Part, gltf_parts, obj_parts
from carillon.fem.geometry.three_mf import three_mf_parts
from carillon.fem.geometry.turning import turned_upright
from carillon.fem.geometry.volume_files import READERS, is_volume_file, read_volume_mesh
from carillon.files.paths import require_file
from carillon.limits import EXTENTS, FARTHEST, MESH_BYTES, UNITS, require_within

# A box thinner than this fraction of its longest side holds no solid that voxels could show.
FLATNESS = 1e-6

FORMATS = ("3mf", "glb", "gltf", "obj", "off", "ply", "stl", "stl_ascii")
"""Endings of files of surfaces; those of volume elements are `volume_files.READERS`.

Of others that trimesh reads, depending on what else is installed, a few bytes may stand for any
number: archives (zip), parts that hold each other (dae), entities (xaml, dae).
"""


def load_surface(
    mesh: str, unit: float = 1.0, is_sheet: bool = False, up: str | None = None
) -> trimesh.Trimesh:
    """Load a triangle surface [m], its faces turned alike; it need not be closed or manifold.

    Raises UserError if the file is missing, not readable as a mesh, longer than `MESH_BYTES` with
    those that it names, shorter than it says, without faces, flat, or holds coordinates that are
    not finite; if its faces are there both ways, or cannot be turned alike; if `unit` is out of
    range, or the surface too large, too small or too far from the origin (see `carillon.limits`);
    if the built-in name is unknown.

    Parameters
    ----------
    mesh
        Path of a file in one of `FORMATS` (obj, stl, ply, off, glb, ...; the objects of a scene are
        concatenated), of a mesh with volume elements (msh, vtu, ...), whose outer faces are the
        surface, or ``builtin:NAME`` for a built-in object.
    unit
        Metres per unit of the mesh's coordinates; built-in objects are in metres already, so for
        them it is a scale factor.
    is_sheet
        Whether a wall is to follow it: it may then be flat, and its faces stay as they are if they
        are there both ways or cannot be turned alike.
    up
        Axis of the file that points up, and is turned to z, see `turned_upright`.

    Examples
    --------
    >>> surface = load_surface("builtin:bell", unit=2.0)
    >>> bool((surface.extents > load_surface("builtin:bell").extents).all())
    True
    """
    _require_unit(unit)
    if mesh.startswith(BUILTIN_PREFIX):
        surface = builtin_surface(mesh.removeprefix(BUILTIN_PREFIX))
    else:
        surface = _read(Path(mesh))
    _require_solid(mesh, surface, unit, is_sheet)
    if not mesh.startswith(BUILTIN_PREFIX):
        surface = _turned_alike(mesh, surface, is_sheet)
    if unit != 1.0:
        surface.apply_scale(unit)
    return turned_upright(surface, up)


def parts_of_scene(mesh: str) -> list[Part] | None:
    """Parts of a file that has such by name, their coordinates those of the file; None of others.

    Raises UserError, see `load_surface`.
    """
    path = Path(mesh)
    kind = path.suffix.lstrip(".").lower()
    if mesh.startswith(BUILTIN_PREFIX) or kind not in ("3mf", "glb", "gltf", "obj"):
        return None
    _require_mesh_file(path)
    content = path.read_bytes()
    with _in_one_sentence(path):
        match kind:
            case "3mf":
                return three_mf_parts(content, mesh)
            case "obj":
                return obj_parts(content.removeprefix(codecs.BOM_UTF8))
            case _:
                return gltf_parts(content, Beside(path).get, mesh)


def surface_of_triangles(
    vertices: ArrayLike, faces: ArrayLike, name: str, is_sheet: bool = False
) -> trimesh.Trimesh:
    """A surface [m] of vertices (v, 3) and triangles (f, 3), checked as those of files are.

    Raises UserError if arrays have other shapes or faces name vertices that are not there, and for
    what `load_surface` refuses of coordinates and faces.
    """
    return checked_surface(vertices, faces, name, 1.0, is_sheet)


def checked_surface(
    vertices: ArrayLike, faces: ArrayLike, name: str, unit: float, is_sheet: bool = False
) -> trimesh.Trimesh:
    """The same of vertices in a `unit` [m]."""
    _require_unit(unit)
    try:
        surface = trimesh.Trimesh(np.asarray(vertices), np.asarray(faces), process=False)
        _require_vertices(surface)
    except (TypeError, ValueError) as error:
        raise UserError(f"{name}: {error}") from None
    if not len(surface.faces):
        raise UserError(f"{name}: has no faces, expected the triangles of a surface")
    _require_solid(name, surface, unit, is_sheet)
    surface = _turned_alike(name, surface, is_sheet)
    if unit != 1.0:
        surface.apply_scale(unit)
    return surface


def surface_name(mesh: str) -> str:
    """Short name of a mesh for messages and files: ``builtin:bell`` -> ``bell``, a path -> stem."""
    return mesh.removeprefix(BUILTIN_PREFIX) if mesh.startswith(BUILTIN_PREFIX) else Path(mesh).stem


_PLY_LENGTH = "PLY is unexpected length"
"""Message of trimesh about binary PLY files whose faces are not all of one length."""


def _read(path: Path) -> trimesh.Trimesh:
    if is_volume_file(path):
        return read_volume_mesh(path).surface
    _require_mesh_file(path)
    with _in_one_sentence(path):
        loaded = _loaded(path)
        if isinstance(loaded, trimesh.Scene):
            loaded = loaded.to_geometry() if loaded.geometry else trimesh.Trimesh()
        if isinstance(loaded, trimesh.Trimesh):
            _require_vertices(loaded)
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0:
        raise UserError(
            f"{path}: has no faces, expected the triangles of a surface; export it as a mesh"
        )
    return loaded


@contextmanager
def _in_one_sentence(path: Path) -> Iterator[None]:
    """Make one UserError of whatever a parser raises."""
    # trimesh logs warnings about odd files; the person gets one sentence instead.
    logger = logging.getLogger("trimesh")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except UserError:
        raise
    except Exception as error:  # parsers of a dozen formats raise anything
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        if _PLY_LENGTH in reason:
            reason = (
                "it is shorter or longer than its header says, or its faces have different numbers "
                "of corners, which are read from text alone"
            )
        raise UserError(
            f"{path}: could not be read as a mesh ({reason}); check or export the file again"
        ) from None
    finally:
        logger.setLevel(level)


def _loaded(path: Path) -> Any:
    nothing = NoFiles(str(path))
    kind = path.suffix.lstrip(".").lower()
    content: bytes | None = None
    match kind:
        case "stl":
            content = whole_stl(path.read_bytes(), str(path))
        case "ply":
            require_plain_ply(path.read_bytes(), str(path))
        case "off":
            written = obj_of_off(path.read_bytes())
            if written is not None:
                content, kind = plain_obj(written), "obj"
        case "obj":
            content = plain_obj(path.read_bytes().removeprefix(codecs.BOM_UTF8))
        case "3mf":
            parts = three_mf_parts(path.read_bytes(), str(path))
            surfaces = [trimesh.Trimesh(each.vertices, each.faces, process=False) for each in parts]
            return trimesh.util.concatenate(surfaces) if surfaces else trimesh.Trimesh()
        case "gltf" | "glb":
            content, kind = plain_gltf(path.read_bytes(), Beside(path).get, str(path)), "glb"
    if content is None:
        return trimesh.load(path, resolver=nothing, process=False)
    return trimesh.load(BytesIO(content), file_type=kind, resolver=nothing, process=False)


def _require_unit(unit: float) -> None:
    if not UNITS[0] <= unit <= UNITS[1]:
        raise UserError(
            f"unit {unit:g}: expected a positive number of metres per mesh unit, {UNITS[0]:g} to "
            f"{UNITS[1]:g}"
        )


def _require_mesh_file(path: Path) -> None:
    require_file(path, "a mesh (obj, stl, ply, off, glb, gltf, 3mf, msh, vtu, ...) or builtin:NAME")
    if path.suffix.lstrip(".").lower() not in FORMATS:
        raise UserError(
            f"{path}: the mesh format {path.suffix or '(no ending)'!r} is not read; convert the "
            f"mesh to one of {', '.join((*FORMATS, *READERS))}"
        )
    size = path.stat().st_size
    if size > MESH_BYTES:
        raise UserError(
            f"{path}: {size:,} bytes, expected at most {MESH_BYTES:,}; simplify the mesh, whose "
            "details are far smaller than voxels"
        )


def _require_vertices(surface: trimesh.Trimesh) -> None:
    """Raise ValueError if a vertex is no place, or a face names one that is not there."""
    if surface.vertices.ndim != 2 or surface.vertices.shape[1] != 3:
        raise ValueError("a vertex does not have three coordinates")
    count, faces = len(surface.vertices), np.asarray(surface.faces)
    strange = faces[(faces < 0) | (faces >= count)]
    if strange.size:
        raise ValueError(f"a face names vertex {strange[0]}, there are 0 to {count - 1}")


def _turned_alike(mesh: str, surface: trimesh.Trimesh, is_sheet: bool) -> trimesh.Trimesh:
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces, dtype=np.int64)
    try:
        turned = turned_alike(vertices, faces, mesh)
    except UserError:
        if is_sheet:
            return surface
        raise
    return surface if turned is None else trimesh.Trimesh(vertices, turned, process=False)


def _require_solid(mesh: str, surface: trimesh.Trimesh, unit: float, is_sheet: bool) -> None:
    used = np.asarray(surface.vertices)[np.unique(surface.faces)]
    bad = int(np.count_nonzero(~np.isfinite(used).all(axis=1)))
    if bad:
        raise UserError(
            f"{mesh}: {bad:,} of {len(used):,} vertices have coordinates that are not finite; "
            f"export the mesh again"
        )
    # Floats of Python, which become infinite in silence where numpy's warn.
    low, high = ([float(x) for x in end] for end in (used.min(axis=0), used.max(axis=0)))
    extents = [b - a for a, b in zip(low, high)]
    if min(extents) <= FLATNESS * max(extents) and not (is_sheet and max(extents) > 0.0):
        raise UserError(
            f"{mesh}: is flat, its bounding box measures "
            f"{' x '.join(f'{side:g}' for side in extents)}, expected a surface around a solid; "
            f"give the object a thickness, such as a wall with finite cells (--wall)"
        )
    longest, away = max(extents), max(map(abs, (*low, *high)))
    require_within(f"{mesh}: the longest side is {longest * unit:g} m", longest * unit, EXTENTS)
    if away > FARTHEST * longest:
        raise UserError(
            f"{mesh}: lies {away:g} from the origin and its longest side is {longest:g}, too far "
            "to tell voxels apart; move it to the origin"
        )


class Beside:
    """Regular files in the folder of a mesh, together with it no longer than a mesh may be."""

    def __init__(self, mesh: Path) -> None:
        self._mesh = mesh
        self._folder = FilePathResolver(str(mesh))
        self._read = mesh.stat().st_size

    def get(self, name: str, length: int | None) -> bytes:
        """The first `length` bytes of the file `name`, all of them if that is None.

        Raises UserError if they are too many, which is seen before they are read, and ValueError if
        there is no such file in the folder, or it is shorter.
        """
        path = self._found(name)
        size = path.stat().st_size
        length = size if length is None else length
        if not 0 <= length <= size:
            raise ValueError(f"the file {name!r} has {size:,} bytes, the mesh says {length:,}")
        if self._read + length > MESH_BYTES:
            raise UserError(
                f"{self._mesh}: is {self._read + length:,} bytes with the file {name!r} that it "
                f"names, expected at most {MESH_BYTES:,}; simplify the mesh"
            )
        self._read += length
        with open(path, "rb") as stream:
            return stream.read(length)

    def _found(self, name: str) -> Path:
        for candidate in (name.strip(), name.strip().lstrip("/"), Path(name).name):
            try:
                path = self._folder.absolute(candidate)
            except ValueError:  # it lies elsewhere
                continue
            if path.is_file():
                return path
        raise ValueError(f"no file {name!r} beside it")


class NoFiles(FilePathResolver):  # type: ignore[misc]
    """A folder in which trimesh finds no file beside a mesh: a shape has no need of materials."""

    def get(self, name: str) -> Any:
        """Raise FileNotFoundError, which trimesh takes for a file that is not there."""
        raise FileNotFoundError(name)
