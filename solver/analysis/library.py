"""The solver as a function: arrays in, arrays out."""

from dataclasses import dataclass
from typing import Any

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.geometry import HexMesh
from carillon.fem.materials import young_modulus
from carillon.fem.model import Solid, fine_model
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from solver.distribution.collective import bcast_from_root, compute_on_root
from solver.files.initial_modes import scatter_rows
from solver.files.modes_file import frequencies


@dataclass(frozen=True)
class Solution:
    """Modes of a solid."""

    eigenvalues: Array
    frequencies: Array
    """(k,) [rad^2/s^2] and [Hz], ascending, rigid motions first."""
    modes: Array | None
    """(n_dofs, k) mass-normalised modes [kg^-1/2], row 3 n + i is node n of the mesh along axis i;
    None on other ranks than 0."""
    residuals: Array
    """(k,) residual ratios, see `solver.verification.residuals.residual_ratios`."""
    evidence: dict[str, Any]
    """What the solver achieved."""
    seconds: dict[str, float]
    """Wall time by phase."""


def solve(
    model: HexMesh | Solid | None,
    material: str | Array | None = None,
    modes: int = 256,
    initial_modes: Solution | Array | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
    **options: Any,
) -> Solution:
    """Lowest modes of a solid.

    Raises UserError for a material that does not fit the mesh, or impossible options, and
    ConvergenceError if a tolerance was missed.

    Parameters
    ----------
    model
        Hexahedral mesh, or a model with material of either discretisation; ranks other than 0 may
        pass None.
    material
        Young's modulus [Pa], (m,) of the voxels or (m, 8) at their quadrature points, or the name
        of a material (`carillon.fem.materials.NAMES`).  None keeps that of the model.
    modes
        Number of modes, rigid ones included.
    initial_modes
        Modes of a similar material on the same mesh, which are corrected.
    comm
        Ranks that share the work.
    options
        Other fields of `SolverOptions`: `method`, `tolerance`, `linear_solver` and so on.

    Notes
    -----
    For many materials on one mesh `ModalSolver` computes what depends on the mesh only once.

    Examples
    --------
    >>> import numpy as np
    >>> from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize
    >>> mesh = hexmesh_from_voxels(voxelize(builtin_surface("bar"), 12))
    >>> solution = solve(mesh, "uniform", modes=10, method="slepc")
    >>> len(solution.frequencies), solution.modes.shape == (mesh.n_dofs, 10)
    (10, True)
    >>> again = solve(mesh, 1.1 * np.full(mesh.n_cells, 1e9), modes=10, initial_modes=solution)
    >>> bool(abs(again.frequencies[9] / solution.frequencies[9] - 1.1**0.5) < 1e-6)
    True
    """
    solid = compute_on_root(comm, lambda: _with_material(model, material))
    solver = ModalSolver(solid, SolverOptions(modes=modes, **options), comm, once=True)
    whole = initial_modes.modes if isinstance(initial_modes, Solution) else initial_modes
    count = bcast_from_root(comm, lambda: _columns(whole, solid, modes))
    rows = None
    if count is not None:
        rows = scatter_rows([] if whole is None else [whole], count, solver.local_mesh, comm)
    result = solver.solve(initial_modes=rows)
    return Solution(
        result.values,
        frequencies(result.values),
        result.system.gather(result.vectors),
        result.residuals,
        result.evidence,
        {**solver.seconds, **result.seconds},
    )


def _columns(block: Array | None, solid: Solid | None, modes: int) -> int | None:
    """Number of initial modes, once they fit the solid and suffice."""
    if block is None:
        return None
    assert solid is not None
    rows, count = block.shape
    if rows != solid.n_dofs:
        raise UserError(f"initial modes of {rows:,} unknowns, expected {solid.n_dofs:,}")
    if count < modes:
        raise UserError(f"{count} initial modes, {modes} are wanted; start from as many")
    return count


def _with_material(model: HexMesh | Solid | None, material: str | Array | None) -> Solid:
    if model is None:
        raise UserError("no model on rank 0, expected a mesh or an elastic model")
    if material is None:
        if isinstance(model, HexMesh):
            raise UserError("a mesh has no material; pass Young's modulus [Pa] of its cells")
        return model
    mesh = model if isinstance(model, HexMesh) else model.mesh
    young = young_modulus(material, mesh) if isinstance(material, str) else material
    return fine_model(mesh, young) if isinstance(model, HexMesh) else model.with_young(young)
