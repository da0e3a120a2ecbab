"""What a modal analysis computes and how."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from carillon.errors import UserError, on_all_ranks
from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import (
    Corrections,
    Number,
    NumberOfModes,
    NumberOfUnknowns,
    ToleranceOrNone,
    between,
)
from solver import linear
from solver.correction.criteria import ACCELERATIONS, EIGENVALUE_TOLERANCE
from solver.hcms.condense import DEFAULT_INTERFACE, INTERFACES
from solver.reference.eigensolver import TYPES, require_method
from solver.reference.truth import RESIDUAL_TOLERANCE

AUTO = "auto"
"""Name of the choice that is left to the program."""
METHODS = (AUTO, "hcms", "lanczos", "lobpcg", *TYPES)
RANDOM = ("lanczos", "lobpcg")
"""Methods that begin with random vectors."""
MAX_CORRECTIONS = 40
MISSED = ("fail", "keep")
"""Consequences of a correction that misses its tolerance."""
LEAST_UNKNOWNS = 4
"""Least number of unknowns for each mode at which `auto` starts from random vectors."""


@parameters
class SolverOptions:
    """What to compute and how; the defaults suit a model of some ten thousand unknowns.

    The interface treatments are told in `solver.hcms.condense`, the linear solvers in
    `solver.linear.LinearSolver`, the accelerations in `solver.correction.error_correction`.
    """

    method: Annotated[str, OneOf(*METHODS)] = option(
        "auto",
        "hcms with error correction; from random vectors lanczos, or lobpcg with multigrid for "
        "what is too large to factorise; auto, the fastest of these; or ground truth by slepc, or "
        "arpack, which needs no SLEPc",
    )
    modes: NumberOfModes = option(256, "number of modes, rigid ones included")
    tolerance: ToleranceOrNone | None = option(
        None,
        "hcms, lanczos, lobpcg: relative eigenvalue error to correct to "
        f"(default {EIGENVALUE_TOLERANCE:g}; with hcms 0 makes exactly --corrections steps); "
        f"slepc, arpack: residual tolerance (default {RESIDUAL_TOLERANCE:g})",
    )
    corrections: Corrections = option(
        MAX_CORRECTIONS, "largest number of correction steps; 0 is plain HCMS"
    )
    retained_modes: NumberOfUnknowns | None = option(
        None, "modes kept at the root of the merge tree (default: some more than --modes)"
    )
    cutoff: Annotated[float, between(1e-9, 1000000000000000.0)] | None = option(
        None,
        "frequency [Hz] up to which HCMS keeps modes below the root (default: numbers of modes "
        "that grow with the subdomains)",
        metavar="HZ",
    )
    subdomains: NumberOfUnknowns | None = option(
        None, "number of subdomains (default: from the unknowns)"
    )
    interface: Annotated[str, OneOf(*INTERFACES)] = option(
        DEFAULT_INTERFACE, "treatment of interfaces by HCMS"
    )
    seed: Number = option(
        0, "of random materials, the partition, and the vectors that slepc and arpack start from"
    )
    check_inertia: bool | None = option(
        None,
        "count the eigenvalues by inertia, and find those that are missing (default: for slepc "
        "and arpack)",
    )
    linear_solver: Annotated[str, OneOf(*linear.METHODS)] = option(
        "auto", "linear solver of the corrections; auto is the fastest direct one"
    )
    acceleration: Annotated[str, OneOf(*ACCELERATIONS)] = option(
        "lanczos", "of the corrections; relaxation is the paper's"
    )
    missed_tolerance: Annotated[str, OneOf(*MISSED)] = option(
        "fail",
        "what comes of a correction that misses its tolerance: fail, with status 3 and no file, or "
        "keep, a file that tells what was reached",
    )

    @property
    def is_general(self) -> bool:
        """Whether a general eigensolver finds the modes, as ground truth."""
        return self.method in TYPES

    def for_residuals(self) -> SolverOptions:
        """The options with a tolerance that lets the modes' residuals tell errors of elements.

        Raises UserError where modes are not corrected.
        """
        if self.is_general:
            return self
        if not self.is_corrected:
            raise UserError(
                "modes that are not corrected do not tell how far finite cells are from the solid; "
                "add --no-estimate, or leave out --tolerance 0 and --corrections 0"
            )
        tolerance = EIGENVALUE_TOLERANCE if self.tolerance is None else self.tolerance
        return replace(self, tolerance=min(tolerance, EIGENVALUE_TOLERANCE))

    @property
    def keeps_missed(self) -> bool:
        """Whether a correction that misses its tolerance yields what it has reached."""
        return self.missed_tolerance == "keep"

    @property
    def is_corrected(self) -> bool:
        """Whether approximate modes are corrected, and to a tolerance."""
        return self.corrections > 0 and self.tolerance != 0.0

    @on_all_ranks()
    def with_method(self, n_dofs: int) -> SolverOptions:
        """The same with a method for `auto`: the fastest of those that the other options allow.

        Raises UserError for options that the method has no use for, and for what needs a package
        that is not installed.
        """
        require_method(self.method)
        given = {
            "--retained-modes": self.retained_modes,
            "--cutoff": self.cutoff,
            "--subdomains": self.subdomains,
        }
        strange = [name for name, value in given.items() if value is not None]
        if self.acceleration != "lanczos":
            strange.append(f"--acceleration {self.acceleration}")
        if self.corrections == 0:
            strange.append("--corrections 0")
        if self.tolerance == 0.0:
            strange.append("--tolerance 0")
        if self.linear_solver == "icc-pcg":
            strange.append("--linear-solver icc-pcg")
        if self.method in RANDOM and strange:
            raise UserError(f"--method {self.method} has no use for {', '.join(strange)}; use hcms")
        multigrid = self.linear_solver == "amg-cg"
        if self.method == "lanczos" and multigrid:
            raise UserError("--method lanczos has no use for --linear-solver amg-cg; use lobpcg")
        if self.method == "lobpcg":
            if self.linear_solver not in ("auto", "amg-cg"):
                raise UserError(
                    f"--method lobpcg has no use for --linear-solver {self.linear_solver}; use "
                    "lanczos"
                )
            linear.require_method("amg-cg", "--method lobpcg")
            return replace(self, linear_solver="amg-cg")
        linear.require_method(self.linear_solver)
        if self.method != AUTO:
            return self
        if strange or n_dofs < LEAST_UNKNOWNS * self.modes:
            return replace(self, method="hcms")
        return replace(self, method="lobpcg" if multigrid else "lanczos")
