"""NumPy: the moduli of a design, for analyses of the fine solid."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from carillon.files.atomic import atomic_path
from sound.project.design import Design


def write_moduli(path: str | Path, design: Design) -> None:
    """Write Young's moduli (M,) [Pa] of the fine cells, in the order of the solver's own cells.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        np.save(file, design.young)
