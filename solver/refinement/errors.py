"""Errors that frequencies are expected to have."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.model import RIGID_MODES
from carillon.notebook.card import card, html_or_text
from carillon.notebook.chart import Axis, range_of, stems
from carillon.parameters import option, parameters
from carillon.parameters.quantities import between
from solver.coarsening.forest import FOREST

LAST = 60
"""Number of the last mode whose error is estimated."""
FROM_FINE, FROM_SOLID = "expected_frequency_error", "solid_frequency_error"
"""Prefixes of the attributes with errors against the fine voxels and against the solid."""
WORST = 3.0
"""Largest error of a frequency, as a multiple of their allowed root mean square."""
ALLOWED_ERROR = 0.05
"""Default of the expected error of frequencies down to which blocks are kept fine."""
ALLOWED_DISTANCE = 0.01
"""Default of the expected distance from the solid's frequencies down to which cells are divided."""
FINE_BLOCKS, DIVIDED_CELLS = "fine_blocks", "divided_cells"
"""Attributes that count what was refined: blocks that stay fine, and cells that are divided."""


@dataclass(frozen=True)
class ExpectedErrors:
    """Expected relative errors (k,) of the frequencies of elastic modes, up to mode `LAST` at most.

    Examples
    --------
    >>> expected = ExpectedErrors(np.array([0.3, -0.4]))
    >>> round(expected.rms, 3), expected.worst, expected.worst_mode, expected.last
    (0.354, -0.4, 8, 8)
    """

    errors: Array
    rigid: int = RIGID_MODES
    """Number of rigid modes, before the elastic ones."""

    def __repr__(self) -> str:
        return f"<ExpectedErrors {in_words(self.attributes(''), '')}>"

    def _repr_html_(self) -> str:
        return html_or_text(self, self._html)

    def _html(self) -> str:
        numbers = self.rigid + 1.0 + np.arange(len(self.errors))
        errors = 100.0 * self.errors
        low, high = range_of([0.0, *errors])
        y = Axis("expected error [%]", low, high)
        chart = stems(Axis("mode", self.rigid, self.last), y, numbers, errors)
        return card("Expected errors", [in_words(self.attributes(""), "")], chart)

    @property
    def rms(self) -> float:
        """Root mean square of the errors."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def worst(self) -> float:
        """Error of largest magnitude, with its sign."""
        return float(self.errors[np.abs(self.errors).argmax()])

    @property
    def worst_mode(self) -> int:
        """Number of the mode that has it, from 1."""
        return self.rigid + 1 + int(np.abs(self.errors).argmax())

    @property
    def last(self) -> int:
        """Number of the last mode."""
        return self.rigid + len(self.errors)

    def excess(self, tolerance: float) -> float:
        """How many times as large as allowed the errors are: their rms, or a third of the worst."""
        return max(self.rms, abs(self.worst) / WORST) / tolerance

    def attributes(self, prefix: str) -> dict[str, Any]:
        """Plain values for a file, under names with this beginning; see `in_words`."""
        return {
            f"{prefix}_rms": self.rms,
            f"{prefix}_worst": self.worst,
            f"{prefix}_worst_mode": self.worst_mode,
            f"{prefix}_modes": [self.rigid + 1, self.last],
        }


@dataclass(frozen=True)
class RefinementStep:
    """A model that was tried.

    It has so many `refined` of `FINE_BLOCKS` or `DIVIDED_CELLS`, which are `counted`.
    """

    unknowns: int
    counted: str
    refined: int
    errors: ExpectedErrors


def in_words(attributes: dict[str, Any], prefix: str) -> str:
    """A sentence's end about errors that a file's attributes tell."""
    first, last = attributes[f"{prefix}_modes"]
    rms, worst = attributes[f"{prefix}_rms"], attributes[f"{prefix}_worst"]
    return (
        f"of frequencies {first} to {last}: {_percent(rms)} rms, worst "
        f"{'+' if worst >= 0.0 else '-'}{_percent(abs(worst))} "
        f"(mode {attributes[f'{prefix}_worst_mode']})"
    )


def _percent(share: float) -> str:
    """A share in percent with two digits that count, or one after the point.

    Examples
    --------
    >>> [_percent(share) for share in (0.1234, 0.0123, 0.00123, 0.000123, 0.0)]
    ['12.3%', '1.2%', '0.12%', '0.012%', '0.0%']
    """
    percent = 100.0 * share
    digits = 1 if percent >= 1.0 or percent < 1e-6 else int(1 - np.floor(np.log10(percent)))
    return f"{percent:.{digits}f}%"


@parameters
class RefinementOptions:
    """Which error a coarse model, or one of finite cells, may have."""

    refine_to: Annotated[float, between(0.0, 10.0)] | None = option(
        None,
        "keep blocks fine, or divide finite cells, until the expected error of the frequencies of "
        "modes 7 to 60 is at most so large: its root mean square, and a third of the worst "
        f"(default {ALLOWED_ERROR:g} with --coarsen {FOREST}; that of --accuracy, or "
        f"{ALLOWED_DISTANCE:g}, with --discretisation finite-cell; 0 refines nothing)",
        metavar="ERROR",
    )

    def tolerance(
        self,
        coarsen: str,
        discretisation: str = "voxel",
        estimated: bool = True,
        accuracy: float | None = None,
    ) -> float | None:
        """The allowed error; None if nothing is to be refined.

        Finite cells are refined by the estimate of their distance from the solid, down to the
        `accuracy` if one is asked for, and left as they are if the distance is not `estimated` and
        nothing was given. Raises UserError if it was given and there is nothing to refine.
        """
        if discretisation == "finite-cell":
            if self.refine_to is None:
                return (accuracy or ALLOWED_DISTANCE) if estimated else None
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
