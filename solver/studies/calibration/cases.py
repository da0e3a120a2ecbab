"""Solids with their exact frequencies, and spectra of their blocks.

No MPI here: worker processes import this module.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh

from carillon.fem.block import ALL_FILLED, degrees_of_freedom
from carillon.fem.element import quadrature_stiffness
from carillon.fem.geometry import HexMesh, blocks_from_mesh, hexmesh_from_grid
from carillon.fem.model import RIGID_MODES, ElasticModel
from carillon.files import create_h5, open_h5
from dataset_gen.objectives import fit, orientations
from dataset_gen.objectives.calibrated import contrast_logs
from dataset_gen.objectives.calibration import octant_orbits
from solver.assembly.sparse import assembled
from solver.coarsening.model import block_moduli, coarse_model
from solver.studies.calibration.constants import FILLED, LUMPED, VOID, CalibrationConstants

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

KIND = "calibration case"
SCHEMA = 2

SHIFT = -0.05
"""Of the inverse iteration, in units of the lowest elastic eigenvalue."""

TOLERANCE = 1e-8
"""Of the eigenvalues, far below what the coarse mesh misses."""


class Logs(NamedTuple):
    """Logarithms (mc, 8) of coarse moduli that do not depend on the constants.

    base : of a block of one material times the contrast of `oversampled`.
    slope : what Galerkin's contrast adds.
    """

    base: Array
    slope: Array


@dataclass(frozen=True)
class SpectrumCase:
    """A coarse mesh, the moduli of its blocks, and the frequencies it ought to have.

    Attributes
    ----------
    name
        Of the shape and of the material, with a colon between.
    fine, young
        Fine mesh and its moduli (m,) [Pa].
    model
        Coarse model; its moduli are placeholders.
    blocks : (mc, 8)
        Fine moduli [Pa] of its elements, 0 where void.
    exact : (k,)
        Elastic angular frequencies [rad/s] of the fine model.
    """

    name: str
    fine: HexMesh
    young: Array
    model: ElasticModel
    blocks: Array
    exact: Array

    @classmethod
    def of_solid(cls, name: str, fine: HexMesh, young: Array, exact: Array) -> SpectrumCase:
        """Case of a fine mesh with moduli (m,) [Pa]."""
        blocks = blocks_from_mesh(fine)
        e = block_moduli(blocks, young)
        return cls(name, fine, young, coarse_model(blocks, np.ones_like(e)), e, exact)

    @cached_property
    def dofs(self) -> Integers:
        """Degrees of freedom (mc, 24) of the elements."""
        return degrees_of_freedom(self.model.mesh.cells.astype(np.int64))

    @cached_property
    def filled(self) -> NDArray[np.bool_]:
        """Which blocks (mc,) have no void cell."""
        return np.asarray(self.model.fill == ALL_FILLED)

    @cached_property
    def orbits(self) -> Integers:
        """Number (mc, 8) of the factor of every quadrature point."""
        images, turns = orientations()
        numbers, _ = octant_orbits()
        fill = self.model.fill
        return np.take_along_axis(numbers[images[fill]], turns[fill], axis=1)

    @cached_property
    def logs(self) -> Logs:
        """See `Logs` and `dataset_gen.objectives.calibrated`."""
        one = (self.blocks > 0.0).astype(float)
        poisson = self.model.poisson
        held, held_one = (fit("oversampled", e, poisson).moduli for e in (self.blocks, one))
        unit = fit("hybrid", one, poisson).moduli
        ours, projected = contrast_logs(self.blocks, held, one, held_one)
        return Logs(np.log(unit) + ours, projected - ours)

    @cached_property
    def lumping(self) -> Array:
        """What lumping adds to the consistent nodal mass (mc, 8, 8); zero in partly void blocks."""
        return replace(self.model, lumped_share=1.0).nodal_mass() - self.model.nodal_mass()

    def moduli(self, constants: CalibrationConstants) -> Array:
        """Coarse moduli (mc, 8) [Pa]."""
        vector, logs = constants.vector, self.logs
        exponent = np.where(self.filled, vector[FILLED], vector[VOID])[:, None]
        return np.asarray(np.exp(logs.base + vector[self.orbits] + exponent * logs.slope))

    def modes(self, constants: CalibrationConstants) -> tuple[Array, Array]:
        """Elastic eigenvalues (k,) and modes (n, k) of the coarse model, as many as are exact."""
        young, share = self.moduli(constants), constants.lumped_share
        stiffness, mass = assembled(replace(self.model, young=young, lumped_share=share))
        count = RIGID_MODES + len(self.exact)
        values, vectors = eigsh(
            stiffness,
            count,
            mass,
            sigma=SHIFT * self.exact[0] ** 2,
            v0=np.random.default_rng(0).standard_normal(self.model.n_dofs),
            ncv=min(self.model.n_dofs - 1, 2 * count),
            tol=TOLERANCE,
        )
        order = np.argsort(values)[RIGID_MODES:]
        return values[order], vectors[:, order]

    def errors(self, constants: CalibrationConstants) -> Array:
        """`log(coarse / exact)` (k,) of the frequencies."""
        return self._logs_of(self.modes(constants)[0])

    def _logs_of(self, values: Array) -> Array:
        return np.asarray(0.5 * np.log(np.maximum(values, 1e-6 * self.exact**2) / self.exact**2))

    def linearised(self, constants: CalibrationConstants) -> tuple[Array, Array]:
        """Errors (k,) and their derivatives (k, constants).

        `d log omega / d log E_q` is the share of strain energy at the quadrature point, and the
        mass acts through minus the kinetic energy.
        """
        values, vectors = self.modes(constants)
        shares = self._strain_energy(self.moduli(constants), values, vectors)
        sloped = (shares * self.logs.slope).sum(axis=2)
        columns = np.zeros((len(values), len(constants.vector)))
        flat = self.orbits.ravel()
        for mode, share in enumerate(shares.reshape(len(values), -1)):
            columns[mode] = np.bincount(flat, share, minlength=columns.shape[1])
        columns[:, FILLED] = sloped[:, self.filled].sum(axis=1)
        columns[:, VOID] = sloped[:, ~self.filled].sum(axis=1)
        motions = vectors[self.dofs].reshape(len(self.blocks), 8, -1)
        kinetic = (motions * (self.lumping @ motions)).reshape(-1, 3, len(values))
        columns[:, LUMPED] = -0.5 * kinetic.sum(axis=(0, 1))
        return self._logs_of(values), columns

    def _strain_energy(self, moduli: Array, values: Array, vectors: Array) -> Array:
        """Half the share (k, mc, 8) of each quadrature point in the modes' strain energy."""
        motions = vectors[self.dofs]
        shares = np.empty((len(values), *moduli.shape))
        for point, kernel in enumerate(quadrature_stiffness(self.model.poisson)):
            energy = (motions * (kernel @ motions)).sum(axis=1) * moduli[:, point, None]
            shares[:, :, point] = (0.5 * self.model.mesh.edge * energy / values).T
        return shares


def write_case(path: Path, case: SpectrumCase) -> None:
    """Write a case atomically."""
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        file.attrs["name"] = case.name
        file.attrs["cell_edge"] = case.fine.edge
        file["grid"] = case.fine.grid
        for name, unit in (("young", "Pa"), ("exact", "rad/s")):
            file.create_dataset(name, data=getattr(case, name), fletcher32=True)
            file[name].attrs["units"] = unit


def read_case(path: Path) -> SpectrumCase:
    """Read a case.

    Raises
    ------
    UserError
        If the file is missing, damaged or of another schema.
    """
    with open_h5(path, KIND, SCHEMA, sealed=True) as file:
        grid, edge = file["grid"][()], float(file.attrs["cell_edge"])
        young, exact, name = file["young"][()], file["exact"][()], str(file.attrs["name"])
    fine = hexmesh_from_grid(grid, np.zeros(3), edge)
    return SpectrumCase.of_solid(name, fine, young, exact)
