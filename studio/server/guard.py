"""Who may ask: the right Host, Origin and cookie on every request and WebSocket, or nothing."""

import hmac
import ipaddress
import re
import secrets
import socket
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from html import escape
from typing import Any
from urllib.parse import parse_qs

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""Names of this machine that no other one can take on."""
SAFE_METHODS = ("GET", "HEAD")
"""Methods that change nothing; they need no Origin, as browsers send none with some of them."""
NEAR = ("same-origin", "none")
"""Values of Sec-Fetch-Site of what the page itself, or the person, asks for."""
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=(self)",
}
"""Headers of every answer."""

_HOST = re.compile(
    r"(?P<name>[A-Za-z0-9.-]{1,253}|\[[0-9A-Fa-f:.]{2,45}\])(:(?P<port>[0-9]{1,5}))?"
)
_NO_COOKIE = (
    "this browser has not been let in yet, or the studio was started anew; open the address that "
    "the command printed, all of it"
)
_PAGE = (
    '<!doctype html><html lang="en"><head><meta charset="utf-8">{head}'
    '<meta name="viewport" content="width=device-width"><title>Carillon studio</title>'
    '<meta name="color-scheme" content="light dark"></head>'
    "<body><h1>Carillon studio</h1><p>{text}</p></body></html>"
)


@dataclass(frozen=True)
class Keys:
    """Secrets of one run: the token stands in the address that is printed, and is good for a
    cookie.
    """

    token: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    cookie: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)


class Guard:
    """Lets through what comes from the studio's own page; an ASGI application around another.

    Names that others can point at this machine (DNS rebinding) are refused by their Host, pages of
    other origins by their Origin, everybody else by the lack of the cookie, which is named after
    the server's port, as cookies are the same for all.  `let_in` is told the address of each client
    that may ask, before it is answered.
    """

    def __init__(
        self,
        app: ASGIApp,
        keys: Keys,
        host: str,
        port: int,
        let_in: Callable[[Any], None] | None = None,
    ) -> None:
        self._app, self._keys, self._let_in = app, keys, let_in
        self._names = host_names(host)
        self._addresses = not is_loopback(host)
        self._cookie = f"carillon_studio_{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        send = _with_headers(send)
        said = self._fault(scope)
        if scope["type"] == "http" and said is None and self._is_entrance(scope):
            self._welcome(scope)
            answer = entrance(self._cookie, self._keys.cookie)
            await answer(scope, receive, send)
        elif said is None and not self._has_cookie(scope):
            await refusal(scope, receive, send, 403, _NO_COOKIE)
        elif said is not None:
            await refusal(scope, receive, send, 403, said)
        else:
            self._welcome(scope)
            await self._app(scope, receive, send)

    def _welcome(self, scope: Scope) -> None:
        if self._let_in is not None:
            self._let_in(scope.get("client"))

    def _fault(self, scope: Scope) -> str | None:
        hosts, origins = _values(scope, b"host"), _values(scope, b"origin")
        if len(hosts) != 1 or not self._is_own(hosts[0]):
            return (
                f"the Host {hosts[0] if hosts else '(none)'} is not this studio's; open the "
                "address that the command printed"
            )
        changes = scope["type"] == "websocket" or scope["method"] not in SAFE_METHODS
        if (changes or origins) and origins != [f"http://{hosts[0]}"]:
            return (
                f"the Origin {', '.join(origins) or '(none)'} is not this studio's; only its own "
                "page may ask for this"
            )
        if not self._is_near(scope):
            return "another site asks for this; only the studio's own page may"
        return None

    def _is_own(self, host: str) -> bool:
        parts = _HOST.fullmatch(host)
        if parts is None or int(parts["port"] or 80) > 65535:
            return False
        name = parts["name"].strip("[]").lower()
        if self._addresses and _is_address(name):
            return not ipaddress.ip_address(name).is_unspecified
        return name in self._names

    def _is_near(self, scope: Scope) -> bool:
        """Whether a browser that tells so says that no other site asks; a link to the page may."""
        if scope["type"] == "http" and scope["path"] == "/":
            return True
        return all(value in NEAR for value in _values(scope, b"sec-fetch-site"))

    def _is_entrance(self, scope: Scope) -> bool:
        if scope["path"] != "/" or scope["method"] != "GET":
            return False
        try:
            words = parse_qs(scope["query_string"].decode("latin-1"), max_num_fields=8)
        except ValueError:
            return False
        given = words.get("token", [])
        return len(given) == 1 and _same(given[0], self._keys.token)

    def _has_cookie(self, scope: Scope) -> bool:
        found = False
        for header in _values(scope, b"cookie"):
            for value in cookie_values(header, self._cookie):
                found |= _same(value, self._keys.cookie)
        return found


def cookie_values(header: str, name: str) -> list[str]:
    """Values of all cookies of a name in a header of a browser.

    Cookies of other programs of this machine are sent along, whatever they hold: they are for all
    of its ports, and libraries give up on those that no standard allows.

    Examples
    --------
    >>> cookie_values('a=b c; key=1; d={"e": [1, 2]}; key=2; keys=3', "key")
    ['1', '2']
    """
    parts = (part.partition("=") for part in header.split(";"))
    return [value.strip(" \t") for key, _, value in parts if key.strip(" \t") == name]


def host_names(host: str) -> frozenset[str]:
    """Names under which a server that listens on `host` may be asked."""
    names = {*LOOPBACK}
    if not is_loopback(host):
        names |= {socket.gethostname().lower(), socket.getfqdn().lower()}
        if not _is_address(host) or not ipaddress.ip_address(host).is_unspecified:
            names.add(host.lower())
    return frozenset(names)


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an address to listen on."""
    return host in LOOPBACK or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def _is_address(name: str) -> bool:
    """Whether a name is an address in digits, which no name server has a say in."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _same(given: str, secret: str) -> bool:
    """Whether a secret was given, in a time that tells nothing of it."""
    return hmac.compare_digest(given.encode(errors="surrogateescape"), secret.encode())


def _values(scope: Scope, name: bytes) -> list[str]:
    headers: Iterable[tuple[bytes, bytes]] = scope["headers"]
    return [value.decode("latin-1") for key, value in headers if key.lower() == name]


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
            headers.setdefault("Cache-Control", "no-store")
            headers.setdefault(
                "Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'"
            )
        await send(message)

    return sending


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
