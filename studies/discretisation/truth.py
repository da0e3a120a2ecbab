"""Frequencies of the solid itself, by finite cells on a finer lattice, and how sure they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.fem.model import RIGID_MODES
from studies.discretisation.methods import TimedSpectrum

Array = NDArray[np.float64]

FINER = 2
"""Voxels of the truth's lattice along the edge of one that a material is given by."""
LEFT = 1.0
"""Largest share of the difference between finite cells on the lattice and on the finer one that is
left on the finer one: as much as the difference, if errors fall with the first power of the spacing
or faster. They do so where edges point inwards."""
LEFT_OF_NOISE = 0.75
"""The same where moduli jump from voxel to voxel. A cell on the finer lattice is one voxel, one on
the other joins eight; on a bell of 12 voxels with `noise` the share was 0.3 in the median mode, by
lattices of two and four times as many."""


@dataclass(frozen=True)
class SolidTruth:
    """Frequencies of a solid.

    Attributes
    ----------
    hertz : (k,)
        Of the elastic modes [Hz].
    doubt : (k,)
        Relative error that each may have.
    finest
        The spectrum on the finer lattice.
    """

    hertz: Array
    doubt: Array
    finest: TimedSpectrum

    @classmethod
    def between(cls, cells: TimedSpectrum, finest: TimedSpectrum, left: float) -> SolidTruth:
        """From finite cells on a lattice and on one `FINER` times as fine.

        The middle of what may be left of their difference, a share from 0 to `left`, is taken off.

        Examples
        --------
        >>> rigid = [0.0] * 6
        >>> spectra = [TimedSpectrum(np.array([*rigid, f]), 0, {}) for f in (110.0, 100.0)]
        >>> truth = SolidTruth.between(*spectra, left=1.0)
        >>> float(truth.hertz[0]), float(truth.doubt[0])
        (95.0, 0.05)
        """
        coarse, fine = cells.hertz[RIGID_MODES:], finest.hertz[RIGID_MODES:]
        off = 0.5 * left * (coarse - fine)
        return cls(np.sort(fine - off), np.abs(off) / fine, finest)

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "n_dofs": self.finest.n_dofs,
            "seconds": sum(self.finest.seconds.values()),
            "doubt_rms": float(np.sqrt(np.mean(self.doubt**2))),
            "doubt_worst": float(self.doubt.max()),
            "frequencies_hz": self.hertz.tolist(),
            "finest_hz": self.finest.hertz[RIGID_MODES:].tolist(),
        }
