"""How loud modes are heard: the sphere of their surface, and boundary elements of all sizes.

    python -m tests.radiation_bem [SOLID...]    bar and plate, or builtin solids without overlaps

The boundary elements of `sound.radiation.boundary_elements` are checked on spheres that pulsate,
swing and flatten, for which there is a theory.  Then the level of each mode of the solids, rms of
all directions, is printed by the finest triangles, and how far off it are coarser ones, the sphere
of `sound.radiation.sphere`, and the plainest approximation: a sphere of the same surface whose
velocity in the direction x/|x| is that of the solid in x.  The last columns are the rms over single
directions, those in which the mode is less than 20 dB below its mean: by coarser triangles, by that
sphere as a monopole and a dipole, and by it with the phases of all orders, as places are heard.
"""

import argparse
from dataclasses import dataclass
from functools import cache

import numpy as np
import trimesh
from numpy.typing import NDArray

from carillon.errors import UserError
from sound.radiation.air import AIR_DENSITY, SOUND_SPEED
from sound.radiation.boundary_elements import radiated_by_elements
from sound.radiation.boundary_mesh import BoundaryMesh, boundary_mesh
from sound.radiation.directivity import Directivity, even_directions
from sound.radiation.sphere import radiated, sphere_directivity
from sound.scenes.bodies import Body, bodies_of, with_modes
from sound.scenes.object_entry import ObjectEntry
from sound.shape import Shape

Array = NDArray[np.float64]

MATERIALS = {"plate": "ceramic", "bowl": "brass", "wine-glass": "glass"}
"""Materials by name of the solids that are not of steel."""
THIN = ("wine-glass",)
"""Solids of finite cells; all others are of voxels."""
RESOLUTION = 24
"""Voxels along the longest side."""
COMPARED = 8
"""Elastic modes compared."""
TRIANGLES = (2000, 4000)
"""Of a solid's surface, unless told otherwise; the last is the reference."""
PLAIN_ORDER = 8
"""Highest order of the plainest approximation."""
FAINT = 40.0
"""Decibels below the loudest mode from which on modes, such as torsion of round solids, which moves
no air, are not counted."""
HEARD = 20.0
"""Decibels below the rms of all directions from which on a single direction is not compared."""
RADIUS = 0.05
"""Radius [m] of the spheres that are checked."""
CHECKED = (0.3, np.pi, 4.4934)
"""Values of ka; at the last two the plain integral equations of a sphere are singular."""


@dataclass(frozen=True)
class VibratingSurface:
    """A closed surface about the centre of mass, whose vertices move by `motion` (V, 3, N)
    [kg^-1/2] in modes of `frequencies` (N,) [Hz]."""

    mesh: BoundaryMesh
    motion: Array
    frequencies: Array

    @property
    def velocity(self) -> Array:
        """Outward velocity (F, N) [kg^-1/2] of each triangle."""
        normals, _ = self.mesh.normals_and_areas
        means = self.motion[self.mesh.faces].mean(axis=1)
        return np.einsum("fin,fi->fn", means, normals)


@cache
def solved(name: str) -> Body:
    """A builtin solid with its lowest elastic modes, about its centre of mass."""
    entry = ObjectEntry(
        name=name,
        mesh=f"builtin:{name}",
        material=MATERIALS.get(name, "steel"),
        resolution=RESOLUTION,
        count=COMPARED,
        discretisation="finite-cell" if name in THIN else "voxel",
    )
    return with_modes(bodies_of([entry]))[0]


def vibrating_solid(name: str, triangles: int = TRIANGLES[0]) -> VibratingSurface:
    """A builtin solid in its lowest elastic modes, on a surface of about so many triangles."""
    body = solved(name)
    mesh = boundary_mesh(body.shape.vertices, body.shape.faces, triangles)
    assert body.solid is not None
    return VibratingSurface(mesh, body.motion(mesh.vertices), body.solid.frequencies)


def level(power: Array) -> Array:
    """Level [dB] of a mean square of pressure times distance, re 1 Pa m / (kg^-1/2 N s)."""
    return 10.0 * np.log10(power)


def approximation(vibrating: VibratingSurface) -> Directivity:
    """Directivity by `sound.radiation.sphere`."""
    shape = Shape.of_surface(vibrating.mesh.vertices, vibrating.mesh.faces, np.zeros(3))
    return radiated(vibrating.motion, shape, vibrating.frequencies).directivity


def all_phases(vibrating: VibratingSurface) -> Directivity:
    """Directivity of that sphere with the phases of all orders."""
    shape = Shape.of_surface(vibrating.mesh.vertices, vibrating.mesh.faces, np.zeros(3))
    moved = vibrating.motion[shape.faces].mean(axis=1)
    return sphere_directivity(lambda _: moved, shape, vibrating.frequencies)


def plain_power(vibrating: VibratingSurface) -> Array:
    """Mean square (N,) of pressure times distance of a sphere that moves in each direction as the
    solid does."""
    from scipy.special import sph_harm_y_all

    _, areas = vibrating.mesh.normals_and_areas
    radius = np.sqrt(areas.sum() / (4.0 * np.pi))
    number = 2.0 * np.pi * vibrating.frequencies / SOUND_SPEED
    centres = vibrating.mesh.vertices[vibrating.mesh.faces].mean(axis=1)
    x, y, z = (centres / np.linalg.norm(centres, axis=1)[:, None]).T
    harmonics = sph_harm_y_all(PLAIN_ORDER, PLAIN_ORDER, np.arccos(z), np.arctan2(y, x))
    flows = vibrating.velocity * areas[:, None] / radius**2
    orders = (np.abs(harmonics @ flows) ** 2).sum(axis=1)
    heard = [(sphere_pressure(order, number, radius) ** 2) for order in range(PLAIN_ORDER + 1)]
    return (orders * heard).sum(axis=0) / (4.0 * np.pi)


def sphere_pressure(order: int, number: Array, radius: float) -> Array:
    """Pressure times distance [Pa m] per normal velocity [m/s] of a sphere in a harmonic."""
    from scipy.special import spherical_jn, spherical_yn

    x = number * radius
    slope = spherical_jn(order, x, True) + 1j * spherical_yn(order, x, True)
    return AIR_DENSITY * SOUND_SPEED / (number * np.abs(slope))


def sphere(ka: float) -> VibratingSurface:
    """A sphere that pulsates, swings and flattens, with a velocity of 1 at the poles."""
    surface = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    outward = np.asarray(surface.vertices) / RADIUS
    swing = np.broadcast_to([0.0, 0.0, 1.0], outward.shape)
    flat = outward * (1.5 * outward[:, 2:] ** 2 - 0.5)
    motion = np.stack([outward, swing, flat], axis=2)
    mesh = BoundaryMesh(np.asarray(surface.vertices), np.asarray(surface.faces))
    return VibratingSurface(mesh, motion, np.full(3, ka / RADIUS * SOUND_SPEED / (2.0 * np.pi)))


def by_elements(vibrating: VibratingSurface) -> Directivity:
    """Directivity by boundary elements."""
    mesh = vibrating.mesh
    moved = np.moveaxis(mesh.at_middles(np.moveaxis(vibrating.motion, 0, -1)).real, -1, 0)
    return radiated_by_elements(mesh, moved, vibrating.frequencies)


def check_spheres() -> None:
    """Print how far boundary elements are off on spheres."""
    print("sphere, 1,280 triangles: boundary elements against theory [dB]")
    print(f"{'ka':>8} {'pulsates':>10} {'swings':>10} {'flattens':>10}")
    for ka in CHECKED:
        found = by_elements(sphere(ka)).rms ** 2
        orders = range(3)
        number = np.array(ka / RADIUS)
        exact = [sphere_pressure(n, number, RADIUS) ** 2 / (2 * n + 1) for n in orders]
        print(f"{ka:8.3f}" + "".join(f" {error:10.2f}" for error in level(found / exact)))


def off_by_direction(found: Directivity, truth: Directivity) -> Array:
    """Rms (N,) [dB] over the directions in which modes are heard of how far levels are off."""
    directions, _ = even_directions(2 * truth.order)
    errors = [np.abs(each.towards(directions)) ** 2 for each in (found, truth)]
    heard = errors[1] > truth.rms**2 * 10.0 ** (-HEARD / 10.0)
    square = np.where(heard, level(np.where(heard, errors[0] / errors[1], 1.0)) ** 2, 0.0)
    return np.sqrt(square.sum(axis=0) / heard.sum(axis=0))


def compare(name: str, triangles: list[int]) -> None:
    """Print how far coarser triangles and the approximations are off in each mode of a solid."""
    solids = [vibrating_solid(name, count) for count in triangles]
    finest = solids[-1]
    _, areas = finest.mesh.normals_and_areas
    radius = np.sqrt(areas.sum() / (4.0 * np.pi))
    found = [by_elements(each) for each in solids]
    truth = level(found[-1].rms ** 2)
    ball = approximation(finest)
    columns = {f"{count:,}": level(each.rms**2) - truth for count, each in zip(triangles, found)}
    columns.popitem()
    columns["sphere"] = level(ball.rms**2) - truth
    columns["plainest"] = level(plain_power(finest)) - truth
    columns[f"{triangles[0]:,} by direction"] = off_by_direction(found[0], found[-1])
    columns["sphere by direction"] = off_by_direction(ball, found[-1])
    columns["with all phases"] = off_by_direction(all_phases(finest), found[-1])
    print(f"\n{name}, {triangles[-1]:,} triangles, a = {1e3 * radius:.1f} mm; off by [dB]")
    print(f"{'mode':>4} {'Hz':>8} {'ka':>6} {'level':>8}  " + "  ".join(columns))
    rows = np.stack(list(columns.values()), axis=1)
    for mode, hertz in enumerate(finest.frequencies):
        ka = 2.0 * np.pi * hertz * radius / SOUND_SPEED
        cells = "  ".join(f"{row:{len(head)}.2f}" for row, head in zip(rows[mode], columns))
        print(f"{mode + 1:4} {hertz:8.0f} {ka:6.2f} {truth[mode]:8.2f}  {cells}")
    loud = rows[truth > truth.max() - FAINT]
    for label, values in (("rms", np.sqrt((loud**2).mean(axis=0))), ("most", np.abs(loud).max(0))):
        cells = "  ".join(f"{value:{len(head)}.2f}" for value, head in zip(values, columns))
        print(f"{label:>4} {'':24}  {cells}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.radiation_bem")
    parser.add_argument("solids", nargs="*", default=["bar", "plate"], metavar="SOLID")
    parser.add_argument(
        "--triangles", type=int, nargs="+", default=TRIANGLES, help="of a solid's surface"
    )
    options = parser.parse_args()
    try:
        check_spheres()
    except UserError as error:
        parser.exit(1, f"{error}\n")
    for name in options.solids:
        compare(name, options.triangles)


if __name__ == "__main__":
    main()
