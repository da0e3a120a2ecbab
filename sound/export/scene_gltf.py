"""glTF 2.0 of a played scene: moving objects, camera and sound.

The motion is an ordinary animation.  The sound is in the draft extension KHR_audio_emitter, see
`sound.export.gltf_audio`, as a global emitter: the sound at two ears has no position.  Players that
do not know the draft show the scene silently.

glTF's y points up and the scene's z: a root node turns all of it.
"""

from pathlib import Path
from typing import Any

import numpy as np

from carillon import __version__
from carillon.arrays import Array, Integers
from sound.export.gltf_asset import (
    FLOAT,
    TRIANGLES,
    UNSIGNED_INT,
    VERTICES,
    Buffer,
    node_rotation,
    write_asset,
)
from sound.export.gltf_audio import DRAFT, EXTENSION, audio_of
from sound.scenes.performance import Appearance, Camera, Motion, Performance, Picture, linear_light

ROUGHNESS = 0.5
"""Roughness of all surfaces in glTF's sense, from 0, a mirror, to 1."""
GROUND_COLOUR = (0.8, 0.8, 0.8)
GROUND_REACH = 20.0
"""Half the side of the ground, over the distance of the camera's target."""
NEAREST = 0.01
"""Distance of the camera's near plane, over that of its target."""
_STRAIGHT = 1e-9
"""Length of a cross product below which the camera looks straight up or down."""


def write_scene_gltf(path: str | Path, performance: Performance, binary: bool) -> None:
    """Write `.glb` if `binary`, else `.gltf` with the data embedded in it.

    Raises UserError if the file cannot be written.
    """
    write_asset(path, *scene_document(performance), binary)


def scene_document(performance: Performance) -> tuple[dict[str, Any], bytes]:
    """The asset as JSON and its buffer."""
    picture = performance.picture
    buffer = Buffer()
    seen = [*picture.objects, *_ground(picture)]
    channels, samplers = _animation(picture.motion, buffer)
    nodes = [*_object_nodes(picture), *_ground_nodes(picture), _camera_node(picture.camera)]
    root = {
        "name": "z points up",
        "rotation": node_rotation(),
        "children": list(range(1, 1 + len(nodes))),
    }
    camera = picture.camera  # sees as far as to infinity
    perspective = {"yfov": float(np.radians(camera.degrees)), "znear": NEAREST * _distance(camera)}
    document: dict[str, Any] = {
        "asset": {
            "version": "2.0",
            "generator": f"Carillon {__version__}",
        },
        "scene": 0,
        "scenes": [{"name": performance.title, "nodes": [0]}],
        "nodes": [root, *nodes],
        **_surfaces(seen, buffer),
        "cameras": [{"type": "perspective", "perspective": perspective}],
        "animations": [{"name": "motion", "channels": channels, "samplers": samplers}],
    }
    _add_sound(document, performance, buffer)
    return document | buffer.entries(), bytes(buffer.data)


def _add_sound(document: dict[str, Any], performance: Performance, buffer: Buffer) -> None:
    """The sound of the whole scene, played once, equally loud everywhere."""
    sounds = [("sound", performance.sound)]
    audio = audio_of(sounds, performance.rate, buffer, positional=False, autoplay=True)
    if audio is None:
        return
    extras = {EXTENSION: DRAFT, "sound": "begins with the animation, at time 0"}
    document["asset"]["extras"] = extras
    document["extensionsUsed"] = [EXTENSION]
    document["extensions"] = {EXTENSION: audio}
    document["scenes"][0]["extensions"] = {EXTENSION: {"emitters": [0]}}


def _object_nodes(picture: Picture) -> list[dict[str, Any]]:
    turns = _turns(picture.motion)
    return [
        {
            "name": each.name,
            "mesh": number,
            "translation": picture.motion.positions[0, number].tolist(),
            "rotation": turns[0, number].tolist(),
        }
        for number, each in enumerate(picture.objects)
    ]


def _animation(motion: Motion, buffer: Buffer) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    times = buffer.add(motion.times, FLOAT)
    for path, values in (("translation", motion.positions), ("rotation", _turns(motion))):
        for number in range(values.shape[1]):
            # The root is the first node; objects follow.
            channels.append(
                {"sampler": len(samplers), "target": {"node": 1 + number, "path": path}}
            )
            output = buffer.add(values[:, number], FLOAT)
            samplers.append({"input": times, "output": output, "interpolation": "LINEAR"})
    return channels, samplers


def _turns(motion: Motion) -> Array:
    """Quaternions (T, B, 4) in glTF's order (x, y, z, w), each near to the one before it.

    A quaternion and its negative are one rotation, but not all players take the short way.
    """
    turns = np.roll(motion.rotations, -1, axis=2)
    cosines = (turns[1:] * turns[:-1]).sum(axis=2, keepdims=True)
    turns[1:] *= np.cumprod(np.where(cosines < 0.0, -1.0, 1.0), axis=0)
    return turns


def _surfaces(seen: list[Appearance], buffer: Buffer) -> dict[str, Any]:
    """Meshes and materials: a part of a mesh for each colour."""
    meshes: list[dict[str, Any]] = []
    materials: list[dict[str, Any]] = []
    for each in seen:
        positions = buffer.add(each.vertices, FLOAT, VERTICES)
        primitives = []
        for faces, colour in _painted(each):
            indices = buffer.add(faces.ravel(), UNSIGNED_INT, TRIANGLES)
            primitives.append(
                {
                    "attributes": {"POSITION": positions},
                    "indices": indices,
                    "material": len(materials),
                }
            )
            materials.append(_material(each.name, colour))
        meshes.append({"name": each.name, "primitives": primitives})
    return {"meshes": meshes, "materials": materials}


def _painted(each: Appearance) -> list[tuple[Integers, tuple[float, float, float]]]:
    """Triangles (f, 3) of each colour."""
    if each.painted is None:
        return [(each.faces, each.colour)]
    parts = [(each.faces[each.painted == k], colour) for k, colour in enumerate(each.colours)]
    return [part for part in parts if len(part[0])]


def _material(name: str, colour: tuple[float, float, float]) -> dict[str, Any]:
    return {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*linear_light(colour).tolist(), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": ROUGHNESS,
        },
    }


def _ground(picture: Picture) -> list[Appearance]:
    if picture.ground is None:
        return []
    reach = GROUND_REACH * _distance(picture.camera)
    corners = reach * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    corners += picture.camera.target[:2]
    vertices = np.column_stack([corners, np.zeros(len(corners))])
    return [Appearance("ground", vertices, np.array([(0, 1, 2), (0, 2, 3)]), GROUND_COLOUR)]


def _ground_nodes(picture: Picture) -> list[dict[str, Any]]:
    if picture.ground is None:
        return []
    height = [0.0, 0.0, picture.ground]
    return [{"name": "ground", "mesh": len(picture.objects), "translation": height}]


def _camera_node(camera: Camera) -> dict[str, Any]:
    """glTF's cameras look along -z, with y up in the picture."""
    from scipy.spatial.transform import Rotation

    back = np.subtract(camera.position, camera.target) / _distance(camera)
    across = np.cross([0.0, 0.0, 1.0], back)
    long = float(np.linalg.norm(across))
    # Looking straight up or down, where no direction is up in the picture.
    right = across / long if long > _STRAIGHT else np.array([1.0, 0.0, 0.0])
    axes = np.column_stack([right, np.cross(back, right), back])
    return {
        "name": "camera",
        "camera": 0,
        "translation": list(camera.position),
        "rotation": Rotation.from_matrix(axes).as_quat().tolist(),
    }


def _distance(camera: Camera) -> float:
    return float(np.linalg.norm(np.subtract(camera.position, camera.target)))
