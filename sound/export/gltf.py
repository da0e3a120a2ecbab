"""glTF 2.0: the surface with its modal model, by the draft extension KHR_audio_rigid_bodies.

Beside it are the mass properties (draft KHR_physics_rigid_bodies, repository
eoineoineoin/glTF_Physics, commit ac5c413), with the convex hull as collider, and the sound of a
strike of 1 N s at each target, see `sound.export.gltf_audio`.  The solid's node turns the axis
that points up to glTF's y.

KHR_audio_rigid_bodies is a draft (Karl Hiner, repository glTF_PhysicalAudio, folder
extensions/2.0/Khronos/KHR_audio_rigid_bodies; state of 2026, with `modalModels`,
`acousticMaterials` and the radiation factor 2 pi f_n in its synthesis).  A player that follows it
makes of an impulse j at a point p

    s(t) = gain sum_n 2 pi f_n (phi_n(p) . j) exp(-d_n t) sin(2 pi f_n t).

A design is matched to clips without that factor, so phi_n here is the mass-normalised mode u_n
times f_1 / f_n, f_1 being the lowest frequency: the player's sound then is the design's.  The draft
asks for such data "in the same form", and the factors stand in the model's extras.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon import __version__
from carillon.arrays import Array
from carillon.fem.model import mass_properties
from sound.export import gltf_audio
from sound.export.gltf_asset import (
    FLOAT,
    TRIANGLES,
    UNSIGNED_INT,
    VERTICES,
    Buffer,
    node_rotation,
    write_asset,
)
from sound.export.gltf_material import acoustic_material
from sound.export.gltf_surface import surface_material, surface_mesh
from sound.project.design import Design
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, render
from sound.rendering.rendered_sound import ringing_seconds
from sound.rendering.solid import SoundingSolid

EXTENSION = "KHR_audio_rigid_bodies"
PHYSICS = "KHR_physics_rigid_bodies"
DRAFT = (
    "draft by Karl Hiner, repository glTF_PhysicalAudio, "
    "extensions/2.0/Khronos/KHR_audio_rigid_bodies, 2026"
)
PHYSICS_DRAFT = (
    "draft, repository eoineoineoin/glTF_Physics, "
    "extensions/2.0/Khronos/KHR_physics_rigid_bodies, commit ac5c413"
)
SOUND_RATE = 48_000
"""Samples per second of the strikes' sounds."""
UNITS = {
    "positions": "m, axes of the solid",
    "frequencies": "Hz",
    "decayRates": "1/s",
    "shapes": "kg^-1/2",
    "impulse": "N s",
    "density": "kg/m^3",
    "youngsModulus": "Pa",
    "elasticity": "1, times youngsModulus; strains xx, yy, zz, xy, yz, zx, engineering shears",
    "alpha": "1/s",
    "beta": "s",
    "output": "full scale is 1",
}


def write_gltf(
    path: str | Path,
    design: Design,
    binary: bool,
    up: str | None = None,
    name: str | None = None,
) -> None:
    """Write `.glb` if `binary`, else `.gltf` with the data embedded in it.

    `up` is the axis of the mesh file that points up, see `Design.remaining_turn`.  Raises UserError
    if the file cannot be written.
    """
    write_asset(path, *gltf_document(design, up, name), binary)


def gltf_document(
    design: Design, up: str | None = None, name: str | None = None
) -> tuple[dict[str, Any], bytes]:
    """The asset as JSON and its buffer."""
    name = name or design.name
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    buffer = Buffer()
    mesh = surface_mesh(design, buffer)
    model, gain = _modal_model(design, solid, listening, buffer)
    strikes = _strike_nodes(design, listening)
    mass = _mass_properties(design)
    body: dict[str, Any] = {
        "name": name,
        "mesh": 0,
        "rotation": node_rotation(design.remaining_turn(up)),
        "children": list(range(1, 1 + len(strikes))),
        "extensions": {
            EXTENSION: {"modalModel": 0, "gain": gain},
            PHYSICS: {
                "motion": mass,
                "collider": {"geometry": {"node": 0, "convexHull": True}},
            },
        },
    }
    extensions: dict[str, Any] = {
        EXTENSION: {
            "modalModels": [{**model, "massProperties": mass}],
            "acousticMaterials": [acoustic_material(design)],
        }
    }
    drafts = {EXTENSION: DRAFT, PHYSICS: PHYSICS_DRAFT}
    sounds = _sounds(design, solid, listening)
    audio = gltf_audio.audio_of(sounds, SOUND_RATE, buffer, positional=True, autoplay=False)
    if audio is not None:
        extensions[gltf_audio.EXTENSION] = audio
        drafts[gltf_audio.EXTENSION] = gltf_audio.DRAFT
        for number, node in enumerate(strikes):
            node["extensions"] = {gltf_audio.EXTENSION: {"emitters": [number]}}
    document = {
        "asset": {"version": "2.0", "generator": f"Carillon {__version__}", "extras": drafts},
        "extensionsUsed": list(drafts),
        "extensions": extensions,
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [body, *strikes],
        "meshes": [mesh],
        "materials": [surface_material(design)],
        **buffer.entries(),
    }
    return document, bytes(buffer.data)


def _modal_model(
    design: Design, solid: SoundingSolid, listening: Listening, buffer: Buffer
) -> tuple[dict[str, Any], float]:
    """The model without its mass, and the gain of its node."""
    order = _loudest_first(design, solid, listening)
    lowest = float(solid.frequencies.min())
    scales = lowest / solid.frequencies[order]
    shapes = solid.motion(design.surface_vertices).transpose(2, 0, 1)[order]
    model = {
        "name": "modes",
        "frequencies": buffer.add(solid.frequencies[order], FLOAT),
        "decayRates": buffer.add(solid.dampings[order], FLOAT),
        "positions": buffer.add(design.surface_vertices, FLOAT, VERTICES),
        "shapes": buffer.add((shapes * scales[:, None, None]).reshape(-1, 3), FLOAT),
        "indices": buffer.add(design.surface_faces.ravel(), UNSIGNED_INT, TRIANGLES),
        "material": 0,
        "extras": {
            "modeNumbers": (order + 1).tolist(),
            "shapeScales": scales.tolist(),
            "normalisation": "shapes = shapeScales * U, U^T M U = 1 with M in kg",
            "units": UNITS,
        },
    }
    # A player has one gain for the whole body; nodes have the gains of the struck points.
    return model, float(listening.gains.mean()) / (2.0 * np.pi * lowest)


def _sounds(design: Design, solid: SoundingSolid, listening: Listening) -> list[tuple[str, Array]]:
    """Names of the targets, and the sound (s,) of a strike of 1 N s at each."""
    seconds = ringing_seconds(solid)
    return [
        (
            strike.name,
            render(
                solid,
                [Hit(0.0, strike.position, strike.inward)],
                seconds,
                SOUND_RATE,
                listening=listening,
            ),
        )
        for strike in design.strikes
    ]


def _loudest_first(
    design: Design, solid: SoundingSolid, listening: Listening
) -> NDArray[np.integer]:
    inward = np.array([strike.inward for strike in design.strikes])
    amplitudes = solid.amplitudes(listening.positions, inward) * listening.gains[:, None]
    return np.argsort(-(amplitudes**2).sum(axis=0) / solid.dampings, kind="stable")


def _mass_properties(design: Design) -> dict[str, Any]:
    from scipy.spatial.transform import Rotation

    properties = mass_properties(design.model)
    return {
        "mass": properties.mass,
        "centerOfMass": properties.centre.tolist(),
        "inertiaDiagonal": properties.moments.tolist(),
        "inertiaOrientation": Rotation.from_matrix(properties.axes).as_quat().tolist(),
    }


def _strike_nodes(design: Design, listening: Listening) -> list[dict[str, Any]]:
    return [
        {
            "name": strike.name,
            "translation": strike.position.tolist(),
            "extras": {
                "vertex": strike.vertex,
                "inward": strike.inward.tolist(),
                "gain": float(gain),
                "gainUnits": "full scale per amplitude U . j [kg^-1/2 N s]",
            },
        }
        for strike, gain in zip(design.strikes, listening.gains)
    ]
