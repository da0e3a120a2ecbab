"""Reading a page as a browser would, and comparing it with the files beside it (test support)."""

import csv
import re
from collections.abc import Iterable, Mapping
from html.parser import HTMLParser
from pathlib import Path
from types import MappingProxyType
from typing import Any

from studies.base.numbers import show
from studies.base.parts import unbroken
from studies.base.study import Study
from studies.base.style import save
from studies.base.table import kind_in, read_table, write_table


class Page(HTMLParser):
    """What a browser would load and show."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.source = path.read_text(encoding="utf-8")
        self.links: list[str] = []
        self.led: list[str] = []
        self.ids: list[str] = []
        self.tables: dict[str, list[list[tuple[str, str | None]]]] = {}
        self._table: str | None = None
        self._in_cell = False
        self.feed(self.source)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        for key in ("src", "href", "xlink:href", "srcset", "data", "action", "poster"):
            if found.get(key):
                (self.led if tag == "a" else self.links).append(found[key])
        if found.get("id"):
            self.ids.append(found["id"])
        if tag == "table":
            self._table = found["data-table"]
            self.tables.setdefault(self._table, [])
        elif tag == "tr" and self._table:
            self.tables[self._table].append([])
        elif tag == "td":
            self.tables[self._table][-1].append(("", found.get("data-value")))
            self._in_cell = True

    def handle_endtag(self, tag):
        if tag == "td":
            self._in_cell = False
        elif tag == "table":
            self._table = None

    def handle_data(self, data):
        if self._in_cell:
            text, value = self.tables[self._table][-1][-1]
            self.tables[self._table][-1][-1] = (text + data, value)


def page_of(study: Study, results: Any, path: Path) -> Page:
    """The page that a study makes of results, with its tables beside it and its figures."""
    tables = study.made(results)
    (path.parent / "tables").mkdir(parents=True, exist_ok=True)
    for table in tables.values():
        write_table(table, path.parent / "tables")
    for figure in study.figures:
        if not figure.of:
            drawn = results.figure(f"{figure.file}.svg")
            drawn.parent.mkdir(exist_ok=True)
            save(study.named(figure.draw)(results), [drawn])
    path.write_text(study.build(results, tables), encoding="utf-8")
    return Page(path)


def assert_self_contained(page: Page) -> None:
    """The page loads nothing, runs nothing, and no identifier stands twice."""
    assert page.links
    assert all(link.startswith("data:") or link.startswith("#") for link in page.links)
    # Files beside this page are led to, not loaded.
    assert not any(re.match(r"/|\w+:", link) for link in page.led)
    assert not re.search(r"@import|url\((?!#)", page.source)
    assert "<script" not in page.source
    assert len(page.ids) == len(set(page.ids))


def assert_same_numbers(page: Page, tables: Path, name: str, hidden: tuple[str, ...] = ()) -> None:
    """A table reads the same on the page, but for columns `hidden` there, and in its files."""
    table = read_table(tables / f"{name}.json")
    lines = (tables / f"{name}.csv").read_text().splitlines()
    rows = list(csv.reader(line for line in lines if not line.startswith("# ")))[1:]
    shown = [row for row in page.tables[name] if row]
    assert len(shown) == len(rows) == len(table.rows) > 0
    markdown = (tables / f"{name}.md").read_text()
    if name == "provenance":
        hidden = ("processor", "cores", "versions", "blas")
    columns = [column for column in table.shown if column.key not in hidden]
    for row, cells, line in zip(table.rows, shown, rows):
        raw = dict(zip([column.key for column in table.columns], line))
        for column, (text, value) in zip(columns, cells, strict=True):
            kind = kind_in(row, column)
            assert text == unbroken(row.get(column.key), kind)
            assert show(row.get(column.key), kind).replace("|", "/") in markdown
            if column.kind not in ("text", "range"):
                assert raw[column.key] == ("" if value == "None" else value)


def assert_holds(
    page: Page,
    study: Study,
    folder: Path,
    names: Iterable[str] = (),
    hidden: Mapping[str, tuple[str, ...]] = MappingProxyType({}),
) -> None:
    """A page needs nothing else, and has all figures and the tables of a study, or those named."""
    assert_self_contained(page)
    assert {f"plot-{figure.file}" for figure in study.figures if not figure.of} <= set(page.ids)
    for name in names or study.tables:
        assert_same_numbers(page, folder / "tables", name, hidden.get(name, ()))


def finished_page(study: Study, folder: Path, names: Iterable[str] = (), **hidden: Any) -> Page:
    """The page of a study that has run, which tells where its numbers are from and proves them."""
    page = Page(folder / "report.html")
    assert_holds(page, study, folder, names, hidden)
    for figure in study.figures:
        (drawn,) = (folder / "figures").glob(re.sub(r"\{\w+\}", "*", f"{figure.file}.png"))
        assert drawn.stat().st_size > 5000
    for row in read_table(folder / "tables/provenance.json").rows:
        assert all(row[key] for key in ("command", "commit", "config_hash", "versions"))
    if (truths := folder / "tables/truths.json").is_file():
        for row in read_table(truths).rows:
            expected, counted = row["inertia"].split(" / ")
            assert expected == counted
    return page
