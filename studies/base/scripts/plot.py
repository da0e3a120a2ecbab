"""Draw one figure of a study."""

from pathlib import Path

from studies.base.catalogue import all_studies
from studies.base.study import logged
from studies.base.style import save

with logged(snakemake.log):
    study = all_studies()[snakemake.params.study]
    results = study.open(Path(snakemake.input.config).parent)
    figure = study.named(snakemake.params.draw)(results, *snakemake.wildcards)
    save(figure, snakemake.output)
