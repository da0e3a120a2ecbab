"""Points of a surface where a solid is struck or watched."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from solver.files.modes_file import ModesFile
from solver.response.points import motion_at
from solver.response.surface import Surface, surface_of

RULING_MODES = 6
"""Number of the lowest elastic modes, which decide where a solid is struck."""
FAR = 0.5
"""Least distance from the strike that counts as far, as a share of the largest on the surface."""


@dataclass(frozen=True)
class Contact:
    """A point of the surface."""

    position: Array
    """(3,) [m]: where it is."""
    inward: Array
    """(3,) unit vector into the solid."""


def choose_contacts(
    truth: ModesFile, strike: Sequence[float] | None = None, observed: Sequence[float] | None = None
) -> list[Contact]:
    """Three points on the surface: where it is struck, where it is watched, and one far from both.

    Raises UserError if a position is away from the surface.

    Parameters
    ----------
    truth
        The modes that choose: it is struck where the lowest ones give way most to a push along the
        normal, and watched where, far from there, it then moves most.
    strike, observed
        Positions (3,) [m] that a person wants instead, see `solver.response.surface.Surface.place`.
    """
    surface = surface_of(truth.model)
    motion, eigenvalues = _ruling_modes(truth, surface)
    along = np.einsum("sik,si->sk", motion, surface.outward)
    first = int(np.argmax((along**2 / eigenvalues).sum(axis=1)))
    struck = _contact(surface, first, strike, "strike")
    if strike is not None:
        first = surface.nearest(struck.position, "strike")
    away = np.linalg.norm(surface.points - struck.position, axis=1)
    swing = ((motion**2).sum(axis=1) * (along[first] ** 2 / eigenvalues)).sum(axis=1)
    second = int(np.argmax(np.where(away >= FAR * away.max(), swing, -1.0)))
    watched = _contact(surface, second, observed, "observed")
    from_watched = np.linalg.norm(surface.points - watched.position, axis=1)
    third = int(np.argmax(np.minimum(away, from_watched)))
    return [struck, watched, _contact(surface, third)]


def _contact(
    surface: Surface, index: int, requested: Sequence[float] | None = None, what: str = ""
) -> Contact:
    """The point of the surface with this number, or the one that a person wants."""
    if requested is not None:
        return Contact(*surface.place(np.asarray(requested, dtype=float), what))
    return Contact(surface.points[index], -surface.outward[index])


def _ruling_modes(truth: ModesFile, surface: Surface) -> tuple[Array, Array]:
    """Their motion (s, 3, k) at the points of the surface, and eigenvalues (k,)."""
    assert truth.modes is not None
    rigid = truth.model.rigid_modes
    chosen = slice(rigid, rigid + RULING_MODES)
    modes = np.ascontiguousarray(truth.modes[:, chosen])
    if surface.nodes is None:
        motion = motion_at(truth.model, modes, surface.points)
    else:
        motion = modes.reshape(truth.model.n_nodes, 3, -1)[surface.nodes]
    return motion, truth.eigenvalues[chosen]
