"""A design of a small box, made without optimisation (test support)."""

from functools import cache

import numpy as np
import trimesh

from carillon.fem.model import RIGID_MODES
from solver import solve
from solver.coarsening.choice import make_coarsening
from solver.coarsening.model import build_model
from sound.clips.targets import Targets
from sound.project.design import HISTORY_TYPE, Design
from sound.strikes import Strike
from tests.solids import box_mesh

SIDES = (0.24, 0.16, 0.08)
N_MODES = 8
RATES = (44_100, 22_050)


@cache
def small_design() -> Design:
    """Box of 6 x 4 x 2 fine cells, 3 x 2 x 1 coarse ones, with two targets."""
    fine = box_mesh(6, 4, 2, 0.04)
    random = np.random.default_rng(7)
    young = 2e8 * 10.0 ** random.uniform(-0.5, 0.5, fine.n_cells)
    model = build_model(fine, young, make_coarsening("average"))
    result = solve(model, modes=RIGID_MODES + N_MODES, method="slepc")
    assert result.modes is not None
    surface = box_surface()
    return Design(
        [_strike("corner", surface, np.array(SIDES)), _strike("side", surface, np.zeros(3))],
        _targets(random, result.frequencies[RIGID_MODES:]),
        random.normal(size=5),
        young,
        model,
        result.eigenvalues,
        result.modes,
        np.array(surface.vertices),
        np.array(surface.faces),
        fine.grid,
        fine.origin,
        fine.edge,
        np.array([(0.1, 1, 5.0, 4.0, 0.1, 2.0), (0.9, 9, 1.0, 0.5, 0.05, 2.5)], HISTORY_TYPE),
        {"mesh": "builtin:box", "resolution": 6, "weights": [1.0, 10.0, 1e-5]},
        {"stopped": "by the test"},
    )


def box_surface() -> trimesh.Trimesh:
    """Surface of the box, its edges cut in four."""
    surface = trimesh.creation.box(SIDES).subdivide().subdivide()
    surface.apply_translation(np.array(SIDES) / 2.0)
    return surface


def _strike(name: str, surface: trimesh.Trimesh, near: np.ndarray) -> Strike:
    vertex = int(np.argmin(np.linalg.norm(surface.vertices - near, axis=1)))
    inward = -np.array(surface.vertex_normals[vertex])
    return Strike(name, vertex, np.array(surface.vertices[vertex]), inward)


def _targets(random: np.random.Generator, frequencies: np.ndarray) -> Targets:
    return Targets(
        ("corner", "side"),
        frequencies * random.uniform(0.99, 1.01, N_MODES),
        random.uniform(3.0, 30.0, N_MODES),
        random.uniform(0.01, 0.3, (2, N_MODES)),
        tuple(0.01 * random.normal(size=rate // 10) for rate in RATES),
        RATES,
    )
