"""The small tables of a run as text, kept for others to compare theirs with."""

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from carillon.command_line.progress import say
from carillon.files.atomic import atomic_path
from studies.base.conditions import LABELS
from studies.base.numbers import show
from studies.base.table import Table
from studies.comparison.comparison import APART
from studies.comparison.folders import Folder, read_folder

FOLDER = "reference"
"""Folder below the results; it has one for each processor that a run was made on."""
DIGITS = 7
"""Significant digits that are kept: more than any rule of the comparison looks at."""
LONG = 200
"""Rows from which on a table is kept as CSV alone."""
LARGE = 300_000
"""Size of the folder in bytes from which on it is too large to be kept with the source."""
TIMED = "tables/times"
"""Table whose conditions are those of the run."""
OF_TABLES = ("runs", "spread")
"""Conditions that are not the run's, so that its description does not tell them."""
LEFT_OUT = [FOLDER, "comparison"]
"""Folders that are no results of the run."""
DESCRIPTION = f"""\
# Reference: {{title}}

Tables of a complete run, made by `snakemake reference`, to set others beside them:

    snakemake --profile workflow/profiles/default compare --config baseline={{place}}
    carillon study compare-runs {{place}} RESULTS

Numbers have {DIGITS} digits; tables of {LONG} rows and more are there as CSV alone.

## Conditions

{{conditions}}

## Wall time

Of the jobs that are benchmarked (`benchmarks/`), which are all that take long:

{{seconds}}

## Disk

{{sizes}}
"""


def write_reference(results: str | Path, processor: str) -> None:
    """Write tables, configuration and a description to `reference/PROCESSOR` below the results."""
    results = Path(results)
    folder = read_folder(results)
    target = results / FOLDER / processor
    shutil.rmtree(target, ignore_errors=True)
    for path, table in folder.tables.items():
        _put(target / f"{path}.csv", rounded(table).as_csv())
        if len(table.rows) < LONG and not path.endswith(APART):
            _put(target / f"{path}.md", table.as_markdown())
    _put(target / "config.yaml", (results / "config.yaml").read_text())
    _put(target / "README.md", description(folder, target))
    size = sizes_by_part(target)["all"]
    if size > LARGE:
        say(f"{target}: {size:,} bytes are much to keep with the source, {LARGE:,} would be less")


def _put(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def rounded(table: Table) -> Table:
    """A table whose numbers have `DIGITS` significant digits."""

    def kept(value: Any) -> Any:
        return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value

    return replace(table, rows=[{key: kept(row[key]) for key in row} for row in table.rows])


def description(folder: Folder, place: Path) -> str:
    """What the reference is, on which machine it was made, and what that took."""
    conditions = folder.tables[TIMED].conditions
    texts = conditions.texts if conditions else {}
    of_run = {LABELS[key]: text for key, text in texts.items() if key not in OF_TABLES}
    return DESCRIPTION.format(
        title=folder.config["title"],
        place=place,
        conditions=_table("", "", of_run),
        seconds=_table("Jobs", "Time", seconds_by_part(folder.path), "seconds"),
        sizes=_table("Results", "Size", sizes_by_part(folder.path), "bytes"),
    )


def _table(name: str, value: str, rows: Mapping[str, Any], kind: str = "text") -> str:
    cells = [(name, value), ("---", "---"), *((key, show(rows[key], kind)) for key in rows)]
    return "\n".join(f"| {key} | {text} |" for key, text in cells)


def seconds_by_part(results: Path) -> dict[str, float]:
    """Wall seconds of the benchmarked jobs by the folder of what they made, and in all."""
    folder = results / "benchmarks"
    jobs = sorted(folder.rglob("*.tsv"))
    return _by_part({file: pd.read_csv(file, sep="\t")["s"].sum() for file in jobs}, folder)


def sizes_by_part(results: Path) -> dict[str, float]:
    """Bytes of the results by folder, and in all."""
    files = [file for file in sorted(results.rglob("*")) if file.is_file()]
    return _by_part({file: file.stat().st_size for file in files}, results)


def _by_part(amounts: Mapping[Path, float], folder: Path) -> dict[str, float]:
    parts = [file.relative_to(folder).parts[0] for file in amounts]
    by_part = pd.Series(list(amounts.values()), parts).groupby(level=0, sort=False).sum()
    by_part = by_part.drop(LEFT_OUT, errors="ignore")
    return {**by_part.to_dict(), "all": by_part.sum()}
