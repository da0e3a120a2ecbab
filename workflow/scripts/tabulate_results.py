"""Write every table of the run."""

from pathlib import Path

from workflow.report.results import results_beside
from workflow.report.table import write_table
from workflow.report.tables import build_tables

for table in build_tables(results_beside(snakemake.input.config)):
    write_table(table, Path(snakemake.output[0]).parent)
