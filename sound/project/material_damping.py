"""Dampings of a design's modes by its material, and their place in the design's file."""

from __future__ import annotations

from dataclasses import dataclass

import h5py
import numpy as np

from carillon.arrays import Array
from solver.files.model_group import put


@dataclass(frozen=True)
class MaterialDamping:
    """Dampings by loss factors of the material.

    Attributes
    ----------
    loss_factors : (M,) [1]
        Loss factors of the fine cells.
    mass_per_second : float [1/s]
        Coefficient of mass damping, as by air; half of it is part of every damping.
    dampings : (N,) [1/s]
        d of the elastic modes, in the order of `Design.frequencies`.
    """

    loss_factors: Array
    mass_per_second: float
    dampings: Array


def put_damping(group: h5py.Group, damping: MaterialDamping) -> None:
    """Write dampings beside the fine cells."""
    put(group, "loss_factors", damping.loss_factors, "1", "loss factor of the fine cells")
    mass = np.array([damping.mass_per_second])
    put(group, "mass_per_second", mass, "1/s", "twice the damping that all modes have in common")
    put(group, "dampings", damping.dampings, "1/s", "of the elastic modes, by these two")


def get_damping(group: h5py.Group) -> MaterialDamping | None:
    """Read dampings; None in an old design without them."""
    if "loss_factors" not in group:
        return None
    mass = float(group["mass_per_second"][0])
    return MaterialDamping(group["loss_factors"][()], mass, group["dampings"][()])
