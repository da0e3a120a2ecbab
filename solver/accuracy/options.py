"""How near the frequencies shall be to those of the solid."""

from __future__ import annotations

from typing import Annotated

from carillon.errors import UserError
from carillon.parameters import option, parameters
from carillon.parameters.quantities import between
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions

FIRST_RESOLUTION = 16
"""First resolution of a search for an accurate one."""


@parameters
class DistanceOptions:
    """Which distance from the solid's frequencies is asked for, and whether it is estimated."""

    accuracy: Annotated[float, between(1e-05, 1.0)] | None = option(
        None,
        "raise the resolution until frequencies are expected to be so near to the solid's: the "
        "root mean square of the relative errors, and a third of the worst "
        f"(from --resolution, or {FIRST_RESOLUTION})",
        metavar="ERROR",
    )
    estimate: bool | None = option(
        None,
        "estimate how far frequencies are from the solid's; voxels are compared with finite cells "
        "(default: unless a mesh is coarsened, or for slepc and arpack)",
    )

    def is_estimated(self, solid: ProblemOptions, solver: SolverOptions) -> bool:
        """Whether the distance from the solid is estimated.

        Raises
        ------
        UserError
            If it is not to be, and an accuracy is asked for.
        """
        if self.accuracy is not None:
            if self.estimate is False:
                raise UserError("--accuracy goes by the estimate: leave out --no-estimate")
            return True
        if self.estimate is not None:
            return self.estimate
        return solid.coarsen == "none" and not solver.is_general
