"""Eigenvalues after 0, 1, 2, ... corrections from different start vectors (Fig. 10)."""

from pathlib import Path
from typing import Any, cast

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.errors import UserError
from carillon.fem.model import Solid
from carillon.processes.mpi import MPI
from solver.analysis.bounds import check_mode_count, default_keep
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from solver.assembly.system import Layout, System, assemble
from solver.correction.criteria import STEPWISE
from solver.correction.error_correction import correct
from solver.distribution.collective import bcast_from_root
from solver.distribution.local_mesh import LocalMesh, distribute
from solver.files.modes_file import read_modes
from solver.hcms.condense import INTERFACES
from solver.hcms.synthesis import synthesize
from solver.linear import LinearSolver
from solver.reference.eigensolver import installed_method
from solver.verification.matching import eigenvalue_errors

RANDOM = "random"
STARTS = (*(f"hcms-{interface}" for interface in INTERFACES), RANDOM)
"""HCMS by each interface treatment, and random vectors."""


def correction_history(
    model: Solid | None,
    modes: int,
    steps: int,
    seed: int = 0,
    truth: str | Path | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> dict[str, Any]:
    """Elastic eigenvalues [rad^2/s^2] after each correction, by start and acceleration.

    The starts are HCMS with every interface treatment, and random Gaussian vectors,
    orthogonalised, as many as HCMS keeps.

    Raises UserError if there are too few unknowns for so many modes, or `truth` is not of this
    solid.

    Returns plain values: `rigid_modes`, `exact` (e,) of the others, and `histories`, each with
    `start`, `acceleration`, `values` (steps + 1, e) and their errors, `eigenvalue_error`.

    Parameters
    ----------
    model
        The solid; only rank 0's is looked at.
    modes
        Number of modes, rigid ones included.
    steps
        Corrections made.
    truth
        Modes file of the same solid with its exact eigenvalues; if not given, SLEPc finds them, or
        ARPACK where SLEPc is not installed.
    """
    bcast_from_root(comm, lambda: check_mode_count(modes, cast(Solid, model).n_dofs))
    rigid = bcast_from_root(comm, lambda: cast(Solid, model).rigid_modes)
    exact = _exact(model, modes, truth, comm)[rigid:]
    local_mesh = distribute(model, None, seed, comm)
    layout = Layout.of_local_mesh(local_mesh, comm)
    system = assemble(local_mesh, comm, layout)
    linear = LinearSolver("auto", layout)
    histories = []
    keep = default_keep(modes, local_mesh.decomposition.tree.parts)
    for start in track(STARTS, "starts", visible=comm.rank == 0):
        if start == RANDOM:
            block = random_block(local_mesh, keep, seed, comm)
        else:
            block = synthesize(local_mesh, keep, start.removeprefix("hcms-"), comm).vectors
        for acceleration in STEPWISE:
            values = _correct(system, linear, block, modes - rigid, steps, acceleration)
            histories.append(
                {
                    "start": start,
                    "acceleration": acceleration,
                    "values": [step.tolist() for step in values],
                    "eigenvalue_error": [eigenvalue_errors(step, exact) for step in values],
                }
            )
    return {
        "modes": modes,
        "steps": steps,
        "n_dofs": local_mesh.n_dofs,
        "rigid_modes": rigid,
        "exact": exact.tolist(),
        "histories": histories,
    }


def _exact(model: Solid | None, modes: int, truth: str | Path | None, comm: MPI.Comm) -> Array:
    """The lowest eigenvalues (modes,) from the file `truth`, or by SLEPc or else ARPACK."""
    if truth is not None:
        return bcast_from_root(comm, lambda: _read_exact(cast(Solid, model), modes, truth))
    result = modal_analysis(model, SolverOptions(method=installed_method(), modes=modes), comm)
    result.system.destroy()
    return result.values


def _read_exact(model: Solid, modes: int, truth: str | Path) -> Array:
    file = read_modes(truth, with_modes=False)
    available, unknowns = len(file.eigenvalues), file.model.n_dofs
    if available < modes or unknowns != model.n_dofs:
        raise UserError(
            f"{truth}: {available:,} modes of {unknowns:,} unknowns, expected {modes:,} or more of "
            f"{model.n_dofs:,}"
        )
    return file.eigenvalues[:modes]


def _correct(
    system: System,
    linear: LinearSolver,
    block: Array,
    requested: int,
    steps: int,
    acceleration: str,
) -> list[Array]:
    """Ritz values (requested,) before the first correction and after each."""
    history: list[Array] = []
    correct(
        system,
        block,
        requested,
        linear,
        tolerance=0.0,
        max_steps=steps,
        acceleration=acceleration,
        observe=lambda step, values: history.append(values.copy()),
    )
    return history


def random_block(local_mesh: LocalMesh, columns: int, seed: int, comm: MPI.Comm) -> Array:
    """This rank's rows (local unknowns, columns) of a Gaussian block.

    Drawn by subdomain, so that it does not depend on who owns which.
    """
    offsets = local_mesh.decomposition.offsets
    drawn = [
        np.random.default_rng([seed, part]).standard_normal(
            (3 * int(offsets[part + 1] - offsets[part]), columns)
        )
        for part in local_mesh.decomposition.subdomains_of(comm.rank)
    ]
    return np.concatenate(drawn)
