"""Your own objective: a bar whose second partial is an octave and a fourth above the first.

Any function of a solution can be minimised; here scipy varies the stiffness of the bar's middle.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize_scalar

bar = ca.load_mesh("builtin:bar").hexahedra(32)
place = np.abs(bar.origin[0] + bar.edge * (bar.grid[:, 0] + 0.5) - bar.nodes[:, 0].mean())
middle = np.exp(-((place / (0.2 * np.ptp(bar.nodes[:, 0]))) ** 2))
tried = {}


def miss(decades):
    """Distance of f2 / f1 of the bending modes in a plane from 8 / 3."""
    young = 10e9 * 10.0 ** (decades * middle)
    solution = ca.solve(bar, young, modes=16)
    flat = np.abs(solution.shapes[6:, :, 2]).sum(axis=1) > np.abs(solution.shapes[6:, :, 1]).sum(1)
    first, second = solution.frequencies[6:][flat][:2]
    tried[decades] = second / first
    return (second / first - 8.0 / 3.0) ** 2


best = minimize_scalar(miss, bounds=(-2.0, 0.0), method="bounded", options={"xatol": 1e-3})
print(f"the middle is {10.0**-best.x:.1f} times as soft: f2 / f1 = {tried[best.x]:.4f}")
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.plot(*zip(*sorted(tried.items())), "o-")
axes.axhline(8.0 / 3.0, color="black", lw=0.8)
axes.set(xlabel="stiffness of the middle [decades]", ylabel="f2 / f1")
figure.savefig("own_objective.png", dpi=80)
