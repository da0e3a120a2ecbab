"""Build the page that judges the spectra of one model, and its tables."""

from pathlib import Path

from carillon.files import atomic_path
from workflow.report.results import results_beside
from workflow.report.table import write_table
from workflow.validate.evidence import Evidence
from workflow.validate.page import build

page, tables = build(Evidence(results_beside(snakemake.input.config), snakemake.wildcards.model))
for table in tables.values():
    write_table(table, Path(snakemake.output.criteria).parent)
with atomic_path(snakemake.output.page) as temporary:
    temporary.write_text(page, encoding="utf-8")
