"""Train forests: draw random blocks, fit a coarse element to each, learn from them.

Fifteen hundred samples are far from enough; a cluster makes millions by the same functions.
"""

import carillon as ca
import matplotlib.pyplot as plt
import numpy as np

if __name__ == "__main__":
    ca.generate("blocks.h5", samples=1500, seed=1)
    small = ca.train(["blocks.h5"], "forests.h5", trees=2, min_leaf=20)
    print({name: round(score, 4) for name, score in small.scores.items()})
    blocks = 10.0 ** np.random.default_rng(2).uniform(-1.0, 1.0, (300, 8))  # [GPa]
    figure, axes = plt.subplots(figsize=(4, 4), layout="constrained")
    large = ca.Forests.load()
    axes.loglog(large.coarsen(blocks).ravel(), small.coarsen(blocks).ravel(), ".", ms=2)
    axes.axline((1.0, 1.0), (2.0, 2.0), color="black", lw=0.8)
    axes.set(xlabel="forests that come along [GPa]", ylabel="these [GPa]")
    figure.savefig("train_forests.png", dpi=80)
