"""Paths, sizes, contents, names and messages that attack the studio's server, which bears them."""

import re
import socket
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed

from studio.server.page_files import PAGE, page_table
from studio.server.uploads import Limits, plain_name
from studio.session.handlers import HANDLERS
from tests.patience import wait_for
from tests.studio_server import ROUTES, SECONDS, Served, next_event, reply_of, served

SMALL = Limits(mesh_bytes=5000, clip_bytes=3000, message_bytes=2000)
HASTY = replace(SMALL, idle_seconds=0.4, upload_seconds=1.0)


@pytest.fixture(scope="module")
def server():
    with served(SMALL) as found:
        yield found


@pytest.fixture(scope="module")
def hasty():
    """A server that waits for no upload."""
    with served(HASTY) as found:
        yield found


# ----------------------------------------------------------------------------- paths

CLIMBS = (
    "/page/../server/guard.py",
    "/page/../../pyproject.toml",
    "/page/../../../../../../etc/passwd",
    "/page/%2e%2e/%2e%2e/pyproject.toml",
    "/page/%2e%2e%2f%2e%2e%2fpyproject.toml",
    "/page/%252e%252e/%252e%252e/pyproject.toml",
    "/page/%25252e%25252e/pyproject.toml",
    "/page/..%5c..%5cpyproject.toml",
    "/page/..\\..\\pyproject.toml",
    "/page/..%c0%af..%c0%afpyproject.toml",
    "/page/%c0%ae%c0%ae/pyproject.toml",
    "/page/..%ef%bc%8fpyproject.toml",
    "/page/....//....//pyproject.toml",
    "/page/..;/..;/pyproject.toml",
    "/page//etc/passwd",
    "//etc/passwd",
    "/page/%2fetc%2fpasswd",
    "/page/file:///etc/passwd",
    "/page/main.js%00.css",
    "/page/main.js/",
    "/page/./main.js",
    "/page/x/../main.js",
    "/page/MAIN.JS",
    "/page/",
    "/page",
    "/page/index.html",
    "/page/vendor",
    "/page/vendor/vendor.json",
    "/page/types.d.ts/../main.js",
    "/static/../page/main.js",
    "/clip/../surface/1",
    "/clip/..%2f..%2fetc/sound",
    "/clip/c1/..%2fsound",
    "/export/..%2f..%2fetc%2fpasswd",
    "/export/h5/../../etc",
    "/surface/../page/main.js",
    "/surface/1e0",
    "/surface/-1",
    "/surface/%D9%A1",
    "/surface/" + "9" * 5000,
)


@pytest.mark.parametrize("path", CLIMBS)
def test_no_path_leads_out_of_the_table(server, path):
    head = f"Host: {server.host}\r\nCookie: {server.cookie}\r\nConnection: close\r\n\r\n"
    answer = server.raw(b"GET " + path.encode("latin-1") + b" HTTP/1.1\r\n" + head.encode())
    status, content = answer.split()[1], answer.partition(b"\r\n\r\n")[2]
    assert status in (b"400", b"404"), answer[:200]
    assert not any(word in content for word in (b"root:", b"[project]", b"import ", b"class "))


def test_the_table_holds_files_of_the_page_alone():
    table = page_table()
    assert "/page/main.js" in table and "/page/vendor/three/three.module.js" in table
    for address, path in table.items():
        assert path.resolve().is_relative_to(PAGE) and path.is_file() and not path.is_symlink()
        assert ".." not in address and "node_modules" not in address


def test_links_out_of_the_page_are_not_in_the_table(tmp_path):
    (tmp_path / "page").mkdir()
    (tmp_path / "secret.js").write_text("secret")
    (tmp_path / "page" / "linked.js").symlink_to(tmp_path / "secret.js")
    (tmp_path / "page" / "folder").symlink_to(tmp_path)
    (tmp_path / "page" / ".hidden.js").touch()
    (tmp_path / "page" / "own.js").touch()
    assert list(page_table(tmp_path / "page")) == ["/page/own.js"]


# ----------------------------------------------------------------- sizes and patience


@pytest.mark.parametrize(("kind", "most"), [("mesh", SMALL.mesh_bytes), ("clip", SMALL.clip_bytes)])
def test_files_that_are_too_large_are_refused_however_they_are_sent(server, kind, most):
    before, ending = list(server.studio.uploads), {"mesh": ".stl", "clip": ".wav"}[kind]
    piece = b"RIFF" * 256
    whole = piece * (most // len(piece) + 1)
    for body in (whole, iter([piece] * (len(whole) // len(piece))), iter([piece] * 1000)):
        try:
            answer = server.ask(f"/{kind}?name=a{ending}", "POST", body)
        except (ConnectionResetError, BrokenPipeError):
            continue  # it was told to go, and did not listen
        assert answer.status == 413
        assert "larger" in answer.error and "MiB" in answer.error
    assert server.studio.uploads == before
    assert server.ask(f"/{kind}?name=a{ending}", "POST", whole[:most]).status == 200


def test_a_length_that_is_only_declared_is_refused_at_once(server):
    begin = time.monotonic()
    answer = server.raw(server.posting("mesh", "Content-Length: 99999999999\r\n\r\n"))
    assert answer.split()[1] == b"413" and time.monotonic() - begin < SMALL.idle_seconds


@pytest.mark.parametrize(
    "lengths",
    [
        "Content-Length: 5\r\nContent-Length: 6\r\n",
        "Content-Length: -1\r\n",
        "Content-Length: 0x10\r\n",
        "Transfer-Encoding: gzip\r\n",
        "Transfer-Encoding: chunked, identity\r\n",
    ],
)
def test_lengths_that_can_be_read_in_two_ways_are_refused(server, lengths):
    answer = server.raw(server.posting("mesh", f"{lengths}\r\nhello"))
    assert answer.split()[1] in (b"400", b"501")


@pytest.mark.parametrize("pause", [0.15, 3.0])
def test_slow_uploads_are_ended(hasty, pause):
    """One that stops, and one that goes on for ever by a byte at a time."""
    with socket.create_connection(("127.0.0.1", hasty.port), timeout=SECONDS) as stream:
        stream.sendall(hasty.posting("clip", "Content-Length: 900\r\n\r\nR"))
        ended, drops = threading.Event(), []

        def drip() -> None:
            while not ended.wait(pause):
                drops.append(pause)
                try:
                    stream.sendall(b"I")
                except OSError:
                    return

        thread = threading.Thread(target=drip)
        thread.start()
        answer = stream.recv(1 << 16)
        while b"slowly" not in answer and (more := stream.recv(1 << 16)):
            answer += more
        ended.set()
        thread.join()
    assert answer.split()[1] == b"408" and b"slowly" in answer
    # By a clock that is as busy as the server.
    assert sum(drops) < 3 * HASTY.upload_seconds


def test_uploads_that_break_off_leave_the_server_well(server):
    for _ in range(3 * SMALL.uploads):
        with socket.create_connection(("127.0.0.1", server.port), timeout=SECONDS) as stream:
            stream.sendall(server.posting("mesh", "Content-Length: 900\r\n\r\nR"))
    wait_for(lambda: server.upload("mesh", "a.stl", b"solid").status == 200, "the uploads to end")


def test_only_some_files_are_taken_at_a_time(server):
    streams = [
        socket.create_connection(("127.0.0.1", server.port), timeout=SECONDS)
        for _ in range(SMALL.uploads)
    ]
    try:
        for stream in streams:
            stream.sendall(server.posting("mesh", "Content-Length: 9\r\n\r\nR"))
        answers = []

        def is_refused() -> bool:
            answers.append(server.upload("mesh", "a.stl", b"solid"))
            return answers[-1].status != 200

        wait_for(is_refused, "all of them to be under way")
        assert answers[-1].status == 503 and "wait" in answers[-1].error
    finally:
        for stream in streams:
            stream.close()


def test_headers_have_an_end(server):
    endless = b"GET / HTTP/1.1\r\nHost: x\r\nA: " + b"a" * 300_000
    try:
        answer = server.raw(endless)
    except OSError:
        return  # it was told to go, and did not listen
    assert answer.split()[1] in (b"400", b"431")


# ------------------------------------------------------------------ contents and names


@pytest.mark.parametrize(
    ("kind", "content"),
    [("mesh", b"broken"), ("clip", b"no RIFF"), ("mesh", b""), ("clip", b"")],
)
def test_contents_that_are_no_good_are_one_sentence(server, kind, content):
    answer = server.upload(kind, "a.wav", content)
    assert answer.status == 400 and "expected" in answer.error


NAMES = {
    "plate.wav": "plate.wav",
    "../../etc/passwd": "passwd",
    "/etc/passwd": "passwd",
    "..\\..\\boot.ini": "boot.ini",
    "C:\\x\\y.wav": "y.wav",
    "a\r\nSet-Cookie: b=c.wav": "aSet-Cookie: b=c.wav",
    "a\x00b.wav": "ab.wav",
    "\u202egnp.wav": "gnp.wav",
    "<img src=x onerror=alert(1)>.wav": "<img src=x onerror=alert(1)>.wav",
    "</script><script>alert(1)<!--": "script><script>alert(1)<!--",
    "....": "clip",
    "": "clip",
    "~": "clip",
    ".bashrc": "bashrc",
    "Gl\u00f6ckchen \u266a.wav": "Gl\u00f6ckchen \u266a.wav",
    "x" * 5000 + ".wav": "x" * 96 + ".wav",
}


@pytest.mark.parametrize("name", NAMES)
def test_names_of_files_are_names_and_nothing_else(server, name):
    assert plain_name(name, "clip") == NAMES[name]
    before = list(server.studio.uploads)
    answer = server.upload("clip", name, b"RIFF")
    assert answer.headers["Set-Cookie"] is None
    if NAMES[name].endswith(".wav"):
        assert answer.status == 200 and server.studio.uploads[-1][1] == NAMES[name]
    else:
        assert answer.status == 400 and server.studio.uploads == before


@pytest.mark.parametrize("kind", ["mesh", "clip"])
@pytest.mark.parametrize(
    "name", ["pan.yaml", "pan.h5", "a.py", "page.html", "run.sh", "a.stl.exe", "a", "a.", "a.zip"]
)
def test_only_meshes_and_clips_come_to_lie_among_the_persons_files(server, kind, name):
    before = list(server.studio.uploads)
    answer = server.upload(kind, name, b"RIFF")
    assert answer.status == 400 and "ends in" in answer.error
    assert server.studio.uploads == before


def test_script_in_names_is_text_wherever_it_comes_back(server):
    name = "</script><img src=x onerror=alert(1)>"
    assert server.ask("/clip/" + "%3Cscript%3E" + "/sound").status == 404
    with server.talk() as page:
        assert "error" not in reply_of(
            page, {"id": 1, "do": "add_target", "vertex": 3, "name": name}
        )
        assert next_event_targets(page, server)[-1] == name
        found = server.ask(
            f"/export/wav?target={name.replace('<', '%3C').replace('>', '%3E').replace(' ', '%20')}"
        )
        told = found.headers["Content-Disposition"]
        assert found.status == 200 and re.fullmatch(
            r"attachment; filename\*=UTF-8''[\w.%~-]+", told
        )
        error = server.ask("/export/wav?target=%3Cscript%3E%0d%0aX:y")
        assert error.status == 400 and error.headers["X"] is None
        assert error.headers["Content-Type"] == "application/json"
        assert reply_of(page, {"id": 2, "do": "remove_target", "target": name}) == {"reply": 2}


def next_event_targets(page, server: Served) -> list[str]:
    server.soon(server.studio.changed)
    return [each["name"] for each in next_event(page, "state")["targets"]]


@pytest.mark.parametrize("route", [*ROUTES, "/nowhere", "/clip/c9/sound", "/export/exe"])
def test_browsers_are_told_to_take_nothing_for_what_it_is_not(server, route):
    headers = server.ask(route).headers
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert headers["Cross-Origin-Opener-Policy"] == "same-origin"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["X-Frame-Options"] == "DENY"
    assert headers["Server"] is None
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert headers["Cache-Control"] == ("no-cache" if route.startswith("/page/") else "no-store")


# -------------------------------------------------------------------------- methods


@pytest.mark.parametrize(
    "method", ["PUT", "DELETE", "PATCH", "TRACE", "CONNECT", "PROPFIND", "get"]
)
def test_other_methods_do_nothing(server, method):
    for route in (*ROUTES, "/mesh", "/clip", "/socket"):
        own = {"Origin": server.origin}
        assert server.ask(route, method, headers=own).status in (400, 403, 404, 405)


def test_what_changes_something_is_asked_for_by_post_alone(server):
    for route in ("/mesh", "/clip"):
        assert server.ask(route).status == 405
        assert server.ask(route, "HEAD").status == 405
    for route in ROUTES:
        assert server.ask(route, "POST", b"x").status == 405


# -------------------------------------------------------------- messages on WebSockets


@pytest.mark.parametrize("message", ["x" * 3000, b"x" * 3000])
def test_messages_that_are_too_long_end_the_connection(server, message):
    with server.talk() as page:
        with pytest.raises(ConnectionClosed) as caught:
            reply_of(page, message)
        assert caught.value.rcvd is not None and caught.value.rcvd.code == 1009
    with server.talk() as page:
        assert next_event(page, "state")["name"] == "stub"


MALFORMED = (
    "",
    "{",
    "null",
    "[]",
    '"optimise"',
    "\x00",
    "[" * 1900,
    '{"id": 1, "do": "optimise"} {}',
    '{"id": NaN, "do": "optimise"}',
    '{"id": 1e400, "do": "optimise"}',
    '{"id": ' + "9" * 1500 + ', "do": "optimise"}',
    b"binary",
    {"do": "optimise"},
    {"id": True, "do": "optimise"},
    {"id": "1", "do": "optimise"},
    {"id": 1.5, "do": "optimise"},
    {"id": None, "do": "optimise"},
    {"id": [1], "do": "optimise"},
)
WRONG = (
    {"id": 1},
    {"id": 1, "do": "exec"},
    {"id": 1, "do": "__class__"},
    {"id": 1, "do": ["optimise"]},
    {"id": 1, "do": {"optimise": 1}},
    {"id": 1, "do": "add_target"},
    {"id": 1, "do": "add_target", "vertex": 3, "path": "/etc/passwd"},
    {"id": 1, "do": "optimise", "__proto__": {"x": 1}},
    {"id": 1, "do": "optimise", "self": 1},
    {"id": 1, "do": "open_mesh", "mesh": "x" * 1500},
    {"id": 1, "do": "open_mesh", "mesh": "/etc/passwd"},
    {"id": 1, "do": "add_target", "vertex": 10**9},
    {"id": 1, "do": "add_target", "vertex": "<script>"},
    {"id": 1, "do": "add_target", "vertex": True},
    {"id": 1, "do": "add_target", "vertex": 1.5},
    {"id": 1, "do": "add_target", "vertex": 10**30},
    {"id": 1, "do": "open_mesh", "mesh": ["builtin:bell"]},
    {"id": 1, "do": "open_mesh", "mesh": None},
    {"id": 1, "do": "open_project", "project": 7},
    {"id": 1, "do": "save", "name": None},
    {"id": 1, "do": "open_heads", "folder": ["people"]},
    {"id": 1, "do": "open_heads", "folder": "x" * 1500},
    {"id": 1, "do": "open_heads", "folder": "people", "anew": 1},
    {"id": 1, "do": "compare_heads", "number": 0, "score": 6},
    {"id": 1, "do": "compare_heads", "number": 0, "score": 2.5},
    {"id": 1, "do": "compare_heads", "number": -1, "score": 3},
    {"id": 1, "do": "write_blend", "file": "../blend.sofa"},
    {"id": 1, "do": "fine", "on": "yes"},
    {"id": 1, "do": "fine", "on": 1},
    {"id": 1, "do": "change_settings", "settings": []},
    {"id": 1, "do": "change_target", "target": "rim", "without": ["440"]},
    {"id": 1, "do": "change_target", "target": "rim", "without": 440.0},
    {"id": 1, "do": "change_target", "target": "rim", "modes": 2.5},
)


@pytest.mark.parametrize("message", [*MALFORMED, *WRONG], ids=lambda each: str(each)[:40])
def test_messages_that_make_no_sense_are_one_sentence(server, message):
    with server.talk() as page:
        reply = reply_of(page, message)
        assert reply["reply"] == (1 if message in WRONG else None)
        assert reply["error"] and "\n" not in reply["error"] and len(reply["error"]) < 1300
        assert "Traceback" not in reply["error"] and "failed" not in reply["error"]
        assert reply_of(page, {"id": 2, "do": "stop"}) == {"reply": 2}


def test_every_call_of_the_protocol_is_known_and_no_other():
    text = (Path(__file__).parent.parent / "docs/contributing/studio.md").read_text()
    table = text.partition("| call | with |")[2].partition("\n\n")[0]
    named = re.findall(r"`(\w+)`", "\n".join(line.split("|")[1] for line in table.splitlines()[2:]))
    assert sorted(named) == sorted(HANDLERS)
