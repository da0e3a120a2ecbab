"""A study: how frequencies converge with the resolution, by voxels and by finite cells.

Voxels get the surface wrong by half a cell; finite cells integrate over what is inside.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

truth = ca.solve("builtin:bowl", resolution=24, modes=26, discretisation="finite-cell")
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
for way, resolutions in {"voxel": (12, 16, 24, 32), "finite-cell": (8, 12, 16)}.items():
    unknowns, errors = [], []
    for resolution in resolutions:
        solution = ca.solve("builtin:bowl", resolution=resolution, modes=26, discretisation=way)
        error = solution.frequencies[6:] / truth.frequencies[6:] - 1.0
        unknowns.append(solution.solid.n_dofs)
        errors.append(np.sqrt(np.mean(error**2)))
        print(f"{way}, {resolution}: {unknowns[-1]:,} unknowns, rms {errors[-1]:.2%}")
    axes.loglog(unknowns, errors, "o-", label=way)
axes.set(xlabel="unknowns", ylabel="frequency error, rms")
axes.legend()
figure.savefig("a_study.png", dpi=80)
