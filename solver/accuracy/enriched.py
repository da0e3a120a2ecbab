"""Finite cells with more functions on their faces and inside, for estimates of their errors.

Products of polynomials of degree 4 at most along each axis, whose degrees above one add up to 6 at
most: those of the trunk space and, on every face, five more, (2, 3), (3, 2), (3, 3), (2, 4) and
(4, 2), and one inside, (2, 2, 2). The points of lines integrate products of two exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array, Flags, Index, frozen
from carillon.fem.finite_cells.basis import DEGREE, basis
from carillon.fem.finite_cells.cells import FLOORS
from carillon.fem.finite_cells.hanging import at_nodes, from_own, own_values
from carillon.fem.finite_cells.matrices import PAIRS, combined
from carillon.fem.finite_cells.model import FiniteCellModel

ON_FACE = ((2, 3), (3, 2), (3, 3), (2, 4), (4, 2))
"""Degrees of the functions of a face along its two axes."""
NEW = 6 * len(ON_FACE) + 1
"""Functions that a cell has more."""
CHUNK = 16
"""Cells whose matrices are made at once."""


@dataclass(frozen=True, eq=False)
class Enriched:
    """Cells with more functions, whose unknowns follow those of the nodes."""

    model: FiniteCellModel
    numbers: Index
    """(c, n + `NEW`) nodes and further functions of each cell; of functions that are left out, the
    number of one more."""
    count: int
    """Number of nodes and functions."""
    stiffness: Array
    """(c, 3 (n + NEW), 3 (n + NEW)) [N/m] between them."""

    def residual(self, values: Array, modes: Array) -> Array:
        """What unbalanced forces (3 count, k) of modes (n_dofs, k) do on the further functions.

        `values` (k,) are the modes' eigenvalues [rad^2/s^2]. Functions of cells that are not
        `usable` get none.
        """
        k = modes.shape[1]
        cells, nodes = self.model.cells, basis(DEGREE).n_nodes
        result = np.zeros((len(self.numbers), NEW, 3 * k))
        mass = _line_values(self.model, None)
        moved = modes.reshape(-1, 3 * k)
        _, functions = _tables()
        for first in range(0, len(cells), CHUNK):
            few = slice(first, first + CHUNK)
            at = moved[self.numbers[few, :nodes]]
            forces = self.stiffness[few, 3 * nodes :, : 3 * nodes] @ at.reshape(len(at), -1, k)
            own = own_values(DEGREE, at, cells.kinds[few])
            scale = mass[few] * (cells.edges[few] ** 3)[:, None]
            coupled = (functions[:, nodes:].T * scale[:, None]) @ functions[:, :nodes]
            inertia = (coupled @ own).reshape(len(at), NEW, 3, k)
            pulled = values * inertia - forces.reshape(len(at), NEW, 3, k)
            result[few] = pulled.reshape(len(at), NEW, -1)
        padded = np.zeros((self.count + 1, 3 * k))
        np.add.at(padded, self.numbers[:, nodes:], result)
        # Also what they share with cells beside them, of which this would be half.
        padded[self.numbers[~self.usable, nodes:]] = 0.0
        return padded[:-1].reshape(3 * self.count, k)

    @cached_property
    def usable(self) -> Flags:
        """Cells (c,) of one material that nothing holds."""
        elements, regions = self.model.elements, self.model.regions
        result = np.ones(len(self.numbers), dtype=bool)
        if elements.law is not None:
            flat = regions.elasticity.reshape(len(regions), -1)
            rows = np.column_stack([flat, regions.density, regions.young])
            material = np.unique(rows, axis=0, return_inverse=True)[1].ravel()[elements.law]
            empty = ~elements.shares.any(axis=2)
            result = (empty | (material == material[:, :1])).all(axis=1)
        if elements.support is not None:
            result &= elements.support < 0
        return result

    def usable_share(self, modes: Array) -> Array:
        """Share (k,) of the strain energy of modes (n_dofs, k) that `usable` cells have."""
        if self.usable.all():
            return np.ones(modes.shape[1])
        nodes, k = basis(DEGREE).n_nodes, modes.shape[1]
        moved = modes.reshape(-1, 3 * k)
        energy = np.zeros((len(self.numbers), k))
        for first in range(0, len(self.numbers), CHUNK):
            few = slice(first, first + CHUNK)
            at = moved[self.numbers[few, :nodes]].reshape(-1, 3 * nodes, k)
            inner = self.stiffness[few, : 3 * nodes, : 3 * nodes]
            energy[few] = np.einsum("cik,cik->ck", at, inner @ at)
        return np.asarray(energy[self.usable].sum(axis=0) / energy.sum(axis=0))

    def local(self, vectors: Array) -> Array:
        """Parts (c, 3 (n + NEW), k) of vectors (3 count, k) in cells."""
        k = vectors.shape[1]
        padded = np.concatenate([vectors.reshape(-1, 3 * k), np.zeros((1, 3 * k))])
        return np.asarray(padded[self.numbers].reshape(len(self.numbers), -1, k))


def enriched(model: FiniteCellModel) -> Enriched:
    """The cells of a model that was made from a surface, with more functions.

    Faces beside cells of another size have none.
    """
    cells, nodes = model.cells, basis(DEGREE).n_nodes
    size = 3 * (nodes + NEW)
    stiffness = np.zeros((len(cells), size, size))
    laws = [None] if model.region is None else list(np.unique(model.region))
    slopes, _ = _tables()
    for law in laws:
        moduli = _line_values(model, model.young, law)
        elasticity = model.regions.elasticity[0 if law is None else int(law)]
        chosen = np.flatnonzero(moduli.any(axis=1))
        for first in range(0, len(chosen), CHUNK):
            few = chosen[first : first + CHUNK]
            weights = moduli[few] * cells.edges[few, None]
            products = np.empty((len(few), len(PAIRS), nodes + NEW, nodes + NEW))
            for pair, (a, b) in enumerate(PAIRS):
                products[:, pair] = (slopes[a].T * weights[:, None]) @ slopes[b]
            stiffness[few] += combined(products, elasticity)
    own = np.flatnonzero(cells.kinds)
    inner, outer = slice(0, 3 * nodes), slice(3 * nodes, size)
    for first in range(0, len(own), CHUNK):
        few = own[first : first + CHUNK]
        kinds = cells.kinds[few]
        stiffness[few, inner, inner] = at_nodes(DEGREE, stiffness[few, inner, inner], kinds)
        across = stiffness[few, inner, outer].reshape(len(few), nodes, -1)
        across = from_own(DEGREE, across, kinds).reshape(len(few), 3 * nodes, -1)
        stiffness[few, inner, outer] = across
        stiffness[few, outer, inner] = across.transpose(0, 2, 1)
    numbers, count = _numbers(model)
    return Enriched(model, numbers, count, stiffness)


def _line_values(model: FiniteCellModel, values: Array | None, law: int | None = None) -> Array:
    """Weighted values (c, q^3) at the points of lines, from those (m,) of voxels of a region.

    Densities if none are given.
    """
    cells = model.cells
    assert cells.line_weights is not None
    own, floor = np.ones(len(cells.cell)), FLOORS[DEGREE][0]
    if values is None:
        floor = 0.0
        region = 0 if model.region is None else model.region[cells.voxel]
        own *= model.regions.density[region]
    else:
        own *= values[cells.voxel]
    if law is not None and model.region is not None:
        own[model.region[cells.voxel] != law] = 0.0
    start = np.searchsorted(cells.cell, np.arange(len(cells) + 1))
    matrix = sp.csr_matrix((own, cells.row, start), (len(cells), len(cells.line_weights)))
    mean = np.bincount(cells.cell, own * cells.shares, minlength=len(cells)) / cells.fractions
    whole = cells.basis.line_voxels(1)[0]
    return np.asarray(matrix @ cells.line_weights) + (floor * mean)[:, None] * whole


def _numbers(model: FiniteCellModel) -> tuple[Index, int]:
    """Numbers (c, n + NEW) of nodes and further functions, see `Enriched`, and how many."""
    cells = model.cells
    shape = cells.basis
    middles = cells.nodes[:, shape.middles]
    smallest, largest = np.full(cells.n_nodes, np.iinfo(np.int64).max), np.zeros(cells.n_nodes)
    span = np.repeat(cells.span[:, None], 6, axis=1)
    np.minimum.at(smallest, middles, span)
    np.maximum.at(largest, middles, span)
    usable: Flags = smallest[middles] == largest[middles]
    used, face = np.unique(middles[usable], return_inverse=True)
    per, first = len(ON_FACE), cells.n_nodes
    count = first + per * len(used) + len(cells)
    numbers = np.full((len(cells), 6), -1)
    numbers[usable] = face.ravel()
    of_faces = first + per * numbers[:, :, None] + np.arange(per)
    of_faces = np.where(numbers[:, :, None] >= 0, of_faces, count).reshape(len(cells), -1)
    inside = first + per * len(used) + np.arange(len(cells))[:, None]
    return np.concatenate([cells.nodes.astype(np.int64), of_faces, inside], axis=1), count


@cache
def _tables() -> tuple[list[Array], Array]:
    """Slopes along each axis and values (q^3, n + NEW) of all functions at points of lines."""
    shape = basis(DEGREE)
    places = shape.line_points
    own = [_along(places[:, axis]) for axis in range(3)]
    values, slopes = [shape.functions(places)], [[each] for each in _split(shape.gradients(places))]
    factors = []
    for axis in range(3):
        b, c = (other for other in range(3) if other != axis)
        for side in (0, 4):
            factors += [{axis: side, b: one - 1, c: two - 1} for one, two in ON_FACE]
    factors.append(dict.fromkeys(range(3), 1))
    for each in factors:
        columns = [own[axis][0][:, each[axis]] for axis in range(3)]
        values.append(np.prod(columns, axis=0)[:, None])
        for along in range(3):
            turned = list(columns)
            turned[along] = own[along][1][:, each[along]]
            slopes[along].append(np.prod(turned, axis=0)[:, None])
    joined = [frozen(np.ascontiguousarray(np.concatenate(each, axis=1))) for each in slopes]
    return joined, frozen(np.ascontiguousarray(np.concatenate(values, axis=1)))


def _split(gradients: Array) -> list[Array]:
    return [np.ascontiguousarray(gradients[:, :, axis]) for axis in range(3)]


def _along(places: Array) -> tuple[Array, Array]:
    """Values and slopes (p, 5) on an edge: linear to either end, between them degrees 2, 3, 4.

    In the order of a lower end, the degrees, which vanish at both ends, and an upper end.
    """
    legendre = np.polynomial.legendre
    x = 2.0 * places - 1.0
    values, slopes = [1.0 - places], [-np.ones_like(places)]
    for degree in (2, 3, 4):
        series = np.eye(5)[degree - 1]
        values.append(legendre.legval(x, legendre.legint(series, lbnd=-1)))
        slopes.append(2.0 * legendre.legval(x, series))
    values.append(places)
    slopes.append(np.ones_like(places))
    return np.stack(values, axis=1), np.stack(slopes, axis=1)
