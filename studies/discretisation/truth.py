"""Frequencies of the solid itself, by finite cells on a finer lattice, and how sure they are."""

from typing import Any

import numpy as np

from carillon.fem.model import RIGID_MODES
from studies.discretisation.methods import TimedSpectrum

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


def truth_between(cells: TimedSpectrum, finest: TimedSpectrum, left: float) -> dict[str, Any]:
    """Frequencies of a solid from finite cells on a lattice and on one `FINER` times as fine.

    The middle of what may be left of their difference, a share from 0 to `left`, is taken off.

    Returns plain values: `frequencies_hz` of the elastic modes; `doubt_rms` and `doubt_worst`, the
    relative errors that they may have; of the spectrum on the finer lattice `finest_hz`, `n_dofs`
    and `seconds`.

    Examples
    --------
    >>> rigid = [0.0] * 6
    >>> spectra = [TimedSpectrum(np.array([*rigid, f]), 0, {}) for f in (110.0, 100.0)]
    >>> truth = truth_between(*spectra, left=1.0)
    >>> truth["frequencies_hz"], truth["doubt_worst"]
    ([95.0], 0.05)
    """
    coarse, fine = cells.hertz[RIGID_MODES:], finest.hertz[RIGID_MODES:]
    off = 0.5 * left * (coarse - fine)
    doubt = np.abs(off) / fine
    return {
        "n_dofs": finest.n_dofs,
        "seconds": sum(finest.seconds.values()),
        "doubt_rms": float(np.sqrt(np.mean(doubt**2))),
        "doubt_worst": float(doubt.max()),
        "frequencies_hz": np.sort(fine - off).tolist(),
        "finest_hz": fine.tolist(),
    }
