"""The methods that the study compares."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

REFERENCE, PLAIN, CORRECTED = "slepc", "hcms", "hcms_ec"
"""Methods that the page speaks of: the one that errors are taken against, and the paper's two."""


@dataclass(frozen=True)
class SolverMethod:
    """A method of `carillon modes`."""

    label: str
    """Its name for people."""
    options: Mapping[str, Any]
    """Options of the command that choose it."""


METHODS = {
    PLAIN: SolverMethod("HCMS", {"method": "hcms", "corrections": 0}),
    CORRECTED: SolverMethod("HCMS + EC", {"method": "hcms"}),
    "lanczos": SolverMethod("Block Lanczos", {"method": "lanczos"}),
    "lobpcg": SolverMethod("LOBPCG", {"method": "lobpcg"}),
    "coarse_lobpcg": SolverMethod("Coarse modes + LOBPCG", {"method": "lobpcg", "refine": True}),
    "hcms_lobpcg": SolverMethod("HCMS + LOBPCG", {"method": "hcms", "linear_solver": "amg-cg"}),
    REFERENCE: SolverMethod("SLEPc", {"method": "slepc"}),
    "arpack": SolverMethod("ARPACK", {"method": "arpack"}),
}
"""All methods by their names in the configuration."""
CHOICES = {"hcms": CORRECTED, "lanczos": "lanczos", "lobpcg": "coarse_lobpcg"}
"""What the method is here that `auto` takes of a solid of voxels, by its name in the solver."""
