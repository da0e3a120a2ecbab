"""Design from a clip: find a material that makes a bar sound as a recording does.

A bar of one material has other ratios between its partials; stiffness that varies tunes them.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

PARTIALS = np.array([500.0, 625.0, 1000.0, 1500.0])  # [Hz], those of no uniform bar


def clip(rate=16_000):
    """A strike with these partials."""
    seconds = np.arange(rate) / rate
    return 0.2 * np.exp(-8.0 * seconds) * np.sin(2.0 * np.pi * PARTIALS[:, None] * seconds).sum(0)


if __name__ == "__main__":
    ca.write_wav("clip.wav", clip(), 16_000)
    target = {"name": "end", "vertex": 0, "clip": "clip.wav"}
    settings = {"evaluations": 400, "workers": 1}
    design = ca.design(mesh="builtin:bar", resolution=20, targets=[target], optimiser=settings)
    ca.write_wav("design_from_a_clip.wav", design.render(target="end"))
    heard = ~np.isnan(design.target_frequencies)  # Other modes of the bar shall stay silent.
    print("clip", design.target_frequencies[heard].round(1))
    print("bar", design.frequencies[heard].round(1), design.verdict)

    figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
    axes.semilogy(design.found.history["seconds"], design.found.history["cost"])
    axes.set(xlabel="time [s]", ylabel="cost", title="search for a material")
    figure.savefig("design_from_a_clip.png", dpi=80)
