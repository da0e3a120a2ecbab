"""Shapes of measured solids: surfaces, and quadratures of those that are known without a mesh.

Lengths are in metres; the axis of round solids is z.
"""

import inspect
from collections.abc import Callable, Mapping

import numpy as np
from trimesh.creation import annulus, icosphere, torus
from trimesh.creation import box as cuboid
from trimesh.creation import cylinder as full_cylinder
from trimesh.transformations import rotation_matrix

from carillon.arrays import Array, Surface
from carillon.fem.geometry.sweep import joined, sweep
from studies.accuracy import domains
from studies.accuracy.domains import Degrees, Domain

SECTIONS = 192
"""Straight sides of a circle."""
SUBDIVISIONS = 5
"""Subdivisions of an icosahedron for a sphere."""


def box(x: float, y: float, z: float) -> Surface:
    """Parallelepiped."""
    return cuboid(extents=(x, y, z))


def cylinder(diameter: float, height: float, bore: float = 0.0) -> Surface:
    """Cylinder, or a tube with a hole of diameter `bore`."""
    outer, inner = _as_large(0.5 * diameter, SECTIONS), _as_large(0.5 * bore, SECTIONS)
    if bore:
        return annulus(inner, outer, height, sections=SECTIONS)
    return full_cylinder(outer, height, sections=SECTIONS)


def sphere(diameter: float) -> Surface:
    """Sphere, whose triangles enclose its volume."""
    surface = icosphere(SUBDIVISIONS, radius=0.5 * diameter)
    return surface.apply_scale(np.cbrt(np.pi / 6.0 * diameter**3 / surface.volume))


def ring(diameter: float, section: float) -> Surface:
    """Ring of a mean diameter, whose section is round and has a diameter, too."""
    across = SECTIONS // 4
    minor = _as_large(0.5 * section, across)
    return torus(0.5 * diameter, minor, major_sections=2 * SECTIONS, minor_sections=across)


def fork(prongs: float, gap: float, side: float, stem: float) -> Surface:
    """Tuning fork: a square bar bent to a half circle and two straight prongs, and a stem.

    Parameters
    ----------
    prongs, gap
        Length of the straight prongs, and the width between them.
    side
        Of the sections of bar and stem.
    stem
        From the stem's end to the middle of the half circle.
    """
    radius, half = 0.5 * (gap + side), 0.5 * side
    angles = np.linspace(np.pi, 2.0 * np.pi, SECTIONS // 2 + 1)
    arc = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    across = np.concatenate([[[-1.0, 0.0]], arc, [[1.0, 0.0]]])
    middle = radius * across + np.array([0.0, stem])
    middle[[0, -1], 1] += prongs
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    sections = [
        np.column_stack([np.full(len(middle), x), middle + outward * across])
        for x, outward in corners
    ]
    bar = sweep(np.stack(sections, axis=1))
    # The stem ends within the bar.
    end = stem - radius
    return joined(bar, cuboid(bounds=[(-half, -half, 0.0), (half, half, end)]))


def hollow_sphere(diameter: float, bore: float) -> Surface:
    """Sphere with a hole of diameter `bore` in its middle."""
    hole = sphere(bore)
    hole.invert()
    return joined(sphere(diameter), hole)


def arms(count: float, length: float, side: float) -> Surface:
    """Square bars that go out from a point at equal angles, in the plane of x and y."""
    bars = []
    for angle in np.arange(count) * 2.0 * np.pi / count:
        bar = cuboid(bounds=[(0.0, -0.5 * side, -0.5 * side), (length, 0.5 * side, 0.5 * side)])
        bars.append(bar.apply_transform(rotation_matrix(angle, (0, 0, 1))))
    return joined(*bars)


def rhombus(side: float, angle: float, thickness: float) -> Surface:
    """Plate with edges along x and at an angle [degrees] to it."""
    along = side * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    first = np.array([side, 0.0])
    return _prism(np.array([0.0 * first, first, first + along, along]), thickness)


def taper(length: float, root: float, tip: float, thickness: float) -> Surface:
    """Plate along x whose width falls from that of its root, at x = 0, to that of its tip."""
    outline = [(0.0, -root / 2), (length, -tip / 2), (length, tip / 2), (0.0, root / 2)]
    return _prism(np.array(outline), thickness)


def curved_plate(radius: float, arc: float, width: float, thickness: float) -> Surface:
    """Part of a tube's wall: an arc of a mean radius across, and a width along y."""
    angles = np.linspace(-0.5, 0.5, SECTIONS // 2 + 1) * arc / radius
    out = np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=1)
    across = np.array([0.0, 0.5 * width, 0.0])
    inner, outer = (radius + 0.5 * thickness * end for end in (-1.0, 1.0))
    corners = [(inner, -across), (inner, across), (outer, across), (outer, -across)]
    return sweep(np.stack([r * out + shift for r, shift in corners], axis=1))


SHAPES: dict[str, Callable[..., Surface]] = {
    each.__name__: each
    for each in (
        box,
        cylinder,
        sphere,
        hollow_sphere,
        ring,
        fork,
        arms,
        rhombus,
        taper,
        curved_plate,
    )
}
DOMAINS: dict[str, Callable[..., Callable[[Degrees], Domain]]] = {
    "box": lambda x, y, z: lambda degrees: domains.box((x, y, z), degrees),
    "cylinder": lambda diameter, height, bore=0.0: (
        lambda degrees: domains.cylinder((diameter, diameter, height), degrees, bore / diameter)
    ),
    "sphere": lambda diameter: lambda degrees: domains.ellipsoid((diameter,) * 3, degrees),
}
"""Makers of quadratures, from dimensions and then from the degrees of polynomials."""


def require_dimensions(shape: str, dimensions: Mapping[str, float]) -> None:
    """Check that these are the dimensions of a shape.

    Raises ValueError if one is missing or unknown.

    Examples
    --------
    >>> require_dimensions("ring", {"diameter": 2.0})
    Traceback (most recent call last):
    ...
    ValueError: found the dimensions diameter of a ring, expected diameter, section
    """
    expected = inspect.signature(SHAPES[shape]).parameters
    needed = {name for name, each in expected.items() if each.default is each.empty}
    if not needed <= dimensions.keys() <= expected.keys():
        found, names = (", ".join(each) or "nothing" for each in (dimensions, expected))
        raise ValueError(f"found the dimensions {found} of a {shape}, expected {names}")


def _prism(outline: Array, thickness: float) -> Surface:
    """A convex outline (p, 2) in the plane of x and y, with a thickness along z."""
    ends = [
        np.column_stack([outline, np.full(len(outline), z)])
        for z in (-0.5 * thickness, 0.5 * thickness)
    ]
    return sweep(np.stack(ends))


def _as_large(radius: float, sections: int) -> float:
    """Radius to the corners of a polygon that has the area of the circle."""
    angle = 2.0 * np.pi / sections
    return float(radius * np.sqrt(angle / np.sin(angle)))
