"""Extract the modes of one recording in several formats."""

from pathlib import Path

from workflow.studies.base.study import logged
from workflow.studies.recordings.formats import compare
from workflow.studies.recordings.measurement import MODES

with logged(snakemake.log):
    modes = Path(snakemake.input.extracted) / MODES
    compare(Path(snakemake.params.clip), modes, Path(snakemake.output[0]))
