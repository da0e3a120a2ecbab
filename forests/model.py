"""The trained forests as plain arrays, and their HDF5 file. Never a pickle."""

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numba
import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.files.hdf5 import create_h5, open_h5
from carillon.records import provenance
from dataset_gen.objectives import ratios_of
from forests import default
from forests.layout import FEATURE_BITS, FEATURE_MASK, NODE, aligned
from forests.scaling import FEATURES, PATTERNS, TRANSFORMS

KIND = "forests"
SCHEMA = 2

VOID, FILLED = 0, 1
"""Forest of void origins (Reg1 of Eq. 12) and of filled origins (Reg2)."""
CONSTANT, LOW, HIGH = FEATURES, FEATURES + 1, FEATURES + 2
"""Columns of a leaf's record behind its slopes."""
RECORD = FEATURES + 3


@dataclass(frozen=True)
class Forests:
    """Two forests, all trees in one set of arrays."""

    roots: NDArray[np.int32]
    """(2, trees, 128) root nodes of the void and the filled forest, one for each void pattern."""
    nodes: NDArray[Any]
    """(nodes,) of type `forests.layout.NODE`; links lead to later nodes only."""
    leaves: NDArray[np.float32]
    """(leaves, 10) slopes of the seven features, constant, bounds of the answer."""

    @property
    def trees(self) -> int:
        """Trees of each forest."""
        return int(self.roots.shape[1])

    @property
    def thresholds(self) -> NDArray[np.float32]:
        """View of the nodes: thresholds in column 0."""
        return self.nodes.view(np.float32).reshape(-1, 2)

    @property
    def links(self) -> NDArray[np.int32]:
        """View of the nodes: links in column 1."""
        return self.nodes.view(np.int32).reshape(-1, 2)


@dataclass(frozen=True)
class Model:
    """Everything a coarsening needs to know."""

    objective: str
    poisson: float
    """Objective and Poisson's ratio of the fits, which may serve solids of others: `ratios`."""
    transform: str
    """Of the features and the target, one of `forests.scaling.TRANSFORMS`."""
    forests: Forests
    scores: dict[str, float]
    """On samples that were held out, by name."""
    provenance: dict[str, Any]
    """Of the training, by name."""

    @property
    def ratios(self) -> tuple[float, float]:
        """Least and largest Poisson's ratio of the solids that the forests are for."""
        return ratios_of(self.objective, self.poisson)

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        return sum(getattr(self.forests, f.name).nbytes for f in fields(Forests))


def save_model(path: str | Path, model: Model) -> None:
    """Write the model atomically, with a checksum and the provenance of its training."""
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        file.attrs["objective"] = model.objective
        file.attrs["poisson"] = model.poisson
        file.attrs["transform"] = model.transform
        file.attrs["scores"] = json.dumps(model.scores)
        for field in fields(Forests):
            file.create_dataset(field.name, data=getattr(model.forests, field.name))
        file.create_group("provenance").attrs.update(model.provenance)


@numba.njit(cache=True)
def _leads_down(
    roots: NDArray[np.int32], links: NDArray[np.int32], thresholds: NDArray[np.float32], leaves: int
) -> bool:
    """Whether all indices stay inside the arrays and lead onwards, so that every walk ends."""
    nodes = len(links)
    sound = True
    for root in roots.ravel():
        sound &= 0 <= root < nodes
    for node in range(nodes):
        link = links[node, 1]
        if link < 0:
            sound &= ~link < leaves
        else:
            child = link >> FEATURE_BITS
            sound &= node < child < nodes - 1 and link & FEATURE_MASK < FEATURES
            sound &= not np.isnan(thresholds[node, 0])
    return sound


@numba.njit(cache=True)
def _answers_are_finite(leaves: NDArray[np.float32]) -> bool:
    sound = True
    for leaf in leaves:
        for value in leaf:
            sound &= np.isfinite(value)
        sound &= leaf[LOW] <= leaf[HIGH]
    return sound


def _require_sound(path: Path, forests: Forests) -> None:
    """The evaluation does not check what it is given."""
    sound = (
        forests.roots.ndim == 3
        and forests.roots.shape[::2] == (2, PATTERNS)
        and forests.trees > 0
        and forests.nodes.ndim == 1
        and forests.leaves.ndim == 2
        and forests.leaves.shape[1] == RECORD
        and _leads_down(forests.roots, forests.links, forests.thresholds, len(forests.leaves))
        and _answers_are_finite(forests.leaves)
    )
    if not sound:
        raise UserError(f"{path}: its trees are inconsistent; train the forests again")


def load_model(path: str | Path | None = None) -> Model:
    """Read and validate a model, by default the one that comes with the package.

    Raises UserError if the file is missing, damaged, of another kind or schema, or inconsistent.

    Examples
    --------
    >>> model = load_model()
    >>> model.objective, model.ratios, model.forests.trees
    ('calibrated', (0.0, 0.49), 3)
    """
    path = default.default_path() if path is None else Path(path)
    with open_h5(path, KIND, SCHEMA, sealed=True) as file:
        forests = Forests(
            roots=_array(path, file, "roots", np.dtype(np.int32)),
            nodes=_array(path, file, "nodes", NODE),
            leaves=_array(path, file, "leaves", np.dtype(np.float32)),
        )
        transform = str(file.attrs["transform"])
        model = Model(
            objective=str(file.attrs["objective"]),
            poisson=float(file.attrs["poisson"]),
            transform=transform,
            forests=forests,
            scores=json.loads(file.attrs["scores"]),
            provenance=provenance.read(file),
        )
    if transform not in TRANSFORMS:
        raise UserError(f"{path}: transform {transform!r} is unknown; train the forests again")
    _require_sound(path, forests)
    return model


def _array(path: Path, file: h5py.File, name: str, dtype: np.dtype) -> NDArray[Any]:
    if name not in file:
        raise UserError(f"{path}: has no dataset {name!r}; train the forests again")
    stored = file[name]
    if stored.dtype != dtype or not 0 < stored.nbytes <= stored.id.get_storage_size():
        raise UserError(f"{path}: dataset {name!r} is not what it should be; train again")
    array = aligned(stored.shape, dtype)
    stored.read_direct(array)
    return array
