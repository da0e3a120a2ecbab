"""A study: results in a folder of their own, tables and figures made of them, and a page."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

from carillon.command_line import exit_status
from studies.base.entry import Entry, tables_of
from workflow import solids

Config = Mapping[str, Any]
Files = Callable[[Config], list[str]]
"""Names of files below the folder of a study, of a configuration."""


def no_files(config: Config) -> list[str]:
    """Of a study that has none."""
    return []


@dataclass(frozen=True)
class Figure:
    """How a figure is made.

    Attributes
    ----------
    file
        Name below the folder of the figures without ending; it may hold one wildcard.
    draw
        Function `MODULE:NAME` of the results and the wildcard's value, see `named`.
    needs
        File below the folder of the study that it is drawn from.
    of
        Where the configuration has the values of the wildcard, keys joined by dots.
    """

    file: str
    draw: str
    needs: str
    of: str = ""

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
    package
        Package that its modules, tables and template are in.
    folder
        Below that of the run.
    title
        What the page is about, for lists of pages.
    results
        Class `MODULE:NAME` of the results, which takes their folder, see `named`.
    tables
        File of the package that describes its tables, see `Entry`.
    page
        Function `MODULE:NAME` of results and tables that renders the page.
    figures
        All figures.
    measured
        Files that the tables are made from.
    beside
        Files that the page shows beside tables and figures.
    """

    name: str
    package: str
    folder: str
    title: str
    results: str
    page: str
    tables: str = "tables.yaml"
    figures: tuple[Figure, ...] = ()
    measured: Files = no_files
    beside: Files = no_files

    @property
    def table_modules(self) -> list[str]:
        """Modules that the tables are made by."""
        return sorted({entry.module for entry in self.entries.values()})

    @cached_property
    def entries(self) -> dict[str, Entry]:
        """All tables by name."""
        return tables_of(self.package, self.tables)

    def module(self, reference: str) -> str:
        """Module of what is named `MODULE:NAME`."""
        return module_of(self.package, reference)


def module_of(package: str, reference: str) -> str:
    """Module of `MODULE:NAME`, of the package itself if the module's name has no dot."""
    module = reference.partition(":")[0]
    return module if "." in module else f"{package}.{module}"


def named(package: str, reference: str) -> Any:
    """What `MODULE:NAME` stands for, see `module_of`."""
    return getattr(import_module(module_of(package, reference)), reference.partition(":")[2])


@contextmanager
def logged(log: Sequence[str | Path]) -> Iterator[None]:
    """Write what goes wrong into the log of a rule as well, and report it in a sentence."""
    try:
        yield
    except Exception as error:
        Path(log[0]).write_text(traceback.format_exc())
        exit_status.report(exit_status.meaning(error)[1] or f"{type(error).__name__}: {error}")
        raise
