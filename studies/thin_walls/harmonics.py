"""Frequencies of solids of revolution: Fourier harmonics over triangles of the profile.

A mode has the displacements ``u cos(n a)``, ``v sin(n a)``, ``w cos(n a)`` along radius, angle a
and height, of a harmonic n, and but for n = 0 a twin turned by a quarter of a wave (Zienkiewicz and
Taylor, The Finite Element Method, on semi-analytical methods). The strains are linear in n, so that
the stiffness of all harmonics follows from three matrices. Triangles are quadratic.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

from carillon.arrays import Array, Index
from studies.accuracy.solids import DENSITY, POISSON, YOUNG
from studies.accuracy.tetrahedra import gmsh_elements
from studies.thin_walls.grading import grade
from studies.thin_walls.profiles import NEAR, Profile

RIGID = {0: 2, 1: 2}
"""Rigid motions by harmonic: along and about the axis, across and about a line across."""
GMSH_TRIANGLE = 2
"""Gmsh's number for the element."""
FINER = 16.0
"""Edges of triangles relative to those in notches of the profile."""
SHIFT = 1e-3
"""Shift of K by M, relative to a guess at the first elastic eigenvalue."""
SPARE_HARMONICS = 3
"""Harmonics in a row whose lowest frequency is too high, after which no further one is sought."""
Matrices = tuple[list[sp.csr_matrix], sp.csr_matrix, Array]


def harmonic_frequencies(profile: Profile, size: float, count: int) -> Array:
    """The lowest `count` elastic frequencies [Hz], ascending, by triangles of edges `size` [m].

    They are bounds from above.

    Examples
    --------
    >>> from studies.accuracy.tetrahedra import missing
    >>> from studies.thin_walls.profiles import disc
    >>> found = [1.0, 1.0] if missing() else harmonic_frequencies(disc(wall=0.01), 0.005, 2)
    >>> bool(np.isclose(found[0], found[1]))
    True
    """
    stiffness, mass, points = _matrices(profile, size)
    on_axis = np.flatnonzero(points[0] < NEAR)
    found = np.empty(0)
    spared, harmonic = 0, 0
    while spared < SPARE_HARMONICS:
        copies = 2 if harmonic else 1
        elastic = _of_harmonic(harmonic, -(-count // copies), stiffness, mass, on_axis, profile)
        found = np.sort(np.append(found, np.repeat(elastic, copies)))[:count]
        spared = spared + 1 if len(found) == count and elastic[0] > found[-1] else 0
        harmonic += 1
    return found


def _of_harmonic(
    harmonic: int,
    count: int,
    stiffness: list[sp.csr_matrix],
    mass: sp.csr_matrix,
    on_axis: Index,
    profile: Profile,
) -> Array:
    still, first, second = stiffness
    K = still + harmonic * first + harmonic**2 * second
    free = _kept_on_axis(harmonic, K.shape[0], on_axis)
    rigid = RIGID.get(harmonic, 0)
    reduced = [(free.T @ matrix @ free).tocsc() for matrix in (K, mass)]
    shift = -SHIFT * YOUNG / DENSITY / profile.longest**2
    values = eigsh(reduced[0], rigid + count, reduced[1], shift, return_eigenvectors=False)
    return np.asarray(np.sqrt(np.sort(values)[rigid:]) / (2.0 * np.pi))


def _kept_on_axis(harmonic: int, n_dofs: int, on_axis: Index) -> sp.csr_matrix:
    """All displacements (n_dofs, m) from those that the axis leaves free, where all are finite.

    There u = v = 0 of the harmonic 0, u + v = 0 and w = 0 of the first one, and nothing moves of
    the others.
    """
    u, v, w = (3 * on_axis + component for component in range(3))
    fixed = {0: [u, v], 1: [v, w]}.get(harmonic, [u, v, w])
    kept = sp.identity(n_dofs, format="lil")
    if harmonic == 1:
        kept[v, u] = -1.0
    return kept.tocsc()[:, np.setdiff1d(np.arange(n_dofs), np.concatenate(fixed))].tocsr()


def _matrices(profile: Profile, size: float) -> Matrices:
    """Stiffness by power of the harmonic, mass, and places (2, n) of the nodes."""
    from skfem import Basis, BilinearForm, ElementTriP2, ElementVector, MeshTri

    points, triangles = _triangles(profile, size)
    mesh = MeshTri(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T))
    basis = Basis(mesh, ElementVector(ElementTriP2(), 3), intorder=6)
    shear = 0.5 * YOUNG / (1.0 + POISSON)
    lame = 2.0 * shear * POISSON / (1.0 - 2.0 * POISSON)

    def energy(a: list[Any], b: list[Any]) -> Any:
        """Density of the strain energy of strains rr, aa, zz, rz, ra, za."""
        normal = lame * sum(a[:3]) * sum(b[:3])
        normal += 2.0 * shear * sum(x * y for x, y in zip(a[:3], b[:3]))
        return normal + shear * sum(x * y for x, y in zip(a[3:], b[3:]))

    def part(left: Any, right: Any) -> sp.csr_matrix:
        form = BilinearForm(
            lambda trial, test, where: (
                energy(left(trial, where.x[0]), right(test, where.x[0])) * where.x[0]
            )
        )
        return form.assemble(basis).tocsr()

    mass = BilinearForm(
        lambda trial, test, where: DENSITY * sum(trial[i] * test[i] for i in range(3)) * where.x[0]
    )
    mixed = part(_steady, _waved)
    stiffness = [part(_steady, _steady), mixed + mixed.T, part(_waved, _waved)]
    order = np.concatenate(basis.split_indices()).reshape(3, -1).T.ravel()
    places = basis.doflocs[:, order[::3]]
    reorder = [matrix[order][:, order] for matrix in (*stiffness, mass.assemble(basis).tocsr())]
    return reorder[:3], reorder[3], places


def _steady(displacement: Any, radius: Array) -> list[Any]:
    """Strains that the harmonic 0 has."""
    u, v, _ = displacement
    (u_r, u_z), (v_r, v_z), (w_r, w_z) = displacement.grad
    return [u_r, u / radius, w_z, u_z + w_r, v_r - v / radius, v_z]


def _waved(displacement: Any, radius: Array) -> list[Any]:
    """Strains times the harmonic that others have besides."""
    u, v, w = displacement
    return [0.0, v / radius, 0.0, 0.0, -u / radius, -w / radius]


def _triangles(profile: Profile, size: float) -> tuple[Array, Index]:
    """Points (n, 2) [m] and triangles (m, 3) of the polygon, smaller at notches."""

    def draw(gmsh: Any) -> None:
        shapes = gmsh.model.occ
        points = [shapes.addPoint(radius, height, 0.0) for radius, height in profile.points]
        sides = [shapes.addLine(a, b) for a, b in _around(points)]
        shapes.addPlaneSurface([shapes.addCurveLoop(sides)])
        shapes.synchronize()
        notches = [points[corner] for corner in profile.notches]
        if notches:
            grade(gmsh, "PointsList", notches, size, FINER)

    points, triangles = gmsh_elements(draw, size, order=1, kind=GMSH_TRIANGLE, dimension=2)
    return points[:, :2], triangles


def _around(points: list[int]) -> Iterator[tuple[int, int]]:
    return zip(points, [*points[1:], points[0]])
