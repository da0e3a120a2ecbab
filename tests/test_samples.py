"""What lines tell of a closed surface is what winding numbers tell, point by point."""

import numpy as np
import pytest
import trimesh

from carillon.fem.geometry import builtin_surface
from carillon.fem.geometry.grid import bounding_grid
from carillon.fem.geometry.samples import SamplePoints
from carillon.fem.geometry.touching import touched_voxels
from carillon.fem.geometry.winding import Winding

COUNT = 3
TURN = trimesh.transformations.euler_matrix(0.4, 0.6, 0.3)


def every_point(shape) -> np.ndarray:
    return np.indices([COUNT * size for size in shape]).reshape(3, -1).T


@pytest.mark.parametrize("turned", [False, True], ids=["straight", "turned"])
@pytest.mark.parametrize("name", ["box", "plate", "frying-pan", "snare-drum", "comb", "cup"])
def test_lines_and_winding_numbers_agree(name, turned):
    surface = builtin_surface(name)
    if turned:
        surface.apply_transform(TURN)
    grid = bounding_grid(surface, 12)
    index = every_point(grid.shape)
    expected = Winding(surface, grid).inside((index + 0.5) / COUNT)
    assert np.array_equal(SamplePoints(surface, grid, COUNT).inside(index), expected)
    assert expected.any()


def test_a_wall_through_the_points_is_inside_on_all_its_sides():
    """Of a box from the first points of its outermost voxels to the last, all points are inside."""
    grid = bounding_grid(trimesh.creation.box((8.0, 6.0, 4.0)), 8)
    surface = trimesh.creation.box(np.array(grid.shape) - 1.0 / COUNT)
    index = every_point(grid.shape)
    on_face = (index == 0).sum(axis=1) + (index == COUNT * np.array(grid.shape) - 1).sum(
        axis=1
    ) == 1
    inside = SamplePoints(surface, grid, COUNT).inside(index)
    assert (
        inside[on_face].all() and inside[(index > 0).all(axis=1) & (index < 11).all(axis=1)].all()
    )


def agreed(surface: trimesh.Trimesh) -> bool:
    grid = bounding_grid(surface, 10)
    index = every_point(grid.shape)
    expected = Winding(surface, grid).inside((index + 0.5) / COUNT)
    return np.array_equal(SamplePoints(surface, grid, COUNT).inside(index), expected)


@pytest.mark.parametrize("faces", [slice(3, None), slice(None, -400), slice(0, None, 2)])
def test_with_holes_they_agree_too(faces):
    whole = builtin_surface("bell")
    assert agreed(trimesh.Trimesh(whole.vertices, whole.faces[faces], process=False))


def test_a_pipe_without_ends_is_filled():
    pipe = trimesh.creation.cylinder(radius=1.0, height=4.0, sections=32)
    along = np.abs(pipe.face_normals[:, 2]) < 0.5
    assert agreed(trimesh.Trimesh(pipe.vertices, pipe.faces[along], process=False))


def test_triangles_turned_either_way_are_for_winding_numbers():
    surface = builtin_surface("bowl")
    surface.faces[::3] = surface.faces[::3, ::-1]
    assert agreed(trimesh.Trimesh(surface.vertices, surface.faces, process=False))


@pytest.mark.parametrize("name", ["bar", "pitcher", "spiral"])
def test_touched_voxels_hold_the_vertices_of_the_surface_cut_small(name):
    surface = builtin_surface(name)
    grid = bounding_grid(surface, 16)
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    for longest in (2.0, 0.5):
        vertices, faces = trimesh.remesh.subdivide_to_size(
            vertices, faces, max_edge=longest * grid.edge, max_iter=30
        )
    expected = np.zeros(grid.shape, dtype=bool)
    index = np.floor((vertices - grid.origin) / grid.edge).astype(int)
    expected[tuple(np.clip(index, 0, np.array(grid.shape) - 1).T)] = True
    assert np.array_equal(touched_voxels(surface, grid), expected)
