"""What modal analyses of one mesh share, whatever they compute and of which material."""

from __future__ import annotations

from dataclasses import dataclass

from mpi4py import MPI

from carillon.fem.model import Solid
from solver.assembly.system import Layout, System, assemble
from solver.distribution.local_mesh import LocalMesh, distribute
from solver.linear import LinearSolver


@dataclass(frozen=True)
class Prepared:
    """Partition and symbolic analysis of a mesh, one subdomain a rank.

    Attributes
    ----------
    local_mesh
        This rank's part of the solid, with its material.
    layout, linear
        Layout of its matrices, and the solver of linear systems with them.
    """

    local_mesh: LocalMesh
    layout: Layout
    linear: LinearSolver

    @classmethod
    def of_model(cls, model: Solid | None, comm: MPI.Comm) -> Prepared:
        """Prepare a model, which is None except on rank 0; collective."""
        return cls.of_mesh(distribute(model, comm.size, comm=comm), comm)

    @classmethod
    def of_mesh(
        cls, local_mesh: LocalMesh, comm: MPI.Comm, linear_solver: str = "auto"
    ) -> Prepared:
        """Prepare a mesh that is distributed; collective."""
        layout = Layout.of_local_mesh(local_mesh, comm)
        return cls(local_mesh, layout, LinearSolver(linear_solver, layout))

    def assembled(self, threads: int = 1) -> System:
        """Stiffness and mass."""
        elements = self.local_mesh.cells.elements
        return assemble(self.local_mesh, self.layout.comm, self.layout, elements, threads)
