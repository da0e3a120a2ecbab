"""Regression forests that coarsen 2x2x2 blocks: training, HDF5 model, compiled evaluation."""

from typing import TYPE_CHECKING

from carillon import lazy_exports

if TYPE_CHECKING:
    from forests.evaluate import coarsen, coarsen_with_derivatives
    from forests.model import Model, load_model, save_model

__all__ = ["Model", "coarsen", "coarsen_with_derivatives", "load_model", "save_model"]

__getattr__ = lazy_exports.exports(
    __name__,
    {
        "coarsen": "evaluate",
        "coarsen_with_derivatives": "evaluate",
        "Model": "model",
        "load_model": "model",
        "save_model": "model",
    },
)
