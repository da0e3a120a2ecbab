"""The page's modules, gathered so that one file can hold them.

A module that lies in a page has no address that others could be found from.  So every import names
what it imports by a number, and the page says where that is; a worklet's modules become one.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

STUDIO = Path(__file__).resolve().parent.parent
PAGE = STUDIO / "page"
_IMPORTED = re.compile(r"""(\b(?:from|import)\s*\(?\s*)(["'])([^"'\n]+)\2""")
_MAP = re.compile(r'<script type="importmap">(.*?)</script>', re.DOTALL)
_IMPORT = re.compile(r"""^import (?:[^;]*? from )?["'](\.[^"'\n]+)["'];\n""", re.M)
_EXPORT = re.compile(r"^export (?=(?:class|function) )", re.M)
_COMMENT = re.compile(r"^[ \t]*/\*(?:(?!\*/).)*\*/[ \t]*\n|^[ \t]*//[^\n]*\n", re.DOTALL | re.M)
_INDENTED = re.compile(r"^\s+", re.M)


def gathered(entry: Path) -> dict[str, str]:
    """Sources by number of all that a module imports, and of itself, the last one.

    Specifiers are numbers, too; comments are left out but those of licences.
    """
    places = _places()
    names: dict[Path, str] = {}
    sources: dict[str, str] = {}

    def take(path: Path) -> str:
        if path in names:
            return names[path]
        names[path] = name = f"m{len(names)}"

        def renamed(found: re.Match[str]) -> str:
            target = _target(found[3], path, places)
            return found[0] if target is None else f'{found[1]}"{take(target)}"'

        # Without comments first: what they give as an example is no import.
        sources[name] = _IMPORTED.sub(renamed, shortened(path.read_text(encoding="utf-8")))
        return name

    take(entry)
    return sources


def joined(entry: Path) -> str:
    """A module and all that it imports as one that imports nothing; no two may use one name.

    For modules that import at their top, and export classes or functions by name.
    """
    sources: dict[Path, str] = {}

    def take(path: Path) -> None:
        source = shortened(path.read_text(encoding="utf-8"))
        for found in _IMPORT.finditer(source):
            imported = (path.parent / found[1]).resolve()
            if imported not in sources:
                take(imported)
        sources[path] = _EXPORT.sub("", _IMPORT.sub("", source))

    take(entry.resolve())
    return "".join(sources.values())


def shortened(source: str) -> str:
    """A module without comments on lines of their own, indentation and empty lines.

    Texts over several lines lose them, too, which in shaders does not matter.

    Examples
    --------
    >>> shortened("/** What it does. */\\n  a();\\n\\n// Why.\\n  b(); // As ever.\\n")
    'a();\\nb(); // As ever.\\n'
    """
    kept = _COMMENT.sub(lambda found: found[0] if "@license" in found[0] else "", source)
    return _INDENTED.sub("", kept)


def _places() -> dict[str, str]:
    """Addresses by the names that the page's modules know libraries by."""
    found = _MAP.search((PAGE / "index.html").read_text(encoding="utf-8"))
    assert found is not None
    return dict(json.loads(found[1])["imports"])


def _target(specifier: str, importer: Path, places: dict[str, str]) -> Path | None:
    """The file of a module that another one names so; None of what is no module."""
    if specifier.startswith((".", "/")):
        path = importer.parent / specifier
    else:
        begins = [name for name in places if specifier == name or _within(specifier, name)]
        if not begins:
            return None
        begin = max(begins, key=len)
        path = STUDIO / (places[begin] + specifier.removeprefix(begin)).lstrip("/")
    path = path.resolve()
    return path if path.suffix == ".js" and path.is_file() else None


def _within(specifier: str, name: str) -> bool:
    return name.endswith("/") and specifier.startswith(name)
