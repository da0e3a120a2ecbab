"""Scenes for tests: described in few words, played, in pieces (test support)."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from carillon.arrays import Array, Index
from sound.scenes.bodies import Body, bodies_of, with_modes
from sound.scenes.contact.engine import Course, GroundPlane, simulate
from sound.scenes.contact.impacts import HertzImpact, SustainedContact, Touch, split_impacts
from sound.scenes.scene import Scene
from sound.scenes.scene_file import scene_of
from sound.synthesis.driven import BLOCK, Excitation

QUIET = {"radiation": False, "space": False, "contact_damping": False, "noise": False}
"""Sound of modes alone, as they are struck."""


def require_engine() -> None:
    """Skip, clearly, where scenes cannot be played."""
    pytest.importorskip("mujoco", reason="scenes need mujoco (requirements-scenes.txt)")


def ball(name: str = "ball", **given: Any) -> dict[str, Any]:
    """A silent steel ball of 10 mm radius."""
    return {"name": name, "radius": 0.01, "material": "steel", "count": 0, **given}


def scene(*objects: dict[str, Any], **given: Any) -> Scene:
    """The scene of some objects."""
    return scene_of({"objects": list(objects), **given}, Path())


def moved(described: Scene) -> tuple[list[Body], Course]:
    """Its bodies, and their motion."""
    bodies = with_modes(bodies_of(described.objects))
    ground = GroundPlane(described.ground, described.ground_material)
    return bodies, simulate(
        bodies, described.seconds, described.engine, described.gravity, ground, visible=False
    )


def struck(described: Scene) -> tuple[list[Body], list[HertzImpact], list[SustainedContact]]:
    """Its bodies, impacts, and sustained contacts."""
    bodies, course = moved(described)
    touch = Touch(bodies, described.ground_material)
    return bodies, *split_impacts(course.contacts, touch, described.engine, described.gravity)


def strikes_alone(firsts: Index, since: Array, durations: Array, amplitudes: Array) -> Excitation:
    """Strikes of modes that no lasting force drives and nothing touches."""
    none, rows = np.zeros(0, np.int64), np.zeros((0, amplitudes.shape[1]))
    return Excitation(
        firsts, since, durations, amplitudes, none, np.zeros((0, BLOCK)), rows, none, rows
    )
