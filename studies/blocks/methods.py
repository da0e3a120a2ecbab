"""The coarsenings of Fig. 9 under one interface."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.files.paths import require_writable
from carillon.processes.threads import allowed_threads, in_parallel
from dataset_gen.objectives import closed_form, fit
from forests.baselines import average, galerkin
from forests.default import default_path
from forests.evaluate import coarsen
from forests.model import Model, load_model
from studies.blocks.cases import BlockCase
from studies.blocks.condensation import condense, corner_flexibility
from studies.blocks.database import (
    MATERIALS,
    Database,
    base_materials,
    build,
    load_databases,
    look_up,
    save_databases,
)


@dataclass(frozen=True)
class Method:
    """A coarsening of blocks (n, 8)."""

    name: str
    """Unique among the methods of a table."""
    coarsen: Callable[[Array], Array]
    """What is timed: moduli (n, 8), or whatever else the method keeps of each block."""
    storage_bytes: int = 0
    """Kept beforehand."""
    training_seconds: float | None = 0.0
    """Spent beforehand; None if unknown."""
    flexibility: Callable[[Array], Array] | None = None
    """Coarse flexibility (n, 18, 18) for the errors, of methods without moduli."""
    clamped: bool = False
    """Whether blocks have moduli beyond the range that the method was made for."""

    def response(self, young: Array) -> Array:
        """What `block_error` wants: moduli (n, 8) or flexibilities (n, 18, 18)."""
        return (self.flexibility or self.coarsen)(young)


def methods_of(models: dict[str, Model]) -> list[Method]:
    """All coarsenings that hold for any range of moduli; `models` by the names of their files.

    The objectives fitted on the spot are the paper's, Chen's, and those that the models learned.

    Raises UserError, see `common_poisson`.
    """
    poisson = common_poisson(models)
    learned = (closed_form(model.objective) for model in models.values())
    objectives = dict.fromkeys(["energy", "chen2015", *learned])
    methods = [
        Method("average", average),
        Method("Galerkin", galerkin),
        Method(
            "static condensation",
            partial(condense, poisson=poisson),
            flexibility=partial(corner_flexibility, poisson=poisson),
        ),
        *(
            Method(f"{name}, fitted on the spot", partial(_fitted, name, poisson))
            for name in objectives
        ),
    ]
    for name, model in models.items():
        suffix = f" of {name}" if len(models) > 1 else ""
        label = f"{model.objective}, forests{suffix}"
        seconds = {**model.provenance, **model.scores}.get("training_seconds")
        training = None if seconds is None else float(seconds)
        methods.append(Method(label, partial(coarsen, model), model.nbytes, training))
    return methods


def _fitted(objective: str, poisson: float, young: Array) -> Array:
    return fit(objective, young, poisson).moduli


def databases_of(
    cases: Sequence[BlockCase],
    poisson: float,
    path: str | Path | None = None,
    materials: int = MATERIALS,
) -> dict[BlockCase, Database]:
    """A database made for each case that is not another one scaled.

    Raises UserError if the file has other databases, or cannot be written.

    Parameters
    ----------
    path
        File to read them from; if there is none, they are built and written to it.
    materials
        Base materials of each, void included.
    """
    bases = {
        case: base_materials(case.moduli, materials, case.void)
        for case in cases
        if case.scaled_by == 1.0
    }
    if path is not None and Path(path).exists():
        stored = load_databases(path)
        return {case: _stored(stored, base, poisson, path) for case, base in bases.items()}
    if path is not None:
        require_writable(path)
    # Compiled code fills them.  One bar for each of several at a time would be unreadable.
    threads = min(allowed_threads(), len(bases))

    def filled(case: BlockCase) -> Database:
        label = f"database of {case.name}"
        return build(bases[case], poisson, label=label, progress=threads == 1)

    made = in_parallel(filled, [(case,) for case in bases], threads)
    databases = dict(zip(bases, made, strict=True))
    if path is not None:
        save_databases(path, list(databases.values()))
    return databases


def _stored(
    databases: Sequence[Database], materials: Array, poisson: float, path: str | Path
) -> Database:
    for database in databases:
        if database.poisson == poisson and np.array_equal(database.materials, materials):
            return database
    low, high = materials[materials > 0.0][[0, -1]]
    raise UserError(
        f"{path}: has no database of {len(materials)} materials from {low:g} to {high:g} GPa for "
        f"Poisson's ratio {poisson:g}; name a file that does not exist yet, to be written"
    )


def database_methods(case: BlockCase, databases: dict[BlockCase, Database]) -> list[Method]:
    """The database made for the blocks of a case, and those made for a lower range of such blocks.

    The latter take moduli beyond their range for their stiffest material.
    """
    methods = []
    for other, database in databases.items():
        low, high = other.range_gpa
        name = f"Chen et al. 2015, database {low:g}..{high:g} GPa"
        clamped = other.alike(case) and high < case.range_gpa[1]
        if other == case or clamped:
            lookup, suffix = partial(look_up, database), ", clamped" if clamped else ""
            seconds, size = database.seconds, database.nbytes
            methods.append(Method(f"{name}{suffix}", lookup, size, seconds, clamped=clamped))
    return methods


def common_poisson(models: dict[str, Model]) -> float:
    """Poisson's ratio of all models.

    Raises UserError if there is no model, or they differ.
    """
    ratios = {name: model.poisson for name, model in models.items()}
    if not ratios:
        raise UserError("there are no forests to compare: name a model file with --model")
    if len(set(ratios.values())) > 1:
        listed = ", ".join(f"{name} has {value:g}" for name, value in ratios.items())
        raise UserError(f"forests of different Poisson's ratios ({listed}): make a table of each")
    return next(iter(ratios.values()))


def load_models(paths: Sequence[str] | None) -> dict[str, Model]:
    """Forests by file, or the default ones.

    Raises UserError if a file is not a model, or none is named and there are no default forests.
    """
    if not paths:
        paths = [str(default_path())]
    return {path: load_model(path) for path in dict.fromkeys(paths)}
