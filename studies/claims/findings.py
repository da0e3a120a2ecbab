"""Verdict and figures of one claim of the paper, with the tables they were read from."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from studies.base.numbers import show
from studies.base.table import Table
from studies.claims.results import Claims

REPRODUCED, LESS, IN_PART, NOT = "reproduced", "less is needed", "in part", "not reproduced"
UNMEASURED = "not measured"
"""Verdicts."""
SIMILAR = 0.1
"""Errors, relative ones too, below which two blocks, costs or motions count as alike."""
EXACT = "HCMS + EC"
"""The corrected method on the fine mesh, in tables of the validation."""


@dataclass(frozen=True)
class Finding:
    """Measurement of one claim of the paper, and its verdict."""

    verdict: str
    """Whether it agrees."""
    text: str
    """The figures, in words."""
    files: tuple[str, ...] = ()
    """Tables that they are from."""


def ends(values: Iterable[float], kind: str = "times") -> str:
    """Least and greatest value in words."""
    least, most = (show(float(each), kind) for each in (np.min(list(values)), np.max(list(values))))
    return least if least == most else f"{least} to {most}"


def named(claims: Claims, table: Table) -> str:
    """File that a table was read from."""
    return next(name for name, each in claims.read.items() if each is table)


def files(claims: Claims, ending: str) -> tuple[str, ...]:
    """Files of all models with an ending, if any was read, in a word."""
    any_model = any(name.endswith(ending) for name in claims.read)
    return (f"validation/tables/MODEL{ending}",) if any_model else ()
