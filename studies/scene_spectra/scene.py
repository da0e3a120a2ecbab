"""The scene: solids that fall on a floor, and the modes by which they are heard."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carillon.files.yaml_input import read_own_yaml
from workflow.arguments import options
from workflow.variants import TRUTH

DESCRIBED: dict[str, Any] = read_own_yaml(Path(__file__).with_suffix(".yaml"))
FOLDER = "scene_spectra"
"""Folder of modes and renderings beside the run's configuration."""
SCENE, SOUND, TOLD = "scene.yaml", "scene.wav", "scene.json"
"""Files of a rendering in its folder."""


@dataclass(frozen=True)
class Rendering:
    """Modes by which the scene is heard."""

    title: str
    """Their name for people."""
    about: str
    """What they are, in a few words."""
    how: Mapping[str, Any]
    """Options of `solver modes`."""


RENDERINGS = {name: Rendering(**told) for name, told in DESCRIBED["renderings"].items()}
BODIES: dict[str, dict[str, Any]] = DESCRIBED["objects"]


def modes_file(body: str, rendering: str) -> str:
    """Name of the file of a body's modes, below the folder of the study."""
    return f"modes/{body}-{rendering}.h5"


def modes_arguments(config: Mapping[str, Any], body: str, rendering: str) -> list[str]:
    """What `solver modes` finds for a body and a rendering."""
    part = config["scene_spectra"]
    how = {
        "resolution": part["resolution"],
        "modes": part["modes"],
        "material": DESCRIBED["material"],
        "poisson": config["poisson"],
        **DESCRIBED["constants"],
        "no_estimate": True,
    }
    return [f"builtin:{body}", *options(how | dict(RENDERINGS[rendering].how))]


def scene_of(config: Mapping[str, Any], rendering: str) -> dict[str, Any]:
    """The scene of a rendering, in whose folder its file lies.

    All move by the truth's modes files, whatever they are heard by.
    """
    objects = []
    for body, placed in BODIES.items():
        own = {"modes": f"../{modes_file(body, TRUTH)}"}
        if rendering != TRUTH:
            own["heard_modes"] = f"../{modes_file(body, rendering)}"
        objects.append({"name": body, **own, **placed})
    seconds = config["scene_spectra"]["seconds"]
    return {**DESCRIBED["scene"], "seconds": seconds, "objects": objects}
