"""The coarsenings of Fig. 9 under one interface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from carillon.errors import UserError
from dataset_gen.element import Array
from dataset_gen.objectives import fit
from forests import model as forest_model
from forests.baselines import average, galerkin
from forests.condensation import condense, corner_flexibility
from forests.evaluate import coarsen
from forests.model import Model


@dataclass(frozen=True)
class Method:
    """A coarsening of blocks (n, 8).

    Attributes
    ----------
    name : unique among the methods of a table.
    coarsen : what is timed: moduli (n, 8), or whatever else the method keeps of each block.
    storage_bytes : kept beforehand.
    training_seconds : spent beforehand; None if unknown.
    flexibility : coarse flexibility (n, 18, 18) for the errors, of methods without moduli.
    homogeneous : whether moduli scaled by a factor are coarsened to moduli scaled by it.
    """

    name: str
    coarsen: Callable[[Array], Array]
    storage_bytes: int = 0
    training_seconds: float | None = 0.0
    flexibility: Callable[[Array], Array] | None = None
    homogeneous: bool = True

    def response(self, young: Array) -> Array:
        """What `forests.block_error` wants: moduli (n, 8) or flexibilities (n, 18, 18)."""
        return (self.flexibility or self.coarsen)(young)


def direct_fit(objective: str, poisson: float) -> Method:
    """The fit of an objective to every block on the spot."""

    def moduli(young: Array) -> Array:
        return fit(objective, young, poisson).moduli

    return Method(f"{objective}, fitted on the spot", moduli)


def static_condensation(poisson: float) -> Method:
    """Condensation to the corners, with a dense stiffness for every block."""

    def stiffness(young: Array) -> Array:
        return condense(young, poisson)

    def flexibility(young: Array) -> Array:
        return corner_flexibility(young, poisson)

    return Method("static condensation", stiffness, flexibility=flexibility)


def trained(name: str, model: Model) -> Method:
    """Regression forests."""

    def moduli(young: Array) -> Array:
        return coarsen(model, young)

    seconds = {**model.provenance, **model.scores}.get("training_seconds")
    return Method(name, moduli, model.nbytes, None if seconds is None else float(seconds))


def methods_of(models: dict[str, Model]) -> list[Method]:
    """All coarsenings that hold for any range of moduli; `models` by the names of their files.

    The objectives fitted on the spot are the paper's, Chen's, and those that the models learned.

    Raises
    ------
    UserError
        See `common_poisson`.
    """
    poisson = common_poisson(models)
    objectives = dict.fromkeys(["energy", "chen2015", *(m.objective for m in models.values())])
    found = [
        Method("average", average),
        Method("Galerkin", galerkin),
        static_condensation(poisson),
        *(direct_fit(objective, poisson) for objective in objectives),
    ]
    for name, model in models.items():
        suffix = f" of {name}" if len(models) > 1 else ""
        found.append(trained(f"{model.objective}, forests{suffix}", model))
    return found


def common_poisson(models: dict[str, Model]) -> float:
    """Poisson's ratio of all models.

    Raises
    ------
    UserError
        If there is no model, or they differ.
    """
    found = {name: model.poisson for name, model in models.items()}
    if not found:
        raise UserError("there are no forests to compare: name a model file with --model")
    if len(set(found.values())) > 1:
        listed = ", ".join(f"{name} has {value:g}" for name, value in found.items())
        raise UserError(f"forests of different Poisson's ratios ({listed}): make a table of each")
    return next(iter(found.values()))


def load_models(paths: Sequence[str] | None) -> dict[str, Model]:
    """Forests by file, or the default ones.

    Raises
    ------
    UserError
        If a file is not a model, or none is named and there are no default forests.
    """
    if not paths:
        default = getattr(forest_model, "default_path", None)
        if default is None:
            raise UserError("there are no default forests: name a model file with --model")
        paths = [str(default())]
    return {path: forest_model.load_model(path) for path in dict.fromkeys(paths)}
