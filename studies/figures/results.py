"""Where the results for the figures are kept."""

from __future__ import annotations

from studies.base.results import Results
from studies.figures.study import MEASURES


class Figures(Results):
    """The folder of the figures; solids whose mesh does not exist are left out."""

    section = "figures"
    measures = MEASURES
