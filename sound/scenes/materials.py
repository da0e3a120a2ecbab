"""Materials of solids in scenes, by name: elasticity, damping, contact and looks."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from carillon.files.yaml_input import read_own_yaml
from solver.response.response import Damping


@dataclass(frozen=True)
class NamedMaterial:
    """A homogeneous, isotropic material by its name in scenes.

    Attributes
    ----------
    about, source
        Description, with what is simplified; source of the numbers.
    """

    name: str
    about: str
    young: float
    poisson: float
    density: float
    """float [Pa], [1], [kg/m^3]: young's modulus, Poisson's ratio, mass density."""
    alpha: float
    beta: float
    """float [1/s], [s]: rayleigh damping: the damping matrix is alpha M + beta K."""
    restitution: float
    """float [1]: speed after over speed before an impact at about 1 m/s on a hard, heavy body."""
    friction: float
    roughness: float
    """float [1], [m]: coulomb's coefficient of sliding friction; root mean square height of the
    surface."""
    colour: tuple[float, float, float]
    """(3,) red, green and blue from 0 to 1 (sRGB)."""
    source: str

    @property
    def damping(self) -> Damping:
        """Its Rayleigh damping, as the solver takes it."""
        return Damping(mass_per_second=self.alpha, stiffness_seconds=self.beta)


def named_material(name: str) -> NamedMaterial:
    """The material of that name; raises UserError if there is none.

    Examples
    --------
    >>> named_material("steel").young
    200000000000.0
    """
    if not isinstance(name, str) or name not in _TABLE:
        close = difflib.get_close_matches(str(name), MATERIALS, n=1)
        hint = f"; did you mean {close[0]}?" if close else ""
        raise UserError(f"there is no material {name!r}, only {', '.join(MATERIALS)}{hint}")
    return _TABLE[name]


def _material(name: str, values: Mapping[str, Any]) -> NamedMaterial:
    """A material from its entry, whose numbers may be integers."""
    texts = {key: values[key] for key in ("about", "source")}
    colour = tuple(map(float, values["colour"]))
    numbers = {key: float(value) for key, value in values.items() if key not in (*texts, "colour")}
    made: dict[str, Any] = {**texts, **numbers, "colour": colour}
    return NamedMaterial(name, **made)


_ENTRIES: Mapping[str, Any] = read_own_yaml(Path(__file__).parent / "materials.yaml")
_TABLE = {name: _material(name, values) for name, values in _ENTRIES.items()}
MATERIALS = tuple(_TABLE)
"""Names of all materials."""
