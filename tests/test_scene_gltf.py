"""What other tools read from a scene in glTF: objects, their motion, a camera and the sound."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from sound.export.scene_gltf import EXTENSION, write_scene_gltf
from sound.scenes.performance import Appearance, Camera, Motion, Performance, Picture
from tests.gltf_files import accessor, read_gltf, rms, sound_of, validated

STEPS, RATE = 41, 8000
GROUND = -0.02
UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From the scene's axes to glTF's: z becomes y."""
KINDS = ["scene.gltf", "scene.glb"]


def motion() -> Motion:
    """Of two objects that fly and tumble; the signs of quaternions change at random."""
    times = np.linspace(0.0, 1.0, STEPS)
    positions = np.stack([(0.1 * times, 0.2 - times**2, 0.3 + times), (times, times, -times)])
    angles = np.stack([5.0 * times, 1.0 - 9.0 * times])
    turns = Rotation.from_rotvec(angles.ravel()[:, None] * np.array([0.6, 0.0, 0.8]))
    quaternions = np.roll(turns.as_quat(), 1, axis=1).reshape(2, STEPS, 4)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (2, STEPS, 1))
    return Motion(times, positions.transpose(2, 0, 1), (signs * quaternions).transpose(1, 0, 2))


def performance(ground: float | None = GROUND) -> Performance:
    box, ball = trimesh.creation.box((0.1, 0.2, 0.3)), trimesh.creation.icosphere(radius=0.05)
    objects = [
        Appearance("box", box.vertices, box.faces, (1.0, 0.5, 0.0)),
        Appearance("ball", ball.vertices, ball.faces, (0.02, 0.2, 0.9)),
    ]
    camera = Camera((1.0, -2.0, 1.5), (0.1, 0.2, 0.3), 40.0)
    seconds = np.arange(4 * RATE) / RATE
    tones = np.sin(2.0 * np.pi * np.outer(seconds, [440.0, 660.0]))
    sound = np.exp(-3.0 * seconds)[:, None] * tones * (0.3, 1.6)
    picture = Picture(objects, motion(), ground, camera)
    return Performance("Two objects", picture, sound, RATE, [], [None, None])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("scene")
    for name in KINDS:
        write_scene_gltf(path / name, performance(), name.endswith(".glb"))
    return path


def animated(document: dict[str, Any], data: bytes, path: str) -> dict[str, np.ndarray]:
    """Values (T, n) of each object's animation along a path, by the object's name."""
    (animation,) = document["animations"]
    found = {}
    for channel in animation["channels"]:
        if channel["target"]["path"] == path:
            sampler = animation["samplers"][channel["sampler"]]
            name = document["nodes"][channel["target"]["node"]]["name"]
            found[name] = accessor(document, data, sampler["output"])
    return found


@pytest.mark.parametrize("name", KINDS)
def test_the_file_keeps_to_the_specification(folder, name):
    document, data = read_gltf(folder / name)
    assert document["asset"]["version"] == "2.0"
    assert document["buffers"][0]["byteLength"] == len(data)
    ends = [view["byteOffset"] + view["byteLength"] for view in document["bufferViews"]]
    assert max(ends) <= len(data)
    for number, entry in enumerate(document["accessors"]):
        values = accessor(document, data, number)
        assert entry["min"] == values.min(axis=0).tolist()
        assert entry["max"] == values.max(axis=0).tolist()
    for mesh in document["meshes"]:
        (surface,) = mesh["primitives"]
        count = document["accessors"][surface["attributes"]["POSITION"]]["count"]
        assert accessor(document, data, surface["indices"]).max() == count - 1
        assert surface["material"] < len(document["materials"])
    (scene,) = document["scenes"]
    (root,) = (document["nodes"][number] for number in scene["nodes"])
    assert root["children"] == list(range(1, len(document["nodes"])))
    assert scene["name"] == "Two objects"


@pytest.mark.parametrize("name", KINDS)
def test_objects_stand_where_they_begin(folder, name):
    played = performance().picture
    loaded = trimesh.load(folder / name)
    assert isinstance(loaded, trimesh.Scene)
    for number, each in enumerate(played.objects):
        matrix, geometry = loaded.graph[each.name]
        turn = Rotation.from_quat(np.roll(played.motion.rotations[0, number], -1)).as_matrix()
        np.testing.assert_allclose(matrix[:3, :3], UP @ turn, atol=1e-6)
        np.testing.assert_allclose(
            matrix[:3, 3], UP @ played.motion.positions[0, number], atol=1e-6
        )
        shape = loaded.geometry[geometry]
        np.testing.assert_allclose(shape.vertices, each.vertices, atol=1e-7)
        np.testing.assert_array_equal(shape.faces, each.faces)


@pytest.mark.parametrize("name", KINDS)
def test_the_animation_is_the_motion(folder, name):
    document, data = read_gltf(folder / name)
    played = performance().picture.motion
    (animation,) = document["animations"]
    (times,) = {sampler["input"] for sampler in animation["samplers"]}
    assert {sampler["interpolation"] for sampler in animation["samplers"]} == {"LINEAR"}
    np.testing.assert_allclose(accessor(document, data, times)[:, 0], played.times, rtol=1e-6)
    upright = Rotation.from_quat(document["nodes"][0]["rotation"])
    places, turns = (animated(document, data, path) for path in ("translation", "rotation"))
    assert list(places) == list(turns) == ["box", "ball"]
    for number, each in enumerate(places):
        assert places[each].shape == (STEPS, 3) and turns[each].shape == (STEPS, 4)
        np.testing.assert_allclose(
            upright.apply(places[each]), played.positions[:, number] @ UP.T, atol=1e-6
        )
        expected = Rotation.from_quat(np.roll(played.rotations[:, number], -1, axis=1))
        assert (Rotation.from_quat(turns[each]) * expected.inv()).magnitude().max() < 1e-6
        np.testing.assert_allclose(np.linalg.norm(turns[each], axis=1), 1.0, atol=1e-6)
        assert ((turns[each][1:] * turns[each][:-1]).sum(axis=1) > 0.0).all()


def test_the_camera_sees_what_it_looks_at_in_the_middle(folder):
    document, _ = read_gltf(folder / "scene.glb")
    camera = performance().picture.camera
    (node,) = (node for node in document["nodes"] if "camera" in node)
    turn = Rotation.from_quat(node["rotation"])
    ahead = np.subtract(camera.target, camera.position)
    seen = turn.inv().apply(ahead)
    np.testing.assert_allclose(seen, [0.0, 0.0, -float(np.linalg.norm(ahead))], atol=1e-9)
    assert turn.inv().apply([0.0, 0.0, 1.0])[1] > 0.0
    assert turn.apply([1.0, 0.0, 0.0])[2] == pytest.approx(0.0, abs=1e-12)
    lens = document["cameras"][0]["perspective"]
    assert lens["yfov"] == pytest.approx(np.radians(40.0))
    assert 0.0 < lens["znear"] < 0.1


@pytest.mark.parametrize("height", [3.0, -3.0])
def test_a_camera_may_look_straight_up_or_down(tmp_path, height):
    given = performance()
    camera = Camera((0.0, 0.0, height), (0.0, 0.0, 0.0))
    picture = Picture(given.picture.objects, given.picture.motion, None, camera)
    above = Performance("Above", picture, given.sound, RATE, [], [None, None])
    write_scene_gltf(tmp_path / "above.glb", above, True)
    document, _ = read_gltf(tmp_path / "above.glb")
    turn = Rotation.from_quat(document["nodes"][-1]["rotation"])
    np.testing.assert_allclose(turn.apply([0.0, 0.0, -1.0]), [0.0, 0.0, -height / 3.0], atol=1e-9)


def test_the_ground_is_a_square_that_faces_up(folder, tmp_path):
    document, data = read_gltf(folder / "scene.glb")
    (node,) = (node for node in document["nodes"] if node["name"] == "ground")
    assert node["translation"] == [0.0, 0.0, GROUND]
    (surface,) = document["meshes"][node["mesh"]]["primitives"]
    corners = accessor(document, data, surface["attributes"]["POSITION"])
    square = trimesh.Trimesh(corners, accessor(document, data, surface["indices"]).reshape(-1, 3))
    np.testing.assert_allclose(square.face_normals, [(0.0, 0.0, 1.0)] * 2)
    assert square.area > 100.0
    write_scene_gltf(tmp_path / "flying.glb", performance(ground=None), True)
    document, _ = read_gltf(tmp_path / "flying.glb")
    assert [node["name"] for node in document["nodes"][1:]] == ["box", "ball", "camera"]


def test_colours_are_linear(folder):
    document, _ = read_gltf(folder / "scene.gltf")
    box, ball = (document["materials"][n]["pbrMetallicRoughness"] for n in range(2))
    np.testing.assert_allclose(box["baseColorFactor"], [1.0, 0.2140, 0.0, 1.0], atol=1e-4)
    np.testing.assert_allclose(ball["baseColorFactor"], [0.0015, 0.0331, 0.7874, 1.0], atol=1e-4)


@pytest.mark.parametrize("name", KINDS)
def test_the_sound_is_that_of_the_scene(folder, name):
    document, data = read_gltf(folder / name)
    assert document["extensionsUsed"] == [EXTENSION]
    sound = document["extensions"][EXTENSION]
    (number,) = document["scenes"][0]["extensions"][EXTENSION]["emitters"]
    emitter = sound["emitters"][number]
    assert emitter["type"] == "global"
    source = sound["sources"][emitter["sources"][0]]
    assert source["autoplay"] and "loop" not in source
    samples, rate = sound_of(document, data, sound["audio"][source["audio"]])
    assert rate == 4 * RATE
    truth = performance().sound
    assert samples.shape == (4 * len(truth), 2)
    assert 20.0 * np.log10(rms(source["gain"] * samples[::4] - truth) / rms(truth)) < -35.0


@pytest.mark.parametrize("name", KINDS)
def test_khronos_validator_finds_nothing_wrong(folder, name):
    validated(folder / name)


@pytest.mark.parametrize("name", KINDS)
def test_the_file_is_the_same_again(folder, tmp_path, name):
    write_scene_gltf(tmp_path / name, performance(), name.endswith(".glb"))
    assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()
