"""Write every table of a study."""

from pathlib import Path

from carillon.command_line.progress import say
from studies.base.entry import tables_of
from studies.base.study import logged, named
from studies.base.table import write_table

with logged(snakemake.log):
    study = snakemake.params.study
    folder = Path(snakemake.input.config).parent / study["folder"]
    results = named(study["package"], study["results"])(folder)
    if results.without:
        say(results.without)
    for make in tables_of(study["package"], study["tables"]).values():
        write_table(make(results), Path(snakemake.output[0]).parent)
