"""Modes of a clip: the damped sinusoids that the recording of one strike holds.

The clip is made here, with noise, so that what is found can be compared with what went in.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

rate = 16_000
hertz = np.array([523.0, 1310.0, 1322.0, 2870.0])
dampings, amplitudes = np.array([6.0, 9.0, 10.0, 25.0]), np.array([0.4, 0.2, 0.2, 0.1])
seconds = np.arange(rate) / rate
waves = np.exp(-np.outer(dampings, seconds)) * np.sin(2 * np.pi * np.outer(hertz, seconds))
clip = amplitudes @ waves + 1e-3 * np.random.default_rng(0).standard_normal(rate)
sound = ca.extract(clip, rate)
print(*(f"{f:.2f} Hz, {d:.2f}/s" for f, d in zip(sound.frequencies, sound.dampings)), sep="\n")

figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.plot(hertz, dampings, "o", ms=12, mfc="none", label="in the clip")
axes.plot(sound.frequencies, sound.dampings, "x", label="extracted")
axes.set(xlabel="frequency [Hz]", ylabel="damping [1/s]")
axes.legend()
figure.savefig("modes_of_a_clip.png", dpi=80)
