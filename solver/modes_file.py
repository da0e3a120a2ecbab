"""The file `modes.h5`: eigenpairs, the model they belong to, and the evidence for them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from carillon import provenance
from carillon.errors import UserError
from carillon.files import create_h5, open_h5
from carillon.measurement import measured
from solver.geometry import HexMesh
from solver.model import ElasticModel

Array = NDArray[np.float64]

KIND = "modes"
SCHEMA = 1
_COLUMNS_PER_CHUNK = 16
_ROWS_PER_CHUNK = 1 << 20


@dataclass
class ModesFile:
    """Contents of a modes file.

    Attributes
    ----------
    eigenvalues, frequencies
        (k,) [rad^2/s^2] and [Hz].
    modes
        (n_dofs, k) mass-normalised, unknown 3 n + i is node n along axis i; None if not read.
    residuals
        (k,) residual ratios.
    model
        The solid that the modes belong to, from which K and M can be assembled again.
    attributes, provenance
        Method, tolerances, evidence and timings; origin of the numbers.
    """

    eigenvalues: Array
    frequencies: Array
    modes: Array | None
    residuals: Array
    model: ElasticModel
    attributes: dict[str, Any]
    provenance: dict[str, Any]

    @property
    def mesh(self) -> HexMesh:
        """Mesh of the model."""
        return self.model.mesh


def write_modes(
    path: str | Path,
    model: ElasticModel,
    eigenvalues: Array,
    modes: Iterable[Array],
    residuals: Array,
    attributes: dict[str, Any],
    parameters: dict[str, Any],
    more: Callable[[h5py.File], None] | None = None,
) -> None:
    """Write a modes file atomically.

    Parameters
    ----------
    modes
        Blocks (n_dofs, c) of the modes in mesh node order, from the lowest up, as
        `System.pour` gives them; each is on its way to disk before the next one is asked for.
    attributes, parameters
        Evidence and timings; the parameters of the command, for the provenance.
    more
        Writes what else the file shall hold, under names that are not taken.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        put_eigenvalues(file, eigenvalues)
        put_modes(file, modes, (model.n_dofs, len(eigenvalues)))
        put(file, "residuals", residuals, "1", "|K x - lambda M x| / (lambda |M x|)")
        put_model(file, model)
        for key, value in attributes.items():
            file.attrs[key] = json.dumps(value) if isinstance(value, dict) else value
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


def put_model(group: h5py.Group, model: ElasticModel) -> None:
    """Write a solid, from which K and M can be assembled again."""
    mesh = model.mesh
    uniform = bool((model.young == model.young[:, :1]).all())
    young = model.young[:, 0] if uniform else model.young
    put(group, "nodes", mesh.nodes, "m", "positions of the nodes")
    put(group, "node_grid", mesh.node_grid, "1", "integer coordinates of the nodes")
    put(group, "cells", mesh.cells, "1", "node numbers of the cells, corners in bit order")
    put(group, "grid", mesh.grid, "1", "integer coordinates of the cells")
    put(group, "young", young, "Pa", "Young's modulus per cell or per quadrature point")
    put(group, "fill", model.fill, "1", "bit pattern of the cell's octants that hold mass")
    group.attrs["poisson"] = model.poisson
    group.attrs["density"] = model.density
    group.attrs["lumped"] = model.lumped
    group.attrs["lumped_share"] = model.lumped_share
    group.attrs["cell_edge"] = mesh.edge
    group.attrs["origin"] = mesh.origin


def get_model(group: h5py.Group) -> ElasticModel:
    """Read a solid written by `put_model`."""
    mesh = HexMesh(
        cells=group["cells"][()],
        grid=group["grid"][()],
        node_grid=group["node_grid"][()],
        # Attributes come with an explicit byte order, which MPI does not know.
        origin=group.attrs["origin"].astype(float),
        edge=float(group.attrs["cell_edge"]),
    )
    young = group["young"][()]
    if young.ndim == 1:
        young = np.repeat(young[:, None], 8, axis=1)
    return ElasticModel(
        mesh,
        young,
        group["fill"][()],
        float(group.attrs["poisson"]),
        float(group.attrs["density"]),
        bool(group.attrs["lumped"]),
        float(group.attrs.get("lumped_share", 0.0)),
    )


def read_modes(path: str | Path, with_modes: bool = True) -> ModesFile:
    """Read a modes file.

    Raises
    ------
    UserError
        If the file is missing, damaged, of another schema, or inconsistent.
    """
    with open_h5(path, KIND, SCHEMA) as file:
        attributes = {key: _plain(value) for key, value in file.attrs.items()}
        model = get_model(file)
        result = ModesFile(
            file["eigenvalues"][()],
            file["frequencies"][()],
            file["modes"][()] if with_modes else None,
            file["residuals"][()],
            model,
            attributes,
            provenance.read(file),
        )
        shape = file["modes"].shape
    expected = (model.n_dofs, len(result.eigenvalues))
    if shape != expected or len(model.young) != model.mesh.n_cells:
        raise UserError(
            f"{path}: holds modes of shape {shape}, expected {expected}; generate the file again"
        )
    return result


def frequencies(eigenvalues: Array) -> Array:
    """Natural frequencies [Hz] of eigenvalues [rad^2/s^2]; rounding below zero counts as zero."""
    return np.asarray(np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi))


def put(group: h5py.Group, name: str, data: NDArray[Any], units: str, long_name: str) -> None:
    """Write one dataset with a checksum, its unit and what it is."""
    dataset = group.create_dataset(name, data=data, fletcher32=True, chunks=True)
    dataset.attrs["units"] = units
    dataset.attrs["long_name"] = long_name


def _plain(value: Any) -> Any:
    if isinstance(value, str) and value.startswith("{"):
        return json.loads(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if hasattr(value, "item") else value
