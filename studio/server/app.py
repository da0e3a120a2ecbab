"""The routes: what is answered to which request, see docs/contributing/studio.md."""

from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from carillon.errors import UserError
from carillon.parameters.schema import schema_of
from sound.project.project import Project
from studio.interface import (
    CLIP_PARTS,
    EXPORTS,
    HEAD_PARTS,
    STIMULI,
    NotFoundError,
    Studio,
)
from studio.materials import material_table
from studio.server.guard import Guard, Keys, fault
from studio.server.page_files import page_table, send_file, send_page
from studio.server.socket import OWN_FAULT, sentence_of, talk
from studio.server.uploads import (
    CLIP_ENDINGS,
    MESH_ENDINGS,
    Limits,
    UploadError,
    plain_name,
    read_upload,
    upload_name,
)

LONGEST_NUMBER = 15
"""Digits of a number in a path."""


def make_app(
    studio: Studio,
    keys: Keys,
    host: str,
    port: int,
    limits: Limits | None = None,
    let_in: Callable[[Any], None] | None = None,
) -> Guard:
    """The studio as an ASGI application, guarded by the keys of this run, for a server at host and
    port.

    `let_in` is told the address of a client that may ask.
    """
    routes = _Routes(studio, limits or Limits())
    app = Starlette(
        routes=[
            Route("/", routes.page, methods=["GET"]),
            Route("/page/{rest:path}", routes.file, methods=["GET"]),
            Route("/schema.json", routes.schema, methods=["GET"]),
            Route("/materials.json", routes.materials, methods=["GET"]),
            Route("/mesh", routes.mesh, methods=["POST"]),
            Route("/clip", routes.clip, methods=["POST"]),
            Route("/surface/{number}", routes.surface, methods=["GET"]),
            Route("/composition/{number}", routes.composition, methods=["GET"]),
            Route("/clip/{clip}/spectrum", routes.spectrum, methods=["GET"]),
            Route("/clip/{clip}/{part}", routes.sound, methods=["GET"]),
            Route("/heads/{number}/{part}", routes.heads, methods=["GET"]),
            Route("/export/{kind}", routes.export, methods=["GET"]),
            WebSocketRoute("/socket", routes.socket),
        ],
        exception_handlers=_HANDLERS,
    )
    app.router.redirect_slashes = False
    return Guard(app, keys, host, port, let_in)


class _Routes:
    def __init__(self, studio: Studio, limits: Limits) -> None:
        self._studio, self._limits = studio, limits
        self._table = page_table()
        self._uploads = 0

    async def page(self, request: Request) -> Response:
        return send_page()

    async def file(self, request: Request) -> Response:
        file = send_file(request, self._table)
        return fault("the page has no such file", 404) if file is None else file

    async def schema(self, request: Request) -> Response:
        return JSONResponse(schema_of(Project))

    async def mesh(self, request: Request) -> Response:
        content, name = await self._upload(request, "a mesh", self._limits.mesh_bytes, MESH_ENDINGS)
        return JSONResponse({"mesh": await self._studio.take_mesh(name, content)})

    async def clip(self, request: Request) -> Response:
        content, name = await self._upload(request, "a clip", self._limits.clip_bytes, CLIP_ENDINGS)
        return JSONResponse({"clip": await self._studio.take_clip(name, content)})

    async def _upload(
        self, request: Request, what: str, most: int, endings: tuple[str, ...]
    ) -> tuple[bytes, str]:
        if self._uploads >= self._limits.uploads:
            raise UploadError(503, f"{self._uploads} files are being sent already; wait for them")
        self._uploads += 1
        try:
            content = await read_upload(request, most, self._limits, what)
        finally:
            self._uploads -= 1
        return content, upload_name(request.query_params.get("name", ""), what, endings)

    async def materials(self, request: Request) -> Response:
        return JSONResponse(material_table())

    async def surface(self, request: Request) -> Response:
        content = await self._studio.surface(_number(request, "surface"))
        return Response(content, media_type="application/octet-stream")

    async def composition(self, request: Request) -> Response:
        content = await self._studio.composition(_number(request, "composition"))
        return Response(content, media_type="application/octet-stream")

    async def spectrum(self, request: Request) -> Response:
        return JSONResponse(await self._studio.clip_spectrum(request.path_params["clip"]))

    async def sound(self, request: Request) -> Response:
        part = request.path_params["part"]
        if part not in CLIP_PARTS:
            raise NotFoundError(f"a clip has no {part!r:.100}; expected {', '.join(CLIP_PARTS)}")
        content = await self._studio.clip_sound(request.path_params["clip"], part)
        return Response(content, media_type="audio/wav")

    async def heads(self, request: Request) -> Response:
        part = request.path_params["part"]
        if part not in HEAD_PARTS:
            raise NotFoundError(f"heads have no {part!r:.100}; expected {', '.join(HEAD_PARTS)}")
        stimulus = request.query_params.get("stimulus", STIMULI[0])
        if stimulus not in STIMULI:
            raise NotFoundError(f"there is no {stimulus!r:.100}; expected {', '.join(STIMULI)}")
        number = _number(request, "comparison")
        content = await self._studio.head_sound(number, part, stimulus)
        return Response(content, media_type="audio/wav")

    async def export(self, request: Request) -> Response:
        kind = request.path_params["kind"]
        if kind not in EXPORTS:
            raise NotFoundError(f"there is no export {kind!r:.100}; expected {', '.join(EXPORTS)}")
        file = await self._studio.export(kind, request.query_params.get("target"))
        name = plain_name(file.name, f"design.{kind}")
        headers = {"Content-Disposition": f"attachment; filename*=UTF-8''{quote(name, safe='')}"}
        return Response(file.content, media_type=file.media_type, headers=headers)

    async def socket(self, page: WebSocket) -> None:
        await talk(page, self._studio)


def _number(request: Request, what: str) -> int:
    text: str = request.path_params["number"]
    if not (text.isascii() and text.isdigit() and len(text) <= LONGEST_NUMBER):
        raise NotFoundError(f"{what} {text:.100} is no number")
    return int(text)


async def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    words = {404: "there is nothing at this address", 405: f"{request.method} is not for this"}
    return fault(words.get(error.status_code, str(error.detail)), error.status_code)


async def _told(request: Request, error: Exception) -> Response:
    status = 404 if isinstance(error, NotFoundError) else 400
    return fault(sentence_of(error), status)


async def _not_taken(request: Request, error: Exception) -> Response:
    assert isinstance(error, UploadError)
    answer = fault(str(error), error.status)
    # What is still being sent is not another request.
    answer.headers["Connection"] = "close"
    return answer


async def _failed(request: Request, error: Exception) -> Response:
    return fault(OWN_FAULT, 500)


_HANDLERS: Mapping[Any, Any] = {
    HTTPException: _refused,
    UploadError: _not_taken,
    UserError: _told,
    OSError: _told,
    MemoryError: _told,
    Exception: _failed,
}
