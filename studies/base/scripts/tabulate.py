"""Write every table of a study."""

from pathlib import Path

from carillon.command_line.progress import say
from studies.base.catalogue import all_studies
from studies.base.study import logged
from studies.base.table import write_table

with logged(snakemake.log):
    study = all_studies()[snakemake.params.study]
    results = study.open(Path(snakemake.input.config).parent)
    if results.without:
        say(results.without)
    for table in study.made(results).values():
        write_table(table, Path(snakemake.output[0]).parent)
