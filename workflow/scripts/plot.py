"""Draw one figure of a study."""

from pathlib import Path

from workflow.studies.base.study import logged, named
from workflow.studies.base.style import save

with logged(snakemake.log):
    study = snakemake.params.study
    folder = Path(snakemake.input.config).parent / study["folder"]
    results = named(study["results"])(folder)
    save(named(snakemake.params.draw)(results, *snakemake.wildcards), snakemake.output)
