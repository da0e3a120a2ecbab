"""The lowest modes of the fine solid from those of a coarse model: inverse iteration.

Prolonged to the fine nodes, coarse modes are in the right place but far too stiff: what is wrong
with them oscillates from node to node. Such parts are what (K - mu M)^-1 M removes first, with one
factorisation and few, wide blocks of right-hand sides.

With mu amid the eigenvalues the same factorisation serves those who want the fine modes after all,
and its inertia counts the eigenvalues below mu. If fewer are found, the coarse model lacks modes:
then the iteration goes on with a shift below all of them, where the lowest grow most.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.fem.geometry import Blocks
from carillon.fem.model import ElasticModel
from carillon.processes.mpi import MPI
from solver.analysis.coarse_start import prolonged
from solver.analysis.modal_solver import ModalSolver, Prepared
from solver.analysis.options import RANDOM
from solver.correction.random_start import Approximation
from solver.correction.shift import is_amid
from solver.distribution.collective import share_cores
from solver.files.initial_modes import scatter_rows
from solver.linear import Inverse
from solver.subspace.rayleigh_ritz import SHIFT_FRACTION, rayleigh_ritz
from solver.subspace.start import start_block

AMID = (0.45, 0.65)
"""Shares of the rated eigenvalues between which the shift lies, in their widest gap."""
ITERATIONS = 2
"""Number of inverse iterations."""
RANDOM_VECTORS = 16
"""Number of random vectors beside the coarse modes, which lead to modes that the coarse model
lacks."""
NEXT_TO_SHIFT, FAR_FROM_SHIFT = 1e-3, 1e-2
"""Relative distance from the value below which eigenvalues are counted, within which an eigenvalue
may lie on either side: if the value is the shift, and if the shift is below all eigenvalues."""


@dataclass(frozen=True)
class NearModes:
    """Approximate modes of the fine solid."""

    values: Array
    """(k,) Ritz values [rad^2/s^2], not below the eigenvalues."""
    vectors: Array
    """(local, k) mass-orthonormal, this rank's rows."""
    missed: int
    """Number of modes below the shift that are not among them."""


class InverseIteration:
    """A fine solid on all ranks; collective.

    Attributes
    ----------
    prepared
        Partition and symbolic analysis of its mesh.
    inverse
        The last factorisation; None before the first.
    """

    def __init__(self, fine: ElasticModel | None, comm: MPI.Comm = MPI.COMM_WORLD) -> None:
        threads = share_cores(comm)
        self.prepared = Prepared.of_model(fine, comm)
        self.system = self.prepared.assembled(threads)
        self.inverse: Inverse | None = None
        self._counted: tuple[float, int] | None = None

    def lowest(self, values: Array, blocks: Iterable[Array], columns: int) -> NearModes:
        """Lowest elastic modes from coarse ones.

        Parameters
        ----------
        values
            (k,) elastic eigenvalues [rad^2/s^2] of the coarse modes that are rated.
        blocks
            `columns` coarse modes, k or more, prolonged to the fine nodes (n_dofs, c), a few at a
            time; looked at on rank 0 alone.
        """
        system, comm = self.system, self.system.comm
        below = -SHIFT_FRACTION * float(values[0])
        if self.inverse is None:
            self._factorise(_amid(values) if self.prepared.linear.indefinite else below)
        rows = scatter_rows(blocks, columns, self.prepared.local_mesh, comm)
        start = np.concatenate([rows, start_block(system, RANDOM_VECTORS, 0)], axis=1)
        ritz_values, vectors = self._iterated(start)
        if self.missed(ritz_values) and self._shift > 0.0:
            self._factorise(below)
            ritz_values, vectors = self._iterated(vectors)
        return NearModes(ritz_values, vectors, self.missed(ritz_values))

    def whole(self, vectors: Array) -> Array | None:
        """Vectors (n_dofs, k) in the mesh's order of nodes on rank 0, None elsewhere."""
        return self.system.gather(np.ascontiguousarray(vectors))

    def destroy(self) -> None:
        """Free what numpy does not."""
        if self.inverse is not None:
            self.inverse.destroy()
        self.system.destroy()

    @property
    def _shift(self) -> float:
        return 0.0 if self.inverse is None else self.inverse.shift

    def _factorise(self, shift: float) -> None:
        if self.inverse is not None:
            self.inverse.destroy()
        self.inverse = self.prepared.linear.inverse(self.system, shift)
        if shift > 0.0:
            self._counted = shift, self.inverse.negative - self.system.n_rigid

    def _iterated(self, vectors: Array) -> tuple[Array, Array]:
        assert self.inverse is not None
        system = self.system
        for _ in range(ITERATIONS):
            vectors = self.inverse.solve(system.times_mass(vectors))
            vectors /= np.sqrt(system.column_products(vectors, vectors))
        return rayleigh_ritz(system, vectors)

    def missed(self, values: Array) -> int:
        """Number of eigenvalues that were counted and are not among these (k,)."""
        if self._counted is None:
            return 0
        shift, below = self._counted
        slack = NEXT_TO_SHIFT if self._shift > 0.0 else FAR_FROM_SHIFT
        return max(below - int((values < (1.0 + slack) * shift).sum()), 0)


def _amid(values: Array) -> float:
    """A shift amid ascending values (k,), away from all."""
    first = int(AMID[0] * (len(values) - 1))
    last = max(int(AMID[1] * (len(values) - 1)), first + 1)
    if last >= len(values):
        return 0.5 * float(values[0])
    gaps = values[first + 1 : last + 1] / values[first:last]
    place = first + int(gaps.argmax())
    return float(np.sqrt(values[place] * values[place + 1]))


@dataclass
class FineStart:
    """Coarse modes, and the fine solid that they were rated by."""

    solid: InverseIteration
    values: Array
    """(q,) elastic eigenvalues [rad^2/s^2] of the coarse model."""
    blocks: Blocks | None
    modes: Array | None
    """The coarse mesh, and its modes (coarse n_dofs, q), on rank 0."""

    @property
    def prepared(self) -> Prepared:
        """Partition and analysis of the fine mesh."""
        return self.solid.prepared

    def begin(self, solver: ModalSolver) -> Approximation | None:
        """What an analysis of the fine solid may start from; None if it has no use for it."""
        rigid = self.solid.system.n_rigid
        requested = solver.options.modes - rigid
        if solver.options.method not in RANDOM or solver.options.check_inertia:
            return None
        mesh = solver.local_mesh

        def rows() -> Array:
            columns = prolonged(self.blocks, self.modes)
            return scatter_rows(columns, len(self.values), mesh, solver.comm)

        inverse = self.solid.inverse
        if solver.local_mesh is not self.prepared.local_mesh or inverse is None:
            inverse = None
        elif not self.prepared.linear.indefinite or not is_amid(inverse, requested, rigid):
            inverse = None
        else:
            self.solid.inverse = None  # The analysis frees it.
        return Approximation(self.values, rows, inverse)
