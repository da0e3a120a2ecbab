"""Meshes of volume elements are solids by their outer faces, and know where points lie."""

import numpy as np
import pytest

from carillon.fem.geometry.cell_shapes import SHAPES
from carillon.fem.geometry.facets import Facets
from carillon.fem.geometry.volume_mesh import VolumeMesh
from tests.volume_meshes import box, volume_mesh

SIDES = np.array([0.3, 0.2, 0.1])


ARC = np.pi / 4.0


def bent(points):
    """A piece of a ring in place of a straight bar: lines become arcs."""
    angle = points[:, 0] / SIDES[0] * ARC
    radius = 1.0 + points[:, 1]
    return np.stack([radius * np.sin(angle), radius * np.cos(angle), points[:, 2]], axis=1)


def centres_of(mesh: VolumeMesh):
    return np.concatenate(
        [mesh.points[cells[:, : SHAPES[name].corners]].mean(axis=1) for name, cells in mesh.blocks]
    )


@pytest.mark.parametrize("name", SHAPES)
def test_the_surface_is_closed_turned_outwards_and_encloses_the_volume(name):
    surface = volume_mesh(name).surface
    assert surface.is_watertight and surface.is_winding_consistent
    assert surface.volume == pytest.approx(SIDES.prod())
    assert surface.area == pytest.approx(2 * (0.06 + 0.02 + 0.03))


@pytest.mark.parametrize("name", [name for name, shape in SHAPES.items() if shape.edges])
def test_curved_elements_have_curved_faces(name):
    """Chords of half the elements' angle: the volume is off by what they cut off."""
    mesh = volume_mesh(name, bend=bent)
    exact = 0.5 * ARC * (1.2**2 - 1.0) * 0.1
    half_angle = ARC / 3 / 2 / 2
    assert mesh.surface.is_watertight
    assert mesh.surface.volume == pytest.approx(exact, rel=2.0 * half_angle**2 / 3.0)


@pytest.mark.parametrize("bend", [None, bent], ids=["straight", "bent"])
@pytest.mark.parametrize("name", SHAPES)
def test_a_point_lies_in_the_element_that_it_was_taken_from(name, bend):
    mesh = volume_mesh(name, bend=bend)
    middles = centres_of(mesh)
    assert mesh.cells_at(middles).tolist() == list(range(mesh.n_cells))
    random = np.random.default_rng(0)
    cell = random.integers(mesh.n_cells, size=500)
    shape = SHAPES[name]
    weights = random.dirichlet(np.ones(shape.corners), 500)
    corners = mesh.points[mesh.blocks[0][1][:, : shape.corners]]
    found = mesh.cells_at(np.einsum("qk,qki->qi", weights, corners[cell]))
    # In a bent mesh a mean of corners may lie beyond a face.
    assert bend is not None or (found == cell).all()


@pytest.mark.parametrize("bend", [None, bent], ids=["straight", "bent"])
@pytest.mark.parametrize("name", SHAPES)
def test_elements_leave_no_gap_inside_the_surface(name, bend):
    mesh = volume_mesh(name, bend=bend)
    low, high = mesh.surface.bounds
    points = low + (high - low) * np.random.default_rng(1).random((1000, 3))
    import igl

    vertices, faces = np.array(mesh.surface.vertices), np.array(mesh.surface.faces)
    inside = igl.winding_number(vertices, faces.astype(np.int64), points) > 0.5
    assert ((mesh.cells_at(points) >= 0) == inside).all()


def test_points_on_faces_edges_and_corners_are_in_the_first_element_that_has_them():
    mesh = volume_mesh("hexahedron")
    nodes = mesh.blocks[0][1]
    first = np.full(len(mesh.points), mesh.n_cells)
    np.minimum.at(first, nodes.ravel(), np.repeat(np.arange(len(nodes)), 8))
    assert mesh.cells_at(mesh.points).tolist() == first.tolist()


def test_a_point_outside_belongs_to_the_nearest_element():
    mesh = volume_mesh("tetra")
    outside = np.array([[-1.0, 0.05, 0.05], [0.15, 0.1, 0.9], [0.5, 0.5, 0.5]])
    assert mesh.cells_at(outside).tolist() == [-1, -1, -1]
    found = mesh.cells_at(outside, nearest=True)
    on_it = np.clip(outside, 0.0, SIDES)
    corners = mesh.points[mesh.blocks[0][1][found]]
    low, high = corners.min(axis=1), corners.max(axis=1)
    assert ((low <= on_it + 1e-12) & (on_it <= high + 1e-12)).all()


def test_parts_with_nodes_of_their_own_have_no_faces_where_they_meet():
    one, cells = box("tetra")
    points = np.concatenate([one, one + [0.3, 0.0, 0.0]])
    mesh = VolumeMesh("two", points, [("tetra", np.concatenate([cells, cells + len(one)]))])
    assert mesh.surface.volume == pytest.approx(2.0 * SIDES.prod())
    assert np.ptp(mesh.surface.vertices, axis=0) == pytest.approx([0.6, 0.2, 0.1])
    assert len(mesh.surface.faces) == 2 * len(volume_mesh("tetra").surface.faces) - 2 * 2 * 4
    facets = Facets.of_surface(np.asarray(mesh.surface.vertices), np.asarray(mesh.surface.faces))
    assert not facets.unbalanced(np.ones(len(facets), dtype=np.int64)).any()


def test_a_mesh_of_very_different_elements_takes_no_room_of_its_square():
    """Many tiny elements beside few large ones, which reach over all cubes of the grid."""
    points, cells = box("tetra", counts=(20, 10, 10))
    squeezed = points * np.where(points[:, :1] < 0.15, 1.0, 1.0)
    squeezed[:, 0] = 0.3 * (points[:, 0] / 0.3) ** 8
    mesh = VolumeMesh("graded", squeezed, [("tetra", cells)])
    middles = centres_of(mesh)
    assert mesh.cells_at(middles).tolist() == list(range(mesh.n_cells))
    assert len(mesh._search._cells) < 30 * mesh.n_cells
