"""A solid that turns: a still picture, and a viewer of few kilobytes that takes its place.

Where programs are not run, as in a notebook that is not trusted or on a page that shows notebooks,
the picture stays.  The viewer is WebGL without a library; all solids of a page share one context,
of which browsers allow few.
"""

import base64
import json
import re
import zlib
from collections.abc import Sequence
from functools import cache
from html import escape
from pathlib import Path

from carillon.notebook.card import Markup
from carillon.notebook.still import HEIGHT, WIDTH, still_png
from carillon.notebook.triangles import Triangles

PROGRAM = Path(__file__).with_name("viewer.js")
_COMMENT = re.compile(r"/\*\*(?:(?!\*/).)*\*/\s?|^\s*//[^\n]*\n", re.DOTALL | re.M)
_INDENTED = re.compile(r"^\s+", re.M)


def solid(shown: Triangles, label: str, names: Sequence[str] = (), caption: str = "") -> Markup:
    """The triangles, turned by mouse, finger or arrow keys.

    `label` says what it is to those who do not see it, a `caption` below it what its colours are;
    `names` are those of the motions, one of which is shown at a time.

    Raises ValueError if there is not a name for each motion.
    """
    if len(names) != len(shown.motions):
        raise ValueError(f"{len(names)} names for {len(shown.motions)} motions")
    told = {
        "vertices": shown.used,
        "triangles": len(shown.faces),
        "values": shown.values is not None,
        "motions": list(names),
    }
    picture = base64.b64encode(still_png(shown)).decode()
    content = base64.b64encode(zlib.compress(shown.packed(), 9)).decode()
    below = f"<p>{escape(caption)}</p>" if caption else ""
    return Markup(
        f'<div class="carillon-solid" data-view="{escape(json.dumps(told))}" '
        f'data-content="{content}"><img width="{WIDTH}" height="{HEIGHT}" '
        f'alt="{escape(label)}" src="data:image/png;base64,{picture}"/></div>{below}'
        f"<script>{_program()}</script>"
    )


@cache
def _program() -> str:
    """The viewer without comments and indentation."""
    return _INDENTED.sub("", _COMMENT.sub("", PROGRAM.read_text(encoding="utf-8")))
