"""All studies, from `catalogue.yaml`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from carillon.documents import read_own_yaml
from workflow.studies.base.study import Figure, Study

_DESCRIBED: dict[str, dict[str, Any]] = read_own_yaml(Path(__file__).with_suffix(".yaml"))
ALL = {
    name: Study(
        name,
        **described | {"figures": tuple(Figure(**each) for each in described.get("figures", ()))},
    )
    for name, described in _DESCRIBED.items()
}
(
    REPORT,
    FIGURES,
    OBJECTIVES,
    COARSENING,
    DISCRETISATION,
    ACCURACY,
    FORESTS,
    CAMPAIGN,
    VALIDATION,
    CLAIMS,
    SOUND,
    SOUNDS,
    COMPARED_SOUNDS,
    SOUNDS_OF_RECORDINGS,
    RECORDING,
    RECORDINGS,
    SCENES,
    SCENE_SPECTRA,
) = ALL.values()
STUDIES = (REPORT, FIGURES, OBJECTIVES, COARSENING, DISCRETISATION, ACCURACY, FORESTS, CAMPAIGN)
"""Those whose tables, figures and page are made one after the other."""
