"""Options of commands that search for a material."""

from __future__ import annotations

from dataclasses import dataclass

from carillon.command_line.arguments import number_of_workers, positive_number, whole_number
from carillon.command_line.options import option


@dataclass(frozen=True)
class SearchOptions:
    """What takes the place of settings of a project's optimiser; None leaves one as it is."""

    seconds: float | None = option(
        None, "wall time of a search, not the project's", type=positive_number
    )
    evaluations: int | None = option(
        None, "modal analyses of a search at most, not the project's", type=whole_number(1)
    )
    method: str | None = option(None, "not the project's", choices=("hybrid", "cma", "bfgs"))
    workers: int | None = option(None, "processes, not the project's", type=number_of_workers)
