"""What the studio's server asks of whoever holds the state: the answers to the page's requests."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from carillon.errors import UserError
from studio.feed import Feed

CLIP_PARTS = ("sound", "modes", "rest", "noise")
"""Parts of a clip that can be heard."""
HEAD_PARTS = ("A", "B", "before", "after")
"""Sounds of a comparison of heads: its two blends, the first head, the blend preferred so far."""
STIMULI = ("noise", "strike")
"""What heads are compared by."""
EXPORTS = ("h5", "gltf", "glb", "dsp", "npy", "wav", "html", "zip")
"""Kinds of files that a design can be taken home as."""


class NotFoundError(UserError):
    """Something that the page names and that is not there, or not any more."""


@dataclass(frozen=True)
class Download:
    """A file for the browser to save: the name that is proposed, with its ending, and the media
    type as in HTTP, `audio/wav`.
    """

    name: str
    media_type: str
    content: bytes


class Studio(Protocol):
    """State of the studio as its server sees it; all is called in the thread of the event loop.

    Faults of what the page sends or asks for are raised as `UserError`, one sentence each.  What is
    named and not there is a `NotFoundError`.
    """

    async def start(self) -> None:
        """Begin, once the event loop runs; called first, and once."""

    def state(self) -> dict[str, Any]:
        """The event `state`, as docs/contributing/studio.md describes it."""

    def subscribe(self) -> Feed:
        """A feed of all events from now on, that begins with `state`, `history` and the bank."""

    def unsubscribe(self, feed: Feed) -> None:
        """Send nothing more to a feed, whose page is gone."""

    async def call(self, name: str, arguments: Mapping[str, Any]) -> None:
        """Do what the page asks for; neither the name nor the arguments are checked yet."""

    async def take_mesh(self, name: str, content: bytes) -> str:
        """Take up an uploaded mesh; its identifier. `name` is a plain file name."""

    async def take_clip(self, name: str, content: bytes) -> str:
        """Take up an uploaded clip; its identifier. `name` is a plain file name."""

    async def surface(self, number: int) -> bytes:
        """The surface as a binary message, see `studio.binary`."""

    async def composition(self, number: int) -> bytes:
        """Where regions and supports are on the surface, as a binary message."""

    async def clip_sound(self, clip: str, part: str) -> bytes:
        """A clip, or a part of it (`CLIP_PARTS`), as the content of a WAV file."""

    async def clip_spectrum(self, clip: str) -> dict[str, list[float]]:
        """Spectrum of a clip: `hertz`, and `decibels` below the loudest."""

    async def head_sound(self, number: int, part: str, stimulus: str) -> bytes:
        """A sound of the comparison of a number, in `HEAD_PARTS`, of one of `STIMULI`, as WAV."""

    async def export(self, kind: str, target: str | None) -> Download:
        """The design in another form (`EXPORTS`); sounds are those of a strike at a target."""

    async def close(self) -> None:
        """Save what is to be saved and end all processes."""
