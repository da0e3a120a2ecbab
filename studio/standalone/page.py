"""Writes the page of a design: one file that opens in any browser, without server or network."""

from __future__ import annotations

import base64
import gzip
import html
import json
from pathlib import Path
from string import Template

from carillon import __version__
from carillon.command_line.progress import say
from carillon.files.atomic import atomic_path
from sound.project.design import Design
from studio.standalone.content import content, name_of
from studio.standalone.modules import PAGE, gathered, joined

HERE = Path(__file__).resolve().parent
STYLES = (PAGE / "studio.css", PAGE / "solid.css", HERE / "standalone.css")
PROCESSOR = PAGE / "sound/bank-processor.js"
LICENCES = (PAGE / "vendor/three/LICENSE", PAGE / "vendor/three-mesh-bvh/LICENSE")
MANY_TRIANGLES = 20_000
"""Number of triangles above which their cost is named."""


def write_page(path: str | Path, design: Design) -> None:
    """Write a design as one page: turned and struck anywhere, beside the modes of its clips.

    Of the clips it holds the modes, not what is left without them.  Gains have half precision, see
    `studio.standalone.content`.  A line of progress says how large the file is where the surface
    has more than `MANY_TRIANGLES`.

    Raises
    ------
    UserError
        If the file cannot be written.
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
    return assembled(HERE, PROCESSOR, STYLES, name_of(design), content(design))


def assembled(
    folder: Path, processor: Path, styles: tuple[Path, ...], title: str, message: bytes
) -> str:
    """A page as text, from what lies in a folder.

    Parameters
    ----------
    folder
        Has `main.js`, whose `start` is given the content, and `template.html`, which `frame.html`
        is put around; its name is the page's class.
    processor
        Of sound: module that becomes that of a worklet.
    styles
        Files, in the order of their cascade.
    message
        The content, as `studio.binary` has it.
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
