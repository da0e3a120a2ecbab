"""Finite cells hold what is inside the surface, whatever the surface and wherever it lies."""

import numpy as np
import pytest
import trimesh

from carillon.errors import UserError
from carillon.fem.element import elasticity_matrix
from carillon.fem.finite_cells.basis import voxel_places
from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.finite_cells.cells import FLOORS
from carillon.fem.finite_cells.lines import crossings, spread_lines
from carillon.fem.geometry import builtin_surface
from carillon.fem.laplacian import laplacian_modes
from solver.assembly.sparse import assembled
from tests import cut_solids
from tests.cut_solids import box, spaced, turned, uniform
from tests.mesh_files import inside_out, soup, with_turned

SIDES = (0.24, 0.16, 0.12)


def places_of_points(cells):
    """Places (c, d, 3) [m] of the points of the integrals."""
    low = cells.origin + cells.step * cells.corner
    return low[:, None] + cells.edges[:, None, None] * cells.basis.points


def moments(cells):
    """Volume, first and second moments about the origin, from the weights of the points."""
    places = places_of_points(cells)[cells.cell]
    weights = cells.edges[cells.cell, None] ** 3 * cells.weights[cells.row]
    second = np.einsum("cp,cpi,cpj->ij", weights, places, places)
    return weights.sum(), np.einsum("cp,cpi->i", weights, places), second


def moments_of_box(surface, sides):
    volume = float(np.prod(sides))
    turn = trimesh.transformations.euler_matrix(*np.radians(cut_solids.ANGLES))[:3, :3]
    second = turn @ np.diag(volume * np.square(sides) / 12.0) @ turn.T
    return volume, np.zeros(3), second


@pytest.mark.parametrize("sides", [SIDES, (0.24, 0.24, 0.012), (0.24, 0.24, 0.004)])
@pytest.mark.parametrize("spacing", [0.02, 0.03])
def test_moments_are_those_of_the_solid(sides, spacing):
    surface = turned(box(*sides))
    exact, found = moments_of_box(surface, sides), moments(spaced(surface, spacing))
    assert found[0] == pytest.approx(exact[0], rel=5e-3)
    scale = np.abs(exact[2]).max()
    assert np.abs(found[2] - exact[2]).max() < 1e-2 * scale
    assert np.abs(found[1]).max() < 1e-3 * np.sqrt(exact[0] * scale)


def test_a_box_on_the_lattice_is_integrated_exactly():
    cells = finite_cells(box(0.2, 0.3, 0.1), 12)
    assert (cells.row == cells.place).all() and len(cells) == 6 and cells.mesh.n_cells == 384
    # Corners, three nodes on each edge, and one in each face of 2 by 3 by 1 cells.
    assert len(cells.weights) == 64 and cells.n_nodes == 24 + 3 * 46 + 29
    assert moments(cells)[0] == pytest.approx(0.006, rel=1e-12)
    # Between the planes too, along every axis.
    for moved in (0.004, 0.0123):
        cells = spaced(box(0.2, 0.15, 0.01 + moved), 0.025)
        assert moments(cells)[0] == pytest.approx(0.03 * (0.01 + moved), rel=1e-10)


def test_lines_cross_a_closed_surface_as_often_in_as_out():
    surface = trimesh.creation.icosphere(subdivisions=3, radius=3.7)
    vertices = np.ascontiguousarray(surface.vertices + 4.0)
    # Vertices, edges and faces on lines are the hard case.
    for corners in (vertices, np.round(vertices * 8.0) / 8.0 + 0.0198550717512319):
        faces = surface.faces.astype(np.int64)
        x, y, z = (spread_lines(corners, faces, 8, axis) for axis in range(3))
        for axis in range(3):
            lines = crossings(corners, faces, (x, y, z), axis)
            line = np.repeat(np.arange(len(lines.start) - 1), np.diff(lines.start))
            assert (np.bincount(line, lines.step) == 0).all()
            assert (np.diff(lines.place)[np.diff(line) == 0] >= 0.0).all()


OPEN = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
OPEN.update_faces(np.arange(len(OPEN.faces)) != 7)


@pytest.mark.parametrize(
    ("surface", "volume", "tolerance"),
    [
        (inside_out(turned(box(*SIDES))), 0.004608, 1e-3),
        (soup(turned(box(*SIDES))), 0.004608, 1e-3),
        (trimesh.util.concatenate([box(0.2, 0.05, 0.05), box(0.05, 0.2, 0.05)]), 8.75e-4, 1e-3),
        (OPEN, 4.0 / 3.0 * np.pi * 1e-3, 0.01),
        (with_turned(box(0.2, 0.2, 0.05), 0), 0.002, 0.1),
        (builtin_surface("bell"), 8.794e-4, 2e-3),
    ],
    ids=["inverted", "unmerged", "overlapping", "open", "one face flipped", "bell"],
)
def test_volume_of_surfaces_as_they_come(surface, volume, tolerance):
    assert finite_cells(surface, 14).volume == pytest.approx(volume, rel=tolerance)


def test_rigid_motions_and_a_constant_strain():
    """The patch test on a cut solid: linear displacements have the energy of the real solid."""
    cells = spaced(turned(box(0.2, 0.12, 0.05)), 0.02)
    K, M = assembled(uniform(cells))
    nodes = cells.positions
    gradient = np.array([[1.0, 0.3, -0.2], [0.1, -0.5, 0.4], [0.0, 0.2, 0.7]])
    motion = (nodes @ gradient.T).ravel()
    strain = 0.5 * (gradient + gradient.T)
    voigt = np.append(np.diag(strain), 2.0 * strain[[0, 1, 2], [1, 2, 0]])
    density = cut_solids.YOUNG * voigt @ elasticity_matrix(cut_solids.POISSON) @ voigt
    assert motion @ K @ motion == pytest.approx(density * cells.volume, rel=1e-6)
    spin = gradient - gradient.T
    assert np.abs(K @ (nodes @ spin.T).ravel()).max() < 1e-12 * np.abs(K @ motion).max()
    along = np.tile([1.0, 0.0, 0.0], len(nodes))
    mass = cut_solids.DENSITY * cells.volume
    assert along @ M @ along == pytest.approx(mass, rel=10 * FLOORS[4][1] * len(cells))
    assert uniform(cells).mass == pytest.approx(mass)


def test_stiffness_is_linear_in_the_moduli_of_the_voxels():
    cells = spaced(turned(box(0.2, 0.12, 0.05)), 0.03)
    one, other = np.random.default_rng(0).uniform(1e8, 1e9, (2, cells.mesh.n_cells))
    model = uniform(cells)
    sums = [model.with_young(young).stiffness() for young in (one, other, one + 2.0 * other)]
    apart = np.abs(sums[0] + 2.0 * sums[1] - sums[2])
    assert apart.max() < 1e-14 * np.abs(sums[2]).max()


def test_two_plates_in_one_cell_are_apart():
    """A gap of a quarter of the spacing: copies of the cells, and two pieces."""
    plates = trimesh.util.concatenate([box(0.2, 0.2, 0.02), box(0.2, 0.2, 0.02, at=(0, 0, 0.0245))])
    with pytest.raises(UserError, match="is in 2 pieces .* join them, or keep the largest"):
        finite_cells(plates, 16)
    cells = finite_cells(plates, 16, "largest")
    assert cells.volume == pytest.approx(0.2 * 0.2 * 0.02, rel=1e-9)


def test_pieces_that_a_finer_lattice_joins_are_told_the_resolution():
    blocks = [box(0.1, 0.1, 0.1, at=(side * 0.1, 0.0, 0.0)) for side in (-1, 1)]
    joined = turned(trimesh.util.concatenate([*blocks, box(0.12, 3e-4, 3e-4)]))
    with pytest.raises(UserError, match="2 pieces .* raise the resolution to 19, where it is one"):
        finite_cells(joined, 15)
    assert len(finite_cells(joined, 19)) > 40


def test_prongs_of_a_fork_are_copies_of_cells():
    """The two prongs meet at one end only, however close they are."""
    prongs = [box(0.2, 0.013, 0.02, at=(0.02, side * 0.0085, 0.0)) for side in (-1, 1)]
    fork = trimesh.util.concatenate([*prongs, box(0.04, 0.03, 0.02, at=(-0.1, 0.0, 0.0))])
    cells = finite_cells(fork, 12)
    last = np.flatnonzero(cells.corner[:, 0] == cells.corner[:, 0].max())
    weights = cells.point_values(np.ones(cells.mesh.n_cells), 0.0)[last]
    places = places_of_points(cells)[last, :, 1]
    centre = (weights * places).sum(axis=1) / weights.sum(axis=1)
    above, below = (set(cells.nodes[last[side]].ravel()) for side in (centre > 0.0, centre < 0.0))
    assert above and below and not above & below
    assert len(np.unique(cells.corner[last], axis=0)) < len(last)


def test_voxels_carry_the_material():
    cells = spaced(turned(box(0.24, 0.24, 0.012)), 0.02)
    mesh = cells.mesh
    assert sorted(cells.voxel) == list(range(mesh.n_cells))
    assert (cells.shares > 0.0).all() and cells.is_consistent()
    assert np.array_equal(cells.node_grid[cells.nodes], cells.corner[:, None] + cells.basis.nodes)
    corners = mesh.grid[cells.voxel] - cells.corner[cells.cell]
    assert np.array_equal(corners, voxel_places(4)[cells.place])
    values, _ = laplacian_modes(mesh, 3)
    # One piece through faces, but for voxels that a corner of the plate just reaches.
    assert values[0] < 1e-9


def tube(length: float, inner: float, outer: float) -> trimesh.Trimesh:
    """Along x."""
    made = trimesh.creation.annulus(inner, outer, length, sections=48)
    made.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2.0, (0.0, 1.0, 0.0)))
    return made


@pytest.mark.parametrize("resolution", [24, 32, 48])
def test_a_tube_that_the_lines_see_badly_is_told_a_resolution_that_sees_it(resolution):
    """Lines along its axis all see the same cross-section, at few places."""
    thin = tube(1.0, 0.009, 0.01)
    with pytest.raises(
        UserError, match=r"find \d+% of its volume; raise the resolution to"
    ) as caught:
        finite_cells(thin, resolution)
    better = int(str(caught.value).split()[-1])
    assert finite_cells(thin, better).volume == pytest.approx(thin.volume, rel=0.011)


@pytest.mark.parametrize("resolution", [12, 16, 20])
@pytest.mark.parametrize("place", [turned, lambda surface: surface], ids=["turned", "straight"])
def test_a_needle_is_told_a_resolution_that_does(place, resolution):
    needle = place(box(0.3, 1e-3, 1e-3))
    with pytest.raises(UserError, match="raise the resolution to") as caught:
        finite_cells(needle, resolution)
    better = int(str(caught.value).split()[-1])
    assert finite_cells(needle, better).volume == pytest.approx(needle.volume, rel=0.011)


def test_a_needle_of_twenty_kilometres_is_solved_at_a_high_resolution():
    assert finite_cells(box(2e4, 0.15, 0.1), 4096).volume == pytest.approx(300.0)


SHEET = trimesh.Trimesh([[0, 0, 0], [1, 0, 0.2], [0, 1, 0.7]], [[0, 1, 2]])


@pytest.mark.parametrize(
    ("surface", "resolution", "sentence"),
    [
        (
            turned(box(0.24, 5e-4, 5e-4)),
            16,
            "parts far thinner than the lattice.*raise the",
        ),
        (
            box(2e4, 0.15, 0.1),
            8,
            "parts far thinner than the lattice.*raise the resolution to 4096$",
        ),
        (box(2e9, 0.15, 0.1), 8, "parts far thinner than the lattice.*or make them thicker$"),
        (SHEET, 8, "encloses nothing; expected a surface around a solid"),
        (box(0.2, 0.1, 0.1), 1, "expected a whole number of at least 2"),
        (box(0.2, 0.1, 0.1), 4000, "use a resolution of about"),
    ],
    ids=[
        "needle",
        "needle of twenty kilometres",
        "longer needle",
        "sheet",
        "resolution 1",
        "too many",
    ],
)
def test_what_is_refused(surface, resolution, sentence):
    with pytest.raises(UserError, match=sentence):
        finite_cells(surface, resolution)


def test_a_surface_that_just_reaches_into_cells_has_none_there():
    assert len(finite_cells(box(0.2, 0.3, 0.1 * (1.0 + 1e-9)), 12)) == 6
