"""The solids of the study: their sides, surfaces, and frequencies that no mesh made."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Surface
from carillon.fem.model import RIGID_MODES
from studies.accuracy import domains
from studies.accuracy.domains import Degrees, Domain, Sides
from studies.accuracy.ritz import free_eigenvalues

ANGLES = (25.0, 35.0, 15.0)
"""Degrees about x, y and z by which solids are turned against the lattice."""
YOUNG, POISSON, DENSITY = 1e9, 0.25, 1000.0

SUBDIVISIONS = 5
"""Subdivisions of an icosahedron for the surface of an ellipsoid."""
SECTIONS = 192
"""Straight sides of a cylinder's surface."""

DOMAINS: dict[str, Callable[[Sides, Degrees], Domain]] = {
    "box": domains.box,
    "cylinder": domains.cylinder,
    "ellipsoid": domains.ellipsoid,
}
"""Quadratures by shape."""


@dataclass(frozen=True)
class ReferenceSolid:
    """A solid with a closed form."""

    title: str
    """Name for people."""
    shape: str
    """A key of `DOMAINS`."""
    sides: Sides
    """Of its bounding box, before it is turned [m]."""
    degrees: Degrees
    """Of the polynomials, see `free_eigenvalues`."""
    spacings: tuple[float, ...]
    """Between the nodes of its models [m], coarsest first."""

    def frequencies(self, count: int, fewer: int = 0) -> Array:
        """The lowest elastic frequencies [Hz], by degrees that are lower by `fewer`."""
        x, y, z = (degree - fewer for degree in self.degrees)
        values = free_eigenvalues(self.domain((x, y, z)), (x, y, z), YOUNG, POISSON, DENSITY)
        elastic = values[RIGID_MODES : RIGID_MODES + count]
        return np.asarray(np.sqrt(elastic) / (2.0 * np.pi))

    def domain(self, degrees: Degrees) -> Domain:
        """Quadrature that is exact for products of two polynomials of these degrees."""
        return DOMAINS[self.shape](self.sides, degrees)

    def surface(self) -> Surface:
        """Triangles, turned by `ANGLES`; a curved one encloses the solid's own volume."""
        from trimesh.transformations import euler_matrix

        surface = _unturned(self.shape, self.sides)
        return surface.apply_transform(euler_matrix(*np.radians(ANGLES)))


def _unturned(shape: str, sides: Sides) -> Surface:
    import trimesh

    if shape == "box":
        return trimesh.creation.box(extents=sides)
    if shape == "ellipsoid":
        surface = trimesh.creation.icosphere(SUBDIVISIONS, radius=0.5)
        bulge = np.full(3, np.cbrt(np.pi / 6.0 / surface.volume))
    else:
        surface = trimesh.creation.cylinder(radius=0.5, height=1.0, sections=SECTIONS)
        bulge = np.array([1.0, 1.0, 0.0]) * np.sqrt(np.pi / 4.0 / surface.volume)
        bulge[2] = 1.0
    return surface.apply_transform(np.diag([*(bulge * np.array(sides)), 1.0]))


SOLIDS = {
    "block": ReferenceSolid(
        "Block 24×16×12 cm", "box", (0.24, 0.16, 0.12), (16, 16, 16), (0.030, 0.024, 0.018, 0.014)
    ),
    "plate": ReferenceSolid(
        "Plate 24×24×1.2 cm", "box", (0.24, 0.24, 0.012), (28, 28, 10), (0.024, 0.018, 0.012, 0.009)
    ),
    "beam": ReferenceSolid(
        "Beam 32×4×4 cm", "box", (0.32, 0.04, 0.04), (30, 14, 14), (0.032, 0.020, 0.013, 0.009)
    ),
    "sphere": ReferenceSolid(
        "Sphere of 20 cm",
        "ellipsoid",
        (0.20, 0.20, 0.20),
        (12, 12, 12),
        (0.040, 0.0167, 0.0143, 0.0125),
    ),
    "ellipsoid": ReferenceSolid(
        "Ellipsoid 24×16×12 cm",
        "ellipsoid",
        (0.24, 0.16, 0.12),
        (14, 14, 14),
        (0.030, 0.024, 0.018, 0.014),
    ),
    "cylinder": ReferenceSolid(
        "Cylinder 12×24 cm",
        "cylinder",
        (0.12, 0.12, 0.24),
        (14, 14, 16),
        (0.030, 0.024, 0.018, 0.013),
    ),
}
