"""The recordings: what was struck, and in which package it lies."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from carillon.files.yaml_input import read_own_yaml
from studies.recordings.packages import SOUNDS

LIST = Path(__file__).with_name("recordings.yaml")
FOLDER = "recordings"
"""Folder of the study below that of a run."""
PACKAGES = "packages"
"""Folder of the unpacked packages below that of the study."""
EXTRACTED = "extracted"
"""Folder of the files of a recording below its own."""
START, FORMATS = "start.json", "formats.json"
"""Files below the study's folder: the time of the program's start, and a recording in other
formats."""
CALIBRATION, HELD_BACK = SPLITS = ("calibration", "held back")
"""Purposes of a recording."""


@dataclass(frozen=True)
class RecordedStrike:
    """A file of a package that holds one strike."""

    name: str
    """Of its page."""
    package: str
    file: str
    """The package, and the file below the package's folder of sounds."""
    kind: str
    """What was struck."""
    tonal: bool
    """Whether a few modes ring clear of each other and of the noise."""
    split: str
    """One of `SPLITS`."""

    @property
    def title(self) -> str:
        """The name for people."""
        return self.name.replace("-", " ").capitalize()

    def path(self, packages: Path) -> Path:
        """The file below a folder that holds the unpacked packages."""
        return packages / self.package / SOUNDS[self.package] / self.file


@cache
def recordings() -> dict[str, RecordedStrike]:
    """All recordings by name."""
    return {name: RecordedStrike(name, **each) for name, each in read_own_yaml(LIST).items()}
