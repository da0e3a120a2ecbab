"""How loud modes are heard: `sound.scenes.audible.radiation` against the boundary element method.

    python -m tests.radiation_bem [SOLID...]    bar and plate, or builtin solids without overlaps

The field is that of Burton and Miller's equation, solved by bempp-cl for the pressure on the
surface (linear on each triangle) from the normal velocity (constant on each), and checked first on
spheres that pulsate, swing and flatten.  Printed for each mode is the level of its pressure, rms of
all directions, and how far off it are two approximations: that of `sound.scenes.audible.radiation`,
and the plainest one, a sphere of the same surface whose velocity in the direction x/|x| is that of
the solid in x.  Takes a minute, then some seconds a mode (with pyopencl; some minutes without).
"""

import argparse
import sys
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
import trimesh
from numpy.typing import NDArray

from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize
from carillon.fem.model import RIGID_MODES, fine_model
from carillon.fem.regions import Regions
from solver.analysis.library import solve
from solver.response.points import interpolation
from sound.scenes.audible.radiation import AIR_DENSITY, SOUND_SPEED, radiated
from sound.scenes.shape import Shape
from sound.strikes import struck_surface

Array = NDArray[np.float64]
Waves = NDArray[np.complex128]

MATERIALS = {"plate": (60e9, 0.25, 2400.0), "bowl": (100e9, 0.34, 8700.0)}
"""Young's modulus [Pa], Poisson's ratio and density [kg/m^3]: stoneware, bronze."""
STEEL = (200e9, 0.29, 7850.0)
RESOLUTION = 24
"""Voxels along the longest side."""
MODES = 26
"""Modes computed, rigid ones included."""
COMPARED = 8
"""Elastic modes compared."""
TRIANGLES = 1400
"""Of the surface, unless told otherwise."""
DIRECTIONS = 200
PLAIN_ORDER = 8
"""Highest order of the plainest approximation."""
CORNERS = np.full((3, 3), 1.0 / 6.0) + np.eye(3) / 2.0
"""Barycentric coordinates of the points at which far fields are integrated."""
RADIUS = 0.05
"""Radius [m] of the spheres that are checked."""
CHECKED = (0.3, np.pi, 4.4934)
"""Values of ka; at the last two the plain integral equations of a sphere are singular."""


@dataclass(frozen=True)
class VibratingSurface:
    """A surface and how it moves.

    Attributes
    ----------
    vertices : (V, 3) [m]
        From the centre of mass.
    faces : (F, 3)
        Turned outwards.
    motion : (V, 3, N) [kg^-1/2]
        Displacement in each elastic mode.
    frequencies : (N,) [Hz]
        Of the modes.
    """

    vertices: Array
    faces: NDArray[np.int64]
    motion: Array
    frequencies: Array

    @property
    def surface(self) -> trimesh.Trimesh:
        return trimesh.Trimesh(self.vertices, self.faces, process=False)

    @property
    def velocity(self) -> Array:
        """Outward velocity (F, N) [kg^-1/2] of each triangle."""
        return np.einsum(
            "fcin,fi->fn", self.motion[self.faces] / 3.0, self.surface.face_normals, optimize=True
        )


def vibrating_solid(name: str, triangles: int = TRIANGLES) -> VibratingSurface:
    """A builtin solid in its lowest elastic modes, on a surface of at most so many triangles."""
    import igl

    mesh = hexmesh_from_voxels(voxelize(builtin_surface(name), RESOLUTION))
    young, poisson, density = MATERIALS.get(name, STEEL)
    model = fine_model(mesh, np.full(mesh.n_cells, young), regions=Regions.one(poisson, density))
    solution = solve(model, modes=MODES)
    fine = struck_surface(f"builtin:{name}")
    fine.merge_vertices()
    vertices, faces = igl.decimate(
        np.ascontiguousarray(fine.vertices), np.ascontiguousarray(fine.faces), triangles
    )[:2]
    assert solution.modes is not None
    elastic = solution.modes[:, RIGID_MODES : RIGID_MODES + COMPARED].reshape(mesh.n_nodes, -1)
    motion = (interpolation(model, vertices) @ elastic).reshape(len(vertices), 3, -1)
    centre = trimesh.Trimesh(vertices, faces, process=False).center_mass
    frequencies = solution.frequencies[RIGID_MODES : RIGID_MODES + COMPARED]
    return VibratingSurface(vertices - centre, faces, motion, frequencies)


def far_field(vibrating: VibratingSurface, hertz: float, directions: Array) -> Waves:
    """Pressure times distance (D, N) [Pa m / (kg^-1/2 N s)] by bempp-cl at one frequency.

    With exp(-i omega t), G = exp(ikr) / (4 pi r) and dp/dn = i omega rho v known, the pressure p on
    the surface is the solution of (1/2 - K + i/k W) p = -(V + i/k (1/2 + K')) dp/dn; its operators
    are the single layer V, the double layer K, its adjoint K' and the hypersingular W.
    """
    import bempp_cl.api as bempp
    from bempp_cl.api.operators.boundary import helmholtz, sparse

    bempp.DEFAULT_DEVICE_INTERFACE = "opencl" if find_spec("pyopencl") else "numba"
    number = 2.0 * np.pi * hertz / SOUND_SPEED
    grid = bempp.Grid(
        np.ascontiguousarray(vibrating.vertices.T), vibrating.faces.T.astype(np.uint32, order="C")
    )
    linear = bempp.function_space(grid, "P", 1)
    constant = bempp.function_space(grid, "DP", 0)

    def matrix(operator, space, *wave):
        dense = bempp.as_matrix(operator(space, linear, linear, *wave).weak_form())
        return dense.toarray() if hasattr(dense, "toarray") else dense

    coupling = 1j / number
    left = 0.5 * matrix(sparse.identity, linear)
    left = left - matrix(helmholtz.double_layer, linear, number)
    left = left + coupling * matrix(helmholtz.hypersingular, linear, number)
    right = matrix(helmholtz.adjoint_double_layer, constant, number)
    right = coupling * (right + 0.5 * matrix(sparse.identity, constant))
    right = right + matrix(helmholtz.single_layer, constant, number)
    slope = 2j * np.pi * hertz * AIR_DENSITY * vibrating.velocity
    pressure = np.linalg.solve(left, -right @ slope)
    return _from_surface(vibrating, pressure, slope, number, directions)


def _from_surface(
    vibrating: VibratingSurface, pressure: Waves, slope: Waves, number: float, directions: Array
) -> Waves:
    """Far field of a pressure (V, N) on the surface and its normal derivative (F, N)."""
    surface = vibrating.surface
    corners = vibrating.vertices[vibrating.faces]
    field = np.zeros((len(directions), slope.shape[1]), dtype=complex)
    for corner in CORNERS:
        points = np.einsum("c,fci->fi", corner, corners)
        there = np.einsum("c,fcn->fn", corner, pressure[vibrating.faces])
        waves = np.exp(-1j * number * directions @ points.T) * surface.area_faces / 3.0
        field += (waves * (-1j * number * directions @ surface.face_normals.T)) @ there
        field -= waves @ slope
    return field / (4.0 * np.pi)


def level(power: Array) -> Array:
    """Level [dB] of a mean square of pressure times distance, re 1 Pa m / (kg^-1/2 N s)."""
    return 10.0 * np.log10(power)


def approximate_power(vibrating: VibratingSurface) -> Array:
    """Mean square (N,) of pressure times distance by `sound.scenes.audible.radiation`."""
    shape = Shape.of_surface(vibrating.vertices, vibrating.faces, np.zeros(3))
    found = radiated(vibrating.motion, shape, vibrating.frequencies)
    return found.monopoles**2 + (found.dipoles**2).sum(axis=1) / 3.0


def plain_power(vibrating: VibratingSurface) -> Array:
    """The same of a sphere that moves in each direction as the solid does."""
    from scipy.special import sph_harm_y_all

    surface = vibrating.surface
    radius = np.sqrt(surface.area / (4.0 * np.pi))
    number = 2.0 * np.pi * vibrating.frequencies / SOUND_SPEED
    x, y, z = (
        surface.triangles_center / np.linalg.norm(surface.triangles_center, axis=1)[:, None]
    ).T
    harmonics = sph_harm_y_all(PLAIN_ORDER, PLAIN_ORDER, np.arccos(z), np.arctan2(y, x))
    flows = vibrating.velocity * surface.area_faces[:, None] / radius**2
    orders = (np.abs(harmonics @ flows) ** 2).sum(axis=1)
    heard = [(sphere_pressure(order, number, radius) ** 2) for order in range(PLAIN_ORDER + 1)]
    return (orders * heard).sum(axis=0) / (4.0 * np.pi)


def sphere_pressure(order: int, number: Array, radius: float) -> Array:
    """Pressure times distance [Pa m] per normal velocity [m/s] of a sphere in a harmonic."""
    from scipy.special import spherical_jn, spherical_yn

    x = number * radius
    slope = spherical_jn(order, x, True) + 1j * spherical_yn(order, x, True)
    return AIR_DENSITY * SOUND_SPEED / (number * np.abs(slope))


def sphere() -> VibratingSurface:
    """A sphere that pulsates, swings and flattens, with a velocity of 1 at the poles."""
    surface = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    outward = np.asarray(surface.vertices) / RADIUS
    swing = np.broadcast_to([0.0, 0.0, 1.0], outward.shape)
    flat = outward * (1.5 * outward[:, 2:] ** 2 - 0.5)
    motion = np.stack([outward, swing, flat], axis=2)
    return VibratingSurface(
        np.asarray(surface.vertices), np.asarray(surface.faces), motion, np.zeros(0)
    )


def all_directions() -> Array:
    """Unit vectors (D, 3) spread evenly over the sphere."""
    index = np.arange(DIRECTIONS) + 0.5
    height, turn = 1.0 - 2.0 * index / DIRECTIONS, np.pi * (1.0 + np.sqrt(5.0)) * index
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)


def check_spheres() -> None:
    """Print how far the boundary element method is off on spheres."""
    print(f"sphere, {len(sphere().faces):,} triangles: boundary elements against theory [dB]")
    print(f"{'ka':>8} {'pulsates':>10} {'swings':>10} {'flattens':>10}")
    for ka in CHECKED:
        number = ka / RADIUS
        hertz = number * SOUND_SPEED / (2.0 * np.pi)
        found = (np.abs(far_field(sphere(), hertz, all_directions())) ** 2).mean(axis=0)
        orders = range(3)
        exact = [sphere_pressure(n, np.array(number), RADIUS) ** 2 / (2 * n + 1) for n in orders]
        print(f"{ka:8.3f}" + "".join(f" {error:10.2f}" for error in level(found / exact)))


def compare(name: str, triangles: int) -> None:
    """Print how far the approximations are off in each mode of a solid."""
    solid = vibrating_solid(name, triangles)
    radius = np.sqrt(solid.surface.area / (4.0 * np.pi))
    guesses = level(np.array([approximate_power(solid), plain_power(solid)]))
    print(f"\n{name}, {len(solid.faces):,} triangles, a = {1e3 * radius:.1f} mm")
    print(f"{'mode':>4} {'Hz':>8} {'ka':>6} {'level':>8} {'error':>8} {'plainest':>10}   [dB]")
    errors = np.zeros((2, len(solid.frequencies)))
    for mode, hertz in enumerate(solid.frequencies):
        field = far_field(solid, hertz, all_directions())[:, mode]
        truth = float(level((np.abs(field) ** 2).mean()))
        errors[:, mode] = guesses[:, mode] - truth
        ka = 2.0 * np.pi * hertz * radius / SOUND_SPEED
        first, second = errors[:, mode]
        print(
            f"{mode + 1:4} {hertz:8.0f} {ka:6.2f} {truth:8.2f} {first:8.2f} {second:10.2f}",
            flush=True,
        )
    first, second = np.sqrt((errors**2).mean(axis=1))
    print(f"{'rms':>4} {first:32.2f} {second:10.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.radiation_bem")
    parser.add_argument("solids", nargs="*", default=["bar", "plate"], metavar="SOLID")
    parser.add_argument("--triangles", type=int, default=TRIANGLES, help="of a solid's surface")
    options = parser.parse_args()
    if find_spec("bempp_cl") is None:
        sys.exit("the boundary element method is missing: `pip install bempp-cl 'pyopencl[pocl]'`")
    check_spheres()
    for name in options.solids:
        compare(name, options.triangles)


if __name__ == "__main__":
    main()
