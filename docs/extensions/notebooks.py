"""Notebooks of the examples as pages: their texts and their code, without outputs."""

import json
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parent.parent.parent / "examples"


def notebooks() -> list[Path]:
    """All notebooks, by name."""
    return sorted(EXAMPLES.glob("*.ipynb"))


def of_notebook(name: str) -> str:
    """A page in `docs/tutorials` of a notebook: cell after cell, and where it lies."""
    path = EXAMPLES / f"{name}.ipynb"
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    first, *others = map(_cell, cells)
    place = (
        f"This page is the notebook `examples/{path.name}`. Run it in Jupyter: meshes, modes, "
        "sounds and designs [show themselves](../howto/python.md#in-a-notebook) below the cells."
    )
    return "\n\n".join([first, place, *others])


def _cell(cell: dict[str, object]) -> str:
    source = "".join(cell["source"])  # type: ignore[arg-type]
    if cell["cell_type"] == "code":
        return f"```python\n{source}\n```"
    return source.replace("](../docs/", "](../")
