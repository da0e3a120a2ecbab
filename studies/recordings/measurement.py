"""`sound extract` on a clip as people run it: what it writes or says, and its processor time."""

import json
import os
import resource
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from carillon.files.atomic import atomic_path
from carillon.files.cache import PLACE
from carillon.records.measurement import measured
from sound.clips.wav import write_wav

MODES, RESIDUAL, RUN = "modes.json", "residual.wav", "run.json"
"""Files that `extract` writes, and the file about its run."""
_START_RATE, _START_SAMPLES = 8000, 800


class Extraction(NamedTuple):
    """One run of the command, as one would type it.

    `said` is the sentence of a refusal, or empty; `cpu_seconds` are of user and system, the start
    of the program included.
    """

    said: str
    cpu_seconds: float
    command: str


def extract(clip: Path, folder: Path) -> Extraction:
    """Extract the modes of a clip into `MODES` and `RESIDUAL` of a folder, on one thread."""
    words = [str(clip), "--out", str(folder / MODES), "--residual", str(folder / RESIDUAL)]
    command = [sys.executable, "-m", "sound", "extract", *words, "--allow-clipped"]
    with tempfile.TemporaryDirectory() as nothing_known:
        environment = {**os.environ, "OMP_NUM_THREADS": "1", PLACE: nothing_known}
        before = _seconds_of_children()
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        seconds = _seconds_of_children() - before
    said = ""
    if done.returncode:
        lines = done.stderr.strip().splitlines() or ["ended without a word"]
        said = lines[-1].partition(f"{clip}: ")[2] or lines[-1]
    return Extraction(said, seconds, shlex.join(["python", *command[1:]]))


def measure(clip: Path, folder: Path) -> None:
    """Extract the modes of a clip into a folder, and write there how that went."""
    _write(folder / RUN, extract(clip, folder))


def measure_start(path: Path) -> None:
    """Write what the command takes for a clip of a tenth of a second, which is its start."""
    with tempfile.TemporaryDirectory() as name:
        clip = Path(name, "clip.wav")
        t = np.arange(_START_SAMPLES) / _START_RATE
        write_wav(clip, 0.5 * np.exp(-60.0 * t) * np.sin(2.0 * np.pi * 440.0 * t), _START_RATE)
        _write(path, extract(clip, Path(name)))


def _write(path: Path, extraction: Extraction) -> None:
    content: dict[str, Any] = {
        "said": extraction.said,
        "cpu_seconds": extraction.cpu_seconds,
        "provenance": measured({}, threads=1) | {"command": extraction.command},
    }
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1))


def _seconds_of_children() -> float:
    """Time of the processor that processes took which this one started and which have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
