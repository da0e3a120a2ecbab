"""Struck points: on the surface, into the solid, one target each."""

import numpy as np
import pytest
import trimesh

from carillon.errors import UserError
from carillon.fem.geometry import BUILTINS, builtin_surface
from solver.response.vertices import inward_normals
from sound.strikes import Place, Strike, locate_all, struck_surface
from tests.mesh_files import inside_out, soup, with_turned

PAN = "builtin:frying-pan"


def locate(surface, name, at=None, vertex=None, unit=1.0) -> Strike:
    """The vertex that one target is struck at."""
    return locate_all(surface, [Place(name, at, vertex)], unit)[0]


def ball(radius: float = 0.1) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=3, radius=radius)


@pytest.mark.parametrize(
    "change", [lambda s: s, soup, inside_out, lambda s: with_turned(s, *range(0, 1280, 2))]
)
def test_strikes_go_into_a_ball_however_its_triangles_are_stored(change):
    strike = locate(change(ball()), "top", at=(0.0, 0.001, 0.1))
    assert np.allclose(strike.position, (0.0, 0.0, 0.1), atol=1e-2)
    assert strike.inward @ (-strike.position / 0.1) > 0.999
    assert np.linalg.norm(strike.inward) == pytest.approx(1.0)


def test_a_vertex_is_struck_by_its_number():
    strike = locate(ball(), "there", vertex=17)
    assert strike.vertex == 17
    assert np.array_equal(strike.position, ball().vertices[17])


def test_inward_is_into_every_built_in_object():
    import igl

    for name in BUILTINS:
        surface = struck_surface(f"builtin:{name}")
        positions = np.asarray(surface.vertices)[:: max(1, len(surface.vertices) // 200)]
        inward = inward_normals(surface, positions)
        vertices, faces = np.array(surface.vertices), np.array(surface.faces, dtype=np.int64)
        step = 1e-3 * surface.extents.max() * inward
        ahead, behind = (
            igl.fast_winding_number(vertices, faces, positions + s) for s in (step, -step)
        )
        assert (ahead > behind - 0.25).all(), name
        assert (ahead > 0.5).mean() > 0.95, name


TUBE = trimesh.creation.annulus(r_min=0.02, r_max=0.025, height=0.3, sections=96)


@pytest.mark.parametrize("change", [lambda s: s, soup, inside_out])
def test_inward_of_a_closed_surface_takes_no_winding_numbers(change, monkeypatch):
    """They took a minute for a tube of long triangles."""
    import igl

    monkeypatch.setattr(igl, "fast_winding_number", None)
    surface = change(TUBE)
    vertices = np.asarray(surface.vertices)
    inward = inward_normals(surface, vertices)
    radius = np.linalg.norm(vertices[:, :2], axis=1)
    outwards = (inward[:, :2] * vertices[:, :2]).sum(axis=1) / radius
    outer = radius > 0.0225
    assert (outwards[outer] < -0.5).all() and (outwards[~outer] > 0.5).all()


def test_inward_of_parts_beside_an_open_one_is_into_each():
    """Of which the open one alone takes winding numbers."""
    shell = trimesh.Trimesh(ball().vertices, ball().faces[:-40], process=False)
    apart = ball().apply_translation((0.3, 0.0, 0.0))
    both = trimesh.util.concatenate([inside_out(shell), inside_out(apart)])
    inward = inward_normals(both, np.asarray(both.vertices))
    outwards = np.concatenate([shell.vertices, ball().vertices]) / 0.1
    right = (inward * outwards).sum(axis=1) < -0.5
    used = np.isin(np.arange(len(both.vertices)), both.faces)
    assert right[len(shell.vertices) :].all()
    assert right[used].mean() > 0.99  # Those at the rim of the hole see little of the inside.


def test_a_struck_surface_is_fine_everywhere_and_keeps_its_vertices():
    plain, fine = builtin_surface("frying-pan"), struck_surface(PAN)
    assert np.array_equal(fine.vertices[: len(plain.vertices)], plain.vertices)
    assert fine.edges_unique_length.max() <= fine.extents.max() / 16
    assert fine.is_watertight and fine.is_winding_consistent
    assert fine.volume == pytest.approx(plain.volume)
    middle = locate(fine, "plate", at=(0.05, 0.0, 0.022))  # the plain mesh has no vertex near
    assert np.linalg.norm(middle.position - (0.05, 0.0, 0.022)) < 0.02
    assert np.allclose(middle.inward, (0.0, 0.0, -1.0))


def test_a_point_off_the_surface_is_moved_to_it_and_that_is_told(capsys):
    strike = locate(ball(), "top", at=(0.0, 0.0, 0.15))
    assert np.allclose(strike.position, (0.0, 0.0, 0.1), atol=1e-2)
    assert strike.distance == pytest.approx(np.linalg.norm(strike.position - (0, 0, 0.15)))
    (line,) = capsys.readouterr().err.splitlines()
    assert "'top': the point (0, 0, 0.15) m is 5 cm off the surface" in line
    assert f"vertex {strike.vertex} at" in line and "unit" not in line


def test_a_point_on_the_surface_needs_no_word(capsys):
    surface = struck_surface(PAN)
    for point in surface.triangles_center[::97]:
        strike = locate(surface, "here", at=np.round(point, 4))
        assert strike.distance == pytest.approx(np.linalg.norm(strike.position - point), abs=1e-4)
    assert locate(surface, "here", vertex=5).distance == 0.0
    assert not capsys.readouterr().err


def test_points_are_in_the_unit_of_the_mesh(capsys):
    there = locate(ball(), "top", at=(0.0, 0.0, 0.1))
    assert locate(ball(), "top", at=(0.0, 0.0, 100.0), unit=1e-3).vertex == there.vertex
    assert not capsys.readouterr().err
    locate(ball(), "top", at=(0.0, 0.0, 0.1), unit=1e-3)
    said = capsys.readouterr().err
    assert "(0, 0, 0.1) mesh units" in said
    assert "times 1000 it is on the surface: is it in another unit?" in said


def test_all_places_that_cannot_be_struck_are_told_together():
    places = [
        Place("far", at=(1.0, 0.0, 0.0)),
        Place("one", vertex=3),
        Place("none", vertex=-1),
        Place("same", vertex=3),
    ]
    with pytest.raises(UserError) as caught:
        locate_all(ball(), places)
    far, none, same = str(caught.value).splitlines()
    assert "'far'" in far and "'none'" in none and "'one' and 'same' are both at" in same


def test_the_unit_of_the_mesh_scales_the_surface():
    assert np.allclose(struck_surface(PAN, 2.0).extents, 2.0 * struck_surface(PAN).extents)


@pytest.mark.parametrize(
    ("place", "says"),
    [
        (
            {"at": (0.0, 0.0, 0.25)},
            r"'top'.*\(0, 0, 0.25\) m is 0.75 times as far from the surface",
        ),
        ({"at": (0.3, 0.3, 0.3)}, r"expected the mesh's own coordinates, from \(-0.1, .*move it"),
        (
            {"at": (0.0, 0.0, 100.0)},
            r"\(0, 0, 100\) m .*times 0.001 it is on the surface: is",
        ),
        ({"at": (1e18, 1e18, 1e18)}, "'top'.*as far from the surface"),
        ({"at": (0.0, float("nan"), 0.1)}, "'top'.*not finite"),
        ({"vertex": 642}, r"'top'.*no vertex 642.* 642 of them, numbered from 0 to 641"),
        ({"vertex": -1}, "'top'.*no vertex -1"),
        ({}, "'top'.*either a position or a vertex"),
        ({"at": (0.0, 0.0, 0.1), "vertex": 3}, "'top'.*either a position or a vertex"),
    ],
)
def test_a_place_that_cannot_be_struck_is_answered_in_one_sentence(place, says):
    with pytest.raises(UserError, match=says) as caught:
        locate(ball(), "top", **place)
    assert "\n" not in str(caught.value)


def test_a_vertex_without_triangles_cannot_be_struck():
    surface = ball()
    loose = trimesh.Trimesh([*surface.vertices, (0, 0, 0.1)], surface.faces, process=False)
    with pytest.raises(UserError, match="vertex 642 belongs to no triangle"):
        locate(loose, "top", vertex=642)
    assert locate(loose, "top", at=(0, 0, 0.1)).vertex != 642


def test_two_targets_at_one_place_are_refused_even_if_its_vertices_differ():
    surface = soup(ball())
    twins = np.flatnonzero((surface.vertices == surface.vertices[0]).all(axis=1))
    with pytest.raises(UserError, match="'left' and 'right' are both at vertex 0"):
        locate_all(surface, [Place("left", vertex=0), Place("right", vertex=int(twins[1]))])
    apart = locate_all(surface, [Place("left", vertex=0), Place("right", vertex=1)])
    assert [strike.name for strike in apart] == ["left", "right"]
