"""Modal analysis of a model by any method, with the evidence that the result is right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.errors import ConvergenceError, UserError
from carillon.progress import say
from solver.correction import EIGENVALUE_TOLERANCE, correct, default_guard
from solver.decomposition import on_root
from solver.distribution import Share, distribute
from solver.eigensolver import TYPES
from solver.hcms.synthesis import synthesize
from solver.model import RIGID_MODES, ElasticModel
from solver.system import System, assemble
from solver.timing import Phases, peak_memory
from solver.truth import RESIDUAL_TOLERANCE, can_count, prove_complete, solve_truth

Array = NDArray[np.float64]

METHODS = ("hcms", *TYPES)
RIGID_TOLERANCE = 1e-9
"""Eigenvalues below this fraction of the largest computed one count as zero."""
ORTHOGONALITY_TOLERANCE = 1e-8
"""Largest accepted entry of X^T M X - I."""
MAX_CORRECTIONS = 40
FEWEST_SPARE = 8
"""Vectors that the correction needs beyond the modes asked for, to tell the last from the rest."""


@dataclass(frozen=True)
class SolverOptions:
    """What to compute and how; the defaults suit a model of some ten thousand unknowns.

    Attributes
    ----------
    method
        `hcms` (with error correction), `slepc` or `arpack` (ground truth).
    modes
        Number of modes, rigid ones included.
    tolerance
        `hcms`: relative eigenvalue error at which the correction stops; 0 makes exactly
        `corrections` steps.  Ground truth: relative residual of the eigensolver.
    corrections
        Largest number of correction steps; 0 is plain HCMS.
    degree
        Polynomial degree of a correction step, see `solver.correction.correct`.
    keep
        Modes kept at the root of the merge tree; a margin above `modes` if not given.
    subdomains
        Number of subdomains; from the number of unknowns if not given.
    interface
        `free` or `fixed`, see `solver.hcms.condense`.
    seed
        Seed of the partition.
    prove
        Whether ground truth is proven complete by an inertia count.
    """

    method: str = "hcms"
    modes: int = 256
    tolerance: float | None = None
    corrections: int = MAX_CORRECTIONS
    degree: int = 3
    keep: int | None = None
    subdomains: int | None = None
    interface: str = "free"
    seed: int = 0
    prove: bool = True


@dataclass
class Modes:
    """Result of a modal analysis.

    Attributes
    ----------
    values
        (k,) eigenvalues [rad^2/s^2], ascending.
    vectors
        (local, k) mass-normalised modes, this rank's rows of `system`.
    residuals
        (k,) residual ratios, see `residual_ratios`.
    evidence
        What the solver achieved: orthogonality, error estimate, steps, inertia, rigid modes, ranks,
        peak memory.
    seconds
        Wall time by phase.
    """

    values: Array
    vectors: Array
    residuals: Array
    system: System
    evidence: dict[str, Any] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)


def modal_analysis(
    model: ElasticModel | None,
    options: SolverOptions,
    comm: MPI.Comm = MPI.COMM_WORLD,
    verbose: bool = False,
) -> Modes:
    """Compute the lowest modes of `model`.

    All ranks of `comm` pass the same options and get the same values.

    Parameters
    ----------
    model
        The solid; only rank 0's is looked at, and dealt out to the others, who may pass None.
    options
        What to compute and how.
    verbose
        Whether to show each phase and its time.

    Raises
    ------
    UserError
        If more modes are wanted than there are unknowns, or more ranks than subdomains.
    ConvergenceError
        If a tolerance was missed, the modes are not orthonormal, or the body does not have six
        zero-frequency modes.
    """
    on_root(comm, lambda: check_mode_count(options.modes, cast(ElasticModel, model).n_dofs))
    phases = Phases(comm, verbose)
    with phases("partition"):
        share = distribute(model, options.subdomains, options.seed, comm)
    with phases("assembly"):
        system = assemble(share, comm)
    evidence: dict[str, Any] = {
        "ranks": comm.size,
        "subdomains": share.decomposition.tree.parts,
        "n_dofs": share.n_dofs,
    }
    if options.method == "hcms":
        values, vectors = _hcms(share, system, options, phases, evidence, verbose)
    else:
        values, vectors = _general_solver(system, options, phases, evidence)
    with phases("verification"):
        residuals, orthogonality = verify(system, values, vectors)
    evidence["orthogonality"] = orthogonality
    evidence["residual_max"] = float(residuals.max())
    evidence["rigid_modes"] = count_rigid(values)
    evidence["peak_memory_bytes"] = peak_memory(comm)
    _judge(options, evidence)
    return Modes(values, vectors, residuals, system, evidence, phases.seconds)


def check_mode_count(modes: int, n_dofs: int) -> None:
    """Raise UserError unless there is an elastic mode among `modes` and unknowns for all."""
    if modes <= RIGID_MODES:
        raise UserError(
            f"{modes} modes asked for; the first {RIGID_MODES} are rigid motions, expected "
            f"{RIGID_MODES + 1} or more"
        )
    if modes > n_dofs:
        raise UserError(
            f"{modes:,} modes asked for, but the model has {n_dofs:,} unknowns; ask for fewer or "
            "raise --resolution"
        )


def default_keep(modes: int) -> int:
    """Modes kept at the root: those that the correction iterates, and a few to choose from."""
    return modes + default_guard(modes) + 16


def _general_solver(
    system: System, options: SolverOptions, phases: Phases, evidence: dict[str, Any]
) -> tuple[Array, Array]:
    with phases("eigensolver"):
        truth = solve_truth(
            system, options.modes, options.method, options.tolerance or RESIDUAL_TOLERANCE
        )
    evidence["eigensolver_iterations"] = truth.iterations
    if options.prove and can_count():
        with phases("inertia"):
            inertia = prove_complete(system, truth)
        evidence |= {
            "inertia_at": inertia.value,
            "inertia_count": inertia.counted,
            "inertia_expected": inertia.computed,
        }
    return truth.values[: options.modes], np.asfortranarray(truth.vectors[:, : options.modes])


def _hcms(
    share: Share,
    system: System,
    options: SolverOptions,
    phases: Phases,
    evidence: dict[str, Any],
    verbose: bool,
) -> tuple[Array, Array]:
    keep = default_keep(options.modes) if options.keep is None else options.keep
    least = options.modes + (FEWEST_SPARE if options.corrections else 0)
    if keep < min(least, share.n_dofs):
        raise UserError(
            f"--keep {keep} is too few for {options.modes} modes; expected at least {least}, and a "
            f"third more for fast convergence"
        )
    with phases("hcms"):
        start = synthesize(share, keep, options.interface, system.comm)
    evidence["hcms"] = start.counts.summary(system.comm)
    if options.corrections == 0:
        if len(start.values) < options.modes:
            raise UserError(
                f"HCMS kept {len(start.values)} modes, {options.modes} are wanted; raise --keep or "
                "lower --subdomains"
            )
        return start.values[: options.modes], start.vectors[:, : options.modes]
    with phases("correction"):
        result = correct(
            system,
            start.vectors,
            options.modes - RIGID_MODES,
            EIGENVALUE_TOLERANCE if options.tolerance is None else options.tolerance,
            options.corrections,
            options.degree,
            report=_reporter(verbose and system.comm.rank == 0),
        )
        stiff = system.inner(system.rigid, system.multiply(system.K, system.rigid))
    evidence |= {
        "corrections": result.steps,
        "right_hand_sides": result.solves,
        "eigenvalue_error_estimate": float(result.errors.max()),
    }
    values = np.concatenate([np.maximum(np.diag(stiff), 0.0), result.values])
    vectors = np.concatenate([system.rigid, result.vectors], axis=1)
    return values, np.asfortranarray(vectors)


def _reporter(visible: bool) -> Callable[[int, float], None] | None:
    if not visible:
        return None
    return lambda step, worst: say(f"  after {step} corrections: eigenvalue error {worst:.1e}")


def verify(system: System, values: Array, vectors: Array) -> tuple[Array, float]:
    """Residual ratios of the pairs, and the largest entry of X^T M X - I.

    Products are taken with the assembled matrices; nothing is believed of the solver.
    """
    mass_vectors = system.multiply(system.M, vectors)
    gram = system.inner(vectors, mass_vectors)
    orthogonality = float(np.abs(gram - np.eye(len(values))).max())
    return residual_ratios(system, values, vectors, mass_vectors), orthogonality


def residual_ratios(system: System, values: Array, vectors: Array, mass_vectors: Array) -> Array:
    """|K x - lambda M x| / (lambda |M x|) of each pair, in the 2-norm.

    Rigid modes, whose lambda is zero, are measured with the first elastic eigenvalue instead.
    """
    residual = system.multiply(system.K, vectors) - mass_vectors * values
    norms = np.sqrt(system.column_products(residual, residual))
    mass_norms = np.sqrt(system.column_products(mass_vectors, mass_vectors))
    tiny = np.finfo(float).tiny
    return np.asarray(norms / np.maximum(residual_scale(values) * mass_norms, tiny))


def residual_scale(values: Array) -> Array:
    """What residuals are measured with: each eigenvalue, the first elastic one for rigid modes."""
    return np.maximum(values, values[RIGID_MODES])


def count_rigid(values: Array) -> int:
    """Number of eigenvalues that are zero to rounding."""
    return int(np.sum(values < RIGID_TOLERANCE * values[-1]))


def _judge(options: SolverOptions, evidence: dict[str, Any]) -> None:
    if evidence["orthogonality"] > ORTHOGONALITY_TOLERANCE:
        raise ConvergenceError(
            f"the modes are mass-orthonormal to {evidence['orthogonality']:.1e} only, "
            f"{ORTHOGONALITY_TOLERANCE:.0e} is required"
        )
    exact = options.method != "hcms" or (options.corrections > 0 and options.tolerance != 0.0)
    if exact and evidence["rigid_modes"] != RIGID_MODES:
        raise ConvergenceError(
            f"{evidence['rigid_modes']} zero-frequency modes found, a connected free body has "
            f"{RIGID_MODES}; part of the model hangs on a hinge or has almost no stiffness"
        )
