"""Bodies that touch along edges or in points alone are no solid, however the lattice lies."""

import numpy as np
import pytest
import trimesh

from carillon.command_line.logs import warn_once
from carillon.errors import UserError
from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.geometry import voxelize
from carillon.fem.geometry.builtin import BUILTINS, THIN, TRIALS, builtin_surface
from carillon.fem.geometry.contacts import one_body
from tests.mesh_files import block, concatenated, inside_out, merged, soup

CUBE = block((0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
TURN = trimesh.transformations.rotation_matrix(0.7, (1.0, 2.0, 3.0))


def on_edge() -> trimesh.Trimesh:
    """A bar that lies with an edge on the cube."""
    half = 0.03
    bar = block((-half, -half, 0.02), (half, half, 0.08))
    bar.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 4, (0.0, 0.0, 1.0)))
    return bar.apply_translation((0.05, 0.1 + half * np.sqrt(2.0), 0.0))


def ball() -> trimesh.Trimesh:
    """A ball that lies with a corner on the cube."""
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    return sphere.apply_translation((0.05, 0.05, 0.1 - sphere.bounds[0, 2]))


APART = {
    "edge": block((0.1, 0.1, 0.0), (0.2, 0.2, 0.1)),
    "half an edge": block((0.1, 0.1, 0.05), (0.2, 0.2, 0.15)),
    "corner": block((0.1, 0.1, 0.1), (0.2, 0.2, 0.2)),
    "edge on a face": on_edge(),
    "corner on a face": ball(),
}
ONE = {
    "face": block((0.1, 0.0, 0.0), (0.2, 0.1, 0.1)),
    "part of a face": block((0.1, 0.02, 0.02), (0.2, 0.08, 0.08)),
    "corners of faces": block((0.1, 0.09, 0.09), (0.2, 0.2, 0.2)),
    "overlap": block((0.08, 0.02, 0.02), (0.2, 0.08, 0.08)),
    "strip of overlap": block((0.099, 0.099, 0.0), (0.2, 0.2, 0.1)),
    "across": block((0.04, -0.1, 0.04), (0.06, 0.2, 0.06)),
    "inside": block((0.02, 0.02, 0.02), (0.06, 0.08, 0.08)),
    "inside, on a face": block((0.0, 0.02, 0.02), (0.06, 0.08, 0.08)),
    "cavity": inside_out(block((0.02, 0.02, 0.02), (0.06, 0.08, 0.08))),
    "cavity at a corner": inside_out(block((0.0, 0.0, 0.0), (0.06, 0.08, 0.08))),
    "gap": block((0.101, 0.0, 0.0), (0.2, 0.1, 0.1)),
}


@pytest.mark.parametrize("form", [lambda each: each, soup], ids=["shared corners", "soup"])
@pytest.mark.parametrize("turn", [np.eye(4), TURN], ids=["straight", "turned"])
@pytest.mark.parametrize("name", [*APART, *ONE])
def test_bodies_are_one_if_they_share_an_area_or_overlap(name, turn, form):
    other = {**APART, **ONE}[name]
    surface = form(concatenated(CUBE, other).apply_transform(turn))
    if name in ONE:
        assert one_body(surface, "error", "it") is surface
        return
    with pytest.raises(UserError, match="2 pieces that touch along an edge or in a point at most"):
        one_body(surface, "error", "it")
    kept = one_body(surface, "largest", "it")
    assert kept.volume == pytest.approx(max(CUBE.volume, other.volume))


@pytest.mark.parametrize("resolution", [10, 15, 16])
@pytest.mark.parametrize("make", [voxelize, finite_cells], ids=["voxels", "finite cells"])
def test_neither_voxels_nor_finite_cells_hold_an_edge_together(make, resolution):
    """Whether it lies on the lattice (16), in the middle of a voxel (15) or of a cell (10)."""
    surface = concatenated(CUBE, APART["edge"])
    with pytest.raises(UserError, match="2 pieces that touch along an edge"):
        make(surface, resolution)


def test_the_largest_of_bodies_that_touch_lies_where_it_did():
    """Its voxels are those of the whole surface's grid, and its cavity stays one."""
    hollow = concatenated(CUBE, inside_out(block((0.04, 0.04, 0.04), (0.06, 0.06, 0.06))))
    small = block((0.1, 0.1, 0.0), (0.15, 0.15, 0.05))
    hole = inside_out(block((0.11, 0.11, 0.01), (0.14, 0.14, 0.04)))
    kept = voxelize(concatenated(hollow, small, hole), 15, components="largest")
    assert kept.edge == pytest.approx(0.01) and kept.n_cells == 1000 - 8
    assert np.argwhere(kept.filled).max() == 9


def test_bodies_that_a_third_one_joins_are_one():
    surface = concatenated(CUBE, APART["edge"], block((0.08, 0.08, 0.02), (0.12, 0.12, 0.08)))
    assert one_body(surface, "error", "it") is surface


SEVEN = [(0, 0), (1, 0), (2, 0), (2, 1), (0, 1), (0, 2), (1, 2)]
"""Cubes around a hole, the first and the last of which share an edge alone."""


def cubes(places: list[tuple[int, int]], edge: float = 0.1) -> trimesh.Trimesh:
    """A cube for each place, not united."""
    low = edge * np.array([(*place, 0) for place in places], dtype=float)
    return concatenated(*[block(tuple(each), tuple(each + edge)) for each in low])


def united(places: list[tuple[int, int]], edge: float = 0.1) -> trimesh.Trimesh:
    """The surface of cubes, with vertices of its own for each face."""
    whole = soup(cubes(places, edge))
    middles = np.round(whole.triangles_center / edge, 6)
    outward = np.round(whole.face_normals)
    sides = {tuple(row) for row in np.column_stack([middles, outward])}
    whole.update_faces(np.array([(*at, *-out) not in sides for at, out in zip(middles, outward)]))
    return whole


C = united(SEVEN)
SELF = {
    "vertices of their own": C,
    "shared vertices": merged(C),
    "cut triangles": merged(C).subdivide().subdivide(),
    "inside out": inside_out(C),
    "blocks": cubes(SEVEN),
    "overlapping parts": concatenated(
        merged(united([*SEVEN[:4], *SEVEN[5:]])), block((0.0, 0.099, 0.0), (0.1, 0.201, 0.1))
    ),
    "the part that touches overlaps": concatenated(
        merged(united(SEVEN[:-1])), block((0.099, 0.2, 0.0), (0.2, 0.3, 0.1))
    ),
    "holes beside each other": united(
        [(x, y) for x in range(4) for y in range(4) if (x, y) not in ((1, 1), (2, 2))]
    ),
    "a part far away": concatenated(C, block((-0.1, 0.02, 0.02), (0.02, 0.08, 0.08))),
    "hollow": concatenated(C, inside_out(block((0.12, 0.22, 0.01), (0.19, 0.29, 0.09)))),
}
NOWHERE = {
    "closed ring": united([*SEVEN, (2, 2)]),
    "corner between": united([*SEVEN, (1, 1)]),
    "gap": concatenated(merged(united(SEVEN[:-1])), block((0.099, 0.201, 0.0), (0.2, 0.3, 0.1))),
    "bridged": concatenated(C, block((0.18, 0.18, 0.02), (0.22, 0.22, 0.08))),
}


def warnings_of(surface, caplog):
    """What is said of a surface that stays as it is."""
    caplog.clear()
    warn_once.cache_clear()
    assert one_body(surface, "error", "it") is surface
    return [each.getMessage() for each in caplog.records]


@pytest.mark.parametrize("turn", [np.eye(4), TURN], ids=["straight", "turned"])
@pytest.mark.parametrize("name", SELF)
def test_a_body_that_touches_itself_along_an_edge_is_warned_of(name, turn, caplog):
    (said,) = warnings_of(SELF[name].copy().apply_transform(turn), caplog)
    assert "touches itself along" in said and "let them overlap" in said


def test_the_place_of_the_longest_edge_is_said(caplog):
    assert "along an edge at (0.2, 0.2, 0.05) m" in warnings_of(united(SEVEN), caplog)[0]
    relief = united([(x, y) for x in range(41) for y in range(41) if (x + y) % 2 == 0], 0.01)
    assert "along 1,000 edges or more, the longest at (" in warnings_of(relief, caplog)[0]


@pytest.mark.parametrize("turn", [np.eye(4), TURN], ids=["straight", "turned"])
@pytest.mark.parametrize("name", NOWHERE)
def test_nothing_is_said_of_a_body_that_touches_itself_nowhere(name, turn, caplog):
    assert warnings_of(NOWHERE[name].copy().apply_transform(turn), caplog) == []


@pytest.mark.parametrize("name", [*BUILTINS, *THIN, *TRIALS])
def test_no_solid_of_the_house_touches_itself(name, caplog):
    assert warnings_of(builtin_surface(name), caplog) == []
