"""Write what the start of the extraction takes."""

from pathlib import Path

from workflow.studies.base.study import logged
from workflow.studies.recordings.measurement import measure_start

with logged(snakemake.log):
    measure_start(Path(snakemake.output[0]))
