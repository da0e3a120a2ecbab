"""Write every table of the study of the forests."""

from pathlib import Path

from workflow.forests_study.results import study_beside
from workflow.forests_study.tables import build_tables
from workflow.report.table import write_table

for table in build_tables(study_beside(snakemake.input.config)):
    write_table(table, Path(snakemake.output[0]).parent)
