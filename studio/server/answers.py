"""Answers that are the same for all routes: refusals, and the way in."""

from __future__ import annotations

from html import escape

from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.types import Receive, Scope, Send

_PAGE = (
    '<!doctype html><html lang="en"><head><meta charset="utf-8">{head}'
    '<meta name="viewport" content="width=device-width"><title>Carillon studio</title>'
    '<meta name="color-scheme" content="light dark"></head>'
    "<body><h1>Carillon studio</h1><p>{text}</p></body></html>"
)


def fault(sentence: str, status: int = 400) -> JSONResponse:
    """What is wrong, for the page."""
    return JSONResponse({"error": sentence}, status)


def entrance(cookie: str, value: str) -> Response:
    """Sets the cookie and leads to the page.

    It is a page of its own that leads on: browsers withhold a strict cookie from where a redirect
    leads if what led to that is another site, such as a terminal in the browser.
    """
    refresh = '<meta http-equiv="refresh" content="0;url=/">'
    answer = _words('<a href="/">The studio opens.</a>', refresh)
    answer.set_cookie(cookie, value, path="/", httponly=True, samesite="strict")
    return answer


async def refusal(scope: Scope, receive: Receive, send: Send, status: int, sentence: str) -> None:
    """Refuse a request or a WebSocket; people get a page, others JSON."""
    if scope["type"] == "websocket":
        if "websocket.http.response" in scope.get("extensions", {}):
            answer: Response = fault(sentence, status)
            await answer(scope, receive, send)
        else:
            await send({"type": "websocket.close", "code": 1008})
        return
    request = Request(scope)
    wants_page = scope["path"] == "/" and "text/html" in request.headers.get("accept", "")
    answer = _words(escape(sentence), status=status) if wants_page else fault(sentence, status)
    answer.headers["Connection"] = "close"
    await answer(scope, receive, send)


def _words(text: str, head: str = "", status: int = 200) -> HTMLResponse:
    return HTMLResponse(_PAGE.format(head=head, text=text), status)
