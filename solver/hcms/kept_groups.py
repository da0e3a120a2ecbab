"""Groups of subdomains whose material is that of the synthesis before: their modes are kept.

Where one part of a solid is painted, the subdomains there are solved and merged anew, and what they
are merged into up to the root.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from carillon.arrays import Array
from carillon.fem.elasticity import Elasticity
from carillon.fem.elements import Elements
from carillon.processes.mpi import MPI
from solver.distribution.tree import MergeTree
from solver.hcms.merge import Group


@dataclass
class KeptGroups:
    """Modes and merges of this rank in the synthesis before, by the number of the group."""

    young: dict[int, Array] = field(default_factory=dict)
    """Moduli [Pa] of the cells that touch each subdomain of this rank."""
    bases: dict[int, Array] = field(default_factory=dict)
    """Modes (3 nodes, k) of each subdomain of this rank."""
    groups: dict[int, Group] = field(default_factory=dict)
    """Subdomains, and merged groups that this rank holds."""
    coefficients: dict[int, tuple[Array, Array]] = field(default_factory=dict)
    """Coefficients of each merged group in the modes of its left and of its right child."""
    laws: tuple[Elasticity, ...] = ()
    density: Array = field(default_factory=lambda: np.empty(0))
    """Elasticity and density [kg/m^3] of its regions."""

    def forget(self) -> None:
        """Keep nothing: a synthesis that failed has made some of its groups."""
        for each in (self.young, self.bases, self.groups, self.coefficients):
            each.clear()

    def unchanged(
        self, elements: dict[int, Elements], tree: MergeTree, comm: MPI.Comm
    ) -> frozenset[int]:
        """Groups, subdomains among them, that are as they were; the same on every rank.

        Collective. `elements` are those that touch each subdomain of this rank; the next call
        compares with them.
        """
        laws, density = self.laws, self.density
        if elements:
            regions = next(iter(elements.values())).regions
            laws, density = regions.laws, regions.density
        is_same = laws == self.laws and np.array_equal(density, self.density)
        same = [
            part
            for part, each in elements.items()
            if is_same and part in self.young and np.array_equal(each.young, self.young[part])
        ]
        self.young = {part: each.young for part, each in elements.items()}
        self.laws, self.density = laws, density
        result = {part for parts in comm.allgather(same) for part in parts}
        for merge in tree.merges:
            if merge.left in result and merge.right in result:
                result.add(merge.group)
        return frozenset(result)
