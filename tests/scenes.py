"""Scenes for tests: described in few words, played, in pieces (test support)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sound.scenes.bodies import Body
from sound.scenes.contact.engine import Course, simulate
from sound.scenes.contact.impacts import Blow, Pressing, told_apart
from sound.scenes.contact.touch import Touch
from sound.scenes.playing.play import bodies_of
from sound.scenes.scene import Scene, scene_of

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
    """Its bodies, and how they move."""
    bodies = bodies_of(described)
    return bodies, simulate(described, bodies, visible=False)


def struck(described: Scene) -> tuple[list[Body], list[Blow], list[Pressing]]:
    """Its bodies, impacts, and what lasts."""
    bodies, course = moved(described)
    touch = Touch(bodies, described.ground_material)
    return bodies, *told_apart(course.contacts, described, touch)
