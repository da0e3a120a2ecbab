"""How near the frequencies of a coarse model shall be to those of the fine one."""

from __future__ import annotations

from typing import Annotated

from carillon.errors import UserError
from carillon.parameters import option, parameters
from carillon.parameters.quantities import between
from solver.coarsening.forest import FOREST

ALLOWED_ERROR = 0.05
"""Default of the expected error of frequencies down to which blocks are kept fine."""
ALLOWED_DISTANCE = 0.01
"""Default of the expected distance from the solid's frequencies down to which cells are divided."""


@parameters
class RefinementOptions:
    """Which error a coarse model, or one of finite cells, may have."""

    refine_to: Annotated[float, between(0.0, 10.0)] | None = option(
        None,
        "keep blocks fine, or divide finite cells, until the expected error of the frequencies of "
        "modes 7 to 60 is at most so large: its root mean square, and a third of the worst "
        f"(default {ALLOWED_ERROR:g} with --coarsen {FOREST}, {ALLOWED_DISTANCE:g} with "
        "--discretisation finite-cell; 0 refines nothing)",
        metavar="ERROR",
    )

    def tolerance(
        self, coarsen: str, discretisation: str = "voxel", estimated: bool = True
    ) -> float | None:
        """The allowed error; None if nothing is to be refined.

        Finite cells are refined by the estimate of their distance from the solid, and left as they
        are if that is not `estimated` and nothing was given.

        Raises
        ------
        UserError
            If it was given and there is nothing to refine.
        """
        if discretisation == "finite-cell":
            if self.refine_to is None:
                return ALLOWED_DISTANCE if estimated else None
            return self.refine_to or None
        if coarsen == "none":
            if self.refine_to is not None:
                raise UserError(
                    "--refine-to keeps blocks of a coarse mesh fine, and there is none: add "
                    f"--coarsen {FOREST} or --discretisation finite-cell, or leave it out"
                )
            return None
        if self.refine_to is None:
            return ALLOWED_ERROR if coarsen == FOREST else None
        return self.refine_to or None
