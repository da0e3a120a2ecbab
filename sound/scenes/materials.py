"""Materials of solids in scenes, by name: elasticity, damping, contact and looks."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from carillon.files.yaml_input import read_own_yaml
from solver.response.response import Damping

_NUMBERS = (
    "young",
    "poisson",
    "density",
    "alpha",
    "beta",
    "restitution",
    "friction",
    "roughness",
)


@dataclass(frozen=True)
class NamedMaterial:
    """A homogeneous, isotropic material.

    Attributes
    ----------
    name
        Name in scenes.
    about
        Description, with what is simplified.
    young : float [Pa]
        Young's modulus.
    poisson : float [1]
        Poisson's ratio.
    density : float [kg/m^3]
        Mass density.
    alpha, beta : float [1/s], [s]
        Rayleigh damping: the damping matrix is alpha M + beta K.
    restitution : float [1]
        Speed after over speed before an impact at about 1 m/s on a hard, heavy body.
    friction : float [1]
        Coulomb's coefficient of sliding friction.
    roughness : float [m]
        Root mean square height of the surface.
    colour : (3,)
        Red, green and blue from 0 to 1 (sRGB).
    source
        Source of the numbers.
    """

    name: str
    about: str
    young: float
    poisson: float
    density: float
    alpha: float
    beta: float
    restitution: float
    friction: float
    roughness: float
    colour: tuple[float, float, float]
    source: str

    @property
    def damping(self) -> Damping:
        """Its Rayleigh damping, as the solver takes it."""
        return Damping(mass_per_second=self.alpha, stiffness_seconds=self.beta)

    def loss_factor(self, frequency: float) -> float:
        """Loss factor [1] of its Rayleigh damping at a frequency [Hz].

        Examples
        --------
        >>> round(named_material("stone").loss_factor(1000.0), 4)
        0.0067
        """
        turns = 2.0 * math.pi * frequency
        return self.alpha / turns + self.beta * turns


def named_material(name: str) -> NamedMaterial:
    """The material of that name.

    Raises
    ------
    UserError
        If there is none.

    Examples
    --------
    >>> named_material("steel").young
    200000000000.0
    """
    if name not in _TABLE:
        close = difflib.get_close_matches(name, MATERIALS, n=1)
        hint = f"; did you mean {close[0]}?" if close else ""
        raise UserError(f"there is no material {name!r}, only {', '.join(MATERIALS)}{hint}")
    return _TABLE[name]


def _read(path: Path) -> dict[str, NamedMaterial]:
    table: dict[str, dict[str, Any]] = read_own_yaml(path)
    return {name: _material(name, values) for name, values in table.items()}


def _material(name: str, values: Mapping[str, Any]) -> NamedMaterial:
    """A material from its entry, whose numbers may be integers."""
    red, green, blue = map(float, values["colour"])
    numbers: dict[str, Any] = {key: float(values[key]) for key in _NUMBERS}
    return NamedMaterial(
        name=name,
        about=values["about"],
        colour=(red, green, blue),
        source=values["source"],
        **numbers,
    )


_TABLE = _read(Path(__file__).parent / "materials.yaml")
MATERIALS = tuple(_TABLE)
"""Names of all materials."""
