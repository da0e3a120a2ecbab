"""Write what the start of the extraction takes."""

from pathlib import Path

from studies.base.study import logged
from studies.recordings.measurement import measure_start

with logged(snakemake.log):
    measure_start(Path(snakemake.output[0]))
