"""Materials by name: elasticity, damping, contact and looks."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from carillon.errors import UserError
from carillon.fem.elasticity import orthotropic_matrix
from carillon.fem.regions import Regions
from carillon.files.yaml_input import read_own_yaml
from carillon.parameters.sentences import alike

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class NamedMaterial:
    """A homogeneous material by its name; of wood, also what it is along its grain and across.

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
    grain_young: Triple | None = None
    """(3,) Young's moduli [Pa] along the grain, the radius and the rings of wood; None if it is
    isotropic."""
    grain_shear: Triple | None = None
    """(3,) shear moduli [Pa] of grain and radius, of radius and rings, of rings and grain."""
    grain_poisson: Triple | None = None
    """(3,) Poisson's ratios of these pairs: across by the second, stress along the first."""

    @property
    def is_wood(self) -> bool:
        """Whether it is not the same in all directions."""
        return self.grain_young is not None

    def region(self, name: str, density: float | None = None) -> Regions:
        """Its row in a solid's table of regions; axes x, y, z are grain, radius and rings."""
        own = self.density if density is None else density
        damping = self.alpha, self.beta
        if self.grain_young is None:
            return Regions.one(self.poisson, own, self.young, damping, name)
        assert self.grain_shear is not None and self.grain_poisson is not None
        triples = self.grain_young, self.grain_shear, self.grain_poisson
        matrix = orthotropic_matrix(*(np.array(triple) for triple in triples))
        return Regions.anisotropic(matrix, own, damping, name)


def named_material(name: str) -> NamedMaterial:
    """The material of that name; raises UserError if there is none.

    Examples
    --------
    >>> named_material("steel").young
    200000000000.0
    """
    if not isinstance(name, str) or name not in _TABLE:
        meant = alike(str(name), MATERIALS)
        hint = f"; did you mean {meant}?" if meant else ""
        raise UserError(f"there is no material {name!r}, only {', '.join(MATERIALS)}{hint}")
    return _TABLE[name]


def _material(name: str, values: Mapping[str, Any]) -> NamedMaterial:
    """A material from its entry, whose numbers may be integers."""
    texts = {key: values[key] for key in ("about", "source")}
    triples = {
        key: tuple(map(float, values[key]))
        for key in ("colour", "grain_young", "grain_shear", "grain_poisson")
        if key in values
    }
    numbers = {key: float(value) for key, value in values.items() if key not in (*texts, *triples)}
    made: dict[str, Any] = {**texts, **numbers, **triples}
    return NamedMaterial(name, **made)


_ENTRIES: Mapping[str, Any] = read_own_yaml(Path(__file__).parent / "materials.yaml")
_TABLE = {name: _material(name, values) for name, values in _ENTRIES.items()}
MATERIALS = tuple(_TABLE)
"""Names of all materials."""
