"""Small solids and reference solutions that the solver's tests share."""

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import scipy.linalg as la
from mpi4py import MPI
from numpy.polynomial import legendre

from carillon.fem.block import degrees_of_freedom
from carillon.fem.geometry import HexMesh, blocks_from_mesh, hexmesh_from_grid
from carillon.fem.model import ElasticModel, Solid, fine_model
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.assembly.sparse import assembled
from solver.assembly.system import System
from solver.coarsening.choice import make_coarsening
from solver.coarsening.model import build_model


def box_mesh(nx: int, ny: int, nz: int, edge: float = 0.01) -> HexMesh:
    """Solid box of nx x ny x nz cells."""
    grid = np.array(list(product(range(nx), range(ny), range(nz))))
    return hexmesh_from_grid(grid, np.zeros(3), edge)


def random_box(nx: int, ny: int, nz: int, seed: int = 0, **constants) -> ElasticModel:
    """Box whose cells have moduli over two decades."""
    mesh = box_mesh(nx, ny, nz)
    young = 1e9 * 10.0 ** np.random.default_rng(seed).uniform(-1.0, 1.0, mesh.n_cells)
    return fine_model(mesh, young, **constants)


def uniform_box(nx: int, ny: int, nz: int, edge: float, young: float = 1e9) -> ElasticModel:
    """Homogeneous box."""
    mesh = box_mesh(nx, ny, nz, edge)
    return fine_model(mesh, np.full(mesh.n_cells, young))


def bar_models(
    method: str = "galerkin", share: float = 0.3
) -> tuple[ElasticModel, ElasticModel, ElasticModel]:
    """A bar with a corner and a groove cut away: fine, mixed, and coarse by `method`.

    One end of the mixed one is fine, and `share` of the other blocks.
    """
    grid = box_mesh(16, 5, 4).grid
    corner = (grid >= np.array([13, 2, 2])).all(axis=1)
    groove = (grid[:, 0] == 8) & (grid[:, 2] == 3)
    mesh = hexmesh_from_grid(grid[~(corner | groove)], np.zeros(3), 0.01)
    rng = np.random.default_rng(5)
    young = 1e9 * 10.0 ** rng.uniform(-1.0, 1.0, mesh.n_cells)
    blocks = blocks_from_mesh(mesh).coarse.grid
    refined = (rng.random(len(blocks)) < share) | (blocks[:, 0] < 3)
    coarsening = make_coarsening(method)
    return (
        fine_model(mesh, young),
        build_model(mesh, young, coarsening, refined),
        build_model(mesh, young, coarsening),
    )


def symmetric_solid(inside: Callable[[np.ndarray], np.ndarray], cells: int) -> ElasticModel:
    """Homogeneous cells of a cube of `cells`^3 for whose centres (c, 3) `inside` holds.

    Centres are counted from the cube's centre in half edges, so that the solid has every symmetry
    of the cube that `inside` has, to the last bit.
    """
    grid = np.array(list(product(range(cells), repeat=3)))
    grid = grid[inside(2 * grid - cells + 1)]
    mesh = hexmesh_from_grid(grid - grid.min(axis=0), np.zeros(3), 0.01)
    return fine_model(mesh, np.full(mesh.n_cells, 1e9))


def local_rows(system: System, block: np.ndarray) -> np.ndarray:
    """This rank's rows of a block (n_dofs, k) in mesh node order that every rank holds."""
    return np.ascontiguousarray(block[degrees_of_freedom(system.nodes)])


def dense_eigenvalues(model: Solid) -> np.ndarray:
    """All eigenvalues by LAPACK."""
    K, M = assembled(model)
    return la.eigh(K.toarray(), M.toarray(), eigvals_only=True)


def analysed(model: Solid, **options: Any) -> Modes:
    """Modes of a model on this rank, by these of the solver's options."""
    return modal_analysis(model, SolverOptions(**options), MPI.COMM_SELF)


def timoshenko_free_frequencies(
    length: float, side: float, young: float, poisson: float, density: float, count: int
) -> np.ndarray:
    """Bending frequencies [Hz] of a free beam of square section, by Timoshenko's theory.

    Solved with a high-order spectral discretisation of the beam's two fields; shear coefficient of
    Cowper (1966) for a rectangle.
    """
    shear_coefficient = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson)
    area, inertia = side**2, side**4 / 12.0
    shear = shear_coefficient * area * young / (2.0 * (1.0 + poisson))
    degree = 24
    points, weights = legendre.leggauss(degree + 2)
    values = legendre.legvander(points, degree)
    slopes = np.stack(
        [legendre.legval(points, legendre.legder(row)) for row in np.eye(degree + 1)], axis=1
    )
    slopes *= 2.0 / length
    weights = weights * length / 2.0

    def form(left: np.ndarray, right: np.ndarray) -> np.ndarray:
        return left.T @ (weights[:, None] * right)

    K = np.block(
        [
            [shear * form(slopes, slopes), -shear * form(slopes, values)],
            [
                -shear * form(values, slopes),
                young * inertia * form(slopes, slopes) + shear * form(values, values),
            ],
        ]
    )
    zero = np.zeros((degree + 1, degree + 1))
    M = np.block(
        [
            [density * area * form(values, values), zero],
            [zero, density * inertia * form(values, values)],
        ]
    )
    return np.sqrt(la.eigh(K, M, eigvals_only=True)[2 : 2 + count]) / (2.0 * np.pi)
