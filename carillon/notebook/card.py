"""A card of HTML: a title, facts in a line, and tables, charts, players or solids below.

All text is escaped here, and colours are those of the page around, be it light or dark.
"""

from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import NamedTuple

STYLE = (
    ".carillon{max-width:46rem;line-height:1.4;font-variant-numeric:tabular-nums}"
    ".carillon p{margin:.1rem 0 .4rem}"
    ".carillon-parts{display:flex;flex-wrap:wrap;gap:.5rem 1.5rem;align-items:flex-start}"
    ".carillon-parts>div{flex:0 1 auto;max-width:100%;overflow-x:auto}"
    ".carillon table{border-collapse:collapse;margin:0;font-size:.85em}"
    ".carillon th,.carillon td{padding:.1rem .7rem .1rem 0;text-align:right;border:0;"
    "background:none}"
    ".carillon thead th{font-weight:600;border-bottom:1px solid}"
    ".carillon th[scope=row]{text-align:left;font-weight:400}"
    ".carillon svg,.carillon img,.carillon canvas{display:block;max-width:100%;height:auto}"
    ".carillon audio{display:block;width:20rem;max-width:100%;height:2.2rem;margin:.2rem 0}"
    ".carillon button{font:inherit;font-size:.85em;margin:.15rem .3rem .15rem 0;"
    "padding:.1rem .5rem;color:inherit;background:none;border:1px solid;border-radius:.2rem;"
    "cursor:pointer}"
    ".carillon button[aria-pressed=true]{font-weight:700;border-width:2px}"
)
"""Style of all cards; it names nothing outside them."""


class Markup(NamedTuple):
    """A piece of HTML, which is not escaped again."""

    html: str


def card(title: str, facts: Iterable[str], *parts: Markup | None) -> str:
    """A card with a title, facts, and the parts that there are, side by side where they fit.

    Examples
    --------
    >>> "&lt;bell&gt;" in card("<bell>", ["3 modes"])
    True
    """
    line = "; ".join(facts)
    told = f"<p>{escape(line)}</p>" if line else ""
    shown = "".join(f"<div>{part.html}</div>" for part in parts if part is not None)
    below = f'<div class="carillon-parts">{shown}</div>' if shown else ""
    return (
        f'<div class="carillon"><style>{STYLE}</style>'
        f"<p><strong>{escape(title)}</strong></p>{told}{below}</div>"
    )


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], note: str = "") -> Markup:
    """A table of numbers with a head; a note below says what it leaves out."""
    head = "".join(f'<th scope="col">{escape(column)}</th>' for column in columns)
    cells = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows)
    body = "".join(f"<tr>{row}</tr>" for row in cells)
    told = f"<p>{escape(note)}</p>" if note else ""
    return Markup(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{told}")


def named_values(rows: Iterable[tuple[str, str]]) -> Markup:
    """A table of values, each with its name before it."""
    body = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>'
        for name, value in rows
    )
    return Markup(f"<table><tbody>{body}</tbody></table>")


def html_or_text(shown: object, make: Callable[[], str]) -> str:
    """The HTML of an object; its `repr` with the reason below if that fails.

    A display that raised would hide the object, which is there and whole.

    Examples
    --------
    >>> html_or_text(3, lambda: card("", []) + 1)
    '<pre>3</pre><p>no picture: can only concatenate str (not &quot;int&quot;) to str</p>'
    """
    try:
        return make()
    except Exception as error:  # Whatever it is: the text remains.
        return f"<pre>{escape(repr(shown))}</pre><p>no picture: {escape(str(error))}</p>"


def hertz(frequency: float) -> str:
    """A frequency [Hz] without its unit, with four digits that count, or whole.

    Examples
    --------
    >>> hertz(11189.6), hertz(59.8966)
    ('11,190', '59.9')
    """
    return f"{frequency:,.0f}" if frequency >= 1000.0 else f"{frequency:.4g}"


def percent(share: float) -> str:
    """A share in percent, with three digits that count.

    Examples
    --------
    >>> percent(0.01234), percent(2.5e-9)
    ('1.23 %', '2.5e-07 %')
    """
    return f"{100.0 * share:.3g} %"
