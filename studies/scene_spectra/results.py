"""Results of the scene that is heard by several modes, read when asked for."""

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.files.modes_file import ModesFile, read_modes
from studies.base.results import Results
from studies.scene_spectra.scene import BODIES, FOLDER, RENDERINGS, SOUND, TOLD, modes_file

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SceneSpectra(Results):
    """The folder of a run."""

    section = FOLDER

    @cached_property
    def told(self) -> dict[str, Any]:
        """What `carillon scene` told of each rendering."""
        folder = self.folder / FOLDER
        return {name: json.loads((folder / name / TOLD).read_text()) for name in RENDERINGS}

    @cached_property
    def pressures(self) -> dict[str, Array]:
        """Sound pressure (s,) [Pa] at the left ear, of each rendering."""
        import soundfile

        spectra = {}
        for name, told in self.told.items():
            ears = soundfile.read(self.folder / FOLDER / name / SOUND, always_2d=True)[0]
            spectra[name] = told["full_scale_pascal"] * ears[:, 0]
        return spectra

    @property
    def rate(self) -> int:
        """Samples per second [Hz]."""
        return int(next(iter(self.told.values()))["rate_hz"])

    @cached_property
    def spectra(self) -> dict[str, list[ModesFile]]:
        """Modes files of all bodies, without modes, by rendering."""
        folder = self.folder / FOLDER
        return {
            name: [read_modes(folder / modes_file(body, name), with_modes=False) for body in BODIES]
            for name in RENDERINGS
        }
