"""Fits by whatever processor numba compiles for.

`python -m tests.fits_of_target FILE.npz OBJECTIVE...`
"""

import sys

import numpy as np

from carillon.numerics.simd_width import LANES
from dataset_gen.objectives import fit
from dataset_gen.objectives.compiled import PANEL
from dataset_gen.sampling import samples


def fits(*objectives):
    """Width, moduli of some samples by each objective, and those of every sample on its own."""
    young = samples(seed=7, start=0, stop=23)
    found = {"lanes": np.array(LANES), "panel": np.array(PANEL)}
    for objective in objectives:
        found[objective] = fit(objective, young).moduli
        alone = [fit(objective, block[None]).moduli[0] for block in young]
        found[f"{objective}, alone"] = np.array(alone)
    return found


if __name__ == "__main__":
    np.savez(sys.argv[1], **fits(*sys.argv[2:]))
