"""Files that the page sends: read with a limit and a clock, under names that are only names."""

import asyncio
import unicodedata
from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import dataclass
from pathlib import PurePosixPath

from starlette.requests import ClientDisconnect, Request

MESH_ENDINGS = (".glb", ".gltf", ".obj", ".off", ".ply", ".stl")
"""Endings of meshes that may be uploaded; other files would come to lie among the person's own."""
CLIP_ENDINGS = (".wav", ".wave", ".flac", ".ogg", ".oga", ".aif", ".aiff", ".mp3")
"""Endings of clips that may be uploaded."""
LONGEST_NAME = 100
"""Longest name of an uploaded file in characters; the ending is kept."""


@dataclass(frozen=True)
class Limits:
    """What the server bears."""

    mesh_bytes: int = 64 << 20
    clip_bytes: int = 16 << 20
    message_bytes: int = 1 << 18
    """Of uploaded files, and of what the page says on its WebSocket."""
    idle_seconds: float = 10.0
    upload_seconds: float = 600.0
    """Time in which an upload has to go on, and to end."""
    uploads: int = 4
    connections: int = 200
    """How many may go on, and be open, at a time."""
    waiting_seconds: float = 10.0
    """Time in which a connection has to ask for something that it may have."""


class UploadError(Exception):
    """An upload that is refused: an HTTP status and a sentence."""

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


async def read_upload(request: Request, most: int, limits: Limits, what: str) -> bytes:
    """The body of a request of at most so many bytes; `what` it is, "a mesh", is for messages.

    Of one that is too large as much again is read and dropped, as browsers listen to an answer only
    when they have sent all.  Raises UploadError if it is empty (400), too large (413), or too slow
    (408).
    """
    too_large = UploadError(
        413, f"the file is larger than {most / (1 << 20):g} MiB, which is the most for {what}"
    )
    declared = request.headers.get("content-length")
    if declared is not None and int(declared) > 2 * most:
        raise too_large
    content, size = bytearray(), 0
    try:
        async with asyncio.timeout(limits.upload_seconds):
            async with aclosing(_pieces(request, limits.idle_seconds)) as pieces:
                async for piece in pieces:
                    size += len(piece)
                    if size <= most:
                        content += piece
                    else:
                        content.clear()
                    if size > 2 * most:
                        break
    except TimeoutError:
        raise UploadError(
            408, f"{what} was sent too slowly, {size:,} bytes came; send it again"
        ) from None
    except ClientDisconnect:
        raise UploadError(400, f"{what} was not sent to its end; send it again") from None
    if size > most:
        raise too_large
    if not content:
        raise UploadError(400, f"the file is empty, expected {what}")
    return bytes(content)


async def _pieces(request: Request, idle_seconds: float) -> AsyncGenerator[bytes, None]:
    async with aclosing(request.stream()) as stream:
        while True:
            try:
                async with asyncio.timeout(idle_seconds):
                    piece = await anext(stream)
            except StopAsyncIteration:
                return
            yield piece


def upload_name(name: str, what: str, endings: tuple[str, ...]) -> str:
    """Name under which a file is kept, from what the page tells; `what` it is is for messages.

    Raises UploadError if it has none of the endings.
    """
    plain = plain_name(name, what.split()[-1])
    if PurePosixPath(plain).suffix.lower() not in endings:
        raise UploadError(400, f"{plain}: expected {what}, its name ends in {', '.join(endings)}")
    return plain


def plain_name(name: str, otherwise: str) -> str:
    """The last part of a path as a name that is safe on any system; `otherwise` if nothing is left.

    Examples
    --------
    >>> plain_name("../../etc/pass\\0wd", "mesh")
    'passwd'
    >>> plain_name("C:\\\\sounds\\\\glass 2.wav", "clip")
    'glass 2.wav'
    >>> plain_name("/..", "mesh")
    'mesh'
    """
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    kept = "".join(c for c in unicodedata.normalize("NFC", last) if c.isprintable())
    kept = kept.strip(" .~")
    if len(kept) > LONGEST_NAME:
        ending = PurePosixPath(kept).suffix[:10]
        kept = kept[: LONGEST_NAME - len(ending)] + ending
    return kept or otherwise
