"""Build the page of a study from its tables, which are written first where no other rule does."""

from pathlib import Path

from carillon.files.atomic import atomic_path
from studies.base.entry import tables_of
from studies.base.study import logged, named
from studies.base.table import read_table, write_table

with logged(snakemake.log):
    study = snakemake.params.study
    folder = Path(snakemake.input.config).parent / study["folder"]
    results = named(study["package"], study["results"])(folder, *snakemake.wildcards)
    tables = {Path(path).stem: read_table(path) for path in snakemake.input.get("tables", [])}
    page = Path(snakemake.output[0])
    described = study.get("tables")
    for name, make in tables_of(study["package"], described).items() if described else ():
        if name not in getattr(results, "absent", ()):
            tables[name] = make(results)
            write_table(tables[name], page.parent / "tables")
    html = named(study["package"], study["page"])(results, tables)
    with atomic_path(page) as temporary:
        temporary.write_text(html, encoding="utf-8")
