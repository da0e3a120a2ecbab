"""A scene: marbles fall on tuned bars, heard where the listener stands.

Scenes have a command of their own; they are described in a file, or built in, as this one is.
"""

import subprocess
import sys

import matplotlib.pyplot as plt
import numpy as np
from scipy.io import wavfile

carillon = [sys.executable, "-m", "carillon"]
words = ["scene", "builtin:bars", "--notes", "C6 E6 G6", "--out", "a_scene.wav"]
subprocess.run([*carillon, *words], check=True)

rate, ears = wavfile.read("a_scene.wav")
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
with np.errstate(divide="ignore"):
    axes.specgram(ears[:, 0], NFFT=2048, Fs=rate, noverlap=1024, vmin=-140)
axes.set(xlabel="time [s]", ylabel="frequency [Hz]", ylim=(0, 8_000))
figure.savefig("a_scene.png", dpi=80)
