"""Meshes of cells of degree four that are divided again and again, for tests of orderings.

A cell has 50 nodes: its corners, three on each edge, one in the middle of each face.  Cells that
share a face or an edge have the same size or twice the other's; the smaller one then has, instead
of nodes that hang, those of the larger one's face or edge, which are its parent's.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.element import rigid_motions
from carillon.fem.elements import Chosen, Elements
from carillon.fem.regions import Regions
from solver.assembly.node_rows import NodeRows, Pattern

Wanted = Callable[[Array, float], Flags]
"""Which cells, by their centres (c, 3) and their edge, both in edges of a root."""

QUARTERS = np.array(
    [
        place
        for place in product(range(5), repeat=3)
        if (inner := [each for each in place if each % 4]) in ([], [2, 2]) or len(inner) == 1
    ]
)
"""(50, 3) nodes of a cell in quarters of its edge."""
_NEAR = [np.array(each) for each in product((-1, 0, 1), repeat=3) if sum(map(abs, each)) < 3]
_Places = set[tuple[int, ...]]


@dataclass(frozen=True)
class Octree:
    """Cells of several sizes, whose nodes lie on one lattice."""

    low: Index
    """(c, 3) lowest corner of each cell."""
    span: Index
    """(c,) edge of each cell in steps of the lattice: 4 of the smallest ones."""
    nodes: Index
    """(c, 50) nodes of each cell."""
    lattice: Index
    """(n, 3) places of the nodes."""

    @property
    def places(self) -> Index:
        """Places (c, 50, 3) of the nodes from the lowest corner of each cell."""
        return self.lattice[self.nodes] - self.low[:, None]

    def pattern(self) -> Pattern:
        """Graph of the nodes that share a cell."""
        return Pattern.of_cells(self.nodes, 0, len(self.lattice))

    def rows(self, pattern: Pattern, seed: int = 0) -> NodeRows:
        """Rows of a random matrix that is positive definite, and of an identity for a mass."""
        rng = np.random.default_rng(seed)
        rows = NodeRows(pattern)
        kinds = rng.standard_normal((8, 150, 150))
        kinds = kinds @ kinds.transpose(0, 2, 1) / 150.0 + np.eye(150)
        for first in range(0, len(self.nodes), 256):
            chosen = slice(first, first + 256)
            kind = rng.integers(0, 8, len(self.nodes[chosen]))
            rows.add(chosen, kinds[kind], np.broadcast_to(np.eye(50), (len(kind), 50, 50)))
        return rows


def octree(
    roots: Iterable[tuple[int, ...]], levels: int, wanted: Wanted, kept: Wanted | None = None
) -> Octree:
    """Cells of edge one at the `roots`; those that are `wanted` are divided, and again so.

    There are so many `levels` of it, and more are divided so that sizes fit.  Of all cells those
    that are `kept` stay.
    """
    edge = 4 << levels
    domain = {tuple(edge * each for each in root) for root in roots}
    divided: list[_Places] = []
    there = domain
    for level in range(levels):
        divided.append(_chosen(there, edge >> level, edge, wanted))
        there = _children(divided[-1], edge >> level + 1)
    for level in range(levels - 1, 0, -1):
        span = edge >> level
        around = {tuple(np.add(low, span * step)) for low in divided[level] for step in _NEAR}
        parents = {tuple(each // (2 * span) * 2 * span for each in low) for low in around}
        divided[level - 1] |= {
            low for low in parents if tuple(each // edge * edge for each in low) in domain
        }
    leaves = [domain - divided[0]] if levels else [domain]
    for level in range(1, levels + 1):
        below = _children(divided[level - 1], edge >> level)
        leaves.append(below - divided[level] if level < levels else below)
    if kept is not None:
        leaves = [_chosen(each, edge >> level, edge, kept) for level, each in enumerate(leaves)]
    lows, spans, places = [], [], []
    for level, each in enumerate(leaves):
        low = np.array(sorted(each), dtype=np.int64).reshape(-1, 3)
        span = edge >> level
        lows.append(low)
        spans.append(np.full(len(low), span))
        larger = leaves[level - 1] if level else set()
        places.append(_places(low, span, larger))
    low, span, place = np.concatenate(lows), np.concatenate(spans), np.concatenate(places)
    lattice, nodes = np.unique(place.reshape(-1, 3), axis=0, return_inverse=True)
    return Octree(low, span, nodes.reshape(-1, 50), lattice)


def _chosen(places: _Places, span: int, edge: int, wanted: Wanted) -> _Places:
    low = np.array(sorted(places), dtype=np.int64).reshape(-1, 3)
    chosen = wanted((low + 0.5 * span) / edge, span / edge)
    return set(map(tuple, low[chosen].tolist()))


def _children(places: _Places, span: int) -> _Places:
    return {tuple(np.add(low, each)) for low in places for each in product((0, span), repeat=3)}


def _places(low: Index, span: int, larger: _Places) -> Index:
    """Places (c, 50, 3) of the nodes of cells of one size, beside the `larger` ones."""
    hangs = np.zeros((len(low), 50), dtype=bool)
    parent = low // (2 * span) * 2 * span
    octant = (low - parent) // span
    sides = QUARTERS[:, None] == np.array([0, 4])[:, None]  # (50, 2, 3)
    for step in _NEAR:
        axes = np.flatnonzero(step)
        if len(axes) and larger:
            across = (parent + 2 * span * step).tolist()
            beside = np.array([tuple(each) in larger for each in across], dtype=bool)
            beside &= ((2 * octant - 1) == step)[:, axes].all(axis=1)
            on = np.all([sides[:, int(step[axis] > 0), axis] for axis in axes], axis=0)
            hangs |= beside[:, None] & on
    own = low[:, None] + span // 4 * QUARTERS
    return np.where(hangs[:, :, None], parent[:, None] + span // 2 * QUARTERS, own)


@dataclass(frozen=True)
class OctreeElements(Elements):
    """Elements with random matrices, which move rigidly without strain, in an octree."""

    ROWS = ("young", "places")

    young: Array
    """(c,) factors of the stiffness."""
    places: Index
    edge: float = 1.0
    regions: Regions = field(default_factory=Regions.one)
    support: None = None
    attached: None = None

    @property
    def steps(self) -> int | None:
        return None

    @property
    def node_places(self) -> Index:
        return self.places

    @property
    def sort_key(self) -> Index:
        return np.zeros(len(self), dtype=np.int64)

    def moduli_of(self, chosen: Flags) -> Array:
        return self.young

    def free_stiffness(self, chosen: Chosen = slice(None)) -> Array:
        matrix = np.random.default_rng(0).standard_normal((150, 150))
        motions = [la.orth(rigid_motions(each.astype(float))) for each in self.places[chosen]]
        free = np.eye(150) - np.array([each @ each.T for each in motions]).reshape(-1, 150, 150)
        return np.asarray(self.young[chosen, None, None] * (free @ (matrix @ matrix.T) @ free))

    def _nodal_mass(self, chosen: Chosen) -> Array:
        return np.broadcast_to(np.eye(50) + 0.02, (len(self.young[chosen]), 50, 50))

    def shape_values(self, elements: NDArray[np.integer], places: Array) -> Array:
        raise NotImplementedError


def solid_of(mesh: Octree) -> Any:
    """What ranks are to share of a solid with random matrices."""
    young = np.random.default_rng(1).uniform(0.5, 2.0, len(mesh.nodes))
    nodes = SimpleNamespace(
        nodes=mesh.lattice.astype(float), origin=np.zeros(3), n_nodes=len(mesh.lattice)
    )
    elements = OctreeElements(young, mesh.places)
    dofs = 3 * len(mesh.lattice)
    return SimpleNamespace(
        mesh=nodes,
        positions=nodes.nodes,
        elements=elements,
        connectivity=mesh.nodes,
        graph=mesh,
        n_nodes=len(mesh.lattice),
        n_dofs=dofs,
    )


def none(centre: Array, edge: float) -> Flags:
    """No cell is wanted."""
    return np.zeros(len(centre), dtype=bool)


def about_a_ring(centre: Array, radius: float, reach: float) -> Wanted:
    """Cells nearer to a level circle than `reach` of their edges."""

    def wanted(places: Array, edge: float) -> Flags:
        apart = places - centre
        across = np.hypot(apart[:, 0], apart[:, 1]) - radius
        return np.hypot(across, apart[:, 2]) < reach * edge

    return wanted


def about_a_line(point: Array, direction: Array, reach: float) -> Wanted:
    """Cells nearer to a straight line than `reach` of their edges."""
    along = np.asarray(direction) / np.linalg.norm(direction)

    def wanted(places: Array, edge: float) -> Flags:
        apart = places - point
        across = apart - (apart @ along)[:, None] * along
        return np.linalg.norm(across, axis=1) < reach * edge

    return wanted


def about_a_bowl(centre: Array, radius: float, thickness: float) -> Wanted:
    """Cells that a thin hemisphere, open upwards, passes through."""

    def wanted(places: Array, edge: float) -> Flags:
        apart = places - centre
        across = np.abs(np.linalg.norm(apart, axis=1) - radius)
        return (across < 0.5 * thickness + 0.7 * edge) & (apart[:, 2] < 0.5 * edge)

    return wanted
