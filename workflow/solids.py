"""Solids of a study whose meshes may be missing, and which are then left out."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from workflow import settings

Config = Mapping[str, Any]


def studied(config: Config) -> list[str]:
    """Sections with solids of their own, which are left out if they have no mesh."""
    return [
        section
        for section, part in config.items()
        if isinstance(part, Mapping)
        and isinstance(part.get("models"), Mapping)
        # Those of the run itself have any names.
        and section != "models"
    ]


def mesh_files(config: Config, section: str, solid: str) -> list[str]:
    """Mesh file of a solid; none for a built-in object."""
    mesh = settings.mesh_of(config, solid, section)
    return [] if mesh.startswith(settings.BUILTIN_PREFIX) else [mesh]


def absent_meshes(config: Config, section: str) -> dict[str, str]:
    """Mesh files that do not exist, by the solid that is left out for it."""
    return {
        solid: file
        for solid in config[section]["models"]
        for file in mesh_files(config, section, solid)
        if not Path(file).is_file()
    }


def named(config: Config, where: str) -> list[str]:
    """Solids that a part of the configuration names, as far as their mesh exists.

    `where`: keys joined by dots, such as `models`, `scaling.models` or `figures.scaling`.
    """
    section, _, part = where.rpartition(".")
    names = list(config[section][part] if section else config[part])
    absent = absent_meshes(config, section) if section in studied(config) else {}
    return [name for name in names if name not in absent]


def measured_files(config: Config, measured: Mapping[str, str]) -> list[str]:
    """Files of what a study measures of its solids, below its folder.

    `measured`: where the configuration names the solids, see `named`, by the file of what is found.
    """
    return [
        f"models/{solid}/{file}.json"
        for file, where in measured.items()
        for solid in named(config, where)
    ]


def without(config: Config, section: str) -> str:
    """One sentence about the solids that are left out; empty if there are none."""
    absent = absent_meshes(config, section)
    if not absent:
        return ""
    return (
        f"Without {' and '.join(absent)}: there is no {' and no '.join(absent.values())}; put "
        "the files there, or set mesh_folder to the folder that holds them."
    )
