"""The trained forests as plain arrays, and their HDF5 file. Never a pickle."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from carillon import provenance
from carillon.errors import UserError
from carillon.files import create_h5, open_h5
from forests.scaling import FEATURES, TRANSFORMS
from forests.training.leaves import Leaves
from forests.training.structure import Tree

KIND = "forests"
SCHEMA = 1

VOID, FILLED = 0, 1
"""Forest of void origins (Reg1 of Eq. 12) and of filled origins (Reg2)."""


@dataclass(frozen=True)
class Forests:
    """Two forests, all trees in one set of arrays.

    Attributes
    ----------
    roots : (2, trees) root nodes of the void and the filled forest.
    feature, threshold, left, right, leaf : (nodes,) splits; `left` is -1 in leaves, where `leaf`
        numbers the row of the leaf arrays.
    coefficients : (leaves, 8) slopes of the seven features and the constant.
    low, high : (leaves,) bounds of a leaf's answer.
    """

    roots: NDArray[np.int32]
    feature: NDArray[np.int32]
    threshold: NDArray[np.float64]
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    leaf: NDArray[np.int32]
    coefficients: NDArray[np.float32]
    low: NDArray[np.float32]
    high: NDArray[np.float32]


@dataclass(frozen=True)
class Model:
    """Everything a coarsening needs to know.

    objective and Poisson's ratio of the fits, feature transform, arrays, held-out scores,
    provenance of the training.
    """

    objective: str
    poisson: float
    transform: str
    forests: Forests
    scores: dict[str, float]
    provenance: dict[str, Any]

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        return sum(getattr(self.forests, f.name).nbytes for f in fields(Forests))


def join(void: list[tuple[Tree, Leaves]], filled: list[tuple[Tree, Leaves]]) -> Forests:
    """Put the trees of both forests, equally many, into one set of arrays."""
    trees = [*void, *filled]
    nodes = np.cumsum([0] + [len(tree.left) for tree, _ in trees])
    leaves = np.cumsum([0] + [tree.leaves for tree, _ in trees])

    def shifted(name: str, offsets: NDArray[np.int64]) -> NDArray[np.int32]:
        parts = [getattr(tree, name) for tree, _ in trees]
        moved = [np.where(p < 0, -1, p + o) for p, o in zip(parts, offsets, strict=False)]
        return np.concatenate(moved).astype(np.int32)

    return Forests(
        roots=nodes[:-1].reshape(2, -1).astype(np.int32),
        feature=np.concatenate([tree.feature for tree, _ in trees]),
        threshold=np.concatenate([tree.threshold for tree, _ in trees]),
        left=shifted("left", nodes),
        right=shifted("right", nodes),
        leaf=shifted("leaf", leaves),
        coefficients=np.concatenate([part.coefficients for _, part in trees]).astype(np.float32),
        low=np.concatenate([part.low for _, part in trees]).astype(np.float32),
        high=np.concatenate([part.high for _, part in trees]).astype(np.float32),
    )


def save_model(path: str | Path, model: Model, parameters: dict[str, Any]) -> None:
    """Write the model atomically, with checksums and provenance."""
    with create_h5(path, KIND, SCHEMA) as file:
        file.attrs["objective"] = model.objective
        file.attrs["poisson"] = model.poisson
        file.attrs["transform"] = model.transform
        file.attrs["scores"] = json.dumps(model.scores)
        for field in fields(Forests):
            file.create_dataset(
                field.name,
                data=getattr(model.forests, field.name),
                compression="gzip",
                shuffle=True,
                fletcher32=True,
            )
        provenance.write(file, parameters)


def _require_sound(path: Path, forests: Forests) -> None:
    """Indices must stay inside the arrays and lead downwards: the evaluator does not check them."""
    nodes, leaves = len(forests.left), len(forests.coefficients)
    number = np.arange(nodes)
    inner = forests.left >= 0
    per_node = (forests.feature, forests.threshold, forests.right, forests.leaf)
    sound = (
        forests.roots.ndim == 2
        and forests.roots.shape[0] == 2
        and forests.roots.size > 0
        and all(values.shape == (nodes,) for values in per_node)
        and forests.coefficients.shape == (leaves, FEATURES + 1)
        and forests.low.shape == forests.high.shape == (leaves,)
        and bool(((forests.roots >= 0) & (forests.roots < nodes)).all())
        and bool(((forests.feature >= 0) & (forests.feature < FEATURES)).all())
        and bool(((forests.left > number) & (forests.left < nodes))[inner].all())
        and bool(((forests.right > number) & (forests.right < nodes))[inner].all())
        and bool(((forests.leaf >= 0) & (forests.leaf < leaves))[~inner].all())
        and bool(np.isfinite(forests.coefficients).all() and np.isfinite(forests.low).all())
        and bool((forests.low <= forests.high).all() and np.isfinite(forests.high).all())
    )
    if not sound:
        raise UserError(f"{path}: its trees are inconsistent; train the forests again")


def load_model(path: str | Path) -> Model:
    """Read and validate a model.

    Raises
    ------
    UserError
        If the file is missing, damaged, of another kind or schema, or inconsistent.
    """
    path = Path(path)
    with open_h5(path, KIND, SCHEMA) as file:
        arrays = {field.name: _array(path, file, field.name) for field in fields(Forests)}
        forests = Forests(**arrays)
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


def _array(path: Path, file: h5py.File, name: str) -> NDArray[Any]:
    if name not in file:
        raise UserError(f"{path}: has no dataset {name!r}; train the forests again")
    return np.asarray(file[name][()])
