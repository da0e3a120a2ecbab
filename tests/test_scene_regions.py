"""Objects of scenes that are of several regions, or held."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from carillon.composition.materials import named_material
from carillon.errors import UserError
from carillon.fem.elasticity import Elasticity
from sound.scenes.bodies import bodies_of, with_modes
from sound.scenes.divided import parts_of_one
from tests.scenes import QUIET, ball, moved, require_engine, scene, struck

SIDES = (0.2, 0.03, 0.02)
HALVES = [
    {"name": "iron", "material": "iron"},
    {"name": "beech", "material": "beech", "grain": [1, 0, 0], "where": "x > 0.05"},
]


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    path = tmp_path_factory.mktemp("meshes") / "bar.obj"
    trimesh.creation.box(extents=SIDES).export(path)
    return str(path)


def body(mesh, **given):
    """The one object of a scene, of low resolution."""
    how = {"name": "it", "mesh": mesh, "resolution": 12, "collision": "hull"}
    (found,) = with_modes(bodies_of(scene({**how, **given}).objects))
    return found


def at(found, place):
    """Number of the vertex nearest to a place of the mesh."""
    return np.linalg.norm(found.in_solid(found.shape.vertices) - place, axis=1).argmin()


def test_regions_of_one_material_are_a_body_of_it(bar):
    one = body(bar, material="steel", count=4)
    regions = [{"name": name, "material": "steel", "where": where} for name, where in (
        ("a", "x < 0.0123"), ("b", "x >= 0.0123"))]  # fmt: skip
    several = body(bar, regions=regions, count=4)
    assert several.mass == pytest.approx(one.mass, rel=1e-6)
    assert several.inertia == pytest.approx(one.inertia, rel=1e-6, abs=1e-6 * one.inertia.max())
    assert several.solid.frequencies == pytest.approx(one.solid.frequencies, rel=1e-5)
    assert several.solid.dampings == pytest.approx(one.solid.dampings, rel=1e-5)
    assert several.volume == pytest.approx(one.volume, rel=1e-6)


def test_mass_and_centre_are_those_of_the_regions(bar):
    found = body(bar, regions=HALVES, count=0)
    densities = [named_material(name).density for name in ("iron", "beech")]
    section = SIDES[1] * SIDES[2]
    masses = section * np.array([0.15, 0.05]) * densities
    assert found.mass == pytest.approx(masses.sum(), rel=1e-6)
    middle = masses @ [-0.025, 0.075] / masses.sum()
    assert found.centre == pytest.approx([middle, 0.0, 0.0], abs=1e-7)
    assert found.volume == pytest.approx(np.prod(SIDES), rel=1e-6)


def test_an_object_is_of_its_own_material_where_no_region_is(bar):
    rest = body(bar, material="iron", regions=HALVES[1:], count=0)
    assert rest.mass == pytest.approx(body(bar, regions=HALVES, count=0).mass, rel=1e-9)
    # What regions cover needs none of it.
    whole = body(bar, material="rubber", regions=HALVES, count=0)
    assert whole.mass == pytest.approx(rest.mass, rel=1e-9)


def test_it_is_touched_as_its_material_is_there(bar):
    found = body(bar, regions=HALVES, count=0)
    iron, beech = named_material("iron"), named_material("beech")
    young, poisson = Elasticity.isotropic_equivalent(beech.region("beech").laws[0])
    compliances = [
        (1.0 - iron.poisson**2) / iron.young,
        (1.0 - poisson**2) / (young * beech.young),
    ]
    places = [(-0.1, 0.0, 0.0), (0.1, 0.0, 0.0)]
    vertices = [at(found, place) for place in places]
    assert found.compliance[vertices] == pytest.approx(compliances)
    # Softer than along the grain, stiffer than across it.
    across = np.array(beech.grain_young)
    assert across[2] < young * beech.young < across[0]
    surfaces = [found.materials[found.which[vertex]] for vertex in vertices]
    assert [each.friction for each in surfaces] == [iron.friction, beech.friction]
    assert [each.roughness for each in surfaces] == [iron.roughness, beech.roughness]


def test_what_an_object_says_of_its_surface_counts_for_all_of_it(bar):
    found = body(bar, regions=HALVES, count=0, friction=0.9, colour=[0, 0, 1])
    assert {each.friction for each in found.materials} == {0.9}
    assert {each.colour for each in found.materials} == {(0.0, 0.0, 1.0)}


@pytest.mark.parametrize(
    "normal", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.3, -0.5)], ids=["x", "z", "oblique"]
)
def test_parts_are_divided_along_a_plane(normal):
    vertices, faces = trimesh.remesh.subdivide_to_size(
        *(lambda box: (box.vertices, box.faces))(trimesh.creation.box(extents=[0.2, 0.1, 0.06])),
        max_edge=0.006,
        max_iter=30,
    )
    which = (vertices @ normal > 0.005).astype(int)
    whole = trimesh.creation.box(extents=[0.2, 0.1, 0.06]).vertices
    parts, numbers = parts_of_one([whole], vertices, which)
    assert sum(ConvexHull(part).volume for part in parts) == pytest.approx(0.2 * 0.1 * 0.06)
    if max(np.abs(normal)) == 1.0:
        assert len(parts) == 2
    wrong = 0
    for part, number in zip(parts, numbers):
        equations = ConvexHull(part).equations
        inside = (vertices @ equations[:, :3].T + equations[:, 3]).max(axis=1) < -1e-9
        wrong += (which[inside] != number).sum()
    assert wrong == 0 and set(numbers) == {0, 1}
    volume = sum(ConvexHull(part).volume for part, n in zip(parts, numbers) if n)
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (20_000, 3)) * [0.2, 0.1, 0.06]
    wanted = (points @ normal > 0.005).mean() * 0.2 * 0.1 * 0.06
    assert volume == pytest.approx(wanted, rel=0.1)


def test_an_inlay_is_a_part_of_its_own():
    box = trimesh.creation.box(extents=[0.2, 0.1, 0.02])
    vertices, _ = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, 0.006, 30)
    inlay = (np.abs(vertices[:, 0]) < 0.03) & (vertices[:, 2] > 0.009)
    inlay &= np.abs(vertices[:, 1]) < 0.02
    parts, numbers = parts_of_one([box.vertices], vertices, inlay.astype(int))
    own = [part for part, number in zip(parts, numbers) if number == 1]
    assert len(own) == 1
    assert np.abs(own[0][:, 0]).max() == pytest.approx(0.03, abs=0.006)


def test_strikes_on_wood_last_longer_than_on_iron_and_leave_less_speed(bar):
    require_engine()
    drops = [
        ball(f"{name}", position=[x, 0.0, 0.12])
        for name, x in (("on iron", -0.05), ("on beech", 0.08))
    ]
    plank = {
        "name": "bar",
        "mesh": bar,
        "regions": [HALVES[0] | {"where": "x <= 0.05"}, HALVES[1] | {"material": "softwood"}],
        "count": 0,
        "fixed": True,
        "resolution": 12,
        "position": [0.0, 0.0, 0.05],
    }
    # The body's own centre is not that of the mesh.
    centre = body(bar, regions=plank["regions"], count=0).centre
    plank["position"] = [float(centre[0]), 0.0, 0.05]
    _, impacts, _ = struck(scene(plank, *drops, ground=None, seconds=0.2))
    first = {each.impact.pair: each.impact for each in reversed(impacts)}
    iron, wood = first[1, 0], first[2, 0]
    assert wood.duration > 1.5 * iron.duration
    # Impulses are (1 + restitution) m v; the steel's own bounce is higher than either.
    speeds = [named_material(name).restitution for name in ("iron", "softwood")]
    rises = [abs(each.impulse[2]) / each.speed for each in (iron, wood)]
    assert rises[0] / rises[1] == pytest.approx((1 + speeds[0]) / (1 + speeds[1]), rel=0.05)


def test_friction_is_that_of_the_region_that_lies_on_the_ground(tmp_path):
    require_engine()
    path = tmp_path / "slab.obj"
    trimesh.creation.box(extents=[0.2, 0.2, 0.05]).export(path)
    regions = [
        {"name": "top", "material": "rubber"},
        {"name": "foot", "material": "steel", "where": "z < -0.01"},
    ]
    given = {"mesh": str(path), "regions": regions, "count": 0, "resolution": 10}
    centre = body(str(path), regions=regions, count=0).centre[2]
    height = 0.025 + centre
    slope = {"gravity": [4.9, 0.0, -8.5], "seconds": 0.3, "ground_material": "glass"}
    ways = {}
    for name, turn, z in (("foot", 0.0, height), ("top", 180.0, 0.05 - height)):
        described = {"name": name, **given, "position": [0, 0, z], "rotation": [turn, 0, 0]}
        described["velocity"] = [0.3, 0, 0]
        _, course = moved(scene(described, **slope))
        ways[name] = course.motion.positions[-1, 0, 0]
    # Rubber slows down on a slope on which steel gets faster.
    for name, material in (("foot", "steel"), ("top", "rubber")):
        speedup = 4.9 - named_material(material).friction * 8.5
        assert ways[name] == pytest.approx(0.3 * 0.3 + 0.5 * speedup * 0.3**2, rel=0.05)


def test_a_held_plate_sounds_as_a_cantilever(tmp_path):
    length, wide, thick = 0.2, 0.02, 0.004
    path = tmp_path / "strip.obj"
    trimesh.creation.box(extents=[length, wide, thick]).export(path)
    given = {"material": "steel", "count": 4, "fixed": True, "resolution": 20}
    found = body(str(path), **given, supports=[{"where": "x < -0.0999"}])
    steel = named_material("steel")
    wave = 1.8751 / length
    bending = np.sqrt(steel.young * thick**2 / 12.0 / steel.density)
    assert found.solid.frequencies[0] == pytest.approx(wave**2 * bending / (2 * np.pi), rel=0.02)
    # Without supports it sounds as a free one does.
    free = body(str(path), **given)
    wave = 4.7300 / length
    assert free.solid.frequencies[0] == pytest.approx(wave**2 * bending / (2 * np.pi), rel=0.02)
    assert 0.0 < found.accuracy["solid_frequency_error_rms"] < 0.2


def test_what_is_held_does_not_move_there(bar):
    found = body(bar, material="brass", count=3, fixed=True, supports=[{"where": "x < -0.09"}])
    ends = found.solid.motion(np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]]))
    assert np.abs(ends[0]).max() < 1e-3 * np.abs(ends[1]).max()


def test_a_held_mesh_is_scaled_to_a_pitch(bar):
    held = {"fixed": True, "supports": [{"where": "x < -0.0999"}], "regions": HALVES, "count": 2}
    plain, pitched = body(bar, **held), body(bar, **held, pitch=440.0)
    assert pitched.solid.frequencies[0] == pytest.approx(440.0, rel=1e-3)
    factor = plain.solid.frequencies[0] / pitched.solid.frequencies[0]
    assert pitched.mass == pytest.approx(plain.mass * factor**3, rel=5e-3)


def test_decays_lie_between_those_of_the_regions(bar):
    found = body(bar, regions=HALVES, count=5)
    values = (2.0 * np.pi * found.solid.frequencies) ** 2
    low, high = (
        0.5 * (each.alpha + each.beta * values)
        for each in (named_material("iron"), named_material("beech"))
    )
    assert (low < found.solid.dampings).all() and (found.solid.dampings < high).all()
    given = body(bar, regions=HALVES, count=5, damping=[3.0, 1e-8])
    assert given.solid.dampings == pytest.approx(0.5 * (3.0 + 1e-8 * values), rel=1e-3)


def test_masses_are_of_the_body(bar):
    plain = body(bar, material="steel", count=2)
    heavy = body(bar, material="steel", count=2, supports=[{"at": [0.1, 0, 0], "mass": 0.2}])
    assert heavy.mass == pytest.approx(plain.mass + 0.2, rel=1e-6)
    assert heavy.centre[0] == pytest.approx(0.2 * 0.1 / heavy.mass, rel=1e-3)
    assert heavy.volume == pytest.approx(plain.volume, rel=1e-6)
    assert heavy.solid.frequencies[0] < plain.solid.frequencies[0]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"material": "steel", "supports": [{"where": "x < 0"}]}, "add fixed: true"),
        (
            {
                "material": "steel",
                "fixed": True,
                "pitch": 440.0,
                "count": 1,
                "supports": [{"where": "x < 0", "spring": 1e9}],
            },
            "springs, pads and masses do not follow",
        ),
        ({"regions": [*HALVES, HALVES[0]]}, "two regions are called 'iron'"),
        ({"regions": [{"name": "a", "material": "irn"}]}, "there is no material 'irn'"),
        ({"regions": HALVES[1:]}, "are of no region"),
        (
            {"regions": [*HALVES, {"name": "c", "material": "steel", "where": "x > 9"}]},
            "region 'c' has no voxel",
        ),
        (
            {"material": "steel", "fixed": True, "supports": [{"where": "x > 9"}]},
            "meets nothing of solid",
        ),
    ],
)
def test_objects_that_describe_no_solid(bar, given, said):
    with pytest.raises(UserError, match=said):
        body(bar, **{"count": 0, **given})


@pytest.mark.parametrize(
    "given",
    [
        {"regions": HALVES},
        {"material": "brass", "fixed": True, "supports": [{"where": "x < -0.09"}]},
    ],
    ids=["regions", "held"],
)
def test_what_is_found_is_kept(bar, monkeypatch, given):
    import solver.analysis.library as library

    given = {**given, "count": 3, "resolution": 11}
    first = body(bar, **given)
    monkeypatch.setattr(library, "solve", None)
    again = body(bar, **given, position=[0, 0, 1])
    assert np.array_equal(first.solid.frequencies, again.solid.frequencies)
    assert np.array_equal(first.solid.dampings, again.solid.dampings)


class TestModes:
    """Modes files of solids of several regions."""

    text = """regions:
  - {name: pan, material: iron}
  - {name: handle, material: beech, grain: [1, 0, 0], where: "x > 0.05"}
"""

    def solved(self, bar, tmp_path, *more, text=None):
        from solver.__main__ import main

        table, modes = tmp_path / "regions.yaml", str(tmp_path / "bar.h5")
        table.write_text(self.text if text is None else text)
        how = ["--resolution", "12", "--modes", "10", "--method", "slepc", "--refine-to", "0"]
        how += ["--discretisation", "finite-cell", "--regions", str(table), *more]
        assert main(["modes", bar, *how, "--out", modes]) == 0
        return modes

    def of(self, modes, **given):
        (found,) = with_modes(bodies_of(scene({"name": "it", "modes": modes, **given}).objects))
        return found

    def test_it_is_the_body_of_the_mesh(self, bar, tmp_path):
        modes = self.solved(bar, tmp_path)
        regions = [{"name": "pan", "material": "iron"}, {"name": "handle", "material": "beech"}]
        found = self.of(modes, regions=regions)
        own = body(bar, regions=HALVES, count=4, accuracy=None)
        assert found.mass == pytest.approx(own.mass, rel=1e-6)
        assert found.solid.frequencies == pytest.approx(own.solid.frequencies, rel=1e-4)
        assert found.solid.dampings == pytest.approx(own.solid.dampings, rel=1e-3)
        ends = [at(found, place) for place in ((-0.1, 0, 0), (0.1, 0, 0))]
        others = [at(own, place) for place in ((-0.1, 0, 0), (0.1, 0, 0))]
        assert found.compliance[ends] == pytest.approx(own.compliance[others], rel=1e-6)
        names = [found.materials[found.which[vertex]].friction for vertex in ends]
        assert names == [named_material(name).friction for name in ("iron", "beech")]

    def test_regions_that_it_has_not(self, bar, tmp_path):
        modes = self.solved(bar, tmp_path)
        with pytest.raises(UserError, match="has no region 'lid'; it has 'pan', 'handle'"):
            self.of(modes, regions=[{"name": "lid", "material": "steel"}])
        with pytest.raises(UserError, match="the modes tells where it is"):
            self.of(modes, regions=[{"name": "pan", "where": "x > 0"}])

    def test_held_modes_are_of_a_fixed_object(self, bar, tmp_path):
        modes = self.solved(bar, tmp_path, "--fix", "x < -0.09")
        with pytest.raises(UserError, match="is held, so it cannot move; add fixed: true"):
            self.of(modes)
        found = self.of(modes, fixed=True)
        assert len(found.solid.frequencies) == 10
        own = body(bar, regions=HALVES, count=10, fixed=True, supports=[{"where": "x < -0.09"}])
        assert found.solid.frequencies == pytest.approx(own.solid.frequencies, rel=1e-4)


def test_a_held_object_rings_when_it_is_struck(bar):
    require_engine()
    from sound.scenes.playing.play import perform

    plank = {
        "name": "bar",
        "mesh": bar,
        "regions": HALVES,
        "supports": [{"where": "x < -0.0999"}],
        "fixed": True,
        "resolution": 12,
        "count": 3,
        "position": [0.0, 0.0, 0.05],
    }
    falls = ball(position=[0.06, 0.0, 0.12])
    played = perform(
        scene(plank, falls, ground=None, seconds=0.5, sound={"rate": 8000, **QUIET}),
        1,
        visible=False,
    )
    (frequencies, heard) = played.voices[0].frequencies, played.sound[:, 0]
    assert frequencies[0] < 1000.0  # far below what a free one has
    spectrum = np.abs(np.fft.rfft(heard))
    hertz = np.fft.rfftfreq(len(heard), 1.0 / 8000)
    near = np.abs(hertz - frequencies[0]) < 10.0
    assert spectrum[near].max() > 10.0 * np.median(spectrum)


def test_a_picture_has_the_colours_of_the_regions(bar):
    from sound.export.scene_gltf import scene_document
    from sound.scenes.performance import Appearance, Camera, Motion, Performance, Picture

    found = body(bar, regions=HALVES, count=0)
    shape, colours = found.shape, [each.colour for each in found.materials]
    seen = Appearance.of_regions("bar", shape.vertices, shape.faces, colours, found.which)
    middles = found.in_solid(shape.vertices[shape.faces].mean(axis=1))[:, 0]
    iron, beech = (named_material(name).colour for name in ("iron", "beech"))
    assert seen.colour == iron and seen.colours == (iron, beech)
    # Triangles at the border are small.
    wrong = (seen.painted == 1) != (middles > 0.05)
    assert np.abs(middles[wrong] - 0.05).max(initial=0.0) < 0.01 * SIDES[0]
    motion = Motion(np.zeros(1), np.zeros((1, 1, 3)), np.array([[[1.0, 0.0, 0.0, 0.0]]]))
    picture = Picture([seen], motion, None, Camera((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    played = Performance("it", picture, np.zeros((8, 2)), 8000, [], [None])
    document, _ = scene_document(played)
    assert [len(mesh["primitives"]) for mesh in document["meshes"]] == [2]
    assert len(document["materials"]) == 2
