"""Figure of measured and modelled wall times over the number of ranks."""

from __future__ import annotations

from matplotlib.figure import Figure

from solver.studies.scaling import plot
from workflow.studies.base.results import Results
from workflow.studies.base.style import SETTINGS


def scaling_figure(results: Results, model: str) -> Figure:
    """Wall times of a solid over ranks."""
    return plot.scaling_figure(results.read_json(f"models/{model}/scaling.json"), SETTINGS)
