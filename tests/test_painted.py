"""Painted places of solids."""

import numpy as np
import pytest
import trimesh

from carillon.composition.entries import (
    CompositionEntry,
    RegionEntry,
    SolidFrame,
    SupportEntry,
    compose,
)
from carillon.composition.materials import named_material
from carillon.composition.painted import Painted
from carillon.composition.supports import placed_supports
from carillon.errors import UserError
from carillon.fem.geometry import hexmesh_from_voxels, voxelize
from carillon.fem.model import fine_model
from carillon.fem.regions import Regions

PLATE = trimesh.creation.box(extents=[0.2, 0.1, 0.01])
TOP, RADIUS = (0.03, 0.0, 0.005), 0.02


@pytest.fixture
def points():
    generator = np.random.default_rng(5)
    return generator.uniform(-0.5, 0.5, (4000, 3)) * PLATE.extents


def beside(points) -> np.ndarray:
    """Distance from the axis through the dab."""
    return np.hypot(points[:, 0] - TOP[0], points[:, 1] - TOP[1])


def test_paint_goes_through_a_thin_wall(points):
    inside = Painted(PLATE, [(*TOP, RADIUS)]).contains(points)
    below = np.abs(points[:, 1]) < 0.04
    # At the other side the ball of the dab is a little narrower.
    narrow = np.sqrt(RADIUS**2 - 0.01**2)
    assert inside[below & (beside(points) < narrow)].all()
    assert not inside[below & (beside(points) > RADIUS + 1e-9)].any()


def test_paint_of_a_depth_stays_at_the_surface(points):
    inside = Painted(PLATE, [(*TOP, RADIUS)], depth=0.002).contains(points)
    deep = np.abs(points[:, 2]) < 0.003
    assert inside.any() and not inside[deep | (points[:, 2] < 0.0)].any()


def test_the_last_dab_counts(points):
    both = [(*TOP, RADIUS), (*TOP, -0.75 * RADIUS)]
    ring = Painted(PLATE, both).contains(points)
    whole = Painted(PLATE, both[:1]).contains(points)
    again = Painted(PLATE, [*both, *both[:1]]).contains(points)
    near = beside(points) < 0.4 * RADIUS
    assert near.any() and not (ring & near).any() and (ring & ~whole).sum() == 0
    assert (again == whole).all()
    assert not Painted(PLATE, both[1:]).contains(points).any()


def test_paint_does_not_depend_on_the_triangles(points):
    finer = PLATE.subdivide().subdivide()
    dabs = [(*TOP, RADIUS), (-0.1, 0.02, 0.0, 0.015)]
    one, other = (Painted(surface, dabs).contains(points) for surface in (PLATE, finer))
    # Equally near to two sides a point may be of either.
    assert (one != other).mean() < 0.002


def test_a_handle_is_painted_all_around():
    bar = trimesh.creation.cylinder(radius=0.01, height=0.2, sections=48)
    dabs = [(0.01, 0.0, z, 0.025) for z in np.arange(0.0, 0.1, 0.01)]
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (3000, 3)) * [0.007, 0.007, 0.08]
    inside = Painted(bar, dabs).contains(points)
    assert inside[points[:, 2] > 0.0].all()
    assert not inside[points[:, 2] < -0.03].any()


def composed(supports=(), **keys):
    entry = CompositionEntry(
        regions=(
            RegionEntry(name="body", material="steel"),
            RegionEntry(name="patch", material="brass", **keys),
        ),
        supports=supports,
    )
    return compose(entry, SolidFrame("", PLATE, "plate"))


def test_painted_voxels_are_of_the_region():
    mesh = hexmesh_from_voxels(voxelize(PLATE, 40))
    placed = composed(painted=[(*TOP, RADIUS)]).composition.of_voxels(mesh)
    middles = mesh.origin + mesh.edge * (mesh.grid + 0.5)
    expected = beside(middles) < RADIUS
    assert (np.asarray(placed.region == 1) != expected).mean() < 0.02


def test_paint_that_meets_no_voxel_is_told():
    mesh = hexmesh_from_voxels(voxelize(PLATE, 40))
    with pytest.raises(UserError, match="'patch' has no voxel"):
        composed(painted=[(*TOP, 1e-5)]).composition.of_voxels(mesh)


def test_a_painted_support_holds_the_surface_there():
    entry = SupportEntry(painted=[(-0.1, 0.0, 0.0, 0.03)])
    mesh = hexmesh_from_voxels(voxelize(PLATE, 20))
    solid = fine_model(mesh, np.full(mesh.n_cells, 1e9), regions=Regions.one())
    placed = placed_supports((entry.support({}, PLATE),), solid, PLATE)
    assert placed is not None
    assert (np.linalg.norm(placed.positions - [-0.1, 0.0, 0.0], axis=1) < 0.031).all()
    on_surface = np.abs(np.abs(placed.positions) - PLATE.extents / 2.0).min(axis=1)
    assert np.allclose(on_surface, 0.0, atol=1e-6)
    assert solid.with_supports(placed).rigid_modes == 0


def test_a_pad_is_painted():
    entry = SupportEntry(painted=[(*TOP, RADIUS)], pad="rubber", thickness=0.01)
    mesh = hexmesh_from_voxels(voxelize(PLATE, 20))
    solid = fine_model(mesh, np.full(mesh.n_cells, 1e9), regions=Regions.one())
    placed = placed_supports((entry.support({}, PLATE),), solid, PLATE)
    assert placed is not None
    # The stiffness is that of the area, of the side that is painted alone.
    young, area = named_material("rubber").young, np.pi * RADIUS**2
    assert placed.stiffness[:, 2, 2].sum() == pytest.approx(young / 0.01 * area, rel=0.1)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"painted": []}, "painted"),
        ({"painted": [(0.0, 0.0, 0.0)]}, "painted"),
        ({"painted": [(*TOP, RADIUS)], "where": "x > 0"}, "expected one place"),
        ({"depth": 0.01}, "depth goes with painted"),
    ],
)
def test_paint_that_is_none(keys, said):
    with pytest.raises(UserError, match=said):
        RegionEntry(name="patch", **keys)


def test_supports_have_one_place():
    with pytest.raises(UserError, match="expected where, at or painted"):
        SupportEntry(where="x > 0", painted=[(*TOP, RADIUS)])
