"""How close the model is to the solid, and what brings it closer, in words."""

from pathlib import Path
from typing import Any

from carillon.files.yaml_input import read_own_yaml
from studies.base.numbers import show
from workflow.validation.evidence import Evidence

TEXTS: dict[str, Any] = read_own_yaml(Path(__file__).with_name("distance.yaml"))
MODELS = {"voxel": "voxels", "finite-cell": "finite cells"}
"""Elements of a discretisation, in words."""


def distance_in_words(evidence: Evidence) -> dict[str, str]:
    """What is `told` of the distance, and in a `word`; its `meaning`, and how to come `closer`."""
    discretisation, distance = evidence.settings["discretisation"], evidence.distance
    names: dict[str, Any] = {"model": MODELS[discretisation]}
    if distance:
        names["first"], names["last"] = distance["modes"]
        names["worst_mode"] = distance["worst_mode"]
        names["side"] = "high" if distance["worst"] > 0.0 else "low"
        names |= {key: show(abs(distance[key]), "percent") for key in ("rms", "worst")}
    texts = {
        "told": TEXTS["told" if distance else "unknown"],
        "word": "{rms} off" if distance else "not known",
        "meaning": TEXTS["meaning"],
        "closer": TEXTS["closer"][discretisation],
    }
    return {name: text.format(**names) for name, text in texts.items()} | {"model": names["model"]}
