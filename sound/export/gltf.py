"""glTF 2.0: the surface with its modal model, by the draft extension KHR_audio_rigid_bodies.

The extension is a draft (Karl Hiner, repository glTF_PhysicalAudio, folder
extensions/2.0/Khronos/KHR_audio_rigid_bodies; state of 2026, with `modalModels`,
`acousticMaterials` and the radiation factor 2 pi f_n in its synthesis).  A player that follows it
makes of an impulse j at a point p

    s(t) = gain sum_n 2 pi f_n (phi_n(p) . j) exp(-d_n t) sin(2 pi f_n t).

A design is matched to clips without that factor, so phi_n here is the mass-normalised mode u_n
times f_1 / f_n, f_1 being the lowest frequency: the player's sound then is the design's.  The draft
asks for such data "in the same form", and the factors stand in the model's extras.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon import __version__
from carillon.fem.model import mass_properties
from sound.export.gltf_buffer import (
    FLOAT,
    TRIANGLES,
    UNSIGNED_INT,
    VERTICES,
    Buffer,
    write_asset,
)
from sound.project.design import Design
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid

EXTENSION = "KHR_audio_rigid_bodies"
DRAFT = (
    "draft by Karl Hiner, repository glTF_PhysicalAudio, "
    "extensions/2.0/Khronos/KHR_audio_rigid_bodies, 2026"
)
UNITS = {
    "positions": "m, axes of the original mesh",
    "frequencies": "Hz",
    "decayRates": "1/s",
    "shapes": "kg^-1/2",
    "impulse": "N s",
    "density": "kg/m^3",
    "youngsModulus": "Pa",
    "output": "full scale is 1",
}


def write_gltf(path: str | Path, design: Design, binary: bool) -> None:
    """Write `.glb` if `binary`, else `.gltf` with the data embedded in it.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    write_asset(path, *gltf_document(design), binary)


def gltf_document(design: Design) -> tuple[dict[str, Any], bytes]:
    """The asset as JSON and its buffer."""
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    order = _loudest_first(design, solid, listening)
    lowest = float(solid.frequencies.min())
    scales = lowest / solid.frequencies[order]
    shapes = solid.motion(design.surface_vertices).transpose(2, 0, 1)[order]
    buffer = Buffer()
    positions = buffer.add(design.surface_vertices, FLOAT, VERTICES)
    indices = buffer.add(design.surface_faces.ravel(), UNSIGNED_INT, TRIANGLES)
    model = {
        "name": "modes",
        "frequencies": buffer.add(solid.frequencies[order], FLOAT),
        "decayRates": buffer.add(solid.dampings[order], FLOAT),
        "positions": positions,
        "shapes": buffer.add((shapes * scales[:, None, None]).reshape(-1, 3), FLOAT),
        "indices": indices,
        "material": 0,
        "massProperties": _mass_properties(design),
        "extras": {
            "modeNumbers": (order + 1).tolist(),
            "shapeScales": scales.tolist(),
            "normalisation": "shapes = shapeScales * U, U^T M U = 1 with M in kg",
            "units": UNITS,
        },
    }
    # A player has one gain for the whole body; nodes have the gains of the struck points.
    gain = float(listening.gains.mean()) / (2.0 * np.pi * lowest)
    strikes = _strike_nodes(design, listening)
    body = {
        "name": "object",
        "mesh": 0,
        "children": list(range(1, 1 + len(strikes))),
        "extensions": {EXTENSION: {"modalModel": 0, "gain": gain}},
    }
    document = {
        "asset": {
            "version": "2.0",
            "generator": f"Carillon {__version__}",
            "extras": {EXTENSION: DRAFT},
        },
        "extensionsUsed": [EXTENSION],
        "extensions": {
            EXTENSION: {"modalModels": [model], "acousticMaterials": [_material(design)]}
        },
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [body, *strikes],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": positions}, "indices": indices}]},
        ],
        **buffer.entries(),
    }
    return document, bytes(buffer.data)


def _loudest_first(
    design: Design, solid: SoundingSolid, listening: Listening
) -> NDArray[np.integer]:
    """Order of the modes by their energy when the targets' points are struck."""
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


def _material(design: Design) -> dict[str, Any]:
    """Constants of the solid, without alpha and beta, as every mode has its own damping."""
    return {
        "name": "designed",
        "density": design.model.density,
        "youngsModulus": float(design.young.mean()),
        "poissonRatio": design.model.poisson,
        "extras": {
            "youngsModulus": "mean over the volume; it varies between "
            f"{design.young.min():.6g} and {design.young.max():.6g} Pa"
        },
    }


def _strike_nodes(design: Design, listening: Listening) -> list[dict[str, Any]]:
    """Empty nodes where the targets were assigned."""
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
