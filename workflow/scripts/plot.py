"""Draw one figure of a study."""

from pathlib import Path

from workflow.studies.base.study import logged, named
from workflow.studies.base.style import save

with logged(snakemake.log):
    folder = Path(snakemake.input.config).parent / snakemake.params.folder
    results = named(snakemake.params.results)(folder)
    save(named(snakemake.params.draw)(results, *snakemake.wildcards), snakemake.output)
