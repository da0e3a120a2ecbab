"""The solver runs that every model goes through, and what they are called."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Variant:
    """One way to compute the spectrum of a model."""

    label: str
    """Name for people, short enough for a table's head."""
    coarsen: str
    method: str
    """Options of `solver modes`."""
    corrected: bool
    """Whether error correction runs until its tolerance is met; plain HCMS otherwise."""
    role: str
    """What the run is there for, in a few words."""


TRUTH = "truth"

VARIANTS = {
    TRUTH: Variant("Ground truth", "none", "slepc", False, "SLEPc on the fine mesh"),
    "hcms": Variant("HCMS", "none", "hcms", False, "fine mesh, no error correction"),
    "hcms_ec": Variant("HCMS + EC", "none", "hcms", True, "fine mesh, error corrected"),
    "ddfem_hcms_ec": Variant(
        "DDFEM* + HCMS + EC", "ddfem", "hcms", True, "mesh coarsened by the forests"
    ),
    "ddfem_slepc": Variant("DDFEM*", "ddfem", "slepc", False, "SLEPc on the coarsened mesh"),
    "average_hcms_ec": Variant(
        "Average + HCMS + EC", "average", "hcms", True, "mesh coarsened by averaging moduli"
    ),
    "galerkin_hcms_ec": Variant(
        "Galerkin + HCMS + EC", "galerkin", "hcms", True, "mesh coarsened by Galerkin projection"
    ),
}

CANDIDATES = tuple(name for name in VARIANTS if name != TRUTH)

SHOWN = (TRUTH, "hcms", "hcms_ec", "ddfem_hcms_ec")
"""Variants whose modes are drawn and whose frequencies are listed."""

FROM_SOLID = "hcms_ec"
"""Variant that tells how far the model is from the solid."""

COARSENED = {
    "average_hcms_ec": "average",
    "galerkin_hcms_ec": "Galerkin",
    "ddfem_hcms_ec": "DDFEM*",
}
"""Variants that differ in nothing but the coarsening."""


def variants_of(model: Mapping[str, Any]) -> dict[str, Variant]:
    """Variants of a model, from its part of the configuration: finite cells are not coarsened."""
    fine = model["discretisation"] != "voxel"
    return {name: each for name, each in VARIANTS.items() if not fine or each.coarsen == "none"}


def candidates_of(model: Mapping[str, Any]) -> tuple[str, ...]:
    """Those of them that are compared with the truth."""
    return tuple(name for name in CANDIDATES if name in variants_of(model))


def judged_of(model: Mapping[str, Any]) -> tuple[str, ...]:
    """Candidates whose modes a validation judges."""
    return tuple(name for name in candidates_of(model) if name in SHOWN)


def further_of(model: Mapping[str, Any]) -> tuple[str, ...]:
    """Candidates that the report alone compares with the truth."""
    return tuple(name for name in candidates_of(model) if name not in SHOWN)


def shown_of(model: Mapping[str, Any]) -> tuple[str, ...]:
    """Those of them that are drawn and listed."""
    return tuple(name for name in SHOWN if name in variants_of(model))
