"""The forests that a coarsening uses: a file that is named, or those that come with the package."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

from carillon.errors import UserError
from forests import Model, load_model
from forests import model as forest_model

FOREST = "ddfem"
"""What coarsening by forests is called among the objectives."""

DEFAULT = "default"
"""Name of the forests that come with the package."""

_DIGITS = 16


class Trained(NamedTuple):
    """Forests and where they are from.

    Attributes
    ----------
    name : file as it was named, or `DEFAULT`.
    sha256 : first digits of the file's SHA-256.
    """

    name: str
    model: Model
    sha256: str

    def record(self) -> dict[str, str]:
        """Plain values that tell which forests these are."""
        return {
            "forest": self.name,
            "forest_objective": self.model.objective,
            "forest_sha256": self.sha256,
        }


def load_trained(path: str | Path | None, poisson: float) -> Trained:
    """Forests of the file `path`, or the default ones, for a solid of this Poisson's ratio.

    Raises
    ------
    UserError
        If there are none, the file is not a model, or they are for another Poisson's ratio.
    """
    name = DEFAULT if path is None else str(path)
    file = forest_model.default_path() if path is None else Path(path)
    model = load_model(file)
    if abs(model.poisson - poisson) > 1e-12:
        raise UserError(_mismatch(path, model.poisson, poisson))
    with open(file, "rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    return Trained(name, model, digest[:_DIGITS])


def trained_or_reason(path: str | Path | None, poisson: float) -> Trained | str:
    """The same, or why there are no default forests for this solid, which is no error."""
    try:
        return load_trained(path, poisson)
    except UserError as error:
        if path is not None:
            raise
        return f"without ddfem: {error}"


def _mismatch(path: str | Path | None, trained: float, wanted: float) -> str:
    if path is None:
        return (
            f"the default forests are for Poisson's ratio {trained:g}, the model has {wanted:g}; "
            f"train others (python -m dataset_gen generate --poisson {wanted:g}, then python -m "
            "forests train) and name them with --forest"
        )
    return (
        f"{path}: trained for Poisson's ratio {trained:g}, the model has {wanted:g}; train forests "
        "for it or pass --poisson"
    )
