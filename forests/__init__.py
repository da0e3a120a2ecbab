"""Regression forests that coarsen 2x2x2 blocks: training, HDF5 model, compiled evaluation."""

import carillon
from forests.evaluate import coarsen, coarsen_with_derivatives
from forests.model import Model, load_model, save_model

__all__ = ["Model", "coarsen", "coarsen_with_derivatives", "load_model", "save_model"]
