"""Build the page of a study from its tables, which are written first where no other rule does."""

from pathlib import Path

from carillon.files.atomic import atomic_path
from studies.base.catalogue import all_studies
from studies.base.study import logged
from studies.base.table import read_table, write_table

with logged(snakemake.log):
    study = all_studies()[snakemake.params.study]
    results = study.open(Path(snakemake.input.config).parent, *snakemake.wildcards)
    page = Path(snakemake.output[0])
    files = {Path(path).stem: path for path in snakemake.input.get("tables", [])}
    tables = {name.removeprefix(study.prefix): read_table(files[name]) for name in files}
    if not tables:
        tables = study.made(results)
        for table in tables.values():
            write_table(table, page.parent / "tables")
    html = study.build(results, tables)
    with atomic_path(page) as temporary:
        temporary.write_text(html, encoding="utf-8")
