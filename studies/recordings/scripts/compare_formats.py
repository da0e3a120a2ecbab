"""Extract the modes of one recording in several formats."""

from pathlib import Path

from studies.base.study import logged
from studies.recordings.formats import compare
from studies.recordings.measurement import MODES

with logged(snakemake.log):
    modes = Path(snakemake.input.extracted) / MODES
    compare(Path(snakemake.params.clip), modes, Path(snakemake.output[0]))
