"""Fields of plane waves on a surface at rest over a band, by boundary elements.

Each frequency takes seconds to minutes.  Without the wave's own phase fields are smooth over the
frequency, so that a spline between few of them is near, but for resonances of the air in a hollow
solid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from carillon.arrays import Array, Complex
from carillon.command_line.counts import counted
from carillon.command_line.progress import track
from carillon.files.cache import remembered
from carillon.files.datasets import read
from carillon.files.hdf5 import create_h5, open_h5
from sound.radiation.air import SOUND_SPEED
from sound.radiation.boundary_elements import BoundaryElements
from sound.radiation.boundary_mesh import BoundaryMesh
from sound.radiation.cache_entries import get_complex, key_of, put_complex

LEAST_STEP = 0.01
"""Distance of frequencies, over the frequency, that is divided no more."""
AGREED = 0.02
"""Relative difference of a field from its interpolation below which no more are needed there."""
_KIND, _SCHEMA = "fields", 1
_VERSION = 1  # counted up when other fields are found than before
"""Kind and schema of entries in the cache."""


@dataclass(frozen=True)
class SolvedWaves:
    """Fields (F, V) of plane waves from one direction at ascending frequencies (F,) [Hz], without
    the waves' own phases, so that they are smooth over the frequency."""

    mesh: BoundaryMesh
    direction: Array
    hertz: Array
    smooth: Complex

    @classmethod
    def of(cls, mesh: BoundaryMesh, direction: Array, first: Array, name: str) -> SolvedWaves:
        """Fields at the `first` frequencies, and between where they differ from interpolations.

        They are kept in the user's cache.  Raises UserError if bempp-cl is not installed.
        """
        constants = _VERSION, LEAST_STEP, AGREED
        key = key_of(constants, mesh.vertices, mesh.faces, direction, first)

        def found() -> tuple[Array, Complex]:
            elements = BoundaryElements(mesh)
            label = f"radiation of {name}, {counted(len(mesh.faces), 'triangle')}"

            def solve(hertz: Array) -> Complex:
                each = track(hertz, label, unit="frequencies")
                fields = [elements.field(float(frequency), direction) for frequency in each]
                return np.array(fields) / _phases(mesh, direction, hertz)

            return adapted(solve, first)

        return cls(mesh, direction, *remembered("fields", key, found, _read, _write))

    def at(self, hertz: Array) -> Complex:
        """Fields (N, V) at frequencies (N,) [Hz] between the solved ones."""
        smooth = CubicSpline(self.hertz, self.smooth)(hertz)
        return np.asarray(smooth * _phases(self.mesh, self.direction, hertz))


def _phases(mesh: BoundaryMesh, direction: Array, hertz: Array) -> Complex:
    numbers = 2.0 * np.pi * hertz[:, None] / SOUND_SPEED
    return np.asarray(np.exp(-1j * numbers * (mesh.vertices @ direction)))


def adapted(solve: Callable[[Array], Complex], first: Array) -> tuple[Array, Complex]:
    """Ascending frequencies (F,) [Hz], and what is solved for there (F, V), such that a spline
    between them is near it.

    It is solved in the middles of intervals, which are divided on where the spline was off.
    """
    hertz, values = first, solve(first)
    open_intervals = np.stack([first[:-1], first[1:]], axis=1)
    while len(open_intervals):
        middles = open_intervals.mean(axis=1)
        expected, actual = CubicSpline(hertz, values)(middles), solve(middles)
        off = np.linalg.norm(actual - expected, axis=1) / np.linalg.norm(actual, axis=1)
        order = np.argsort(np.concatenate([hertz, middles]), kind="stable")
        hertz = np.concatenate([hertz, middles])[order]
        values = np.concatenate([values, actual])[order]
        halves = [
            half
            for (low, high), middle, error in zip(open_intervals, middles, off)
            for half in ((low, middle), (middle, high))
            if error > AGREED and high - low > LEAST_STEP * low
        ]
        open_intervals = np.array(halves).reshape(-1, 2)
    return hertz, values


def _read(path: Path) -> tuple[Array, Complex]:
    with open_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        return read(file, "hertz", (None,)), get_complex(file)


def _write(path: Path, waves: tuple[Array, Complex]) -> None:
    with create_h5(path, _KIND, _SCHEMA, sealed=True) as file:
        file["hertz"], smooth = waves
        put_complex(file, smooth)
