"""Build the page of an example of sound design, and its tables."""

from carillon.files import atomic_path
from workflow.report.table import write_table
from workflow.sounds.page import build
from workflow.sounds.results import found_beside

found = found_beside(snakemake.input.config, snakemake.wildcards.example)
page, tables = build(found)
for table in tables.values():
    write_table(table, found.folder / "tables")
with atomic_path(snakemake.output.page) as temporary:
    temporary.write_text(page, encoding="utf-8")
