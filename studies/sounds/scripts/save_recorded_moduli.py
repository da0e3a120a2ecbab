"""Write the moduli [Pa] of the voxels of a solid whose strikes are clips, in their order."""

import numpy as np

from carillon.files.atomic import atomic_path
from solver.analysis.problem import ProblemOptions, build_problem
from studies.sounds.examples import Recording

example = snakemake.params.example
mesh = build_problem(ProblemOptions(example["mesh"], example["resolution"])).fine
centres = mesh.origin + mesh.edge * (mesh.grid + 0.5)
with atomic_path(snakemake.output[0]) as temporary, open(temporary, "wb") as file:
    np.save(file, Recording(**example["recorded"]).moduli(centres))
