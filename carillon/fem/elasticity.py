"""Linear elasticity: the matrix between strain and stress, of isotropic and of other materials.

Strains are in the order of `carillon.fem.element.strain_displacement`: along x, y, z, then the
engineering shears xy, yz, zx.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from carillon.arrays import Array, frozen
from carillon.errors import UserError

DEFAULT_POISSON = 0.25
"""Poisson's ratio of all experiments in the paper (section 8.1)."""
AXES = "xyz"
SHEARS = ((0, 1), (1, 2), (2, 0))
"""Pairs of axes of the three shears, in their order."""
SYMMETRIC = 1e-6
"""Largest relative difference of an elasticity matrix and its transpose."""


def elasticity_matrix(poisson: float = DEFAULT_POISSON) -> Array:
    """Isotropic elasticity matrix (6, 6) for Young's modulus 1; engineering shear strains."""
    if not -1.0 < poisson < 0.5:
        raise ValueError(f"Poisson's ratio {poisson} is outside (-1, 0.5)")
    lame = poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    shear = 0.5 / (1.0 + poisson)
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = lame
    matrix[np.arange(3), np.arange(3)] += 2.0 * shear
    matrix[np.arange(3, 6), np.arange(3, 6)] = shear
    return matrix


@dataclass(frozen=True)
class Elasticity:
    """An elasticity for Young's modulus 1; of other materials for 1 in place of the `modulus`.

    Two are equal if their entries are.
    """

    entries: tuple[float, ...]
    """(36,) of the matrix, row by row."""
    poisson: float | None = None
    """Poisson's ratio of an isotropic one; None of others."""

    @classmethod
    @lru_cache(64)
    def isotropic(cls, poisson: float) -> Elasticity:
        """That of a Poisson's ratio.

        Examples
        --------
        >>> Elasticity.isotropic(0.0).matrix.diagonal().tolist()
        [1.0, 1.0, 1.0, 0.5, 0.5, 0.5]
        """
        return cls(tuple(elasticity_matrix(poisson).ravel().tolist()), poisson)

    @classmethod
    def of_matrix(cls, matrix: Array, modulus: float) -> Elasticity:
        """That of a matrix (6, 6) [Pa], over a modulus [Pa]."""
        return cls(tuple((matrix / modulus).ravel().tolist()))

    @property
    def matrix(self) -> Array:
        """(6, 6) stress by strain."""
        return frozen(np.array(self.entries).reshape(6, 6))

    def isotropic_equivalent(self) -> tuple[float, float]:
        """Young's modulus, over the modulus, and Poisson's ratio of a mixture of all directions.

        Means of the bounds by Voigt and Reuss (Hill 1952).
        """
        if self.poisson is not None:
            return 1.0, self.poisson
        matrix = self.matrix
        bulk, shear = _isotropic_part(matrix)
        inverse_bulk, inverse_shear = _isotropic_part(_tensor_compliance(matrix))
        bulk = 0.5 * (bulk + 1.0 / (9.0 * inverse_bulk))
        shear = 0.5 * (shear + 1.0 / (4.0 * inverse_shear))
        young = 9.0 * bulk * shear / (3.0 * bulk + shear)
        return young, young / (2.0 * shear) - 1.0

    def rotated(self, axes: Array) -> Elasticity:
        """The same material turned: what was along x, y, z is along the columns of `axes` (3, 3).

        That of an isotropic one is the same.
        """
        if self.poisson is not None:
            return self
        return Elasticity(tuple(rotated(self.matrix, axes).ravel().tolist()))


def _isotropic_part(matrix: Array) -> tuple[float, float]:
    """Bulk and shear modulus of the isotropic tensor nearest to one, (6, 6) by stiffness."""
    trace, bulk = float(matrix[:3, :3].sum()), float(matrix[:3, :3].sum()) / 9.0
    diagonal = float(matrix[:3, :3].trace() + 2.0 * matrix[3:, 3:].trace())
    return bulk, (diagonal - trace / 3.0) / 10.0


def _tensor_compliance(matrix: Array) -> Array:
    """Inverse (6, 6), its shears those of a tensor as in the matrix."""
    inverse = np.linalg.inv(matrix)
    inverse[:3, 3:] /= 2.0
    inverse[3:, :3] /= 2.0
    inverse[3:, 3:] /= 4.0
    return inverse


def orthotropic_matrix(young: Array, shear: Array, poisson: Array) -> Array:
    """Elasticity matrix (6, 6) [Pa] of three planes of symmetry, across x, y and z.

    Raises UserError if no material has these constants: the strain energy of some strain would be
    negative.

    Parameters
    ----------
    young
        (3,) Young's moduli [Pa] along x, y, z.
    shear
        (3,) shear moduli [Pa] of xy, yz, zx.
    poisson
        (3,) Poisson's ratios nu_xy, nu_yz, nu_zx: nu_ab is minus the strain along b over that along
        a under a stress along a.

    Examples
    --------
    >>> matrix = orthotropic_matrix(np.ones(3), np.full(3, 0.4), np.full(3, 0.25))
    >>> bool(np.allclose(matrix, elasticity_matrix(0.25)))
    True
    """
    young, shear, poisson = (np.asarray(each, dtype=float) for each in (young, shear, poisson))
    names = [f"E_{axis}" for axis in AXES] + [f"G_{AXES[a]}{AXES[b]}" for a, b in SHEARS]
    for name, value in zip(names, np.concatenate([young, shear]), strict=True):
        if not (np.isfinite(value) and value > 0.0):
            raise UserError(f"{name} is {value:g} Pa, expected a positive modulus")
    for (a, b), ratio in zip(SHEARS, poisson, strict=True):
        most = np.sqrt(young[a] / young[b])
        if not abs(ratio) < most:
            raise UserError(
                f"nu_{AXES[a]}{AXES[b]} is {ratio:g}; with E_{AXES[a]} = {young[a]:g} Pa and "
                f"E_{AXES[b]} = {young[b]:g} Pa it must lie between {-most:.4g} and {most:.4g}"
            )
    compliance = np.diag(1.0 / np.concatenate([young, shear]))
    for (a, b), ratio in zip(SHEARS, poisson, strict=True):
        compliance[a, b] = compliance[b, a] = -ratio / young[a]
    if np.linalg.eigvalsh(_scaled(compliance)).min() <= 0.0:
        xy, yz, zx = poisson
        product = float(xy * yz * zx)
        squares = sum(ratio**2 * young[b] / young[a] for (a, b), ratio in zip(SHEARS, poisson))
        raise UserError(
            f"Poisson's ratios {xy:g}, {yz:g}, {zx:g} together are those of no material: "
            "1 - (nu_xy^2 E_y/E_x + nu_yz^2 E_z/E_y + nu_zx^2 E_x/E_z) - 2 nu_xy nu_yz nu_zx is "
            f"{1.0 - squares - 2.0 * product:.3g}, expected more than 0"
        )
    matrix = np.linalg.inv(compliance)
    return np.asarray(0.5 * (matrix + matrix.T))


def require_elasticity(matrix: Array, source: str = "elasticity") -> Array:
    """A given elasticity matrix (6, 6) [Pa] as floats.

    Raises UserError if it is of another shape, not finite, not symmetric or not positive definite.
    """
    try:
        given = np.array(matrix, dtype=float)
    except (TypeError, ValueError):
        raise UserError(f"{source}: found {matrix!r:.60}, expected 6 rows of 6 numbers") from None
    if given.shape != (6, 6):
        raise UserError(f"{source}: an array of shape {given.shape}, expected (6, 6)")
    if not np.isfinite(given).all():
        raise UserError(f"{source}: some entries are not finite; expected moduli [Pa]")
    if not np.abs(given - given.T).max() <= SYMMETRIC * np.abs(given).max():
        row, column = np.unravel_index(np.abs(given - given.T).argmax(), (6, 6))
        raise UserError(
            f"{source}: is not symmetric: row {row + 1}, column {column + 1} is "
            f"{given[row, column]:g} and the other way round {given[column, row]:g}"
        )
    given = 0.5 * (given + given.T)
    least = np.linalg.eigvalsh(_scaled(given)).min() if (given.diagonal() > 0.0).all() else -1.0
    if least <= 0.0:
        raise UserError(
            f"{source}: is not positive definite, so some strain would set energy free; look at "
            "its signs and units [Pa]"
        )
    return given


def _scaled(matrix: Array) -> Array:
    """A symmetric matrix with ones on the diagonal, as definite as the matrix."""
    scale = 1.0 / np.sqrt(matrix.diagonal())
    return np.asarray(matrix * scale * scale[:, None])


def young_moduli(matrix: Array) -> Array:
    """Young's moduli (..., 3) along x, y, z of elasticity matrices (..., 6, 6), in their unit."""
    return np.asarray(1.0 / np.einsum("...ii->...i", np.linalg.inv(matrix))[..., :3])


def rotated(matrix: Array, axes: Array) -> Array:
    """Elasticity (6, 6) of a material turned so that its x, y, z are the columns of `axes` (3, 3).

    Bond's transformation (Bond 1943).

    Examples
    --------
    >>> stiff = orthotropic_matrix(np.array([10.0, 1.0, 1.0]), np.full(3, 0.5), np.zeros(3))
    >>> turned = rotated(stiff, np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    >>> young_moduli(turned).round(9).tolist()
    [1.0, 10.0, 1.0]
    """
    # Stress of the material's axes to those of space.
    turn = np.empty((6, 6))
    turn[:3, :3] = axes**2
    for column, (a, b) in enumerate(SHEARS, start=3):
        turn[:3, column] = 2.0 * axes[:, a] * axes[:, b]
    for row, (i, j) in enumerate(SHEARS, start=3):
        turn[row, :3] = axes[i] * axes[j]
        for column, (a, b) in enumerate(SHEARS, start=3):
            turn[row, column] = axes[i, a] * axes[j, b] + axes[i, b] * axes[j, a]
    result = turn @ matrix @ turn.T
    return np.asarray(0.5 * (result + result.T))


def axes_along(grain: Array, radial: Array | None = None, source: str = "grain") -> Array:
    """Axes (3, 3), in columns: along `grain` (3,), and of what is across it along `radial` (3,).

    Raises UserError for vectors of no length, or that are parallel. Without a radial direction the
    coordinate axis that is farthest from the grain takes its place.
    """
    first = np.asarray(grain, dtype=float)
    if first.shape != (3,) or not np.isfinite(first).all() or not np.linalg.norm(first) > 0.0:
        raise UserError(f"{source}: found {grain!r:.60}, expected a direction of three numbers")
    first = first / np.linalg.norm(first)
    second = np.eye(3)[np.abs(first).argmin()] if radial is None else np.asarray(radial, float)
    if second.shape != (3,) or not np.isfinite(second).all():
        raise UserError(f"{source}: found {radial!r:.60}, expected a direction of three numbers")
    across = second - (second @ first) * first
    if np.linalg.norm(across) <= 1e-6 * np.linalg.norm(second):
        raise UserError(
            f"{source}: radial {second.tolist()} is along the grain {first.tolist()}; expected "
            "another direction"
        )
    across = across / np.linalg.norm(across)
    return np.stack([first, across, np.cross(first, across)], axis=1)
