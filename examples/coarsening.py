"""Coarsening: an eighth of the elements, by forests, and what that costs in the frequencies.

Forests know how a block of eight voxels answers; averages of its moduli do not.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

solid = {"body": "builtin:bowl", "material": "smooth", "resolution": 32}
fine = ca.solve(**solid, modes=46)
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
for method in ("average", "galerkin", "ddfem"):
    coarse = ca.solve(ca.coarsen(**solid, method=method), modes=46)
    error = coarse.frequencies[6:] / fine.frequencies[6:] - 1.0
    print(f"{method}: rms {np.sqrt(np.mean(error**2)):.1%}, {coarse.solid.n_dofs:,} unknowns")
    axes.plot(range(7, 47), 100.0 * error, "o-", label=method)
axes.set(xlabel="mode", ylabel="frequency error [%]", title=f"{fine.solid.n_dofs:,} unknowns fine")
axes.legend()
figure.savefig("coarsening.png", dpi=80)
