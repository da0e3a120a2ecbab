"""Connections of those who are not let in: they end, they make room, and the page still answers."""

import asyncio
import resource
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field

import pytest

from studio.server.connections import BURST, LEAST, RESERVED, Connections, most_connections
from studio.server.uploads import Limits
from tests.patience import wait_for
from tests.studio_server import SECONDS, Served, next_event, reply_of, served

MOST = 8


@dataclass
class Due:
    function: Callable[[], None]
    is_off: bool = False

    def cancel(self) -> None:
        self.is_off = True


@dataclass
class Clock:
    """Time that passes when it is told to."""

    due: list[tuple[float, Due]] = field(default_factory=list)

    def later(self, seconds: float, function: Callable[[], None]) -> Due:
        self.due.append((seconds, Due(function)))
        return self.due[-1][1]

    def pass_(self) -> None:
        due, self.due = self.due, []
        for _, each in due:
            if not each.is_off:
                each.function()


class Transport(asyncio.Transport):
    """A connection that is none."""

    def __init__(self, port: int) -> None:
        super().__init__({"peername": ("127.0.0.1", port, 0, 0)})
        self.port, self.is_ended = port, False

    def abort(self) -> None:
        self.is_ended = True


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def connections(clock) -> Connections:
    return Connections(MOST, 10.0, clock.later)


def opened(connections: Connections, ports: range) -> list[Transport]:
    found = [Transport(port) for port in ports]
    for each in found:
        connections.opened(each)
    return found


def test_who_asks_nothing_in_time_is_ended(connections, clock):
    first, second, third = opened(connections, range(3))
    assert [seconds for seconds, _ in clock.due] == [10.0] * 3
    connections.let_in(("127.0.0.1", second.port))
    connections.let_in(["127.0.0.1", second.port])
    connections.let_in(None)
    connections.closed(third)
    clock.pass_()
    assert (first.is_ended, second.is_ended, third.is_ended) == (True, False, False)
    assert len(connections) == 1


def test_who_has_waited_longest_makes_room(connections):
    waiting = opened(connections, range(MOST))
    connections.let_in(("127.0.0.1", 0))
    (new,) = opened(connections, range(100, 101))
    assert [each.port for each in waiting if each.is_ended] == [1] and not new.is_ended
    opened(connections, range(200, 300))
    assert not waiting[0].is_ended and all(each.is_ended for each in waiting[1:])
    assert len(connections) == MOST


def test_who_was_let_in_is_never_ended_for_others(connections):
    inside = opened(connections, range(MOST))
    for each in inside:
        connections.let_in(("127.0.0.1", each.port))
    (refused,) = opened(connections, range(100, 101))
    assert refused.is_ended and not any(each.is_ended for each in inside)
    connections.closed(refused)
    connections.closed(inside[0])
    (new,) = opened(connections, range(101, 102))
    assert not new.is_ended and len(connections) == MOST


def test_a_connection_that_goes_on_as_a_websocket_is_counted_once(connections, clock):
    (page,) = opened(connections, range(1))
    connections.opened(page)
    assert len(connections) == len(clock.due) == 1


@pytest.mark.parametrize(
    ("allowed", "most"),
    [
        (resource.RLIM_INFINITY, 200),
        (1024, 200),
        (RESERVED + 100, 100),
        (RESERVED, LEAST),
        (20, LEAST),
    ],
)
def test_descriptors_are_left_for_files(monkeypatch, allowed, most):
    monkeypatch.setattr(resource, "getrlimit", lambda _: (allowed, allowed))
    assert most_connections(200) == most
    assert BURST < RESERVED // 4


# ----------------------------------------------------------------------- over real sockets


@pytest.fixture
def server(connections) -> Iterator[Served]:
    with served(connections=connections) as found:
        yield found


@pytest.fixture
def idle(server) -> Iterator[Callable[[int, bytes], list[socket.socket]]]:
    """Opens connections that say something that is no request, or nothing."""
    with ExitStack() as ending:

        def idle(count: int, words: bytes = b"") -> list[socket.socket]:
            found = []
            for _ in range(count):
                stream = socket.create_connection(("127.0.0.1", server.port), timeout=SECONDS)
                found.append(ending.enter_context(stream))
                stream.sendall(words)
            return found

        yield idle


def is_ended(stream: socket.socket) -> bool:
    """Wait until the server closes a connection."""
    try:
        return stream.recv(1) == b""
    except ConnectionResetError:
        return True


def test_a_flood_without_a_token_keeps_nobody_out(server, connections, idle):
    with server.talk() as page:
        next_event(page, "state")
        assert all(map(is_ended, idle(5 * MOST)[: 4 * MOST]))
        assert server.ask("/").status == 200
        assert server.ask(f"/?token={server.keys.token}", headers={"Cookie": None}).status == 200
        assert server.ask("/", headers={"Cookie": None}).status == 403
        assert "error" not in reply_of(page, {"id": 1, "do": "undo"})
        assert len(connections) <= MOST


@pytest.mark.parametrize("words", [b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: x\r\nA: "])
def test_connections_that_never_ask_are_ended(server, connections, clock, idle, words):
    with server.talk() as page:
        next_event(page, "state")
        waiting = idle(2, words)
        wait_for(lambda: len(connections) == 3, "connections")
        server.soon(clock.pass_)
        assert all(map(is_ended, waiting))
        assert "error" not in reply_of(page, {"id": 1, "do": "undo"})


@pytest.mark.parametrize("path", ["/", "/socket"])
def test_who_is_refused_does_not_stay_connected(server, connections, clock, idle, path):
    words = (
        f"GET {path} HTTP/1.1\r\nHost: {server.host}\r\nOrigin: {server.origin}\r\n"
        "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    (stream,) = idle(1, words.encode())
    assert stream.recv(12).endswith(b"403")
    server.soon(clock.pass_)
    while stream.recv(1 << 16):
        pass
    wait_for(lambda: len(connections) == 0, "connections to end")


def test_limits_say_how_many_and_how_long():
    limits = Limits()
    assert limits.connections >= 2 * LEAST and 5.0 <= limits.waiting_seconds <= 60.0
