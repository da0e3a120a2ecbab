"""Wwise: a list of sounds that its importer makes objects of, with the levels as their volumes.

The columns are those of "Importing Media Files from Tab Delimited Text Files" in Wwise's help.
"""

import csv
import io
from collections.abc import Sequence

from sound.export.level_table import LevelRow

QUIETEST_DECIBELS = -96.0
"""Least volume [dB] that Wwise takes."""


def wwise_import(levels: Sequence[LevelRow], folder: str) -> str:
    r"""The list: a random container for each point and strength, with a sound for each variation.

    `folder`: that of the WAV files, seen from the list.  Paths of objects begin where the importer
    is told.

    Examples
    --------
    >>> level = LevelRow("pan_rim_s1_v2.wav", "rim", 0.5, 2, -3.0, *[0.0] * 8)
    >>> print(wwise_import([level], "sounds"), end="")
    Audio File	Object Path	Property[Volume]
    sounds\pan_rim_s1_v2.wav	<Random Container>pan_rim_s1\<Sound SFX>pan_rim_s1_v2	-3
    """
    content = io.StringIO()
    table = csv.writer(content, delimiter="\t", lineterminator="\n")
    table.writerow(["Audio File", "Object Path", "Property[Volume]"])
    for level in levels:
        name = level.file.removesuffix(".wav")
        container = name.rpartition("_")[0]
        path = f"<Random Container>{container}\\<Sound SFX>{name}"
        volume = max(level.gain_db, QUIETEST_DECIBELS)
        table.writerow([f"{folder}\\{level.file}", path, f"{volume:.6g}"])
    return content.getvalue()
