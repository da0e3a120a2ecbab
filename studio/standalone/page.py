"""Writes the page of a design: one file that opens in any browser, without server or network.

A module that lies in a page has no address that others could be found from.  So every import names
what it imports by a number, and the page says where that is; a worklet's modules become one.
"""

import base64
import gzip
import html
import json
import re
from pathlib import Path
from string import Template

from carillon import __version__
from carillon.command_line.progress import say
from carillon.files.atomic import atomic_path
from sound.project.design import Design
from studio.standalone.content import content

HERE = Path(__file__).resolve().parent
STUDIO = HERE.parent
PAGE = STUDIO / "page"
STYLES = (PAGE / "studio.css", PAGE / "solid.css", HERE / "standalone.css")
PROCESSOR = PAGE / "sound/bank-processor.js"
LICENCES = (PAGE / "vendor/three/LICENSE", PAGE / "vendor/three-mesh-bvh/LICENSE")
MANY_TRIANGLES = 20_000
"""Number of triangles above which their cost is named."""
_IMPORTED = re.compile(r"""(\b(?:from|import)\s*\(?\s*)(["'])([^"'\n]+)\2""")
_MAP = re.compile(r'<script type="importmap">(.*?)</script>', re.DOTALL)
_IMPORT = re.compile(r"""^import (?:[^;]*? from )?["'](\.[^"'\n]+)["'];\n""", re.M)
_EXPORT = re.compile(r"^export (?=(?:class|function) )", re.M)
_COMMENT = re.compile(r"^[ \t]*/\*(?:(?!\*/).)*\*/[ \t]*\n|^[ \t]*//[^\n]*\n", re.DOTALL | re.M)
_INDENTED = re.compile(r"^\s+", re.M)


def write_page(path: str | Path, design: Design) -> None:
    """Write a design as one page: turned and struck anywhere, beside the modes of its clips.

    Of the clips it holds the modes, not what is left without them. Gains have half precision, see
    `studio.standalone.content`. A line of progress says how large the file is where the surface has
    more than `MANY_TRIANGLES`.  Raises UserError if the file cannot be written.
    """
    text = page_of(design)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    count = len(design.surface_faces)
    if count > MANY_TRIANGLES:
        say(
            f"{path}: {len(text) / 1e6:.1f} MB for a surface of {count:,} triangles; with a mesh "
            f"of {MANY_TRIANGLES:,} or fewer it would look alike and open faster"
        )


def page_of(design: Design) -> str:
    """The page as text."""
    return assembled(HERE, PROCESSOR, STYLES, design.name, content(design))


def assembled(
    folder: Path, processor: Path, styles: tuple[Path, ...], title: str, message: bytes
) -> str:
    """A page as text, with its styles in the order of their cascade, from what lies in a folder.

    That has `main.js`, whose `start` is given the message, as `studio.binary` has it, and
    `template.html`, which `frame.html` is put around; its name is the page's class.  The module
    `processor` of sound becomes that of a worklet.
    """
    modules = gathered(folder / "main.js")
    programs = {
        "modules": modules,
        "entry": list(modules)[-1],
        "processor": joined(processor),
    }
    version = html.escape(__version__)
    licences = [html.escape(each.read_text(encoding="utf-8")) for each in LICENCES]
    body = _template(folder / "template.html").substitute(
        version=version, licences="\n\n".join(licences)
    )
    return _template(HERE / "frame.html").substitute(
        kind=folder.name,
        title=html.escape(f"{title} - Carillon"),
        version=version,
        styles="\n".join(each.read_text(encoding="utf-8") for each in styles),
        body=body.rstrip(),
        programs=_packed(json.dumps(programs).encode()),
        content=_packed(message),
        start=(HERE / "start.js").read_text(encoding="utf-8"),
    )


def _template(path: Path) -> Template:
    return Template(path.read_text(encoding="utf-8"))


def _packed(data: bytes) -> str:
    """Bytes as text that is no markup, whatever they are."""
    return base64.b64encode(gzip.compress(data, mtime=0)).decode()


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

        def renamed(match: re.Match[str]) -> str:
            target = _target(match[3], path, places)
            return match[0] if target is None else f'{match[1]}"{take(target)}"'

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
        for match in _IMPORT.finditer(source):
            imported = (path.parent / match[1]).resolve()
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
    kept = _COMMENT.sub(lambda match: match[0] if "@license" in match[0] else "", source)
    return _INDENTED.sub("", kept)


def _places() -> dict[str, str]:
    match = _MAP.search((PAGE / "index.html").read_text(encoding="utf-8"))
    assert match is not None
    return dict(json.loads(match[1])["imports"])


def _target(specifier: str, importer: Path, places: dict[str, str]) -> Path | None:
    """The file of a module that another one names so; None of what is no module."""
    if specifier.startswith((".", "/")):
        path = importer.parent / specifier
    else:
        folders = [name for name in places if name.endswith("/") and specifier.startswith(name)]
        begins = [specifier] if specifier in places else folders
        if not begins:
            return None
        begin = max(begins, key=len)
        path = STUDIO / (places[begin] + specifier.removeprefix(begin)).lstrip("/")
    path = path.resolve()
    return path if path.suffix == ".js" and path.is_file() else None
