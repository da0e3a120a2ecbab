"""A pan of two materials: a steel pan with a wooden handle, against one all of steel.

A material is a number, a name, an array, or a function of the voxels' centres, as here.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

pan = ca.load_mesh("builtin:frying-pan")
handle = pan.vertices[:, 0].max() - 0.45 * pan.extents[0]


def steel_and_wood(centres):
    """Young's modulus [Pa] of voxels by their centres (m, 3) [m]."""
    return np.where(centres[:, 0] < handle, 200e9, 11e9)


figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
for name, young in {"steel": 200e9, "steel and wood": steel_and_wood}.items():
    solution = ca.solve(pan, ca.Material(young, density=7850.0), resolution=24, modes=36)
    axes.plot(range(7, 37), solution.frequencies[6:], "o", label=name)
axes.set(xlabel="mode", ylabel="frequency [Hz]", yscale="log")
axes.legend()
figure.savefig("pan_of_two_materials.png", dpi=80)
