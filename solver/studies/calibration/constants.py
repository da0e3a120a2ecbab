"""The constants as one vector, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.fem.block import ALL_FILLED, least_patterns
from dataset_gen.objectives.calibration import Calibration, octant_orbits

Array = NDArray[np.float64]

FILLED, VOID, LUMPED = -3, -2, -1
"""Places of the two exponents and of the lumped share, after the logarithms of the factors."""


@dataclass(frozen=True)
class CalibrationConstants:
    """Logarithms of the factors, exponents of Galerkin in filled and partly void blocks, share."""

    vector: Array

    @classmethod
    def neutral(cls) -> CalibrationConstants:
        """Where the search starts: `factored` with a little of Galerkin and of lumped mass."""
        vector = np.zeros(octant_orbits()[1] + 3)
        vector[[FILLED, VOID, LUMPED]] = 0.3, 0.1, 0.2
        return cls(vector)

    @classmethod
    def of(cls, calibration: Calibration) -> CalibrationConstants:
        """The vector of a calibration."""
        numbers, count = octant_orbits()
        vector = np.zeros(count + 3)
        for mask in least_patterns():
            vector[numbers[mask]] = np.log(calibration.factors[mask])
        vector[[FILLED, VOID, LUMPED]] = (
            calibration.galerkin_filled,
            calibration.galerkin_void,
            calibration.lumped_share,
        )
        return cls(vector)

    @property
    def lumped_share(self) -> float:
        """Share of lumped mass in filled blocks."""
        return float(self.vector[LUMPED])

    def as_json(self) -> dict[str, Any]:
        """Content of the calibration's file, without provenance."""
        numbers, _ = octant_orbits()
        return {
            "factors": {
                str(mask): [round(float(f), 4) for f in np.exp(self.vector[numbers[mask]])]
                for mask in least_patterns()
            },
            "galerkin_share": {
                "filled": round(float(self.vector[FILLED]), 4),
                "partly_void": round(float(self.vector[VOID]), 4),
            },
            "lumped_share": round(self.lumped_share, 4),
        }


def filled_places() -> NDArray[np.int64]:
    """Places of the constants of blocks without void cells: factor, exponent and lumped share."""
    numbers, count = octant_orbits()
    return np.array([numbers[ALL_FILLED, 0], count + 3 + FILLED, count + 3 + LUMPED])
