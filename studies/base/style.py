"""How figures look, and how they are written."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.ticker import LogLocator, NullFormatter, PercentFormatter

from carillon.files.atomic import atomic_path
from studies.base.colours import FAINT, INK, MUTED

matplotlib.use("Agg")

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SETTINGS: Any = {
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": FAINT,
    "grid.linewidth": 0.7,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.minor.visible": False,
    "ytick.minor.visible": False,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "svg.fonttype": "none",
    "figure.constrained_layout.use": True,
}
matplotlib.rcParams.update(SETTINGS)

PNG_DPI = 200


def plain(text: str) -> str:
    """Text for a figure, in which dollars are no sign of a formula."""
    return text.replace("$", r"\$")


def logarithmic(*shown: Any, percent: bool = False) -> None:
    """Make axes logarithmic, ticks at 1, 2 and 5 of every decade as plain numbers or per cent."""
    for axis in shown:
        axis.axes.set(**{f"{axis.axis_name}scale": "log"})
        axis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(PercentFormatter(1.0) if percent else "{x:g}")
        axis.set_minor_formatter(NullFormatter())


def named_rows(axes: Any, names: Sequence[str]) -> None:
    """Names of rows at 0, 1, 2 ..., from the top down, without ticks and lines."""
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    axes.invert_yaxis()


def save(figure: Figure, paths: Iterable[str | Path]) -> None:
    """Write a figure as SVG or, on white, as PNG, by the ending of each path."""
    for path in map(Path, paths):
        with atomic_path(path) as temporary:
            if path.suffix == ".svg":
                temporary.write_text(svg(figure, path.stem), encoding="utf-8")
            else:
                figure.savefig(temporary, format="png", dpi=PNG_DPI, facecolor="white")


def svg(figure: Figure, name: str) -> str:
    """The figure as an `<svg>` element whose identifiers all begin with `name`.

    Several such elements can then stand in one page. Text stays text, in the page's own font.
    """
    text = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": name}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    source = text.getvalue()
    source = source[source.index("<svg") :]
    source = re.sub(r"<metadata>.*?</metadata>", "", source, flags=re.DOTALL)
    source = re.sub(r'\bid="', f'id="{name}-', source)
    return re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", source)
