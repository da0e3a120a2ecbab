"""The gallery of examples: each script with its picture; `python docs/extensions/gallery.py` draws.

Pictures lie in `docs/gallery`, so that pages are made in seconds. They are drawn anew by the
scripts, all or those that are named.
"""

import ast
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
EXAMPLES = ROOT / "examples"
PICTURES = ROOT / "docs" / "gallery"


def scripts() -> list[Path]:
    """All examples, by name."""
    return sorted(EXAMPLES.glob("*.py"))


def picture_of(script: Path) -> Path:
    """Where the picture of an example lies."""
    return PICTURES / f"{script.stem}.png"


def of_examples() -> str:
    """A section for each: title, what it shows, picture, code."""
    return "\n\n".join(map(_section, scripts()))


def draw(script: Path) -> None:
    """Run an example in a folder of its own and keep its picture."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, script], cwd=folder, check=True)
        shutil.copy(Path(folder) / picture_of(script).name, picture_of(script))


def _section(script: Path) -> str:
    source = script.read_text()
    text = ast.get_docstring(ast.parse(source)) or ""
    code = source.partition('"""\n\n')[2].strip()
    title = script.stem.replace("_", " ").capitalize()
    return (
        f"## {title}\n\n{text}\n\n![{title}](gallery/{script.stem}.png)\n\n"
        f"`examples/{script.name}`\n\n```python\n{code}\n```"
    )


def main(names: Sequence[str]) -> None:
    """Draw the pictures of the examples named, or of all."""
    PICTURES.mkdir(exist_ok=True)
    for script in scripts():
        if not names or script.stem in names:
            print(script.stem, flush=True)
            draw(script)


if __name__ == "__main__":
    main(sys.argv[1:])
