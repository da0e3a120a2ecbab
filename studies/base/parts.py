"""Parts that pages are made of, as HTML: prose, tables, figures, tiles, pictures, sounds.

Text that is no `Markup` is escaped wherever it goes in.
"""

import base64
from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from string import Formatter
from typing import Any

from markupsafe import Markup, escape

from studies.base.colours import themed
from studies.base.conditions import LABELS, Conditions
from studies.base.numbers import show
from studies.base.table import KIND, MARK, Column, Row, Table

WIDE = 4
"""Columns from which on a table needs a scroll bar on a telephone."""
APART = ("processor", "cores", "versions", "blas")
"""Columns of the table of origins that stand above it, once for all rows."""


class _Filling(Formatter):
    """Fields escaped, and shown as of the kind that their format names."""

    def format_field(self, value: Any, format_spec: str) -> str:
        return str(escape(unbroken(value, format_spec) if format_spec else value))


def html(text: str, /, *values: Any, **named: Any) -> Markup:
    """HTML with fields in braces, as of `str.format`; a format is a kind of number.

    Examples
    --------
    >>> html("<b>{}</b>: {row[error]:percent}", "a < b", row={"error": 0.031})
    Markup('<b>a &lt; b</b>: 3.1\\xa0%')
    """
    return Markup(_Filling().vformat(text, values, named))


def unbroken(value: Any, kind: str = "text") -> str:
    """The number as `show` writes it, with a space before its unit at which no line breaks."""
    text = show(value, kind)
    return text if kind == "text" else text.replace(" ", "\N{NO-BREAK SPACE}")


def together(*parts: Any, between: str = "\n") -> Markup:
    """Parts one after the other, without those that are empty."""
    return Markup(between).join(part for part in parts if part)


def element(tag: str, *parts: Any, **attributes: Any) -> Markup:
    """An element of HTML; attributes that are None or empty are left out, `class_` is `class`.

    Examples
    --------
    >>> element("p", "1 < 2", class_="prose", id=None)
    Markup('<p class="prose">1 &lt; 2</p>')
    """
    pairs = {key.strip("_").replace("_", "-"): value for key, value in attributes.items()}
    words = (f' {key}="{escape(pairs[key])}"' for key in pairs if pairs[key] not in (None, ""))
    return Markup(f"<{tag}{''.join(words)}>{together(*parts)}</{tag}>")


def div(class_: str, *parts: Any) -> Markup:
    """A division."""
    return element("div", *parts, class_=class_)


def prose(*paragraphs: Any) -> Markup:
    """Paragraphs, those that are empty left out; nothing without any."""
    filled = [element("p", text) for text in paragraphs if text]
    return div("prose", *filled) if filled else Markup()


def note(text: str) -> Markup:
    """A paragraph that catches the eye; nothing of an empty text."""
    return prose(element("b", text)) if text else Markup()


def bullets(items: Iterable[Any]) -> Markup:
    """A list."""
    return element("ul", *(element("li", item) for item in items))


def article(id: str | None, title: Any, *parts: Any, class_: str = "") -> Markup:
    """A part of a section with a heading of its own."""
    return element("article", element("h3", title), *parts, id=id, class_=class_)


def facts(*items: Any) -> Markup:
    """Short facts in a row."""
    spans = (item if isinstance(item, Markup) else element("span", item) for item in items if item)
    return element("p", *spans, class_="facts")


def _tile(values: Mapping[str, Any], figure: str, text: str, style: str = "") -> Markup:
    number, meaning = (
        part if isinstance(part, Markup) else html(part, **values) for part in (figure, text)
    )
    return div(
        f"tile {style}".strip(),
        element("p", number, class_="figure"),
        element("p", meaning, class_="what"),
    )


def tiles(*items: tuple[str, ...], style: str = "", **values: Any) -> Markup:
    """Tiles side by side: a number in large letters, what it means, a style; see `html`."""
    return div(f"tiles {style}".strip(), *(_tile(values, *item) for item in items))


def styled(style: str, text: str) -> Markup:
    """A name beside its colour."""
    return html('<span class="name"><i class="{}"></i>{}</span>', style, text)


def key(items: Iterable[tuple[Markup, str]], label: str) -> Markup:
    """What colours stand for: names, see `styled`, and what else is said of them."""
    lines = (element("li", name + (element("span", said) if said else "")) for name, said in items)
    return element("ul", *lines, class_="key", aria_label=label)


def place(point: Iterable[float]) -> str:
    """A point in space."""
    return f"({', '.join(show(each, 'fraction') for each in point)})"


def figure(*parts: Any, caption: Any = "", **attributes: Any) -> Markup:
    """Anything with a caption below it."""
    below = element("figcaption", caption) if caption else ""
    return element("figure", *parts, below, **attributes)


def plot(drawn: Markup, caption: Any, id: str = "", width: str = "wide") -> Markup:
    """A figure with its caption; a wide one can be scrolled."""
    part = element("div", drawn, class_="scroll", tabindex=0) if width == "wide" else drawn
    name = f"plot-{id}" if id else None
    return figure(part, caption=caption, class_=f"plot {width}".strip(), id=name)


def image(picture: Mapping[str, Any], alt: str) -> Markup:
    """A picture with its size."""
    words = {name: picture[name] for name in ("width", "height")}
    return html(
        '<img src="{source}" width="{width}" height="{height}" alt="{alt}">',
        source=picture["source"],
        alt=alt,
        **words,
    )


def pictures(items: Iterable[Any], columns: str = "") -> Markup:
    """Pictures side by side, each with what is said of it."""
    return div(f"pictures {columns}".strip(), *(element("div", item) for item in items))


def audio(source: str, label: str) -> Markup:
    """A player."""
    return element("audio", src=source, controls="controls", preload="metadata", aria_label=label)


def listed(summary: str, *parts: Any) -> Markup:
    """What is shown when it is opened."""
    return element("details", element("summary", summary), *parts, class_="listed")


def grid(
    table: Table,
    rows: Sequence[Row] | None = None,
    skip: Container[str] = (),
    caption: bool = True,
    by: str = "",
    judged: Container[str] = (),
) -> Markup:
    """A table, or some of its rows and columns.

    Parameters
    ----------
    skip
        Columns that are left out.
    by
        A rule separates rows whose values of this column differ.
    judged
        Columns whose values are marked as within the `limit` of their row or above it.
    """
    rows = table.rows if rows is None else rows
    columns = [column for column in table.shown if column.key not in skip]
    lines = [
        element("tr", *(_cell(row, column, judged) for column in columns), class_="begins" * begins)
        for begins, row in zip(_beginnings(rows, by), rows)
    ]
    heads = (element("th", column.label, scope="col", class_=_align(column)) for column in columns)
    drawn = element(
        "table",
        element("thead", element("tr", *heads)),
        element("tbody", *lines),
        class_="wide" if len(columns) > WIDE else "",
        data_table=table.name,
    )
    parts = [
        element(
            "div",
            drawn,
            class_="scroll",
            tabindex=0,
            role="region",
            aria_label=f"Table: {table.name}",
        )
    ]
    if caption:
        file = html('<span class="file">tables/{}.csv</span>', table.name)
        parts.append(element("figcaption", html("{} {}", table.caption, file)))
        if table.conditions:
            parts.append(_conditions(table.conditions))
    return element("figure", *parts, class_="table")


def _beginnings(rows: Sequence[Row], by: str) -> list[bool]:
    return [False, *(bool(by) and a.get(by) != b.get(by) for a, b in pairwise(rows))]


def _align(column: Column) -> str:
    return "" if column.kind == "text" else "number"


def _cell(row: Row, column: Column, judged: Container[str]) -> Markup:
    """A cell; a text may have a kind and a mark of its own."""
    key, value = column.key, row.get(column.key)
    if column.kind == "text":
        shown = unbroken(value, row.get(f"{key}{KIND}") or column.kind)
        return element("td", shown, class_=row.get(f"{key}{MARK}"))
    verdict = ""
    if key in judged and value is not None:
        verdict = " met" if value <= row["limit"] else " missed"
    shown = unbroken(value, column.kind)
    return element("td", shown, class_=f"number{verdict}", data_value=str(value))


def _conditions(measured: Conditions) -> Markup:
    lines = definitions((LABELS[key], text) for key, text in measured.texts.items())
    return element("details", element("summary", measured.headline), lines, class_="conditions")


def definitions(pairs: Iterable[tuple[Any, Any]], class_: str = "") -> Markup:
    """Terms, and what is said of each."""
    lines = (element("div", element("dt", term), element("dd", said)) for term, said in pairs)
    return element("dl", *lines, class_=class_)


def machine(table: Table, config: str) -> Markup:
    """Machines and commands of the table of origins; `config` says where the configuration is."""
    cores = " or ".join(str(each) for each in _each(table, "cores") if each)
    processors = ", ".join(map(show, _each(table, "processor")))
    blas = [row["blas"] for row in table.rows if row.get("blas")]
    counts = {each: blas.count(each) for each in blas}
    files = (f"{each} ({n} file{'s' if n > 1 else ''})" for each, n in counts.items())
    about = [
        ("Code", ", ".join(map(show, _each(table, "commit")))),
        ("Processor", f"{processors}, {cores} cores"),
        *([("BLAS", ", ".join(files))] if blas else []),
        *(("Versions", show(each)) for each in _each(table, "versions")),
        ("Configuration", config),
    ]
    commands = div("commands", grid(table, skip=APART))
    return together(definitions(about, class_="machine"), commands)


def _each(table: Table, key: str) -> list[Any]:
    return list(dict.fromkeys(row.get(key) for row in table.rows))


def inline(path: Path) -> Markup:
    """An SVG file as part of a page, in the page's own colours and font."""
    return Markup(themed(path.read_text(encoding="utf-8")))


def data_uri(kind: str, content: bytes) -> str:
    """Content of a file as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def picture_uri(path: Path) -> str:
    """A PNG file as a data URI."""
    return data_uri("image/png", path.read_bytes())
