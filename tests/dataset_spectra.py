"""Small free boxes, fine and coarsened, whose frequencies judge a coarsening (test support)."""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

from carillon.fem.block import COARSE_EDGE, coarse_cell_mass
from carillon.fem.element import CORNERS, DEFAULT_POISSON, Array, nodal_mass, quadrature_stiffness

Coarsen = Callable[[Array], Array]


def blocks_of(field: Array) -> Array:
    """Moduli (m, 8) of the 2x2x2 blocks of a voxel field (even sizes), x slowest."""
    x, y, z = (n // 2 for n in field.shape)
    return field.reshape(x, 2, y, 2, z, 2).transpose(0, 2, 4, 5, 3, 1).reshape(-1, 8)


def lattice_cells(shape: tuple[int, int, int]) -> np.ndarray:
    """Nodes (m, 8) of all cells of a lattice, x slowest."""
    strides = np.array([(shape[1] + 1) * (shape[2] + 1), shape[2] + 1, 1])
    cells = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 3)
    return (cells[:, None] + CORNERS) @ strides


def assemble(
    cells: np.ndarray, stiffness: Array, mass: Array
) -> tuple[sp.csc_matrix, sp.csc_matrix]:
    """K and M from element matrices (m, 24, 24) and nodal masses (m, 8, 8) on used nodes."""
    used, local = np.unique(cells, return_inverse=True)
    local = local.reshape(cells.shape)
    dofs = (3 * local[..., None] + np.arange(3)).reshape(len(cells), 24)
    size = 3 * len(used)

    def scatter(matrices: Array) -> sp.csc_matrix:
        rows = np.repeat(dofs, 24, axis=1).ravel()
        columns = np.tile(dofs, (1, 24)).ravel()
        return sp.csc_matrix((matrices.ravel(), (rows, columns)), shape=(size, size))

    vector_mass = np.einsum("mab,ij->maibj", mass, np.eye(3)).reshape(-1, 24, 24)
    return scatter(stiffness), scatter(vector_mass)


def lowest(stiffness: sp.csc_matrix, mass: sp.csc_matrix, count: int) -> Array:
    """Elastic angular frequencies 7..count of a free body."""
    scale = stiffness.diagonal().mean() / mass.diagonal().mean()
    values = eigsh(
        stiffness, count, mass, sigma=-1e-5 * scale, return_eigenvectors=False, v0=_start(stiffness)
    )
    return np.sqrt(np.sort(values)[6:])


def _start(stiffness: sp.csc_matrix) -> Array:
    return np.random.default_rng(0).standard_normal(stiffness.shape[0])


def fine_frequencies(field: Array, count: int = 60, poisson: float = DEFAULT_POISSON) -> Array:
    """Frequencies of the voxel field (0 is void) with consistent mass, unit edge and density."""
    young = field.reshape(-1)
    filled = young > 0
    element = quadrature_stiffness(poisson).sum(axis=0)
    mass = np.broadcast_to(nodal_mass(), (filled.sum(), 8, 8))
    cells = lattice_cells(field.shape)[filled]
    return lowest(*assemble(cells, young[filled, None, None] * element, mass), count)


def coarse_frequencies(
    field: Array,
    coarsen: Coarsen,
    count: int = 60,
    poisson: float = DEFAULT_POISSON,
    lumped_share: float = 0.0,
) -> Array:
    """Frequencies after replacing each block by one element with moduli `coarsen(blocks)`.

    `lumped_share` of the mass is lumped where a block is filled.
    """
    blocks = blocks_of(field)
    filled = blocks.any(axis=1)
    shape = tuple(n // 2 for n in field.shape)
    moduli = coarsen(blocks[filled])
    stiffness = COARSE_EDGE * np.einsum("mq,qab->mab", moduli, quadrature_stiffness(poisson))
    mass = np.einsum("mj,jab->mab", (blocks[filled] > 0).astype(float), coarse_cell_mass())
    lumped = mass.sum(axis=2)[:, :, None] * np.eye(8)
    share = lumped_share * blocks[filled].all(axis=1)
    mass = mass + share[:, None, None] * (lumped - mass)
    return lowest(*assemble(lattice_cells(shape)[filled], stiffness, mass), count)


def box_fields(shape: tuple[int, int, int] = (16, 12, 8), seed: int = 0) -> dict[str, Array]:
    """The three materials of the judging table on a solid box."""
    rng = np.random.default_rng(seed)
    x, y, z = np.meshgrid(*[(np.arange(n) + 0.5) / n for n in shape], indexing="ij")
    smooth = np.exp(np.sin(5 * x + 1) + np.cos(4 * y) * np.sin(3 * z + 2 * x))
    return {"uniform": np.ones(shape), "smooth": smooth, "random": rng.uniform(0.01, 10, shape)}


def rms_error(found: Array, exact: Array) -> tuple[float, float]:
    """Root mean square and mean of the relative frequency errors."""
    error = found / exact - 1
    return float(np.sqrt((error**2).mean())), float(error.mean())
