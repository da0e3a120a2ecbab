"""Options of commands that search for a material."""

from __future__ import annotations

from typing import Annotated

from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import Count, Positive, Workers


@parameters
class SearchOptions:
    """What takes the place of settings of a project's optimiser; None leaves one as it is."""

    seconds: Positive | None = option(None, "wall time of a search, not the project's")
    evaluations: Count | None = option(
        None, "modal analyses of a search at most, not the project's"
    )
    method: Annotated[str, OneOf("hybrid", "cma", "bfgs")] | None = option(
        None, "not the project's"
    )
    workers: Workers | None = option(None, "processes, not the project's")
