"""Trees and sums that an unfinished training keeps, in a folder beside the file that it will write.

A training that was killed goes on from there: from the trees that were grown, and from the sums of
the leaves over the samples that were added.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from carillon.files.datasets import INTEGER, REAL, read
from carillon.files.hdf5 import create_h5, open_h5
from carillon.files.paths import cause
from forests.training.dataset import Samples
from forests.training.exact_sums import Sums
from forests.training.leaf_fit import LeafSums
from forests.training.spent import Spent
from forests.training.structure import Tree
from forests.training.tree_file import difference, load_tree, save_tree

KIND = "leaf sums"
SCHEMA = 1
PART = 1 << 16
"""Leaves whose sums are read together."""


def folder_of(out: str | Path) -> Path:
    """Folder with what is kept of the training that writes `out`."""
    path = Path(out)
    return path.parent / f".{path.name}.training"


class Kept:
    """Trees and sums of one training with certain parameters, in a folder beside its result."""

    def __init__(self, out: str | Path, parameters: dict[str, Any]) -> None:
        self.folder = folder_of(out)
        self._parameters = parameters

    def _tree(self, job: int) -> Path:
        return self.folder / f"tree-{job}.h5"

    @property
    def _sums(self) -> Path:
        return self.folder / "sums.h5"

    def trees(self, jobs: range) -> tuple[dict[int, Tree], Spent]:
        """Trees that are there, by number, and the time that growing them took.

        Raises UserError if they are damaged or were grown with other parameters.
        """
        trees, spent = {}, Spent()
        for job in jobs:
            if self._tree(job).exists():
                with self._explained():
                    number, trees[job], took = load_tree(self._tree(job), self._parameters)
                    if number != job:
                        raise UserError(f"{self._tree(job)}: is tree {number}; remove it")
                spent += took
        return trees, spent

    def keep_tree(self, job: int, tree: Tree, spent: Spent) -> None:
        """Write a tree that was grown."""
        with self._made():
            save_tree(self._tree(job), tree, job, self._parameters, spent)

    def keep_sums(self, state: LeafSums) -> None:
        """Write what is known of the leaves; what was there before is replaced at the end."""
        with self._made(), create_h5(self._sums, KIND, SCHEMA, sealed=True) as file:
            file.attrs["parameters"] = json.dumps(self._parameters, sort_keys=True)
            file.attrs.update({"samples": state.samples, "used": state.used} | asdict(state.spent))
            for name, values in state.held_out._asdict().items():
                file[f"held_out/{name}"] = values
            for job, sums in state.sums.items():
                sums.carry()
                for name, values in sums.arrays():
                    file[f"{job}/{name}"] = values

    def sums(self, nothing: LeafSums) -> LeafSums:
        """Sums that were kept, read into the arrays of `nothing`; `nothing` if there are none.

        Raises UserError if it is damaged or was worked out with other parameters.
        """
        if not self._sums.exists():
            return nothing
        with self._explained(), open_h5(self._sums, KIND, SCHEMA, sealed=True) as file:
            theirs = json.loads(file.attrs["parameters"])
            if theirs != self._parameters:
                raise UserError(f"{self._sums}: {difference(theirs, self._parameters)}")
            shapes = {"young": (None, 8), "moduli": (None, 8), "position": (None,)}
            held_out = {
                name: read(file["held_out"], name, shape, INTEGER if name == "position" else REAL)
                for name, shape in shapes.items()
            }
            for job, sums in nothing.sums.items():
                _fill(file[str(job)], sums)
            samples, used = int(file.attrs["samples"]), int(file.attrs["used"])
            spent = Spent(**{field.name: float(file.attrs[field.name]) for field in fields(Spent)})
        return LeafSums(nothing.sums, Samples(**held_out), samples, used, spent)

    def remove(self) -> None:
        """Remove all that was kept; a folder that a link names stays."""
        with suppress(OSError):
            for file in self.folder.iterdir():
                file.unlink()
            self.folder.rmdir()

    @contextmanager
    def _made(self) -> Iterator[None]:
        """The folder, which is not left behind with nothing in it."""
        try:
            self.folder.mkdir(exist_ok=True)
            yield
        except OSError as error:
            raise UserError(f"{self.folder}: cannot be written ({cause(error)})") from None
        finally:
            with suppress(OSError):
                self.folder.rmdir()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except UserError as error:
            raise UserError(
                f"{error}, or remove {self.folder} to begin again, or name another file to write"
            ) from None


def _fill(group: Any, sums: Sums) -> None:
    for name, values in sums.arrays():
        if group[name].shape != values.shape:
            raise UserError(
                f"{group.file.filename}: {name} has shape {group[name].shape}, expected "
                f"{values.shape}"
            )
        for first in range(0, len(values), PART):
            values[first : first + PART] = group[name][first : first + PART]
