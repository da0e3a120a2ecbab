"""Runs a notebook's cells in order, and shows what they show as a page (test support).

`python -m tests.notebooks NOTEBOOK PAGE`, in the folder that the cells shall work in.  In place of
nbclient: that needs a kernel, a message queue and an event loop, 25 packages that nothing else of
the project imports, to do what these few lines do in one process.
"""

import ast
import json
import sys
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

HEAD = (
    '<!doctype html><html lang="en"><head><meta charset="utf-8"/>'
    '<meta name="viewport" content="width=device-width, initial-scale=1"/><title>notebook</title>'
    "<style>body{font:15px/1.5 sans-serif;max-width:60rem;margin:1rem auto;padding:0 1rem}"
    "pre{overflow-x:auto}</style></head><body>"
)


def cells(notebook: Path, kind: str) -> list[str]:
    """The texts of a notebook's cells of a kind, `code` or `markdown`."""
    found = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in found if cell["cell_type"] == kind]


def run(notebook: Path) -> Iterator[tuple[str, Any]]:
    """Run the code of a notebook; each cell with the value of its last expression, or None."""
    names: dict[str, Any] = {"__name__": "__main__"}
    for number, source in enumerate(cells(notebook, "code"), 1):
        tree, where, value = ast.parse(source), f"{notebook.name}, cell {number}", None
        last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, where, "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), where, "eval"), names)
        yield source, value


def shown(value: Any) -> str:
    """HTML that a notebook has for a value."""
    if value is None:
        return ""
    made = value._repr_html_() if hasattr(value, "_repr_html_") else None
    return made or f"<pre>{escape(repr(value))}</pre>"


def main(notebook: str, page: str) -> None:
    """Run a notebook and write its page."""
    parts = [f"<pre>{escape(code)}</pre>{shown(value)}" for code, value in run(Path(notebook))]
    Path(page).write_text(f"{HEAD}{''.join(parts)}</body></html>\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
