"""The file `modes.h5`: eigenpairs, the model they belong to, and the evidence for them."""

from __future__ import annotations

import json
from collections.abc import Iterable
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
) -> None:
    """Write a modes file atomically.

    Parameters
    ----------
    modes
        Blocks (n_dofs, c) of the modes in mesh node order, from the lowest up, as
        `System.pour` gives them; each is on its way to disk before the next one is asked for.
    attributes, parameters
        Evidence and timings; the parameters of the command, for the provenance.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    mesh = model.mesh
    uniform = bool((model.young == model.young[:, :1]).all())
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        _put(file, "eigenvalues", eigenvalues, "rad^2/s^2", "eigenvalues of K u = lambda M u")
        _put(file, "frequencies", frequencies(eigenvalues), "Hz", "natural frequencies")
        _put_modes(file, modes, (mesh.n_dofs, len(eigenvalues)))
        _put(file, "residuals", residuals, "1", "|K x - lambda M x| / (lambda |M x|)")
        _put(file, "nodes", mesh.nodes, "m", "positions of the nodes")
        _put(file, "node_grid", mesh.node_grid, "1", "integer coordinates of the nodes")
        _put(file, "cells", mesh.cells, "1", "node numbers of the cells, corners in bit order")
        _put(file, "grid", mesh.grid, "1", "integer coordinates of the cells")
        young = model.young[:, 0] if uniform else model.young
        _put(file, "young", young, "Pa", "Young's modulus per cell or per quadrature point")
        _put(file, "fill", model.fill, "1", "bit pattern of the cell's octants that hold mass")
        file.attrs["poisson"] = model.poisson
        file.attrs["density"] = model.density
        file.attrs["lumped"] = model.lumped
        file.attrs["lumped_share"] = model.lumped_share
        file.attrs["cell_edge"] = mesh.edge
        file.attrs["origin"] = mesh.origin
        for key, value in attributes.items():
            file.attrs[key] = json.dumps(value) if isinstance(value, dict) else value
        origin = measured(parameters, attributes.get("ranks", 1))
        file.create_group("provenance").attrs.update(origin)


def _put_modes(file: h5py.File, blocks: Iterable[Array], shape: tuple[int, int]) -> None:
    chunks = (min(_ROWS_PER_CHUNK, shape[0]), min(_COLUMNS_PER_CHUNK, shape[1]))
    dataset = file.create_dataset("modes", shape, float, chunks=chunks, fletcher32=True)
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

    Raises
    ------
    UserError
        If the file is missing, damaged, of another schema, or inconsistent.
    """
    with open_h5(path, KIND, SCHEMA) as file:
        attributes = {key: _plain(value) for key, value in file.attrs.items()}
        mesh = HexMesh(
            cells=file["cells"][()],
            grid=file["grid"][()],
            node_grid=file["node_grid"][()],
            origin=file.attrs["origin"],
            edge=float(file.attrs["cell_edge"]),
        )
        young = file["young"][()]
        if young.ndim == 1:
            young = np.repeat(young[:, None], 8, axis=1)
        model = ElasticModel(
            mesh,
            young,
            file["fill"][()],
            float(file.attrs["poisson"]),
            float(file.attrs["density"]),
            bool(file.attrs["lumped"]),
            float(file.attrs.get("lumped_share", 0.0)),
        )
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
    expected = (mesh.n_dofs, len(result.eigenvalues))
    if shape != expected or len(young) != mesh.n_cells:
        raise UserError(
            f"{path}: holds modes of shape {shape}, expected {expected}; generate the file again"
        )
    return result


def frequencies(eigenvalues: Array) -> Array:
    """Natural frequencies [Hz] of eigenvalues [rad^2/s^2]; rounding below zero counts as zero."""
    return np.asarray(np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi))


def _put(file: h5py.File, name: str, data: NDArray[Any], units: str, long_name: str) -> None:
    dataset = file.create_dataset(name, data=data, fletcher32=True, chunks=True)
    dataset.attrs["units"] = units
    dataset.attrs["long_name"] = long_name


def _plain(value: Any) -> Any:
    if isinstance(value, str) and value.startswith("{"):
        return json.loads(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if hasattr(value, "item") else value
