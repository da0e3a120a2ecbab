"""What the models of a run are made of, and what holds them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from carillon.arrays import Surface
from carillon.composition.entries import (
    CompositionEntry,
    SupportEntry,
    describes_regions,
    joined_surface,
    read_composition,
)
from carillon.fem.geometry import load_surface
from carillon.fem.geometry.walls import WallSize
from workflow.arguments import path_word
from workflow.settings import described_by, mesh_of

Config = Mapping[str, Any]


def composition_of(config: Config, model: str) -> CompositionEntry:
    """Regions of a model, and all that holds it.

    Raises UserError if its file is of no use.
    """
    file = described_by(config, model)
    entry = CompositionEntry() if file is None else read_composition(file)
    held = (SupportEntry(where=place) for place in config["models"][model]["fix"] or ())
    return CompositionEntry(regions=entry.regions, supports=(*entry.supports, *held))


def surface_of(config: Config, model: str) -> Surface:
    """Triangles [m] around a model; of a wall, both of its sides."""
    mesh, entry = mesh_of(config, model), config["models"][model]
    if describes_regions(mesh):
        return joined_surface(read_composition(mesh), mesh, entry["up"])
    if entry["wall"] is None:
        return load_surface(mesh, entry["unit"], up=entry["up"])
    return WallSize(entry["wall"], entry["wall_side"]).read(mesh, entry["unit"], entry["up"]).skin


def files_of(regions: str) -> list[str]:
    """Files that a file of regions names.

    Raises UserError if it is of no use.
    """
    entries = read_composition(regions).regions
    inside = [name for each in entries for name in each.files]
    return list(dict.fromkeys(path_word(Path(regions).parent / name) for name in inside))
