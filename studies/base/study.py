"""A study: results in a folder of their own, tables and figures made of them, and a page."""

import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

from carillon.command_line import exit_status
from studies.base.provenance import provenance
from studies.base.table import Table, Tabulation
from workflow import solids

Config = Mapping[str, Any]
Files = Callable[[Config], list[str]]
"""Names of files below the folder of a study, of a configuration."""


def no_files(config: Config) -> list[str]:
    """Of a study that has none."""
    return []


@dataclass(frozen=True)
class Figure:
    """How a figure is made."""

    file: str
    """Name below the folder of the figures without ending; it may hold one wildcard."""
    draw: str
    """Function `MODULE:NAME` of the results and the wildcard's value, see `Study.named`."""
    needs: str
    """File below the folder of the study that it is drawn from."""
    of: str = ""
    """Where the configuration has the values of the wildcard, keys joined by dots."""

    @property
    def name(self) -> str:
        """The file's name without its wildcard."""
        name = self.file.partition("}")[2].strip("-") or self.file.strip("{}")
        return name.replace("-", "_")

    def files(self, config: Config) -> list[str]:
        """Names of all files without ending; solids whose mesh does not exist have none."""
        if not self.of:
            return [self.file]
        wildcard = self.file[: self.file.index("}") + 1]
        return [self.file.replace(wildcard, value) for value in solids.named(config, self.of)]


@dataclass(frozen=True)
class Study:
    """A study; what does its work is named by module, and loaded when it is asked for."""

    name: str
    """Of the study and, but for the report of a run, of the target that makes it."""
    title: str
    """What the page is about, for lists of pages."""
    results: str
    """Class `MODULE:NAME` of the results, which takes their folder, see `Study.named`."""
    tables: tuple[str, ...]
    """Names of its tables in their order; the module `tabulated` has them, with `_` for `-`, but
    for `provenance`, which all studies share."""
    package: str = ""
    """That its modules are in, the one of its name below `studies` unless said."""
    folder: str | None = None
    """Below that of the run, of its own name unless said."""
    page: str = "page:page"
    tabulated: str = "tables"
    """Function `MODULE:NAME` of results and tables that returns the page; module of the tables."""
    file: str = "report.html"
    """The page below the folder; it may hold one wildcard."""
    prefix: str = ""
    """What the files of its tables begin with, that of its results."""
    target: bool = True
    """Whether a target of its name makes the page, and nothing else."""
    figures: tuple[Figure, ...] = ()
    """All figures."""
    measured: Files = no_files
    """Files that the tables are made from."""
    beside: Files = no_files
    """Files that the page shows beside tables and figures."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "package", self.package or f"studies.{self.name}")
        object.__setattr__(self, "folder", self.name if self.folder is None else self.folder)

    @cached_property
    def entries(self) -> dict[str, Tabulation]:
        """All tables by name."""
        module = import_module(self.module(self.tabulated))
        own = (name for name in self.tables if name != provenance.name)
        tables = {name: getattr(module, name.replace("-", "_")) for name in own}
        return {name: tables.get(name, provenance) for name in self.tables}

    def open(self, run: Path, *wildcards: str) -> Any:
        """The results below the folder of a run."""
        return self.named(self.results)(run / str(self.folder), *wildcards)

    def build(self, results: Any, tables: Mapping[str, Table] | None = None) -> str:
        """The page as HTML; tables are made of the results if there are none."""
        return str(self.named(self.page)(results, self.made(results) if tables is None else tables))

    def made(self, results: Any) -> dict[str, Table]:
        """All tables of results by name, but for those that are `absent` from these."""
        absent = getattr(results, "absent", ())
        return {name: make(results) for name, make in self.entries.items() if name not in absent}

    def named(self, reference: str) -> Any:
        """What `MODULE:NAME` stands for."""
        return getattr(import_module(self.module(reference)), reference.partition(":")[2])

    def module(self, reference: str) -> str:
        """Module of what is named `MODULE:NAME`, of the package if that has no dot."""
        module = reference.partition(":")[0]
        return module if "." in module else f"{self.package}.{module}"


@contextmanager
def logged(log: Sequence[str | Path]) -> Iterator[None]:
    """Write what goes wrong into the log of a rule as well, and report it in a sentence."""
    try:
        yield
    except Exception as error:
        Path(log[0]).write_text(traceback.format_exc())
        exit_status.report(exit_status.meaning(error)[1] or f"{type(error).__name__}: {error}")
        raise
