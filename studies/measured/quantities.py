"""Numbers with units, as data files have them: `118.57 GPa`."""

from typing import Annotated

from carillon.parameters import Check

UNITS = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "pressure": {"Pa": 1.0, "MPa": 1e6, "GPa": 1e9},
    "density": {"kg/m^3": 1.0, "g/cm^3": 1e3},
    "frequency": {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
}
"""Units by what they measure, as multiples of those of the SI."""
LEAST = {"pressure": 1e5, "density": 1.0}
"""Magnitudes from which a number without a unit is taken for one in the SI's: no solid has less."""


def value_in(kind: str, text: object) -> float:
    """The number of a text with a unit of some kind, in the SI's; a large number has them already.

    Raises ValueError with what is wrong.

    Examples
    --------
    >>> value_in("pressure", "118.57 GPa")
    118570000000.0
    """
    if isinstance(text, float | int) and (text == 0.0 or abs(text) >= LEAST[kind]):
        return float(text)
    number, _, unit = str(text).partition(" ")
    try:
        return float(number) * UNITS[kind][unit]
    except (KeyError, ValueError):
        units = ", ".join(UNITS[kind])
        raise ValueError(f"found {text!r}, expected a number and one of {units}") from None


def _read(kind: str) -> Check:
    return Check(lambda text: value_in(kind, text), before=True)


Pressure = Annotated[float, _read("pressure")]
MassDensity = Annotated[float, _read("density")]
