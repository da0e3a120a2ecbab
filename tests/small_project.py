"""A design problem that takes a second: a bar of few cells whose targets are its own sounds."""

from dataclasses import replace

import numpy as np
from numpy.polynomial import legendre

from sound.clips.targets import Targets
from sound.clips.wav import write_wav
from sound.design.preparation import prepare
from sound.project.project import project_of

RATE = 22_050
PROJECT = {
    "mesh": "builtin:bar",
    "resolution": 16,
    "coarsen": "none",
    "modes": 6,
    "targets": [
        {"name": "end", "at": [-0.12, 0.0, 0.03], "clip": "end.wav"},
        {"name": "side", "at": [0.04, 0.0225, 0.02], "clip": "side.wav"},
    ],
    "material": {"dimensions": 10},
    "weights": {"frequency": 1.0, "amplitude": 10.0},
    "optimiser": {"seconds": None, "evaluations": 120, "workers": 1},
}


def write_clips(folder, frequencies, amplitudes=None):
    """Clips of damped sinusoids, one for each target."""
    seconds = np.arange(0.25 * RATE) / RATE
    random = np.random.default_rng(0)
    for target in PROJECT["targets"]:
        loudness = random.uniform(0.3, 1.0, len(frequencies)) if amplitudes is None else amplitudes
        modes = np.exp(-20.0 * seconds) * np.sin(2 * np.pi * np.outer(frequencies, seconds))
        write_wav(folder / target["clip"], loudness @ modes, RATE, peak=True)


def project(folder, **changes):
    """The project, whose clips are there but say nothing; keys of `optimiser` may be changed."""
    for target in PROJECT["targets"]:
        (folder / target["clip"]).touch()
    made = project_of(PROJECT, folder)
    return replace(made, optimiser=replace(made.optimiser, **changes))


def with_options(problem, **changes):
    """The design problem with other options of its optimiser."""
    made = problem.project
    optimiser = replace(made.optimiser, **changes)
    return replace(problem, project=replace(made, optimiser=optimiser))


def smooth_fields(grid):
    """Nine smooth functions (m, 9) of the cells' places, of mean 0 and root mean square 1."""
    x, y, z = (2.0 * (grid - grid.mean(axis=0)) / np.ptp(grid, axis=0)).T
    fields = np.column_stack([legendre.legvander(x, 4)[:, 1:], y, z, x * y, x * z, y * z])
    fields -= fields.mean(axis=0)
    return fields / np.sqrt((fields**2).mean(axis=0))


def other_moduli(grid, seed=0):
    """Moduli (m,) of another material."""
    return np.exp(0.3 * smooth_fields(grid) @ np.random.default_rng(seed).normal(size=9))


def targets(made, seed=0, names=("end", "side")):
    """What the bar sounds like with another material.

    That is given by moduli, not coordinates: modes of the Laplacian come in pairs here, of which
    every processor finds others.
    """
    count = made.modes
    empty = Targets(
        ("end", "side"),
        np.linspace(400.0, 4000.0, count),
        np.full(count, 20.0),
        np.ones((2, count)),
        (np.zeros(1),) * 2,
        (RATE,) * 2,
    )
    setting = prepare(made, empty).setting
    moduli = other_moduli(setting.mesh.grid, seed)
    evaluation = setting.simulation().evaluate(setting.material.coordinates(moduli))
    frequencies = np.sqrt(evaluation.eigenvalues) / (2.0 * np.pi)
    chosen = [("end", "side").index(name) for name in names]
    return replace(
        empty,
        names=tuple(names),
        frequencies=0.5 * frequencies,
        amplitudes=np.abs(evaluation.pushed)[chosen],
        residuals=empty.residuals[: len(names)],
        rates=empty.rates[: len(names)],
    )
