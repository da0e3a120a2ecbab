"""A server that listens until it is told to end."""

import asyncio
import logging
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import uvicorn

from carillon.errors import UserError
from carillon.files.paths import cause
from studio.interface import Studio
from studio.server.app import make_app
from studio.server.connections import BURST, Connections, most_connections, protocols
from studio.server.guard import Keys
from studio.server.uploads import Limits

FIRST_PORT = 8620
"""Port that is tried first, and the next ones after it."""
PORTS = 20
"""Number of ports that are tried before the system chooses one."""
QUEUE = 128
"""Connections that wait in the system until they are accepted."""
ENDING_SECONDS = 3
"""Time for answers under way when the server ends."""
CLOSING_SECONDS = 20
"""Time for the studio to save and to end its processes."""
ENDINGS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Signals that end the server."""


def listen(host: str, port: int | None) -> socket.socket:
    """A socket that listens at an address, or a name of one, and a port.

    None takes the first free one from `FIRST_PORT` on.  Raises UserError if the port is in use or
    not allowed, or the address is not one of this machine's.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host, port or 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (OSError, UnicodeError):
        raise UserError(f"--host {host}: is no address of this machine") from None
    tried = [port] if port is not None else [*range(FIRST_PORT, FIRST_PORT + PORTS), 0]
    for each in tried:
        listener = socket.socket(family, socket.SOCK_STREAM)
        # A port whose last connections are still ending is free; one that is listened on is not.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((address[0], each, *address[2:]))
            listener.listen(QUEUE)
        except OSError as error:
            listener.close()
            failure = error
            continue
        listener.setblocking(False)
        return listener
    raise UserError(
        f"{host}:{port or FIRST_PORT}: cannot be listened on ({cause(failure)}); name another "
        "--port, or none and a free one is taken"
    )


def address_of(listener: socket.socket, host: str) -> str:
    """Where the page is found, without its token: `http://127.0.0.1:8620/`."""
    name = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)
    return f"http://{name}:{listener.getsockname()[1]}/"


def serve(
    studio: Studio,
    listener: socket.socket,
    host: str,
    keys: Keys,
    limits: Limits | None = None,
    ready: Callable[[], None] | None = None,
) -> None:
    """Serve until Ctrl-C, or a signal that asks to end; then close the studio.

    `ready` is called once requests are answered.
    """
    server = make_server(studio, listener, host, keys, limits or Limits())
    with _ended_by_signals():
        asyncio.run(serve_and_close(server, listener, studio, ready))


def make_server(
    studio: Studio,
    listener: socket.socket,
    host: str,
    keys: Keys,
    limits: Limits,
    connections: Connections | None = None,
) -> uvicorn.Server:
    """The server, which has not begun yet; `connections` are made from the limits if not given."""
    if connections is None:
        most = most_connections(limits.connections)
        connections = Connections(most, limits.waiting_seconds)
    http, page = protocols(connections)
    # Of what uvicorn tells, faults of the program's alone are of use to people.
    logging.getLogger("uvicorn.error").addFilter(lambda record: record.exc_info is not None)
    config = uvicorn.Config(
        make_app(studio, keys, host, listener.getsockname()[1], limits, connections.let_in),
        http=http,
        ws=page,
        loop="asyncio",
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        backlog=BURST,
        ws_max_size=limits.message_bytes,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=ENDING_SECONDS,
    )
    return uvicorn.Server(config)


async def serve_and_close(
    server: uvicorn.Server,
    listener: socket.socket,
    studio: Studio,
    ready: Callable[[], None] | None = None,
) -> None:
    """Start the studio, serve until the server is told to end, and close the studio."""
    try:
        await studio.start()
        await _serve(server, listener, ready)
    finally:
        # However often somebody asks to end: what is not saved is saved here.
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOSING_SECONDS):
                await studio.close()


async def _serve(
    server: uvicorn.Server, listener: socket.socket, ready: Callable[[], None] | None
) -> None:
    serving = asyncio.create_task(server.serve([listener]))
    if hasattr(signal, "SIGHUP") and _in_main_thread():
        # A terminal that is closed; uvicorn itself takes up the others.
        signal.signal(signal.SIGHUP, server.handle_exit)
    while not (server.started or serving.done()):
        await asyncio.sleep(0.01)
    if not serving.done():
        # Of those that wait, the server takes few at a time.
        listener.listen(QUEUE)
        if ready is not None:
            ready()
    await serving


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """Let signals end the server and nothing else: uvicorn raises them again when it is done."""
    if not _in_main_thread():
        yield
        return
    before = {each: signal.signal(each, lambda *_: None) for each in ENDINGS}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
