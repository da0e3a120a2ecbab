"""Reduced material: Young's modulus Y = Phi z over modes of the volumetric Laplacian."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.element import elasticity_matrix
from carillon.fem.geometry import HexMesh
from carillon.fem.laplacian import laplacian_modes
from carillon.fem.moduli import require_moduli
from carillon.fem.regions import Regions
from sound.design.constants import NOTHING, FreeConstants

LAWS = ("linear", "exponential")
"""Laws from the field Phi z to moduli, see `ReducedMaterial`."""
KNEE = 0.1
"""Factor below which the linear law bends to stay positive.

Regression forests distinguish moduli in a block over about four decades; a far lower knee would
only make cells without stiffness.
"""
REACH = np.log(100.0)
"""Natural logarithm of the largest factor of the exponential law."""
FIRST, SECOND = 0.0, 0.4
"""Poisson's ratios of the two elasticity matrices whose combinations are all others."""


@dataclass(frozen=True)
class ReducedMaterial:
    """Moduli of the cells as a function of reduced coordinates z (section 6, [XLCB15]).

    Each is a factor times the modulus Y0 of the cell's region. `linear` is Y / Y0 = g(x) with x = 1
    + Phi z, where g(x) = x above the knee k and k exp(x / k - 1) below it: the paper's Y = Phi z,
    continued smoothly to stay positive. `exponential` is Y / Y0 = exp(r tanh(Phi z / r)) with r =
    `REACH`, about exp(Phi z), for moduli that differ by decades.

    Neither frequencies relative to the first one nor balances of amplitudes depend on a factor
    common to all moduli, so the constant part is not among the coordinates: z = 0 is the material
    as it is, of the moduli `young` [Pa], one or (M,). Where supports give the solid a scale of its
    own, the `level` of all moduli is a coordinate, too, the last of these.

    Phi is `basis` (M, m), the modes of the Laplacian without the constant one, of root mean square
    1, and `laplacian` (m,) their eigenvalues, the diagonal of Q in Eq. (4).  Some constants of the
    regions may be `free`, functions of the last coordinates.  Moduli do not depend on these: their
    columns of the basis and their eigenvalues are 0.
    """

    basis: Array
    laplacian: Array
    young: float | Array
    law: str
    free: FreeConstants = NOTHING
    level: bool = False

    @classmethod
    def of_mesh(
        cls,
        mesh: HexMesh,
        dimensions: int,
        young: float | Array,
        law: str,
        free: FreeConstants = NOTHING,
        level: bool = False,
    ) -> ReducedMaterial:
        """Reduction of the moduli of a mesh to `dimensions` coordinates, and those of level and
        constants.

        Raises UserError if the mesh has too few cells, the law is unknown or the modulus out of
        range.
        """
        if law not in LAWS:
            raise UserError(f"material law {law!r} is unknown, expected one of {', '.join(LAWS)}")
        if not 1 <= dimensions < mesh.n_cells:
            raise UserError(
                f"{dimensions} material coordinates for {mesh.n_cells:,} voxels; expected at least "
                "1 and fewer than voxels"
            )
        require_moduli(np.full(mesh.n_cells, young), mesh.n_cells, "material to start from")
        values, modes = laplacian_modes(mesh, dimensions + 1)
        basis = np.sqrt(mesh.n_cells) * modes[:, 1:]
        values = np.maximum(values[1:], 0.0)
        if level:
            basis = np.column_stack([basis, np.ones(mesh.n_cells)])
        basis = np.pad(basis, ((0, 0), (0, len(free))))
        values = np.pad(values, (0, basis.shape[1] - len(values)))
        return cls(np.ascontiguousarray(basis), values, young, law, free, level)

    @property
    def dimensions(self) -> int:
        """Number of coordinates."""
        return self.basis.shape[1]

    def moduli(self, z: Array) -> Array:
        """Moduli (M,) [Pa] of the cells."""
        field = self.basis @ z
        if self.law == "exponential":
            return np.asarray(self.young * np.exp(REACH * np.tanh(field / REACH)))
        x = 1.0 + field
        bent = KNEE * np.exp(np.minimum(x, KNEE) / KNEE - 1.0)
        return np.asarray(self.young * np.where(x > KNEE, x, bent))

    @property
    def moving(self) -> int:
        """Number of coordinates that moduli depend on, the first ones."""
        return self.dimensions - len(self.free)

    def regions(self, z: Array, table: Regions) -> Regions:
        """The materials of a table with the constants that z chooses."""
        return self.free.regions(z[self.moving :], table)

    def coordinates(self, moduli: Array, regions: Regions | None = None) -> Array:
        """Coordinates (m,) whose moduli are nearest to a multiple of `moduli` (M,) [Pa].

        With a level they are nearest to these themselves. Free constants are those of `regions`.
        """
        factor = moduli if np.ndim(self.young) == 0 and not self.level else moduli / self.young
        if self.law == "exponential":
            level = np.log(factor)
            level = level if self.level else level - level.mean()
            reach = 0.999 * REACH
            field = REACH * np.arctanh(np.clip(level, -reach, reach) / REACH)
        else:
            field = (factor if self.level else factor / factor.mean()) - 1.0
        z = np.linalg.lstsq(self.basis, field, rcond=None)[0]
        if len(self.free) and regions is not None:
            z[self.moving :] = self.free.coordinates(regions)
        return np.asarray(z)

    def slopes(self, moduli: Array) -> Array:
        """Derivatives (M,) [Pa] of `moduli` (M,) with respect to Phi z."""
        if self.law == "exponential":
            level = np.log(moduli / self.young) / REACH
            return np.asarray(moduli * (1.0 - level**2))
        return np.asarray(self.young * np.minimum(1.0, moduli / (KNEE * self.young)))

    def regulariser(self, z: Array) -> float:
        """R = 1/2 z^T Q z of Eq. (4)."""
        return float(0.5 * z @ (self.laplacian * z))


def elasticity_slope(poisson: float) -> tuple[float, float]:
    """Weights of the elasticity at `FIRST` and `SECOND` in its derivative by Poisson's ratio.

    Elasticity is linear in the two Lame parameters, so any two span it, exactly.

    Examples
    --------
    >>> step, weights = 1e-6, elasticity_slope(0.3)
    >>> by_weights = sum(w * elasticity_matrix(v) for w, v in zip(weights, (FIRST, SECOND)))
    >>> difference = elasticity_matrix(0.3 + step) - elasticity_matrix(0.3 - step)
    >>> bool(np.allclose(by_weights, difference / (2.0 * step)))
    True
    """
    spread, denominator = 1.0 + poisson, (1.0 + poisson) * (1.0 - 2.0 * poisson)
    slopes = [(1.0 + 2.0 * poisson**2) / denominator**2, -0.5 / spread**2]
    matrices = elasticity_matrix(FIRST), elasticity_matrix(SECOND)
    # The first Lame parameter is off the diagonal, the second one at its end.
    lame = np.array([[matrix[0, 1], matrix[3, 3]] for matrix in matrices]).T
    first, second = np.linalg.solve(lame, slopes)
    return float(first), float(second)
