"""Scenes from files, or from the keys and values of one."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from carillon.builtin_names import in_folder
from carillon.parameters.documents import parameters_from, read_parameters
from sound.scenes.object_entry import FILES
from sound.scenes.scene import Scene


def load_scene(path: str | Path) -> Scene:
    """Read a scene file (YAML), but none of the files that it names.

    Raises UserError with one sentence about the first thing that is wrong with it.
    """
    return _in_folder(read_parameters(path, Scene, "a scene"), Path(path).parent)


def scene_of(described: Mapping[str, Any], folder: Path) -> Scene:
    """The scene that the keys and values of a file in `folder` describe.

    Raises UserError with one sentence about the first thing that is wrong.
    """
    return _in_folder(parameters_from(described, Scene), folder)


def _in_folder(scene: Scene, folder: Path) -> Scene:
    """The scene with its files, which are relative to a folder, as the working directory has."""
    objects = []
    for each in scene.objects:
        named = {key: getattr(each, key) for key in FILES}
        files: Any = {key: in_folder(name, folder) for key, name in named.items() if name}
        regions = tuple(region.in_folder(folder) for region in each.regions)
        objects.append(replace(each, **files, regions=regions))
    head = scene.listener.hrtf
    listener = replace(scene.listener, hrtf=str(folder / head) if head else None)
    return replace(scene, objects=tuple(objects), listener=listener)
