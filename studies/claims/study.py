"""What the study is made of."""

from pathlib import Path

from studies.base.study import Config, Study
from workflow.report.study import REPORT

FULL = "paper"
"""Folder of `snakemake figures` below that of a run."""
SCENE_TABLE = "tables/scene_spectra.json"
SCENE_PICTURE = "figures/scene-spectrograms.png"


def measured(config: Config) -> list[str]:
    """Tables of the run; those of `figures` and `scene_spectra` too where they are there."""
    full = (f"{FULL}/tables/{name}.json" for name in ("methods", "convergence"))
    others = [SCENE_TABLE, SCENE_PICTURE, *full]
    files = [
        *(f"tables/{name}.json" for name in REPORT.tables),
        *(f"validation/tables/{model}-criteria.json" for model in config["models"]),
        *(file for file in others if Path(config["results_dir"], file).is_file()),
    ]
    return [f"../{file}" for file in files]


CLAIMS = Study(
    name="claims",
    title="The paper's claims",
    results="results:Claims",
    tables=("claims", "solids", "sources"),
    measured=measured,
)
