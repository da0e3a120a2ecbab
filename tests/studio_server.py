"""A served studio and somebody who asks it, byte by byte if need be (test support)."""

import asyncio
import http.client
import json
import socket
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote

from websockets.sync.client import ClientConnection, connect

from studio.server.connections import Connections
from studio.server.guard import Keys
from studio.server.serve import listen, make_server, serve_and_close
from studio.server.uploads import Limits
from tests.studio_stub import StubStudio

ROUTES = (
    "/",
    "/page/main.js",
    "/schema.json",
    "/surface/1",
    "/clip/c1/sound",
    "/heads/0/A",
    "/export/h5",
)
"""One of each kind that can be asked for by GET."""
SECONDS = 20.0
"""Longest wait for an answer."""


@dataclass
class Answer:
    """What came back."""

    status: int
    headers: http.client.HTTPMessage
    content: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.content)

    @property
    def error(self) -> str:
        """The sentence of a refusal."""
        sentence = self.json["error"]
        assert isinstance(sentence, str) and sentence and "\n" not in sentence
        return sentence


@dataclass
class Served:
    """A studio on a port of this machine."""

    studio: StubStudio
    port: int
    keys: Keys
    limits: Limits
    loop: asyncio.AbstractEventLoop = field(repr=False)

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.port}"

    @property
    def origin(self) -> str:
        return f"http://{self.host}"

    @property
    def cookie(self) -> str:
        return f"carillon_studio_{self.port}={self.keys.cookie}"

    def ask(
        self,
        path: str,
        method: str = "GET",
        body: Any = None,
        headers: Mapping[str, str | None] | None = None,
    ) -> Answer:
        """Ask as the page does; `headers` of None are left out."""
        given: dict[str, str | None] = {"Host": self.host, "Cookie": self.cookie}
        if method == "POST":
            given["Origin"] = self.origin
        given |= headers or {}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=SECONDS)
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, value in given.items():
                if value is not None:
                    connection.putheader(name, value)
            if isinstance(body, bytes) and "Content-Length" not in given:
                connection.putheader("Content-Length", str(len(body)))
            if body is not None and not isinstance(body, bytes):
                connection.putheader("Transfer-Encoding", "chunked")
            connection.endheaders(
                body, encode_chunked=body is not None and not isinstance(body, bytes)
            )
            answer = connection.getresponse()
            return Answer(answer.status, answer.headers, answer.read())
        finally:
            connection.close()

    def upload(self, kind: str, name: str, content: bytes) -> Answer:
        return self.ask(f"/{kind}?name={quote(name, safe='')}", "POST", content)

    def posting(self, kind: str, rest: str) -> bytes:
        """A request of the page's to upload something, whose other headers are the rest."""
        head = f"POST /{kind} HTTP/1.1\r\nHost: {self.host}\r\nCookie: {self.cookie}\r\n"
        return f"{head}Origin: {self.origin}\r\n{rest}".encode()

    def raw(self, request: bytes) -> bytes:
        """What comes back on bytes of one's own making, until the server closes."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=SECONDS) as stream:
            stream.sendall(request)
            stream.shutdown(socket.SHUT_WR)
            pieces = []
            while piece := stream.recv(1 << 16):
                pieces.append(piece)
            return b"".join(pieces)

    def talk(
        self, headers: Mapping[str, str | None] | None = None, **options: Any
    ) -> ClientConnection:
        """A WebSocket of the page's; `headers` of None are left out."""
        given: dict[str, str | None] = {"Cookie": self.cookie, "Origin": self.origin}
        given |= headers or {}
        return connect(
            options.pop("address", f"ws://{self.host}/socket"),
            additional_headers={k: v for k, v in given.items() if v is not None},
            open_timeout=SECONDS,
            max_size=None,
            proxy=None,
            **options,
        )

    def soon(self, function: Any, *arguments: Any) -> None:
        """Call a function in the server's loop, and wait for it."""
        done = threading.Event()
        self.loop.call_soon_threadsafe(lambda: (function(*arguments), done.set()))
        assert done.wait(SECONDS)


@contextmanager
def served(
    limits: Limits | None = None,
    host: str = "127.0.0.1",
    connections: Connections | None = None,
    studio: StubStudio | None = None,
    port: int | None = None,
) -> Iterator[Served]:
    """A made-up studio, served by a thread."""
    studio, keys, limits = studio or StubStudio(), Keys(), limits or Limits()
    with listen(host, port) as listener:
        port = listener.getsockname()[1]
        server = make_server(studio, listener, host, keys, limits, connections)
        loop = asyncio.new_event_loop()
        started = threading.Event()

        def work() -> None:
            loop.run_until_complete(serve_and_close(server, listener, studio, started.set))
            loop.close()

        thread = threading.Thread(target=work)
        thread.start()
        try:
            assert started.wait(SECONDS)
            yield Served(studio, port, keys, limits, loop)
        finally:
            server.should_exit = True
            thread.join(SECONDS)
            assert not thread.is_alive() and getattr(studio, "closed", True)


def next_event(page: ClientConnection, event: str) -> dict[str, Any]:
    """The next event of a kind, binary ones left out."""
    while True:
        message = page.recv(timeout=SECONDS)
        if isinstance(message, str) and json.loads(message).get("event") == event:
            found: dict[str, Any] = json.loads(message)
            return found


def reply_of(page: ClientConnection, message: Any) -> dict[str, Any]:
    """Send a message, as JSON unless it is bytes or text, and wait for a reply."""
    page.send(message if isinstance(message, (str, bytes)) else json.dumps(message))
    while True:
        answer = page.recv(timeout=SECONDS)
        if isinstance(answer, str) and "reply" in json.loads(answer):
            found: dict[str, Any] = json.loads(answer)
            return found
