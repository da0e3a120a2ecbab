"""What displacements cubic along the cells' edges would add to those of finite cells.

Errors that larger cells would have tell nothing of what no cell of any size can do: where one cell
spans a rod's section it has no warping, x y (x^2 - y^2) in a square (Saint-Venant 1855), and
neither has one twice as large. So each edge of a cell gets a cubic function, whose share falls to
zero across the cells about it; a mode's frequency falls by what the hierarchical surplus says when
they join in (Bank and Smith 1993). It is a lower bound of the error, since more functions yet can
only lower the frequency further.
"""

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from scipy.sparse import csr_matrix

from carillon.arrays import Array, Index
from carillon.fem.block import NODES, degrees_of_freedom
from carillon.fem.elasticity import Elasticity
from carillon.fem.element import KEPT, strain_displacement
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.finite_cells.shapes import (
    POINTS,
    octant_weights,
    points,
    shape_functions,
    strain_factors,
)

EDGES: Index = np.flatnonzero((NODES == 1).sum(axis=1) == 1)
"""Numbers (12,) of the nodes in the middles of a cell's edges."""
STEPS = 8
"""Steps of conjugate gradients. Each comes nearer to the surplus, from below."""
CHUNK = 256
"""Number of cells whose matrices are made at once."""
LEAST_INSIDE = 0.005
"""Least share of a cell inside the solid from which cubic functions get forces in it. They are of a
higher degree than the cell's points integrate exactly."""
FLOOR = 1e-6
"""Stiffness of a function, relative to that in a cell that is all inside, below which it is left
out: hardly any of it is inside."""


@dataclass(frozen=True)
class CubicSurplus:
    """What cubic functions would add."""

    gains: Array
    """(k,) by which they would lower the eigenvalues [rad^2/s^2]."""
    shares: Array
    """(c, k) strain energy of what they add in each cell, twice."""


def cubic_surplus(model: FiniteCellModel, values: Array, modes: Array) -> CubicSurplus:
    """Surplus of modes (n_dofs, k) with eigenvalues (k,) [rad^2/s^2].

    Edges beside a cell of another size have no function.
    """
    numbers, count = _numbers(model)
    matrices = np.empty((len(numbers), 36, 36))
    forces = np.empty((len(numbers), 36, modes.shape[1]))
    dofs = degrees_of_freedom(numbers)
    elements, nodes = model.elements, model.connectivity.astype(np.int64)
    for first in range(0, len(numbers), CHUNK):
        few = slice(first, first + CHUNK)
        edges = model.cells.span[few, None] * elements.edge
        mass = float(model.regions.density[0]) * edges**3 * elements.share[few]
        own, across = np.zeros((len(edges), 36 * 36)), np.zeros((len(edges), 36 * 81))
        for law, among, moduli in elements.by_law(few):
            stiff = edges[among] * moduli
            exact, rest = _stiffness(model.regions.laws[law])
            own[among] += stiff @ exact + stiff.sum(axis=1, keepdims=True) * rest
            across[among] += stiff @ _coupling(model.regions.laws[law])
        matrices[few] = own.reshape(-1, 36, 36)
        across = across.reshape(-1, 36, 81)
        inertia = (mass @ _inertia()).reshape(-1, 12, 27)
        # Cells beside others of another size have nodes elsewhere, and no function here.
        moved = modes[degrees_of_freedom(nodes[few])]
        pulled = inertia @ moved.reshape(len(moved), 27, -1)
        inside = elements.share[few].sum(axis=1) > LEAST_INSIDE
        if elements.support is not None:
            # What holds a cell holds these functions, too.
            inside &= elements.support[few] < 0
        if elements.kink is not None:
            # Kinks take part in the strains there, and these know nothing of them.
            inside &= elements.kink[few] < 0
        forces[few] = pulled.reshape(len(moved), 36, -1) * values - across @ moved
        forces[few] *= inside[:, None, None]
    return _solved(matrices, dofs, 3 * count, forces, FLOOR * _typical(model))


def _numbers(model: FiniteCellModel) -> tuple[Index, int]:
    """Numbers (c, 12) of the functions of each cell's edges, and how many there are.

    Where an edge has none the number is that of one more.
    """
    cells = model.cells
    span = np.asarray(cells.span)
    nodes = model.connectivity.astype(np.int64)
    # Of a node: the size of the cells that have it in the middle of an edge, and of all that have
    # it; where these differ, or a node is not in its place, something hangs.
    own = NODES * (span // 2)[:, None, None]
    astray = (model.mesh.node_grid[nodes] - cells.grid[:, None] != own).any(axis=2)
    usable = np.ones(model.mesh.n_nodes, dtype=bool)
    usable[nodes[astray]] = False
    middle = np.zeros(len(NODES), dtype=bool)
    middle[EDGES] = True
    usable[nodes[:, ~middle]] = False
    # Cells with nodes astray have no functions at the places of these.
    usable[nodes[astray.any(axis=1)][:, EDGES]] = False
    chosen = nodes[:, EDGES]
    used, numbers = np.unique(chosen[usable[chosen]], return_inverse=True)
    result = np.full(chosen.shape, len(used), dtype=np.int64)
    result[usable[chosen]] = numbers
    return result, len(used)


def _typical(model: FiniteCellModel) -> float:
    """Stiffness [N/m] of a function in a cell of the median modulus that is all inside."""
    exact, rest = _stiffness(model.regions.laws[0])
    table = octant_weights().sum(axis=0) @ exact + rest
    edge = float(model.cells.span.min()) * model.elements.edge
    return float(np.median(model.young) * edge * np.diag(table.reshape(36, 36)).min())


def _solved(matrices: Array, dofs: Index, count: int, forces: Array, floor: float) -> CubicSurplus:
    """Surplus by conjugate gradients, preconditioned by the diagonal.

    Of the unknowns (c, 36) those from `count` on stand for none.
    """
    places = np.arange(dofs.size)
    gathered = csr_matrix((np.ones(dofs.size), (dofs.ravel(), places)), (count + 3, dofs.size))
    diagonal = gathered @ np.einsum("cii->ci", matrices).ravel()
    used = (diagonal > floor) & (np.arange(count + 3) < count)
    inverse = np.where(used, 1.0 / np.where(used, diagonal, 1.0), 0.0)[:, None]
    residual = gathered @ forces.reshape(dofs.size, -1)
    solution = np.zeros_like(residual)
    gains = np.zeros(residual.shape[1])
    direction = rest = inverse * residual
    product = np.einsum("ij,ij->j", residual, rest)
    for _ in range(STEPS):
        image = used[:, None] * (gathered @ (matrices @ direction[dofs]).reshape(dofs.size, -1))
        energy = np.einsum("ij,ij->j", direction, image)
        length = np.where(energy > 0.0, product / np.where(energy > 0.0, energy, 1.0), 0.0)
        solution += length * direction
        gains += length * product
        residual = residual - length * image
        rest = inverse * residual
        after = np.einsum("ij,ij->j", residual, rest)
        direction = rest + after / np.maximum(product, np.finfo(float).tiny) * direction
        product = after
    local = solution[dofs]
    shares = np.einsum("cik,cik->ck", local, matrices @ local)
    return CubicSurplus(gains, np.maximum(shares, 0.0))


def _along(places: Array, low: bool) -> tuple[Array, Array]:
    """Values and slopes (p, 3) on an edge of length one: to either end linear, amid them cubic.

    If `low`, values of the cubic are those of the nearest polynomial of degree two, a line.
    """
    cubic = (0.1 if low else places * (1.0 - places)) * (2.0 * places - 1.0)
    slope = -6.0 * places**2 + 6.0 * places - 1.0
    ones = np.ones_like(places)
    return (np.stack([1.0 - places, cubic, places], axis=1), np.stack([-ones, slope, ones], axis=1))


@cache
def _functions(low: bool = False) -> tuple[Array, Array]:
    """Values (125, 12) and gradients (125, 12, 3) of the edges' functions at the points."""
    factors = [_along(points()[:, axis], low) for axis in range(3)]
    places = NODES[EDGES]
    values = np.prod([factors[axis][0][:, places[:, axis]] for axis in range(3)], axis=0)
    gradients = np.stack(
        [
            np.prod(
                [factors[axis][int(axis == along)][:, places[:, axis]] for axis in range(3)], axis=0
            )
            for along in range(3)
        ],
        axis=2,
    )
    return values, gradients


def _factors(law: Elasticity, low: bool = False) -> Array:
    """Strains (125, 6, 36) at the points, as `strain_factors`."""
    root = np.linalg.cholesky(law.matrix).T
    return np.asarray(root @ strain_displacement(_functions(low)[1]))


@lru_cache(KEPT)
def _stiffness(law: Elasticity) -> tuple[Array, Array]:
    """Between functions: (125, 36 * 36) by points, see `point_stiffness`, and (36 * 36,) the rest.

    Points integrate over a cell that a surface cuts what is of degree four at most, so they are
    given strains of degree two. The rest is orthogonal to these in a cell that is all inside, and
    enters by the share that is.
    """
    low, whole = (_factors(law, each) for each in (True, False))
    by_points = [(each.transpose(0, 2, 1) @ each).reshape(POINTS, -1) for each in (low, whole)]
    rest = octant_weights().sum(axis=0) @ (by_points[1] - by_points[0])
    return by_points[0], rest


@lru_cache(KEPT)
def _coupling(law: Elasticity) -> Array:
    """Between functions and displacements of a cell's nodes (125, 36 * 81)."""
    products = _factors(law).transpose(0, 2, 1) @ strain_factors(law)
    return np.asarray(products.reshape(POINTS, -1))


@cache
def _inertia() -> Array:
    """The same for the mass, of one component (125, 12 * 27)."""
    values, own = _functions()[0], shape_functions(points())
    return np.asarray((values[:, :, None] * own[:, None, :]).reshape(POINTS, -1))
