"""Names of the solids, and the file of their references: what a plan of the study needs."""

from pathlib import Path
from typing import Literal, get_args

SolidName = Literal[
    "wine-glass",
    "skillet",
    "cymbal",
    "handbell",
    "rin",
    "hemisphere",
    "ring",
    "disc-200",
    "disc-500",
    "plate-200",
    "plate-500",
    "bowl",
    "frying-pan",
    "snare-drum",
    "plate",
    "bar",
    "bell",
    "box",
    "dumbbell",
    "fork",
    "slit-ring",
]
NAMES: tuple[SolidName, ...] = get_args(SolidName)
REFERENCES = Path(__file__).with_name("references.yaml")
