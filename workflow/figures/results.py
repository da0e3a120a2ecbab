"""Which solids the figures are made of, and where their results are kept."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from workflow import settings
from workflow.study_folder import StudyFolder

Row = dict[str, Any]

FOLDER = "paper"
"""Folder of the figures beside the run's configuration."""


def absent_meshes(config: Mapping[str, Any]) -> dict[str, str]:
    """Mesh files that do not exist, by the solid that is left out for it."""
    meshes = {name: settings.figured_mesh(config, name) for name in config["figures"]["models"]}
    return {
        name: mesh
        for name, mesh in meshes.items()
        if not mesh.startswith(settings.BUILTIN) and not Path(mesh).is_file()
    }


def present(config: Mapping[str, Any], part: str = "models") -> list[str]:
    """Solids of a part of the figures whose mesh exists: `models`, `convergence` or `scaling`."""
    absent = absent_meshes(config)
    return [name for name in config["figures"][part] if name not in absent]


def without(config: Mapping[str, Any]) -> str:
    """One sentence about the solids that are left out; empty if there are none."""
    absent = absent_meshes(config)
    if not absent:
        return ""
    return (
        f"Without {' and '.join(absent)}: there is no {' and no '.join(absent.values())}; put "
        "the files there, or set mesh_folder to the folder that holds them."
    )


class Figures(StudyFolder):
    """The folder of the figures."""

    @cached_property
    def methods(self) -> dict[str, Row]:
        """Output of `solver benchmark` by solid."""
        return self._read("models", "methods")

    @cached_property
    def convergence(self) -> dict[str, Row]:
        """Output of `solver convergence` by solid."""
        return self._read("convergence", "convergence")

    @cached_property
    def scaling(self) -> dict[str, Row]:
        """Output of `solver scaling` by solid."""
        return self._read("scaling", "scaling")

    @property
    def titles(self) -> dict[str, str]:
        """Names of the solids for people."""
        return {
            name: model["title"] or name.replace("-", " ").capitalize()
            for name, model in self.config["figures"]["models"].items()
        }

    def _read(self, part: str, file: str) -> dict[str, Row]:
        return {
            name: self.read_json(f"models/{name}/{file}.json")
            for name in present(self.config, part)
        }


def figures_beside(config: str | Path) -> Figures:
    """Figures of the run whose resolved configuration is the file `config`."""
    return Figures(Path(config).parent / FOLDER)
