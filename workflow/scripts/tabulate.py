"""Write every table of a study."""

from pathlib import Path

from carillon.progress import say
from workflow.studies.base.entry import tables_of
from workflow.studies.base.study import logged, named
from workflow.studies.base.table import write_table

with logged(snakemake.log):
    study = snakemake.params.study
    folder = Path(snakemake.input.config).parent / study["folder"]
    results = named(study["results"])(folder)
    if results.without:
        say(results.without)
    for make in tables_of(study["tables"]).values():
        write_table(make(results), Path(snakemake.output[0]).parent)
