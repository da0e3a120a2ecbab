"""A melody: bars of five lengths, cut from one mesh, each struck when its note comes.

`ca.load_mesh` scales by its unit, and a uniform scale lowers all frequencies alike.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

material = ca.Material.named("aluminium")
NOTES = {"C": 1, "D": 9 / 8, "E": 5 / 4, "G": 3 / 2, "A": 5 / 3}
BEAT, TUNE = 0.3, "C D E G A G E D C"
bars = {
    name: ca.solve(ca.load_mesh("builtin:bar", 0.5 / ratio), material, resolution=20, modes=24)
    for name, ratio in NOTES.items()
}
samples = np.zeros(round((BEAT * len(TUNE.split()) + 1.5) * 44_100))
for number, name in enumerate(TUNE.split()):
    middle = bars[name].mesh.nodes.mean(axis=0)
    top = middle + [0.0, 0.0, 0.5 * np.ptp(bars[name].mesh.nodes[:, 2])]
    note = ca.render(bars[name], top, seconds=1.5, damping=(6.0, 1e-8))
    begin = round(BEAT * number * 44_100)
    samples[begin : begin + len(note)] += 0.3 * note
ca.write_wav("melody.wav", samples)

figure, axes = plt.subplots(figsize=(6, 2.5), layout="constrained")
with np.errstate(divide="ignore"):
    axes.specgram(samples, NFFT=4096, Fs=44_100, noverlap=3072, vmin=-140)
axes.set(xlabel="time [s]", ylabel="frequency [Hz]", ylim=(0, 8_000), title=TUNE)
figure.savefig("melody.png", dpi=80)
