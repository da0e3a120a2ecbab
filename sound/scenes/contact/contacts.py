"""Points of contact between bodies, recorded in every step of the simulation."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Integers

CHUNK = 1 << 16
"""Number of points that memory is allocated for at a time."""
_NUMBERS, _VALUES = 3, 26
_LEAST_INVERSE = 1e-12


@dataclass(frozen=True)
class ContactPoints:
    """c points of contact of two bodies each; but for places and own forces, all is in the scene.

    Attributes
    ----------
    steps, pairs : (c,), (c, 2)
        Number of the step, and of the bodies; the second may be `sound.scenes.performance.GROUND`.
    positions, normals : (c, 3) [m], (c, 3)
        Positions, and unit vectors from the second into the first body.
    forces, velocities : (c, 3) [N], (c, 3) [m/s]
        Forces on the first body, and velocities of its point relative to the second one's.
    places, own_forces : (c, 2, 3) [m], (c, 2, 3) [N]
        Positions in the own axes of each of the two bodies, and forces on it.
    turning, masses : (c,) [rad/s], (c,) [kg]
        Angular speeds of rolling, and effective masses for an impulse along the normal.
    """

    steps: Integers
    pairs: Integers
    positions: Array
    places: Array
    normals: Array
    forces: Array
    own_forces: Array
    velocities: Array
    turning: Array
    masses: Array

    def __getitem__(self, chosen: Integers | slice) -> ContactPoints:
        return ContactPoints(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def __len__(self) -> int:
        return len(self.steps)

    @property
    def pressures(self) -> Array:
        """Normal force (c,) [N] at each point."""
        return np.einsum("ci,ci->c", self.forces, self.normals)


class ContactLog:
    """Points of contact in the order of time; `ContactPoints` describes the values of each."""

    def __init__(self) -> None:
        self._full: list[tuple[NDArray[np.int64], Array]] = []
        self._new()

    def _new(self) -> None:
        self._numbers = np.empty((CHUNK, _NUMBERS), dtype=np.int64)
        self._values = np.empty((CHUNK, _VALUES))
        self._used = 0

    @property
    def count(self) -> int:
        """Number of points so far."""
        return sum(len(numbers) for numbers, _ in self._full) + self._used

    def take(self, step: int, addresses: NDArray[np.int32], *values: Any) -> None:
        """Add the points of a step, whose forces have `addresses` (n,) in MuJoCo's data.

        `values` are the other arguments of `_keep`, from `geoms` on.
        """
        if self._used + len(addresses) > CHUNK:
            self._full.append((self._numbers[: self._used], self._values[: self._used]))
            self._new()
        self._used = _keep(self._numbers, self._values, self._used, step, addresses, *values)

    def contacts(self) -> ContactPoints:
        """All points."""
        parts = [*self._full, (self._numbers[: self._used], self._values[: self._used])]
        numbers = np.concatenate([part[0] for part in parts])
        values = np.concatenate([part[1] for part in parts])
        columns = np.split(values, [3, 9, 12, 15, 21, 24, 25], axis=1)
        position, places, normal, force, own_forces, velocity, turning, inverse = columns
        return ContactPoints(
            numbers[:, 0],
            numbers[:, 1:],
            position,
            places.reshape(-1, 2, 3),
            normal,
            force,
            own_forces.reshape(-1, 2, 3),
            velocity,
            turning[:, 0],
            1.0 / np.maximum(inverse[:, 0], _LEAST_INVERSE),
        )


@numba.njit(cache=True, nogil=True)
def _keep(  # type: ignore[no-untyped-def]
    numbers,
    values,
    used,
    step,
    addresses,
    geoms,
    positions,
    frames,
    constraint_forces,
    centres,
    turns,
    velocities,
    owners,
    first_speed,
    inverse_mass,
    inverse_inertia,
):
    """Write the points that carry a force from row `used` on; returns the next free row.

    MuJoCo's normals point from the first to the second body; here they point into the first, which
    the ground, whose number is the lowest, never is.
    """
    for c in range(len(addresses)):
        address = addresses[c]
        if address < 0 or constraint_forces[address] <= 0.0:
            continue
        one, other = owners[geoms[c, 0]], owners[geoms[c, 1]]
        sign = 1.0
        if one > other:
            one, other, sign = other, one, -1.0
        # Now `other` is the first body, into which MuJoCo's normal points for sign 1.
        normal = sign * frames[c, 0:3]
        force = sign * (
            constraint_forces[address] * frames[c, 0:3]
            + constraint_forces[address + 1] * frames[c, 3:6]
            + constraint_forces[address + 2] * frames[c, 6:9]
        )
        position = positions[c]
        row = values[used]
        row[:] = 0.0
        row[0:3] = position
        row[9:12] = normal
        row[12:15] = force
        rolling = np.zeros(3)
        for side in range(2):
            body = other if side == 0 else one
            if body < 0:
                continue
            turn = turns[body + 1]
            arm = position - centres[body + 1]
            toward = 1.0 if side == 0 else -1.0
            row[3 + 3 * side : 6 + 3 * side] = _turned_back(turn, arm)
            row[15 + 3 * side : 18 + 3 * side] = _turned_back(turn, toward * force)
            lever = _turned_back(turn, _cross(arm, normal))
            inverse = inverse_mass[body]
            for i in range(3):
                for j in range(3):
                    inverse += lever[i] * inverse_inertia[body, i, j] * lever[j]
            row[25] += inverse
            first = first_speed[body]
            if first >= 0:
                spin = _turned(turn, velocities[first + 3 : first + 6])
                row[21:24] += toward * (velocities[first : first + 3] + _cross(spin, arm))
                rolling += toward * spin
        rolling -= (rolling * normal).sum() * normal
        row[24] = np.sqrt((rolling * rolling).sum())
        numbers[used, 0] = step
        numbers[used, 1] = other
        numbers[used, 2] = one
        used += 1
    return used


@numba.njit(cache=True, nogil=True)
def _turned_back(turn, vector):  # type: ignore[no-untyped-def]
    """Components in a body's own axes of a vector of the scene."""
    own = np.zeros(3)
    for i in range(3):
        for j in range(3):
            own[i] += turn[3 * j + i] * vector[j]
    return own


@numba.njit(cache=True, nogil=True)
def _turned(turn, vector):  # type: ignore[no-untyped-def]
    """Components in the scene's axes of a vector in a body's own axes."""
    seen = np.zeros(3)
    for i in range(3):
        for j in range(3):
            seen[i] += turn[3 * i + j] * vector[j]
    return seen


@numba.njit(cache=True, nogil=True)
def _cross(a, b):  # type: ignore[no-untyped-def]
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
