"""Draw one figure of a study."""

from pathlib import Path

from studies.base.study import logged, named
from studies.base.style import save

with logged(snakemake.log):
    study = snakemake.params.study
    folder = Path(snakemake.input.config).parent / study["folder"]
    results = named(study["package"], study["results"])(folder)
    save(
        named(study["package"], snakemake.params.draw)(results, *snakemake.wildcards),
        snakemake.output,
    )
