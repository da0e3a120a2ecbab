"""Who is connected: few at a time, and who has not been let in goes first."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from carillon.files.system import optional

BURST = 16
"""Connections that are accepted at once, before any of them is looked at."""
LEAST = 16
"""Connections that are borne however few descriptors there are: a page opens half as many."""
RESERVED = 128
"""Descriptors that connections leave to saving, reading and the processes that compute."""

Client = tuple[str, int]


def _later(seconds: float, function: Callable[[], None]) -> asyncio.TimerHandle:
    return asyncio.get_running_loop().call_later(seconds, function)


@dataclass
class _Connection:
    """A connection by its transport; `due` is when it ends unless it is let in."""

    transport: asyncio.Transport
    client: Client | None
    due: asyncio.TimerHandle | None


class Connections:
    """Connections to a server, `most` at a time; used in the thread of its event loop alone.

    One is let in once it has asked for something that it may have.  One that was not ends after
    some seconds, whatever it says meanwhile, and makes room where there are too many: so whoever
    has no token keeps out nobody who has one.  `later` calls a function after some seconds.
    """

    def __init__(
        self,
        most: int,
        seconds: float,
        later: Callable[[float, Callable[[], None]], Any] = _later,
    ) -> None:
        self._most, self._seconds, self._later = most, seconds, later
        self._open: dict[asyncio.Transport, _Connection] = {}

    def __len__(self) -> int:
        return len(self._open)

    def opened(self, transport: asyncio.Transport) -> None:
        """Take up a connection, or refuse it if there is no room even without those that wait.

        One that is known already, as it goes on as a WebSocket, stays what it is.
        """
        if transport in self._open:
            return
        if len(self._open) >= self._most and not self._make_room():
            transport.abort()
            return
        due = self._later(self._seconds, lambda: self._end(transport))
        peer = transport.get_extra_info("peername")
        client = None if not peer else (str(peer[0]), int(peer[1]))
        self._open[transport] = _Connection(transport, client, due)

    def closed(self, transport: asyncio.Transport) -> None:
        """Forget a connection that has ended."""
        known = self._open.pop(transport, None)
        if known is not None and known.due is not None:
            known.due.cancel()

    def let_in(self, client: Any) -> None:
        """Let the connection of a client stay, by the client's address and port."""
        for each in self._open.values():
            if each.due is not None and client is not None and each.client == tuple(client):
                each.due.cancel()
                each.due = None

    def _make_room(self) -> bool:
        oldest = next((each for each in self._open.values() if each.due is not None), None)
        if oldest is not None:
            self._end(oldest.transport)
        return oldest is not None

    def _end(self, transport: asyncio.Transport) -> None:
        self.closed(transport)
        transport.abort()


def most_connections(requested: int) -> int:
    """Connections that may be open at a time, so that descriptors are left for files."""
    resource = optional("resource")
    if resource is None:  # Windows, which has no such limit
        return requested
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed == resource.RLIM_INFINITY:
        return requested
    return min(requested, max(LEAST, allowed - RESERVED))


def protocols(
    connections: Connections,
) -> tuple[type[asyncio.Protocol], type[asyncio.Protocol]]:
    """Protocols of the server, for HTTP and WebSockets, that tell of their connections."""

    class Counted(asyncio.Protocol):
        transport: asyncio.Transport

        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            assert isinstance(transport, asyncio.Transport)
            super().connection_made(transport)
            connections.opened(transport)

        def connection_lost(self, exc: Exception | None) -> None:
            connections.closed(self.transport)
            super().connection_lost(exc)

    class Http(Counted, H11Protocol):  # type: ignore[misc]
        pass

    class Page(Counted, WebSocketsSansIOProtocol):  # type: ignore[misc]
        pass

    return Http, Page
