"""Write every table of the figures."""

from pathlib import Path

from workflow.figures.results import figures_beside
from workflow.figures.tables import build_tables
from workflow.report.table import write_table

for table in build_tables(figures_beside(snakemake.input.config)):
    write_table(table, Path(snakemake.output[0]).parent)
