"""A solid is the same, however the faces and parts of its mesh are turned; or it is refused."""

import numpy as np
import pytest
import trimesh

from carillon.errors import UserError
from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.geometry import load_surface, voxelize
from carillon.fem.geometry.builtin import BUILTINS, THIN, TRIALS, builtin_surface
from carillon.fem.geometry.orientation import turned_alike
from tests.mesh_files import (
    block,
    both_ways,
    concatenated,
    inside_out,
    merged,
    saved,
    soup,
    with_turned,
)

BOX = block((-0.2, -0.05, -0.05), (0.2, 0.05, 0.05))
LEFT = block((-0.2, -0.05, -0.05), (0.05, 0.05, 0.05))
RIGHT = block((-0.05, -0.05, -0.05), (0.2, 0.05, 0.05))
CAVITY = inside_out(block((-0.1, -0.02, -0.02), (0.1, 0.02, 0.02)))
KERNEL = block((-0.05, -0.01, -0.01), (0.05, 0.01, 0.01))


def turned(surface: trimesh.Trimesh) -> trimesh.Trimesh | None:
    """The surface with its faces turned alike; None if they are."""
    faces = turned_alike(np.asarray(surface.vertices), np.asarray(surface.faces), "it")
    return None if faces is None else trimesh.Trimesh(surface.vertices, faces, process=False)


@pytest.mark.parametrize("name", [*BUILTINS, *THIN, *TRIALS])
def test_nothing_changes_of_solids_that_are_turned_alike(name):
    assert turned(builtin_surface(name)) is None


@pytest.mark.parametrize(
    "surface",
    [
        concatenated(BOX, CAVITY),
        inside_out(concatenated(BOX, CAVITY)),
        concatenated(BOX, CAVITY, KERNEL),
        soup(concatenated(BOX, CAVITY)),
        concatenated(LEFT, RIGHT),
        inside_out(concatenated(LEFT, RIGHT)),
        with_turned(BOX),
        trimesh.Trimesh(BOX.vertices, BOX.faces[2:], process=False),
    ],
    ids=[
        *("cavity", "all inside out", "in a cavity", "soup", "overlap", "overlap, inside out"),
        *("box", "open"),
    ],
)
def test_nothing_changes_of_a_cavity_a_hole_or_a_solid_that_is_inside_out(surface):
    """Inside is where the winding number is not zero, whatever its sign."""
    assert turned(surface) is None


@pytest.mark.parametrize("numbers", [(4,), (0, 5, 7), (0, 1, 2, 3, 4), tuple(range(7))])
@pytest.mark.parametrize("form", [lambda each: each, soup], ids=["shared corners", "soup"])
def test_faces_that_are_turned_against_their_neighbours_are_turned_back(numbers, form):
    """With the most of them turned all others are, which is as good."""
    found = turned(form(with_turned(BOX, *numbers)))
    expected = form(BOX if len(numbers) <= 6 else inside_out(BOX))
    assert np.array_equal(np.sort(found.faces, axis=1), np.sort(expected.faces, axis=1))
    assert found.volume == pytest.approx(expected.volume)


def test_voxels_and_finite_cells_of_a_box_with_a_turned_face_are_those_of_the_box(tmp_path, caplog):
    found = load_surface(saved(with_turned(BOX, 4), tmp_path / "turned.ply"))
    assert "1 of 12 faces were turned" in caplog.text
    expected = load_surface(saved(BOX, tmp_path / "box.ply"))
    assert voxelize(found, 16).filled.all()
    one, other = (finite_cells(each, 8) for each in (found, expected))
    assert np.array_equal(one.nodes, other.nodes)
    assert np.allclose(one.weights, other.weights, rtol=0.0, atol=1e-12)


MIRRORED = {
    "overlapping": (LEFT, inside_out(RIGHT)),
    "the first": (inside_out(LEFT), RIGHT),
    "smaller": (BOX, inside_out(block((0.1, -0.02, -0.02), (0.5, 0.02, 0.02)))),
    "larger": (block((0.1, -0.02, -0.02), (0.5, 0.02, 0.02)), inside_out(BOX)),
    "of three": (LEFT, inside_out(RIGHT), block((-0.3, -0.03, -0.03), (-0.1, 0.03, 0.03))),
    "with a cavity": (
        LEFT,
        inside_out(RIGHT),
        inside_out(block((-0.15, -0.02, -0.02), (-0.1, 0.02, 0.02))),
    ),
    "with its own cavity": (
        LEFT,
        inside_out(concatenated(RIGHT, inside_out(block((0.1, -0.02, -0.02), (0.15, 0.02, 0.02))))),
    ),
    "surrounded": tuple(
        block(tuple(at - 0.1), tuple(at + 0.1))
        for at in 0.18
        * np.array([[0, 0, 1], [0, 0, -1], [0, 1, 0], [0, -1, 0], [1, 0, 0], [-1, 0, 0]])
    )
    + (inside_out(block((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))),),
    "open": (
        LEFT,
        trimesh.Trimesh(
            RIGHT.vertices, inside_out(RIGHT).faces[[2, 3, 4, 5, 6, 7, 8, 9, 10, 11]], process=False
        ),
    ),
    "touching": (LEFT, inside_out(block((0.05, -0.05, -0.05), (0.2, 0.05, 0.05)))),
}


@pytest.mark.parametrize("name", MIRRORED)
def test_a_part_that_is_inside_out_fills_what_it_would_fill(name, tmp_path):
    """A frying pan with its handle inside out has no hollow where they overlap."""
    parts = MIRRORED[name]
    right = [
        inside_out(part) if part.volume < 0 and "cavity" not in name else part for part in parts
    ]
    found = load_surface(saved(concatenated(*parts), tmp_path / "mirrored.ply"))
    if "cavity" not in name:
        expected = concatenated(*right)
        assert np.array_equal(voxelize(found, 20).filled, voxelize(expected, 20).filled)
    else:
        solid = concatenated(LEFT, RIGHT)
        full, hollow = (voxelize(each, 40) for each in (solid, found))
        assert 0 < full.n_cells - hollow.n_cells <= 0.05 * full.n_cells


def test_a_pan_with_its_handle_inside_out_is_the_pan(tmp_path, caplog):
    pan = builtin_surface("skillet")
    pan_faces, handle = pan.faces[:-12], pan.faces[-12:]
    faces = np.concatenate([pan_faces, handle[:, ::-1]])
    mirrored = trimesh.Trimesh(pan.vertices, faces, process=False)
    found = load_surface(saved(mirrored, tmp_path / "mirrored.ply"))
    assert "1 of 2 parts were inside out" in caplog.text
    assert np.array_equal(np.sort(found.faces, axis=1), np.sort(pan.faces, axis=1))
    assert found.volume == pytest.approx(pan.volume)


WHOLE, INNER = np.array([0.4, 0.3, 0.2]), np.array([0.02, 0.02, 0.02])


def slabs() -> list[trimesh.Trimesh]:
    """Six boards as long and as wide as the box, which overlap along its edges."""
    ends = [(axis, side) for axis in range(3) for side in (False, True)]
    low = [np.where(np.eye(3)[axis] * side, WHOLE - INNER, 0.0) for axis, side in ends]
    high = [np.where(np.eye(3)[axis] * (not side), INNER, WHOLE) for axis, side in ends]
    return [block(tuple(one), tuple(other)) for one, other in zip(low, high)]


def mitred() -> list[trimesh.Trimesh]:
    """Six boards whose edges are cut aslant, so that each two share a face."""
    outer, inner = block((0.0, 0.0, 0.0), tuple(WHOLE)), block(tuple(INNER), tuple(WHOLE - INNER))
    sides = [outer.vertices[:, axis] == end for axis in range(3) for end in (0.0, WHOLE[axis])]
    return [
        trimesh.convex.convex_hull(np.concatenate([outer.vertices[side], inner.vertices[side]]))
        for side in sides
    ]


def shuffled(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """The surface with its faces in another order."""
    faces = np.random.default_rng(1).permutation(np.asarray(surface.faces))
    return trimesh.Trimesh(surface.vertices, faces, process=False)


@pytest.mark.parametrize("form", [concatenated, soup, merged, shuffled])
@pytest.mark.parametrize("boards", [slabs, mitred])
@pytest.mark.parametrize("wrong", [(), (1, 4), (0, 2)])
def test_boards_that_share_whole_edges_are_turned_each_by_itself(
    boards, wrong, form, tmp_path, caplog
):
    parts = boards()
    given = [inside_out(part) if at in wrong else part for at, part in enumerate(parts)]
    surface = form(concatenated(*given))
    if not wrong:
        assert turned(surface) is None
        return
    found = load_surface(saved(surface, tmp_path / "boards.ply"))
    assert "2 of 6 parts were inside out" in caplog.text
    assert found.volume == pytest.approx(sum(part.volume for part in parts))


@pytest.mark.parametrize(
    "surface",
    [
        both_ways(BOX),
        both_ways(soup(BOX)),
        both_ways(with_turned(BOX, 3)),
        concatenated(LEFT, both_ways(block((0.1, 0.0, 0.0), (0.3, 0.1, 0.1)))),
    ],
    ids=["all", "soup", "one turned", "one part"],
)
def test_a_part_with_every_face_both_ways_is_refused(surface, tmp_path):
    with pytest.raises(UserError, match="every face of .* is there both ways.* keep one of each"):
        load_surface(saved(surface, tmp_path / "double.ply"))


def test_a_double_sided_sheet_is_refused(tmp_path):
    sheet = trimesh.Trimesh(BOX.vertices, BOX.faces[:10], process=False)
    with pytest.raises(UserError, match="every face of the surface is there both ways"):
        load_surface(saved(both_ways(sheet), tmp_path / "sheet.ply"))


@pytest.mark.parametrize("numbers", [(3,), (0, 1, 2), tuple(range(11))])
def test_of_some_faces_that_are_there_both_ways_one_stays(numbers, caplog):
    found = turned(both_ways(BOX, *numbers))
    assert len(found.faces) == 12 and found.is_watertight and found.is_winding_consistent
    assert abs(found.volume) == pytest.approx(BOX.volume)


def test_a_wall_inside_a_solid_may_be_there_both_ways():
    """Two blocks that share a face are one solid with a wall that cancels."""
    assert turned(concatenated(LEFT, block((0.05, -0.05, -0.05), (0.2, 0.05, 0.05)))) is None


def test_faces_that_cannot_be_turned_alike_are_refused(tmp_path):
    """A Moebius strip has one side."""
    angle = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
    across = np.linspace(-0.3, 0.3, 2)
    x = (1.0 + across[:, None] * np.cos(angle / 2)) * np.cos(angle)
    y = (1.0 + across[:, None] * np.cos(angle / 2)) * np.sin(angle)
    z = across[:, None] * np.sin(angle / 2)
    index = np.arange(48).reshape(2, 24)
    after = np.concatenate([index[:, 1:], index[::-1, :1]], axis=1)
    first = np.stack([index[0], after[0], index[1]], axis=1)
    second = np.stack([index[1], after[0], after[1]], axis=1)
    strip = trimesh.Trimesh(
        np.stack([x, y, z], axis=2).reshape(-1, 3), np.concatenate([first, second]), process=False
    )
    with pytest.raises(UserError, match="turned both ways and cannot be turned alike"):
        load_surface(saved(strip, tmp_path / "strip.ply"))
