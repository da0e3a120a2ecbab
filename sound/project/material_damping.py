"""How the material of a design damps its modes, in the file of the design."""

from __future__ import annotations

from dataclasses import dataclass

import h5py
import numpy as np
from numpy.typing import NDArray

from solver.files.model_group import put

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MaterialDamping:
    """Dampings that follow from loss factors of the material, not from clips.

    Attributes
    ----------
    loss_factors : (M,) [1]
        Of the fine cells.
    mass_per_second : float [1/s]
        What damps all modes alike, as air does; half of it is part of every damping.
    dampings : (N,) [1/s]
        d of the elastic modes, in the order of `Design.frequencies`.
    """

    loss_factors: Array
    mass_per_second: float
    dampings: Array


def put_damping(group: h5py.Group, damping: MaterialDamping) -> None:
    """Write it beside the fine cells."""
    put(group, "loss_factors", damping.loss_factors, "1", "loss factor of the fine cells")
    mass = np.array([damping.mass_per_second])
    put(group, "mass_per_second", mass, "1/s", "twice the damping that all modes have in common")
    put(group, "dampings", damping.dampings, "1/s", "of the elastic modes, by these two")


def get_damping(group: h5py.Group) -> MaterialDamping | None:
    """Read it; designs that were made before there was any have none."""
    if "loss_factors" not in group:
        return None
    mass = float(group["mass_per_second"][0])
    return MaterialDamping(group["loss_factors"][()], mass, group["dampings"][()])
