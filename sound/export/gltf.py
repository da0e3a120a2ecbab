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

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon import __version__
from carillon.fem.model import mass_properties
from carillon.files.atomic import atomic_path
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
    "elasticity": "1, times youngsModulus; strains xx, yy, zz, xy, yz, zx, engineering shears",
    "alpha": "1/s",
    "beta": "s",
    "output": "full scale is 1",
}
FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, TRIANGLES = 34962, 34963
_ALIGNMENT = 4
_WIDTHS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942


class Buffer:
    """Data of accessors, one view each, aligned to four bytes as all of them are."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any], component: int, target: int | None = None) -> int:
        """Append values (n,), (n, 3) or (n, 4); returns the number of their accessor."""
        rows = values.reshape(len(values), -1).astype("<f4" if component == FLOAT else "<u4")
        self.accessors.append(
            {
                "bufferView": self.add_bytes(rows.tobytes(), target),
                "componentType": component,
                "count": len(rows),
                "type": _WIDTHS[rows.shape[1]],
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        return len(self.accessors) - 1

    def add_bytes(self, raw: bytes, target: int | None = None) -> int:
        """Append bytes, such as a file; returns the number of their view."""
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)}
        self.views.append(view if target is None else {**view, "target": target})
        self.data += raw + b"\0" * (-len(raw) % _ALIGNMENT)
        return len(self.views) - 1

    def entries(self) -> dict[str, Any]:
        """Entries of a document that describe the buffer."""
        return {
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.data)}],
        }


def write_asset(path: str | Path, document: dict[str, Any], data: bytes, binary: bool) -> None:
    """Write `.glb` if `binary`, else `.gltf` with the data, the document's only buffer, embedded in
    it.

    Raises UserError if the file cannot be written.
    """
    with atomic_path(path) as temporary:
        if binary:
            temporary.write_bytes(_glb(document, data))
        else:
            text = base64.b64encode(data).decode()
            document["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{text}"
            temporary.write_text(json.dumps(document))


def _glb(document: dict[str, Any], data: bytes) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % _ALIGNMENT)
    data += b"\0" * (-len(data) % _ALIGNMENT)
    length = 12 + 8 + len(text) + 8 + len(data)
    return b"".join(
        [
            struct.pack("<III", _MAGIC, 2, length),
            struct.pack("<II", len(text), _JSON),
            text,
            struct.pack("<II", len(data), _BIN),
            data,
        ]
    )


def write_gltf(path: str | Path, design: Design, binary: bool) -> None:
    """Write `.glb` if `binary`, else `.gltf` with the data embedded in it.

    Raises UserError if the file cannot be written.
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
    regions = design.model.regions
    poisson = regions.mean_poisson if regions.poisson is None else regions.poisson
    several = {} if design.fine_region is None else {"regions": _regions(design)}
    if not several and not regions.is_isotropic:
        several["regions"] = _regions(design)
    return {
        "name": "designed",
        "density": design.model.density,
        "youngsModulus": float(design.young.mean()),
        "poissonRatio": poisson,
        "extras": {
            "youngsModulus": "mean over the volume; it varies between "
            f"{design.young.min():.6g} and {design.young.max():.6g} Pa",
            **several,
        },
    }


def _regions(design: Design) -> list[dict[str, Any]]:
    """Materials of the regions, wood of several directions a row for each."""
    table, rows = design.model.regions, design.fine_region
    found = []
    for row, name in enumerate(table.names):
        young = design.young if rows is None else design.young[rows == row]
        law = table.laws[row]
        own: dict[str, Any] = {"name": name, "density": float(table.density[row])}
        if len(young):
            own |= {
                "youngsModulus": float(young.mean()),
                "youngsModulusRange": [float(young.min()), float(young.max())],
            }
        if law.poisson is not None:
            own["poissonRatio"] = law.poisson
        else:
            own["elasticity"] = law.matrix.tolist()
        damping = table.damping[row]
        if damping is not None:
            own |= {"alpha": damping[0], "beta": damping[1]}
        found.append(own)
    return found


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
