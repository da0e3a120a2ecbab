"""Coarsening by regression forests: a file that is named, or those that come with the package."""

import hashlib
from pathlib import Path

import forests
from carillon.arrays import Array
from carillon.errors import UserError
from dataset_gen.objectives import lumped_share
from forests import default as default_forests
from solver.coarsening.anisotropic import general_objective
from solver.coarsening.coarsening import Coarsening

FOREST = "ddfem"
"""Name of coarsening by forests."""
DEFAULT = "default"
"""Name of the forests that come with the package."""
ROUNDING = 1e-12
"""Difference of Poisson's ratios that counts as none."""
_DIGITS = 16


class ForestCoarsening(Coarsening):
    """Forests and where they are from.

    Parameters
    ----------
    source
        File as it was named, or `DEFAULT`.
    sha256
        First digits of the file's SHA-256.
    """

    def __init__(self, source: str, model: forests.Model, sha256: str) -> None:
        super().__init__(FOREST, lumped_share(model.objective), general_objective(model.objective))
        self.source = source
        self.model = model
        self.sha256 = sha256

    def moduli(self, e: Array) -> Array:
        """See `Coarsening.moduli`."""
        return forests.coarsen(self.model, e)

    def moduli_with_derivatives(self, e: Array) -> tuple[Array, Array]:
        """See `forests.evaluate.coarsen_with_derivatives`."""
        return forests.coarsen_with_derivatives(self.model, e)

    def record(self) -> dict[str, str]:
        """The file, its checksum and the objective that its forests learned."""
        return {
            "forest": self.source,
            "forest_objective": self.model.objective,
            "forest_sha256": self.sha256,
        }


def load_forest(path: str | Path | None, *ratios: float) -> ForestCoarsening:
    """Forests of the file `path`, or the default ones, for a solid of these Poisson's ratios.

    Raises UserError if there are none, the file is not a model, or they are for other Poisson's
    ratios.
    """
    source = DEFAULT if path is None else str(path)
    file = default_forests.default_path() if path is None else Path(path)
    model = forests.load_model(file)
    least, largest = model.ratios
    for poisson in ratios:
        if not least - ROUNDING <= poisson <= largest + ROUNDING:
            raise UserError(_mismatch(path, least, largest, poisson))
    with open(file, "rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    return ForestCoarsening(source, model, digest[:_DIGITS])


def forest_or_reason(
    path: str | Path | None, *ratios: float
) -> tuple[ForestCoarsening | None, str]:
    """The same, or None and why there are no default forests for this solid, which is no error."""
    try:
        return load_forest(path, *ratios), ""
    except UserError as error:
        if path is not None:
            raise
        return None, f"without ddfem: {error}"


def _mismatch(path: str | Path | None, least: float, largest: float, expected: float) -> str:
    one = least == largest
    trained = f"ratio {least:g}" if one else f"ratios {least:g} to {largest:g}"
    if path is None:
        return (
            f"the default forests are for Poisson's {trained}, the model has {expected:g}; "
            f"train others (carillon generate --objective hybrid --poisson {expected:g}, then "
            "carillon train) and name them with --forest"
        )
    return (
        f"{path}: trained for Poisson's {trained}, the model has {expected:g}; train "
        "forests for it or pass --poisson"
    )
