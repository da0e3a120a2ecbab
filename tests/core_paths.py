"""Runs the main paths of one machine in the present folder, in one process (test support).

It is started where mpi4py, petsc4py and slepc4py are hidden; the last line is `done`.
"""

import sys
from importlib import import_module

import numpy as np

import carillon as ca
from carillon.__main__ import main

SOLID = ("builtin:bar", "--resolution", "8", "--material", "two-region", "--modes", "12")
COMMANDS = (
    ("environment",),
    ("modes", *SOLID, "--tolerance", "1e-10", "--check-inertia", "--out", "auto.h5"),
    ("modes", *SOLID, "--method", "hcms", "--tolerance", "1e-10", "--out", "hcms.h5"),
    ("modes", *SOLID, "--method", "arpack", "--out", "truth.h5"),
    ("modes", *SOLID, "--coarsen", "ddfem", "--out", "ddfem.h5"),
    ("modes", *SOLID[:2], "6", "--discretisation", "finite-cell", "--modes", "9", "--out", "c.h5"),
    ("compare", "hcms.h5", "truth.h5"),
    ("audit", "truth.h5"),
    ("inspect-forests",),
    ("generate", "--samples", "64", "--out", "shard.h5"),
    ("train", "shard.h5", "--trees", "1", "--workers", "1", "--out", "forests.h5"),
)
CLUSTER = ("mpi4py", "petsc4py", "slepc4py")


def run() -> None:
    """Commands, then what Python offers; the studio's processes and its server are loaded."""
    for words in COMMANDS:
        assert main(words) == 0, words
    times = np.arange(4000) / 8000
    clip = 0.3 * np.exp(-6 * times) * (np.sin(4400 * times) + np.sin(8200 * times))
    ca.write_wav("clip.wav", clip, 8000)
    target = {"name": "end", "vertex": 0, "clip": "clip.wav"}
    ca.design(
        mesh="builtin:bar",
        resolution=16,
        coarsen="none",
        targets=[target],
        optimiser={"evaluations": 4, "workers": 2},
    )
    for module in ("studio.server.serve", "studio.session.studio", "studio.processes.solid"):
        import_module(module)
    for module in ("sound.scenes.solved", "forests.training.ranks", "studio.commands.scene"):
        import_module(module)
    assert not set(CLUSTER) & set(sys.modules)
    print("done")


if __name__ == "__main__":
    run()
