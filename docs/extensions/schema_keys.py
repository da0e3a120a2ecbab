"""Keys of the configuration, of projects and of scenes as lists, from their models."""

from __future__ import annotations

import parameter_tables

from sound.project.project import Project
from sound.scenes.scene import Scene
from workflow.configuration.whole import limits, whole


def of_configuration() -> str:
    """Sections with the keys of the configuration."""
    return parameter_tables.sections(whole(), "The run") + _limits_of_rules()


def _limits_of_rules() -> str:
    rows = [
        f"| `{rule}` | {each.what} | {each.memory_mb or ''} | {each.minutes} |"
        for rule, each in limits().items()
    ]
    head = ["", "| rule | a job makes | memory [MB] | time [min] |", "| --- | --- | --: | --: |"]
    return "\n".join([*head, *rows, ""])


def of_project() -> str:
    """Sections with the keys of a project."""
    return parameter_tables.sections(Project, "The solid")


def of_scene() -> str:
    """Sections with the keys of a scene."""
    return parameter_tables.sections(Scene, "The scene")
