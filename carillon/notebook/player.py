"""An audio player that holds its sound."""

import base64
from html import escape

from carillon.notebook.card import Markup


def player(wav: bytes, label: str) -> Markup:
    """A player of the content of a WAV file; the label is written above it."""
    content = base64.b64encode(wav).decode()
    return Markup(
        f"<p>{escape(label)}</p>"
        f'<audio controls="" preload="metadata" aria-label="{escape(label)}" '
        f'src="data:audio/wav;base64,{content}"></audio>'
    )
