"""Export a design: for game engines, Faust, browsers, and its moduli for analyses on finer meshes.

The picture shows the stiffness that the search gave the bar.
"""

from pathlib import Path

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

if __name__ == "__main__":
    seconds = np.arange(8000) / 8000
    partials = np.sin(2.0 * np.pi * np.outer([600.0, 1500.0, 2300.0], seconds)).sum(axis=0)
    ca.write_wav("clip.wav", 0.2 * np.exp(-8.0 * seconds) * partials, 8000)
    target = {"name": "end", "vertex": 0, "clip": "clip.wav"}
    settings = {"evaluations": 100, "workers": 1}
    design = ca.design(mesh="builtin:bar", resolution=20, targets=[target], optimiser=settings)
    for name in ("bar.glb", "bar.dsp", "bar.js", "bar.csv", "bar.npy", "bar.h5"):
        design.export(name)
        print(f"{name}: {Path(name).stat().st_size:,} bytes")

    found = design.found
    x, y, z = (found.fine_origin + found.fine_edge * (found.fine_grid + 0.5)).T
    figure = plt.figure(figsize=(5, 3), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    axes.set_box_aspect(np.ptp([x, y, z], axis=1))
    points = axes.scatter(x, y, z, c=design.young / 1e9, marker="s", s=40)
    figure.colorbar(points, label="Young's modulus [GPa]")
    figure.savefig("export_a_design.png", dpi=80)
