"""Extract the modes of one recording as people do, and write how that went."""

from pathlib import Path

from studies.base.study import logged
from studies.recordings.measurement import measure

with logged(snakemake.log):
    folder = Path(snakemake.output[0])
    folder.mkdir(parents=True, exist_ok=True)
    measure(Path(snakemake.params.clip), folder)
