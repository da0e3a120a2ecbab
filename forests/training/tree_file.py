"""One grown tree in a file, for trainings whose trees are grown by jobs of their own."""

import json
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from carillon.errors import UserError
from carillon.files.datasets import INTEGER, REAL, read
from carillon.files.hdf5 import create_h5, open_h5
from carillon.records import provenance
from forests.scaling import FEATURES, PATTERNS
from forests.training.spent import Spent
from forests.training.structure import Tree

KIND = "tree"
SCHEMA = 2


def save_tree(
    path: str | Path, tree: Tree, job: int, parameters: dict[str, Any], spent: Spent
) -> None:
    """Write tree number `job` of a training with these parameters, and the time it took.

    The file is complete or absent.
    """
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        file.attrs["tree"] = job
        file.attrs.update(asdict(spent))
        file.attrs["parameters"] = json.dumps(parameters, sort_keys=True)
        for field in fields(Tree):
            file.create_dataset(field.name, data=getattr(tree, field.name))
        provenance.write(file, parameters)


def load_tree(path: str | Path, parameters: dict[str, Any]) -> tuple[int, Tree, Spent]:
    """Number and splits of a tree, and the time that growing it took.

    Raises UserError if the file is missing, damaged or of another training.
    """
    with open_h5(path, KIND, SCHEMA, sealed=True) as file:
        job = int(file.attrs["tree"])
        spent = Spent(**{field.name: float(file.attrs[field.name]) for field in fields(Spent)})
        theirs = json.loads(str(file.attrs["parameters"]))
        kinds = {field.name: INTEGER for field in fields(Tree)} | {"threshold": REAL}
        tree = Tree(**{name: read(file, name, (None,), kind) for name, kind in kinds.items()})
    if theirs != json.loads(json.dumps(parameters)):
        raise UserError(f"{path}: {difference(theirs, parameters)}")
    _require_sound(path, tree)
    return job, tree, spent


def load_trees(
    paths: Sequence[str | Path], parameters: dict[str, Any]
) -> tuple[dict[int, Tree], Spent]:
    """Trees by number, and the time that growing them took in all.

    Raises UserError if a file is missing, damaged or of another training, or the trees are not each
    there once.
    """
    trees: dict[int, Tree] = {}
    spent = Spent()
    for path in paths:
        job, tree, took = load_tree(path, parameters)
        if job in trees:
            raise UserError(f"{path}: is tree {job}, which another file holds too")
        trees[job] = tree
        spent += took
    numbers = set(range(2 * parameters["trees"]))
    if missing := sorted(numbers - set(trees)):
        raise UserError(
            f"tree {missing[0]} is missing, {len(trees)} of {len(numbers)} trees are named; grow "
            f"it with carillon grow --tree {missing[0]}"
        )
    return trees, spent


def difference(theirs: dict[str, Any], expected: dict[str, Any]) -> str:
    """What the parameters of two trainings differ in, in words."""
    expected = json.loads(json.dumps(expected))
    name = next(key for key in expected | theirs if theirs.get(key) != expected.get(key))
    if name == "samples":
        return "was grown on other samples; name the same ones, or grow it again"
    return (
        f"was grown with {name} {theirs.get(name)} where {expected.get(name)} is asked for; grow "
        "it again"
    )


def _require_sound(path: str | Path, tree: Tree) -> None:
    """Indices must stay inside the arrays and lead downwards: what walks a tree does not look."""
    nodes = len(tree.left)
    inner = tree.left >= 0
    number = np.arange(nodes)
    shapes = (tree.feature, tree.threshold, tree.right, tree.leaf)
    sound = (
        nodes > 0
        and all(values.shape == (nodes,) for values in shapes)
        and tree.roots.shape == (PATTERNS,)
        and bool(((tree.roots >= 0) & (tree.roots < nodes)).all())
        and bool(((tree.feature >= 0) & (tree.feature < FEATURES)).all())
        and bool(((tree.left > number) & (tree.left < nodes))[inner].all())
        and bool(((tree.right > number) & (tree.right < nodes))[inner].all())
        and bool((tree.leaf[~inner] == np.arange((~inner).sum())).all())
    )
    if not sound:
        raise UserError(f"{path}: its tree is inconsistent; grow it again")
