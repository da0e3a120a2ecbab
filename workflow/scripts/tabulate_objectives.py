"""Write every table of the objectives' study."""

from pathlib import Path

from carillon.progress import say
from workflow.report.table import write_table
from workflow.study.cases import study_beside, without
from workflow.study.tables import build_tables

study = study_beside(snakemake.input.config)
if without(study.config):
    say(without(study.config))
for table in build_tables(study):
    write_table(table, Path(snakemake.output[0]).parent)
