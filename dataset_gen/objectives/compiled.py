"""How the fits are compiled, and how large a matrix of lanes stays in registers."""

from pathlib import Path

from carillon.numerics.simd import compiler
from carillon.numerics.simd_width import REGISTERS, Registers

MODULES = (
    *("compiled", "kernel", "bounded", "descent", "free_block", "coarse_response"),
    *("inertial", "oversampled"),
)
"""Those whose compiled functions call each other."""

compiled = compiler(*(Path(__file__).parent / f"{name}.py" for name in MODULES))
"""Decorator of compiled functions."""


def panel_of(registers: Registers) -> int:
    """Columns of the largest product of three rows whose sums stay in registers.

    Beside the sums there must be room for the rows and for one column. Six or three, which divide
    the columns that occur: 6, 18, 24 and 48.

    Examples
    --------
    >>> panel_of(Registers(8, 32)), panel_of(Registers(4, 16))
    (6, 3)
    """
    return 6 if 3 * 6 + 3 + 1 <= registers.number else 3


PANEL = panel_of(REGISTERS)
"""Columns of right-hand sides worked on together."""
