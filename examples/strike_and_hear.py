"""Strike and hear: one bar of four materials, struck at its end.

Damping makes the material: Rayleigh's coefficients go with the name, and so into the sound.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

sounds = []
for name in ("steel", "glass", "wood", "plastic"):
    bar = ca.solve("builtin:bar", ca.Material.named(name), resolution=24, modes=40)
    end = bar.mesh.nodes[bar.mesh.nodes[:, 0].argmin()]
    sounds.append(ca.render(bar, end, seconds=1.0))
samples = np.concatenate(sounds)
ca.write_wav("strike_and_hear.wav", samples)

figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
with np.errstate(divide="ignore"):
    axes.specgram(samples, NFFT=1024, Fs=44_100, noverlap=512, vmin=-140)
axes.set(xlabel="time [s]", ylabel="frequency [Hz]", ylim=(0, 12_000))
figure.savefig("strike_and_hear.png", dpi=80)
