"""The methods that the study compares."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

REFERENCE, PLAIN, CORRECTED = "slepc", "hcms", "hcms_ec"
"""Methods that the page speaks of: the one that errors are taken against, and the paper's two."""


@dataclass(frozen=True)
class Method:
    """A method of `carillon modes`."""

    label: str
    """Its name for people."""
    options: Mapping[str, Any]
    """Fields of `SolverOptions` that choose it."""


METHODS = {
    PLAIN: Method("HCMS", {"method": "hcms", "corrections": 0}),
    CORRECTED: Method("HCMS + EC", {"method": "hcms"}),
    "lanczos": Method("Block Lanczos", {"method": "lanczos"}),
    "lobpcg": Method("LOBPCG", {"method": "lobpcg"}),
    "hcms_lobpcg": Method("HCMS + LOBPCG", {"method": "hcms", "linear_solver": "amg-cg"}),
    REFERENCE: Method("SLEPc", {"method": "slepc"}),
    "arpack": Method("ARPACK", {"method": "arpack"}),
}
"""All methods by their names in the configuration."""
