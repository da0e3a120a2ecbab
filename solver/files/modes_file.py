"""The file `modes.h5`: eigenpairs, the model they belong to, and the evidence for them."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError, as_text
from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.walls import SIDES, WallSize
from carillon.fem.model import RIGID_MODES, Solid
from carillon.files.datasets import find, finite, put, read, refused
from carillon.files.hdf5 import create_h5, open_h5
from carillon.parameters.quantities import UP_AXES
from carillon.records import provenance
from carillon.records.measurement import measured
from solver.files.model_group import get_model, put_model

KIND = "modes"
SCHEMA = 1
ESTIMATE = "estimate"
"""Phase that estimates how far frequencies are from the solid's."""
FINE_TAKEN = "fine_taken"
"""Attribute that says why the fine solid was solved in place of a coarse one."""
CHECKS = ("inertia", "completion", "verification", ESTIMATE)
"""Phases that check modes, and find those that are missing. No method is charged for them."""
ROUNDING = 1e-6
"""Largest distance of an eigenvalue below zero, as a share of the largest one."""
SAME_SOLID = 1.000001
"""Largest difference of the boxes around voxels of one solid, in cell edges."""
_COLUMNS_PER_CHUNK = 16
_ROWS_PER_CHUNK = 1 << 20


@dataclass
class ModesFile:
    """Contents of a modes file."""

    eigenvalues: Array
    frequencies: Array
    """(k,) [rad^2/s^2] and [Hz]."""
    modes: Array | None
    """(n_dofs, k) mass-normalised, unknown 3 n + i is node n along axis i; None if not read."""
    residuals: Array
    """(k,) residual ratios."""
    model: Solid
    """The solid that the modes belong to, from which K and M can be assembled again."""
    attributes: dict[str, Any]
    provenance: dict[str, Any]
    """Method, tolerances, evidence and timings; origin of the numbers."""

    @property
    def mesh(self) -> HexMesh:
        """Mesh of the model."""
        return self.model.mesh

    @property
    def wall(self) -> WallSize | None:
        """The wall that the solid is, as its file says; None if its mesh encloses it."""
        thickness, side = (self.attributes.get(name) for name in ("wall", "wall_side"))
        return WallSize(float(thickness), str(side)) if thickness and side in SIDES else None

    @property
    def up(self) -> str | None:
        """Axis of its mesh that was turned to z; None if its axes are those of the mesh."""
        axis = self.attributes.get("up")
        return str(axis) if axis in UP_AXES else None


def write_modes(
    path: str | Path,
    model: Solid,
    eigenvalues: Array,
    modes: Iterable[Array],
    residuals: Array,
    attributes: dict[str, Any],
    parameters: dict[str, Any],
    more: Callable[[h5py.File], None] | None = None,
) -> None:
    """Write a modes file atomically.

    Raises UserError if the file cannot be written.

    Parameters
    ----------
    modes
        Blocks (n_dofs, c) of the modes in mesh node order, from the lowest up, as
        `System.stream_to_root` gives them; each is on its way to disk before the next one is
        asked for.
    attributes, parameters
        Evidence and timings; the parameters of the command, for the provenance.
    more
        Writes what else the file shall hold, under names that are not taken.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> from carillon.fem.model import fine_model
    >>> cube = hexmesh_from_grid(np.zeros((1, 3), int), np.zeros(3), 1.0)
    >>> solid, rigid = fine_model(cube, np.ones(1)), np.tile([[1.0], [0.0], [0.0]], (8, 1))
    >>> with TemporaryDirectory() as folder:
    ...     path = f"{folder}/modes.h5"
    ...     write_modes(path, solid, np.zeros(1), [rigid], np.zeros(1), {"method": "by hand"}, {})
    ...     file = read_modes(path)
    >>> file.attributes["method"], file.frequencies.tolist()
    ('by hand', [0.0])
    """
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        put_eigenvalues(file, eigenvalues)
        put_modes(file, modes, (model.n_dofs, len(eigenvalues)))
        put(file, "residuals", residuals, "1", "|K x - lambda M x| / (lambda |M x|)")
        put_model(file, model)
        for key, value in attributes.items():
            text = json.dumps(value) if isinstance(value, dict) else value
            file.attrs[key] = as_text(text) if isinstance(text, str) else text
        origin = measured(parameters, attributes.get("ranks", 1))
        file.create_group("provenance").attrs.update(origin)
        if more is not None:
            more(file)


def put_eigenvalues(group: h5py.Group, eigenvalues: Array) -> None:
    """Write the eigenvalues (k,) and the frequencies that they belong to."""
    put(group, "eigenvalues", eigenvalues, "rad^2/s^2", "eigenvalues of K u = lambda M u")
    put(group, "frequencies", frequencies(eigenvalues), "Hz", "natural frequencies")


def put_modes(group: h5py.Group, blocks: Iterable[Array], shape: tuple[int, int]) -> None:
    """Write mass-normalised modes of the given shape (n_dofs, k), handed over in blocks."""
    chunks = (min(_ROWS_PER_CHUNK, shape[0]), min(_COLUMNS_PER_CHUNK, shape[1]))
    dataset = group.create_dataset("modes", shape, float, chunks=chunks, fletcher32=True)
    dataset.attrs["units"] = "kg^-1/2"
    dataset.attrs["long_name"] = "mass-normalised modes; row 3 n + i is node n along axis i"
    first = 0
    for block in blocks:
        dataset[:, first : first + block.shape[1]] = block
        first += block.shape[1]
    if first != shape[1]:
        raise ValueError(f"{first} modes for {shape[1]} eigenvalues")


def read_modes(path: str | Path, with_modes: bool = True) -> ModesFile:
    """Read a modes file.

    Raises UserError if the file is missing, damaged, of another schema, or inconsistent: everything
    in it is a finite number, eigenvalues ascend, and the parts fit each other.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> from carillon.fem.model import fine_model
    >>> cube = hexmesh_from_grid(np.zeros((1, 3), int), np.zeros(3), 1.0)
    >>> solid, rigid = fine_model(cube, np.ones(1)), np.tile([[1.0], [0.0], [0.0]], (8, 1))
    >>> with TemporaryDirectory() as folder:
    ...     path = f"{folder}/modes.h5"
    ...     write_modes(path, solid, np.zeros(1), [rigid], np.zeros(1), {}, {})
    ...     read_modes(path).frequencies.tolist()
    [0.0]
    """
    with open_h5(path, KIND, SCHEMA, sealed=True) as file:
        attributes = {key: _plain(value) for key, value in file.attrs.items()}
        eigenvalues, model = get_eigenvalues(file), get_model(file)
        shape = (model.n_dofs, len(eigenvalues))
        stored = find(file, "modes", shape)
        return ModesFile(
            eigenvalues,
            read(file, "frequencies", eigenvalues.shape),
            finite(file, "modes", stored[()]) if with_modes else None,
            read(file, "residuals", eigenvalues.shape),
            model,
            attributes,
            provenance.read(file),
        )


def read_elastic(path: str | Path) -> ModesFile:
    """Read a modes file that holds elastic modes, whose frequencies one can divide by.

    Raises UserError, see `read_modes`; or if there is none, or one at zero frequency.
    """
    return require_elastic(read_modes(path), path)


def require_elastic(file: ModesFile, name: str | Path) -> ModesFile:
    """The contents of a file, `name` in messages, if they hold elastic modes.

    Raises UserError if there is none, or one at zero frequency.
    """
    rigid = file.model.rigid_modes
    if len(file.eigenvalues) <= rigid:
        raise UserError(
            f"{name}: holds {len(file.eigenvalues)} modes, of which {rigid} are rigid; compute more"
        )
    if file.eigenvalues[rigid] <= 0.0:
        raise UserError(
            f"{name}: more than {rigid} of its modes have frequency zero, as of a solid that "
            "hangs on a hinge; repair the mesh and compute them again"
        )
    return file


def require_same_solid(paths: Sequence[str | Path], files: Sequence[ModesFile]) -> None:
    """Check that files are of one solid: boxes around it that agree to cells of the coarsest mesh.

    Raises UserError if one differs from the first.
    """
    corners = [file.mesh.bounds for file in files]
    for path, file, box in zip(paths, files, corners, strict=True):
        cell = max(file.mesh.edge, files[0].mesh.edge)
        if np.abs(box - corners[0]).max() > SAME_SOLID * cell:
            sides = [
                " x ".join(f"{x:.4g}" for x in np.ptp(each, axis=0)) for each in (box, corners[0])
            ]
            raise UserError(
                f"{path}: is of another solid ({sides[0]} m) or place than {paths[0]} "
                f"({sides[1]} m); name files of one"
            )


def get_eigenvalues(group: h5py.Group) -> Array:
    """Eigenvalues (k,) [rad^2/s^2], ascending but for the rounding of those of rigid motions.

    Raises UserError if they are missing, not finite, out of order, or negative beyond rounding.
    """
    values = read(group, "eigenvalues", (None,)).astype(float, copy=False)
    if not len(values):
        raise refused(group, "holds no modes")
    slack = ROUNDING * float(np.abs(values).max())
    rigid, elastic = values[:RIGID_MODES], values[RIGID_MODES:]
    ascending = rigid.max() <= elastic.min(initial=np.inf) and (np.diff(elastic) >= -slack).all()
    if values.min() < -slack or not ascending:
        raise refused(group, "eigenvalues are negative or do not ascend")
    return values


def frequencies(eigenvalues: Array) -> Array:
    """Natural frequencies [Hz] of eigenvalues [rad^2/s^2]; rounding below zero counts as zero."""
    return np.asarray(np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi))


def _plain(value: Any) -> Any:
    if isinstance(value, str) and value.startswith("{"):
        return json.loads(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if hasattr(value, "item") else value
