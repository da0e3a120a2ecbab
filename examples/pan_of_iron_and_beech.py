"""A pan of iron and beech: regions have materials by name, and a design tunes them to a chord.

It finds a factor on the moduli of iron and of beech, which is stiff along its grain and damps more.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

CHORD = np.array([400.0, 500.0, 1000.0, 1500.0])  # [Hz]
REGIONS = [
    ca.Region("pan", material="iron"),
    ca.Region("handle", material="beech", grain=(1, 0, 0), where="x > 0.12"),
]


def clip(rate=16_000):
    """A strike that rings in the chord."""
    seconds = np.arange(rate) / rate
    return 0.2 * np.exp(-8.0 * seconds) * np.sin(2.0 * np.pi * CHORD[:, None] * seconds).sum(0)


if __name__ == "__main__":
    ca.write_wav("chord.wav", clip(), 16_000)
    design = ca.design(
        mesh="builtin:frying-pan",
        resolution=24,
        regions=REGIONS,
        targets=[{"name": "rim", "at": [-0.1115, 0.0, 0.036], "clip": "chord.wav"}],
        modes=4,  # The lowest ones, a tone of the chord each.
        damping={"source": "material"},
        weights={"frequency": 1.0, "amplitude": 1.0},
        optimiser={"evaluations": 600, "seconds": None, "workers": 1},
    )
    ca.write_wav("pan_of_iron_and_beech.wav", design.render(target="rim"))
    plain = ca.solve("builtin:frying-pan", ca.Material(regions=REGIONS), resolution=24, modes=10)

    found = design.found
    centres = found.fine_origin + found.fine_edge * (found.fine_grid + 0.5)
    factors = design.young / found.model.regions.moduli(found.fine_region)
    figure, (top, axes) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
    order = np.argsort(centres[:, 2])
    seen = top.scatter(*centres[order, :2].T, c=np.log10(factors[order]), marker="s", s=50)
    figure.colorbar(seen, ax=top, label="log10 of the factor")
    top.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="from above")
    axes.plot(range(1, 5), plain.frequencies[6:10], "x", label="iron and beech")
    axes.plot(range(1, 5), design.frequencies, "o", label="designed")
    axes.plot(range(1, 5), design.target_frequencies, "k_", markersize=16, label="chord")
    axes.set(xlabel="mode", ylabel="frequency [Hz]", xticks=range(1, 5))
    axes.legend()
    figure.savefig("pan_of_iron_and_beech.png", dpi=80)
