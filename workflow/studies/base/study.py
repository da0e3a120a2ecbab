"""A study: results in a folder of their own, tables and figures made of them, and a page."""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

from workflow import solids
from workflow.studies.base.entry import ROOMS, Entry, tables_of

Config = Mapping[str, Any]


@dataclass(frozen=True)
class Figure:
    """How a figure is made.

    Attributes
    ----------
    file
        Name below the folder of the figures without ending; it may hold one wildcard.
    draw
        Function `MODULE:NAME` below `ROOMS` of the results and the wildcard's value.
    shows, caption
        What Snakemake's report says of it: in a list, and the file in `captions/`.
    needs
        File below the folder of the study that it is drawn from.
    of
        Where the configuration has the values of the wildcard, keys joined by dots.
    group
        What Snakemake's report lists it under; the study if empty.
    """

    file: str
    draw: str
    shows: str
    caption: str
    needs: str
    of: str = ""
    group: str = ""

    @property
    def name(self) -> str:
        """The file's name without its wildcard."""
        return self.file.partition("}")[2].strip("-") or self.file.strip("{}")

    def files(self, config: Config) -> list[str]:
        """Names of all files without ending; solids whose mesh does not exist have none."""
        if not self.of:
            return [self.file]
        wildcard = self.file[: self.file.index("}") + 1]
        return [self.file.replace(wildcard, value) for value in solids.named(config, self.of)]


@dataclass(frozen=True)
class Study:
    """A study; what does its work is named by module, and loaded when it is asked for.

    Attributes
    ----------
    name
        Of the study and, but for the report of a run, of the target that makes it.
    folder
        Below that of the run.
    title
        What Snakemake's report says of the page.
    results
        Class `MODULE:NAME` below `ROOMS` of the results, which takes their folder.
    tables
        File below `workflow/studies` that describes its tables, see `Entry`.
    page
        Function `MODULE:NAME` below `ROOMS` of results and tables that renders the page.
    caption
        File in `captions/` that tells of the page.
    figures
        All figures.
    """

    name: str
    folder: str
    title: str
    results: str
    tables: str
    page: str
    caption: str
    figures: tuple[Figure, ...] = ()

    @property
    def table_modules(self) -> list[str]:
        """Modules that the tables are made by."""
        return sorted({entry.module for entry in self.entries.values()})

    @property
    def room(self) -> str:
        """Name of the package that holds its page."""
        return self.page.partition(".")[0]

    @cached_property
    def entries(self) -> dict[str, Entry]:
        """All tables by name."""
        return tables_of(self.tables)


def named(reference: str) -> Any:
    """What `MODULE:NAME` below `ROOMS` stands for."""
    module, _, name = reference.partition(":")
    return getattr(import_module(f"{ROOMS}.{module}"), name)


def modules_of(*references: str) -> list[str]:
    """Modules of what is named `MODULE:NAME`."""
    return [f"{ROOMS}.{reference.partition(':')[0]}" for reference in references]


@contextmanager
def logged(log: Sequence[str | Path]) -> Iterator[None]:
    """Write what goes wrong into the log of a rule as well."""
    try:
        yield
    except Exception:
        Path(log[0]).write_text(traceback.format_exc())
        raise
