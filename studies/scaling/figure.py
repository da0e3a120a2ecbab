"""The figure of wall times over ranks in pages."""

from __future__ import annotations

from matplotlib.figure import Figure

from studies.base.results import Results
from studies.base.style import SETTINGS
from studies.scaling import plot


def scaling_figure(results: Results, model: str) -> Figure:
    """Measured and modelled wall times over the number of ranks."""
    return plot.scaling_figure(results.read_json(f"models/{model}/scaling.json"), SETTINGS)
