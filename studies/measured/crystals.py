"""Elasticity matrices of crystals from their named constants."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from carillon.arrays import Array

VOIGT = {1: 0, 2: 1, 3: 2, 4: 4, 5: 5, 6: 3}
"""Rows of the order xx, yy, zz, xy, yz, zx by Voigt's numbers, of which 4 is yz and 6 is xy."""
AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Axes of each row."""
NONE = 1e-9
"""Constants, relative to c11, that count as none."""

SYMMETRIES: dict[str, dict[str, tuple[str, ...]]] = {
    "isotropic": {"c11": ("c22", "c33"), "c44": ("c55", "c66")},
    "cubic": {"c11": ("c22", "c33"), "c12": ("c13", "c23"), "c44": ("c55", "c66")},
    "hexagonal": {"c11": ("c22",), "c33": (), "c12": (), "c13": ("c23",), "c44": ("c55",)},
    "tetragonal": {
        "c11": ("c22",),
        "c33": (),
        "c12": (),
        "c13": ("c23",),
        "c44": ("c55",),
        "c66": (),
        "c16": (),
    },
    "orthotropic": {f"c{pair}": () for pair in (11, 22, 33, 12, 13, 23, 44, 55, 66)},
}
"""Constants that a symmetry has, each with those that are equal to it."""


def elasticity(symmetry: str, constants: Mapping[str, float]) -> Array:
    """Elasticity (6, 6) [Pa] along the crystal's axes, engineering shear strains.

    Rows are xx, yy, zz, xy, yz, zx. Raises ValueError if constants are missing or unknown, or the
    matrix is not positive definite.

    Examples
    --------
    >>> elasticity("cubic", {"c11": 3.0, "c12": 1.0, "c44": 2.0}).diagonal().tolist()
    [3.0, 3.0, 3.0, 2.0, 2.0, 2.0]
    """
    equal = SYMMETRIES[symmetry]
    if constants.keys() != equal.keys():
        found, expected = (", ".join(each) for each in (constants, equal))
        raise ValueError(f"found {found} of a {symmetry} solid, expected {expected}")
    named = {other: constants[name] for name in equal for other in (name, *equal[name])}
    if symmetry == "isotropic":
        named |= dict.fromkeys(("c12", "c13", "c23"), named["c11"] - 2.0 * named["c44"])
    if symmetry == "hexagonal":
        named["c66"] = 0.5 * (named["c11"] - named["c12"])
    if symmetry == "tetragonal":
        named["c26"] = -named["c16"]
    matrix = np.zeros((6, 6))
    for name, value in named.items():
        row, column = (VOIGT[int(digit)] for digit in name[1:])
        matrix[row, column] = matrix[column, row] = value
    if np.linalg.eigvalsh(matrix)[0] <= 0.0:
        raise ValueError("found constants of a solid that some strain would set free")
    return matrix


def turned(matrix: Array, degrees: Sequence[float]) -> Array:
    """Elasticity (6, 6) of a crystal that is turned by a vector (3,) of degrees about its axis.

    Examples
    --------
    >>> cubic = elasticity("cubic", {"c11": 3.0, "c12": 1.0, "c44": 2.0})
    >>> bool(np.allclose(turned(cubic, (0.0, 90.0, 0.0)), cubic))
    True
    >>> turned(cubic, (0.0, 0.0, 45.0))[0, 0].round(6).item()
    4.0
    """
    turn = Rotation.from_rotvec(degrees, degrees=True).as_matrix()
    tensor = np.empty((3, 3, 3, 3))
    for row, (a, b) in enumerate(AXES):
        for column, (c, d) in enumerate(AXES):
            for i, j in {(a, b), (b, a)}:
                tensor[i, j, c, d] = tensor[i, j, d, c] = matrix[row, column]
    tensor = np.einsum("ia,jb,kc,ld,abcd->ijkl", *[turn] * 4, tensor)
    return np.array([[tensor[*first, *second] for second in AXES] for first in AXES])


def grain(matrix: Array, degrees: Sequence[float]) -> dict[str, list[float]]:
    """A turned crystal as a region of `carillon modes --regions` describes it, by nine constants.

    Whoever turns a tetragonal crystal about z to where c16 vanishes has three planes of symmetry.
    Raises ValueError of a crystal that has fewer.
    """
    angle = 0.0
    if abs(matrix[0, 3]) > NONE * matrix[0, 0]:
        # c16 changes its sign within 45 degrees.
        angle = float(brentq(lambda about: turned(matrix, (0.0, 0.0, about))[0, 3], 0.0, 45.0))
        matrix = turned(matrix, (0.0, 0.0, angle))
    coupled = matrix - np.diag(matrix.diagonal())
    coupled[:3, :3] = 0.0
    if np.abs(coupled).max() > NONE * matrix[0, 0]:
        raise ValueError("found a crystal without three planes of symmetry")
    turn = Rotation.from_rotvec(degrees, degrees=True)
    axes = (turn * Rotation.from_rotvec((0.0, 0.0, -angle), degrees=True)).as_matrix()
    compliance = np.linalg.inv(matrix)
    pairs = ((0, 1), (1, 2), (2, 0))
    return {
        "grain_young": [float(1.0 / compliance[i, i]) for i in range(3)],
        "grain_shear": matrix.diagonal()[3:].tolist(),
        "grain_poisson": [float(-compliance[j, i] / compliance[i, i]) for i, j in pairs],
        "grain": axes[:, 0].tolist(),
        "radial": axes[:, 1].tolist(),
    }
