"""Solver runs that consist of others, priced by the laws of these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from workflow.estimate.rates import Cost
from workflow.estimate.sizes import Size

TUNED = 6
"""Configurations of SLEPc that a tuned timing tries."""
WARM_UP_MODES = 20
"""Modes of the runs that compile and load everything before a timing."""
COARSE_RUNS = 3
"""Runs of HCMS + EC on the coarsened solid in every round of a timing."""


@dataclass(frozen=True)
class Composition:
    """Seconds on one core, without those of starting."""

    laws: Mapping[str, Cost]

    def seconds(self, method: str, unknowns: float, modes: float) -> float:
        """One run of a method, see `Rates.laws`."""
        return self.laws[method].seconds(unknowns, modes)

    def timing(self, size: Size, modes: int, part: Mapping[str, Any]) -> float:
        """`solver benchmark` with the runs that a part of the configuration asks for."""
        return (
            self._round(size, min(modes, WARM_UP_MODES))
            + self._slow(size, min(modes, WARM_UP_MODES), part)
            + part["runs"] * self._round(size, modes)
            + min(part["runs"], part["slow_runs"]) * self._slow(size, modes, part)
            + (TUNED * self.seconds("slepc", size.fine, modes) if part.get("tune") else 0.0)
            + 2.0 * self.seconds("slepc", size.coarse, modes)
        )

    def _round(self, size: Size, modes: int) -> float:
        fine = sum(self.seconds(name, size.fine, modes) for name in ("slepc", "hcms", "hcms_ec"))
        coarse = COARSE_RUNS * self.seconds("hcms_ec", size.coarse, modes)
        return fine + coarse + self.seconds("slepc", size.coarse, modes)

    def _slow(self, size: Size, modes: int, part: Mapping[str, Any]) -> float:
        """ARPACK, once more if it also runs without a factorisation."""
        runs = 2 if part.get("arpack_regular") else 1
        return runs * self.seconds("arpack", size.fine, modes)
