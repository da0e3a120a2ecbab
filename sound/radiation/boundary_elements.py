"""Sound radiated by the modes of a solid, by the boundary element method.

By reciprocity a surface of the outward velocity v, which moves as exp(-i omega t), radiates to the
direction d far away, at a distance r, the pressure

    p(d) = -i omega rho exp(ikr) / (4 pi r)  integral of v phi_d over the surface,

where phi_d is the pressure on the surface at rest of a plane wave exp(-ik d.x) that comes from d.
Burton and Miller's equation for it has one solution at each frequency,

    (1/2 - K + i/k W) phi_d = (1 + d.n) exp(-ik d.x),

with the double layer K and the hypersingular operator W; bempp-cl assembles both, by Galerkin's
method for pressures that are linear on each triangle.  Its system, which is solved once for the
modes of one frequency in place of all directions, is transposed.
"""

import os
from collections.abc import Iterable
from contextlib import redirect_stdout
from importlib.util import find_spec
from io import StringIO
from typing import Any

import numpy as np

from carillon.arrays import Array, Complex
from carillon.errors import UserError, one_line
from carillon.processes.threads import allowed_threads
from sound.radiation.air import AIR_DENSITY, SOUND_SPEED
from sound.radiation.boundary_mesh import BoundaryMesh
from sound.radiation.directivity import Directivity, even_directions, harmonics, order_of

REQUIREMENTS = "workflow/envs/requirements-radiation.txt"
SAME = 2e-3
"""Relative difference of frequencies [1] up to which modes share a system of equations."""
POINTS = np.array(
    [
        [0.108103018168070, 0.445948490915965, 0.445948490915965],
        [0.445948490915965, 0.108103018168070, 0.445948490915965],
        [0.445948490915965, 0.445948490915965, 0.108103018168070],
        [0.816847572980459, 0.091576213509771, 0.091576213509771],
        [0.091576213509771, 0.816847572980459, 0.091576213509771],
        [0.091576213509771, 0.091576213509771, 0.816847572980459],
    ]
)
SHARES = np.repeat([0.223381589678011, 0.109951743655322], 3)
"""Barycentric coordinates and weights by which polynomials of degree 4 are integrated exactly
(Dunavant 1985)."""


def radiated_by_elements(
    mesh: BoundaryMesh,
    motion: Array,
    frequencies: Array,
    groups: Iterable[slice] | None = None,
) -> Directivity:
    """Sound that modes of ascending frequencies (N,) [Hz] radiate.

    Their motion (3 F, 3, N) [kg^-1/2] is that at the middles of the edges, `BoundaryMesh.middles`.
    Modes of each of the `groups`, which are those of `same_frequency` unless told, share a
    frequency.  Raises UserError if bempp-cl, or OpenCL, is not installed.
    """
    radius = float(np.linalg.norm(mesh.vertices, axis=1).max())
    flows = mesh.flows(motion)
    highest = 2.0 * np.pi * float(frequencies.max()) / SOUND_SPEED
    coefficients = np.zeros(
        (len(frequencies), (order_of(highest * radius) + 1) ** 2), dtype=complex
    )
    elements = BoundaryElements(mesh)
    for group in same_frequency(frequencies) if groups is None else groups:
        hertz = float(frequencies[group].mean())
        order = order_of(2.0 * np.pi * hertz / SOUND_SPEED * radius)
        directions, shares = even_directions(2 * order)
        pressures = elements.far_field(flows[:, group], hertz, directions)
        projected = (shares[:, None] * harmonics(order, directions)).T @ pressures
        # With exp(i omega t), and the velocity of a coordinate as the real part of its oscillator.
        coefficients[group, : (order + 1) ** 2] = 1j * np.conj(projected.T)
    return Directivity(coefficients)


class BoundaryElements:
    """Burton and Miller's equation on a surface."""

    def __init__(self, mesh: BoundaryMesh) -> None:
        bempp = _bempp()
        self._mesh = mesh
        grid = bempp.Grid(
            np.ascontiguousarray(mesh.vertices.T),
            np.ascontiguousarray(mesh.faces.T, dtype=np.uint32),
        )
        self._space = bempp.function_space(grid, "P", 1)
        self._half = 0.5 * mesh.hat_products()

    def far_field(self, flows: Array, hertz: float, directions: Array) -> Complex:
        """Pressure times distance (D, N) [Pa m], without exp(ikr), in directions (D, 3).

        The surface moves at a frequency [Hz] by flows (V, N) [m^3/s], see `BoundaryMesh.flows`.
        """
        number = 2.0 * np.pi * hertz / SOUND_SPEED
        answers = np.linalg.solve(self._system(number).T, flows.astype(complex))
        pressures = self._waves(number, directions).T @ answers
        return np.asarray(-1j * AIR_DENSITY * SOUND_SPEED * number / (4.0 * np.pi) * pressures)

    def field(self, hertz: float, direction: Array) -> Complex:
        """Field (V,) [Pa m / (m^3/s)] whose product with flows is the pressure times distance in a
        direction (3,)."""
        number = 2.0 * np.pi * hertz / SOUND_SPEED
        pressures = np.linalg.solve(
            self._system(number), self._waves(number, direction[None])[:, 0]
        )
        return np.asarray(-1j * AIR_DENSITY * SOUND_SPEED * number / (4.0 * np.pi) * pressures)

    def _system(self, number: float) -> Any:
        """Matrix (V, V) of the equation, of a wave number [1/m]."""
        from bempp_cl.api.operators.boundary import helmholtz

        system = self._half - self._matrix(helmholtz.double_layer, number)
        return system + (1j / number) * self._matrix(helmholtz.hypersingular, number)

    def _matrix(self, operator: Any, *numbers: float) -> Any:
        space = self._space
        matrix = _bempp().as_matrix(operator(space, space, space, *numbers).weak_form())
        return matrix.toarray() if hasattr(matrix, "toarray") else matrix

    def _waves(self, number: float, directions: Array) -> Complex:
        """Integrals (V, D) [m^2] of (1 + d.n) exp(-ik d.x) times each vertex' hat function."""
        mesh = self._mesh
        normals, areas = mesh.normals_and_areas
        corners = mesh.vertices[mesh.faces]
        facing = (1.0 + normals @ directions.T) * areas[:, None]
        total = np.zeros((len(mesh.vertices), len(directions)), dtype=complex)
        for point, share in zip(POINTS, SHARES):
            places = np.einsum("c,fci->fi", point, corners)
            waves = share * facing * np.exp(-1j * number * (places @ directions.T))
            for corner in range(3):
                np.add.at(total, mesh.faces[:, corner], point[corner] * waves)
        return total


def same_frequency(frequencies: Array) -> list[slice]:
    """Groups of ascending frequencies (N,) [Hz] that differ by less than `SAME`.

    Examples
    --------
    >>> same_frequency(np.array([100.0, 100.1, 250.0]))
    [slice(0, 2, None), slice(2, 3, None)]
    """
    groups, first = [], 0
    for number in range(1, len(frequencies) + 1):
        if number == len(frequencies) or frequencies[number] > frequencies[first] * (1.0 + SAME):
            groups.append(slice(first, number))
            first = number
    return groups


def _bempp() -> Any:
    if find_spec("bempp_cl") is None or find_spec("pyopencl") is None:
        raise UserError(
            "boundary elements need bempp-cl and OpenCL, which are not installed; "
            f"pip install -r {REQUIREMENTS}"
        )
    os.environ.setdefault("POCL_MAX_PTHREAD_COUNT", str(allowed_threads()))
    try:
        with redirect_stdout(StringIO()):  # It tells that Gmsh is missing.
            import bempp_cl.api as bempp
    except Exception as error:
        raise UserError(f"bempp-cl cannot be loaded ({one_line(str(error))})") from None
    bempp.DEFAULT_DEVICE_INTERFACE = "opencl"
    return bempp
