"""Build the page that leads to the examples of sound design."""

from pathlib import Path

from carillon.files import atomic_path
from workflow.report.table import write_table
from workflow.sounds.index import build
from workflow.sounds.results import found_beside

names = snakemake.params.examples
page, table = build([found_beside(snakemake.input.config, name) for name in names])
write_table(table, Path(snakemake.output.table).parent)
with atomic_path(snakemake.output.page) as temporary:
    temporary.write_text(page, encoding="utf-8")
