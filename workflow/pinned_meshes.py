"""Meshes that kept tables rest on: whether files of their names are the same files."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from carillon.files.yaml_input import read_own_yaml
from workflow import settings

PINNED: dict[str, dict[str, str]] = read_own_yaml(Path(__file__).with_suffix(".yaml"))
"""SHA-256 and source by file name."""
SHOWN = 12
"""Digits of a hash that a sentence tells."""


def of_run(config: Mapping[str, Any]) -> list[str]:
    """A sentence about every mesh of a configuration that is another file than the pinned one.

    Any text of a configuration may name one.
    """
    return list(_others(config, _texts(config)))


def of_study(config: Mapping[str, Any], section: str) -> list[str]:
    """The same of the solids of a study."""
    return list(_others(config, [each["mesh"] for each in config[section]["models"].values()]))


def _texts(part: Any) -> Iterator[str]:
    if isinstance(part, str):
        yield part
    elif isinstance(part, Mapping | list):
        for each in part.values() if isinstance(part, Mapping) else part:
            yield from _texts(each)


def _others(config: Mapping[str, Any], meshes: Iterable[str]) -> Iterator[str]:
    for mesh in dict.fromkeys(meshes):
        path = Path(settings.located(config, mesh))
        pinned = PINNED.get(path.name)
        if pinned is None or not path.is_file():
            continue
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        if digest != pinned["sha256"]:
            yield (
                f"{path} is another file than the one that kept tables rest on (SHA-256 "
                f"{digest[:SHOWN]}…, expected {pinned['sha256'][:SHOWN]}…; {pinned['source']}): "
                "figures of it do not compare with theirs."
            )
