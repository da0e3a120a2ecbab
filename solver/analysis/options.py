"""What a modal analysis computes and how."""

from __future__ import annotations

from dataclasses import dataclass

from solver.hcms.condense import DEFAULT_INTERFACE
from solver.reference.eigensolver import TYPES

METHODS = ("hcms", *TYPES)
MAX_CORRECTIONS = 40


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
    keep
        Modes kept at the root of the merge tree; a margin above `modes` if not given.
    cutoff
        Frequency [Hz] up to which subdomains and groups of them keep their modes; numbers of modes
        that grow with their size if not given.
    subdomains
        Number of subdomains; from the number of unknowns if not given.
    interface
        Interface treatment, see `solver.hcms.condense`.
    seed
        Seed of the partition, and of the vectors that ground truth starts from.
    prove
        Whether an inertia count proves that no eigenvalue was missed, and those that were are
        searched for; by default for ground truth alone, for which further searches have to do where
        nothing can be counted.
    inner
        Inner solver of the correction, see `solver.linear.InnerSolver`.
    acceleration
        `lanczos`, `krylov` or `relaxation`, see `solver.correction.correct.correct`.
    """

    method: str = "hcms"
    modes: int = 256
    tolerance: float | None = None
    corrections: int = MAX_CORRECTIONS
    keep: int | None = None
    cutoff: float | None = None
    subdomains: int | None = None
    interface: str = DEFAULT_INTERFACE
    seed: int = 0
    prove: bool | None = None
    inner: str = "auto"
    acceleration: str = "lanczos"
