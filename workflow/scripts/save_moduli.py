"""Write the moduli [Pa] of a design's voxels, in their order, as an array."""

import numpy as np

from carillon.files import atomic_path
from sound.project.design_file import read_design

with atomic_path(snakemake.output[0]) as temporary, open(temporary, "wb") as file:
    np.save(file, read_design(snakemake.input.design).young)
