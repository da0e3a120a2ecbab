"""Who asks the studio's server and may not: each attack over real sockets, and each refused."""

import argparse
import base64
import hashlib
import re
import socket

import pytest
from websockets.exceptions import InvalidStatus

from carillon.errors import UserError
from carillon.parameters.command_line import collect
from studio.commands.studio import StudioOptions
from studio.server.guard import Keys, host_names
from studio.server.page_files import PAGE, page_policy
from studio.server.serve import listen
from studio.server.uploads import Limits
from tests.studio_server import ROUTES, SECONDS, Served, served

SMALL = Limits(
    mesh_bytes=5000, clip_bytes=3000, message_bytes=2000, idle_seconds=0.4, upload_seconds=1.0
)


@pytest.fixture(scope="module")
def server():
    with served(SMALL) as found:
        yield found


def refused(answer) -> str:
    """The sentence of a refusal, which holds nothing of the page's."""
    assert answer.status == 403
    return answer.error


# ------------------------------------------------------------------------------ Host

FOREIGN_HOSTS = (
    "evil.example",
    "evil.example:{port}",
    "127.0.0.1.evil.example:{port}",
    "localhost.evil.example:{port}",
    "evil-localhost:{port}",
    "localhost.:{port}",
    "127.0.0.1@evil.example:{port}",
    "0.0.0.0:{port}",
    "[::]:{port}",
    "127.0.0.2:{port}",
    "2130706433:{port}",
    "0x7f.1:{port}",
    "192.168.0.1:{port}",
    "127.0.0.1:99999",
    "127.0.0.1:",
    "127.0.0.1:{port}:{port}",
    "127.0.0.1:{port}/",
    "<script>alert(1)</script>",
    "",
)


@pytest.mark.parametrize("host", FOREIGN_HOSTS)
def test_names_that_others_point_at_this_machine_are_refused(server, host):
    foreign = {"Host": host.format(port=server.port)}
    assert "Host" in refused(server.ask("/", headers=foreign))
    assert "Host" in refused(server.ask(f"/?token={server.keys.token}", headers=foreign))
    # A page that was loaded by that name has that name for its Origin, too.
    origin = {**foreign, "Origin": f"http://{foreign['Host']}"}
    assert "Host" in refused(server.ask("/mesh?name=a.stl", "POST", b"solid", origin))


def test_a_refusal_shows_no_markup_of_what_was_sent(server):
    answer = server.ask("/", headers={"Host": "<script>alert(1)</script>", "Accept": "text/html"})
    assert answer.status == 403 and b"<script" not in answer.content
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]


def test_no_host_and_two_hosts_are_refused(server):
    cookie = f"Cookie: {server.cookie}\r\n"
    for head in ("", f"Host: {server.host}\r\nHost: evil.example\r\n"):
        for version in ("1.0", "1.1"):
            answer = server.raw(f"GET / HTTP/{version}\r\n{head}{cookie}\r\n".encode())
            assert answer.split()[1] in (b"400", b"403")
    absolute = f"GET http://evil.example/ HTTP/1.1\r\nHost: {server.host}\r\n{cookie}"
    assert server.raw(f"{absolute}Connection: close\r\n\r\n".encode()).split()[1] == b"404"


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "LOCALHOST", "[::1]"])
@pytest.mark.parametrize("port", [None, 9000])
def test_names_of_this_machine_are_let_in_through_tunnels_too(server, name, port):
    host = f"{name}:{port or server.port}"
    assert server.ask("/", headers={"Host": host}).status == 200
    own = {"Host": host, "Origin": f"http://{host}"}
    assert server.ask("/mesh?name=a.stl", "POST", b"solid", own).status == 200


def test_a_server_for_others_takes_addresses_in_digits_and_its_own_name_only():
    assert host_names("127.0.0.1") == host_names("localhost") == {"127.0.0.1", "localhost", "::1"}
    assert "0.0.0.0" not in host_names("0.0.0.0")
    assert socket.gethostname().lower() in host_names("0.0.0.0")
    with served(host="0.0.0.0") as found:
        for host, status in (
            ("10.1.2.3", 200),
            ("[fe80::1]", 200),
            ("evil.example", 403),
            ("0.0.0.0", 403),
            ("[::]", 403),
        ):
            assert found.ask("/", headers={"Host": f"{host}:{found.port}"}).status == status, host


# ---------------------------------------------------------------------------- Origin

FOREIGN_ORIGINS = (
    None,
    "",
    "null",
    "http://evil.example",
    "http://evil.example:{port}",
    "http://127.0.0.1:{port}.evil.example",
    "http://evil.example/http://127.0.0.1:{port}",
    "http://evil127.0.0.1:{port}",
    "http://127.0.0.1:{port}@evil.example",
    "http://127.0.0.1",
    "http://127.0.0.1:{other}",
    "http://127.0.0.1:{port}0",
    "http://localhost:{port}",
    "https://127.0.0.1:{port}",
    "file://127.0.0.1:{port}",
    "127.0.0.1:{port}",
    "http://127.0.0.1:{port}/",
    "HTTP://127.0.0.1:{port}",
    "http://127.0.0.1:{port} http://evil.example",
    "http://evil.example, http://127.0.0.1:{port}",
)


def spelt(origin: str | None, server: Served) -> str | None:
    return None if origin is None else origin.format(port=server.port, other=server.port + 1)


@pytest.mark.parametrize("origin", FOREIGN_ORIGINS)
def test_pages_of_others_change_nothing(server, origin):
    headers = {"Origin": spelt(origin, server)}
    before = list(server.studio.uploads)
    for kind in ("mesh", "clip"):
        assert "Origin" in refused(server.ask(f"/{kind}?name=a.wav", "POST", b"RIFF", headers))
    assert server.studio.uploads == before


@pytest.mark.parametrize("origin", FOREIGN_ORIGINS)
def test_pages_of_others_get_no_websocket(server, origin):
    with pytest.raises(InvalidStatus) as caught:
        server.talk({"Origin": spelt(origin, server)})
    assert caught.value.response.status_code == 403


def test_two_origins_are_none(server):
    other = "Origin: http://evil.example\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
    assert server.raw(server.posting("mesh", other)).split()[1] == b"403"


@pytest.mark.parametrize("route", ROUTES)
def test_pages_of_others_read_nothing(server, route):
    assert "Origin" in refused(server.ask(route, headers={"Origin": "http://evil.example"}))
    assert server.ask(route).status == 200
    if route != "/":
        for site in ("cross-site", "same-site"):
            assert "site" in refused(server.ask(route, headers={"Sec-Fetch-Site": site}))
    for name in server.ask(route).headers:
        assert not name.lower().startswith("access-control-")


def test_preflights_are_not_answered(server):
    wanted = {"Origin": "http://evil.example", "Access-Control-Request-Method": "POST"}
    answer = server.ask("/mesh", "OPTIONS", headers=wanted)
    assert answer.status == 403 and answer.headers["Access-Control-Allow-Origin"] is None


# ------------------------------------------------------------------ token and cookie


@pytest.mark.parametrize("route", ROUTES)
def test_nothing_is_told_without_the_cookie(server, route):
    assert "let in" in refused(server.ask(route, headers={"Cookie": None}))


def test_the_token_is_good_for_a_cookie_and_for_nothing_else(server):
    token = server.keys.token
    answer = server.ask(f"/?token={token}", headers={"Cookie": None})
    assert answer.status == 200
    cookie = answer.headers["Set-Cookie"]
    assert {"HttpOnly", "SameSite=strict", "Path=/"} <= set(cookie.split("; "))
    assert cookie.startswith(server.cookie) and token not in cookie
    assert token.encode() not in answer.content
    assert answer.headers["Referrer-Policy"] == "no-referrer"
    assert answer.headers["Cache-Control"] == "no-store"
    name = server.cookie.partition("=")[0]
    for route in ROUTES[1:]:
        assert server.ask(f"{route}?token={token}", headers={"Cookie": None}).status == 403
        assert server.ask(route, headers={"Cookie": f"{name}={token}"}).status == 403


@pytest.mark.parametrize(
    "wrong",
    [
        "token=",
        "token=x",
        "token={start}",
        "token={token}x",
        "token={token}&token={token}",
        "token=%00{token}",
        "token=%ff%fe",
        "token={swapped}",
        "TOKEN={token}",
        "&" * 5000,
        "",
    ],
)
def test_wrong_tokens_give_no_cookie(server, wrong):
    token = server.keys.token
    query = wrong.format(token=token, start=token[:-1], swapped=token.swapcase())
    answer = server.ask(f"/?{query}", headers={"Cookie": None})
    assert answer.status in (400, 403) and answer.headers["Set-Cookie"] is None


@pytest.mark.parametrize(
    "wrong",
    [
        "{name}=",
        "{name}={start}",
        "{name}={value}x",
        "{name}0={value}",
        "{value}",
        '{name}="{value}"',
        "{name}={value},{name}={value}",
        "{name} {value}",
        "NAME={value}; {name}={value}%20",
        "a\x00b",
        "=;=;",
    ],
)
def test_wrong_cookies_are_refused(server, wrong):
    name, _, value = server.cookie.partition("=")
    cookie = wrong.format(name=name, value=value, start=value[:-1]).encode("latin-1")
    head = f"GET / HTTP/1.1\r\nHost: {server.host}\r\nConnection: close\r\nCookie: ".encode()
    assert server.raw(head + cookie + b"\r\n\r\n").split()[1] in (b"400", b"403")


FOREIGN_COOKIES = (
    "a=b c",
    'a={"x": [1, "2"]}',
    'a="b; c"',
    'a="unclosed',
    "a",
    "=x",
    "=",
    ";;",
    "a(b)=c",
    "a=b=c==",
    "\xe9=\xff",
    "Path=/; HttpOnly; expires=never",
    "{name}=of-a-former-start",
    '{name}=""',
    "{name}",
    "{name}=; {name}=x",
    "x{name}=1; {name}x=2",
)


@pytest.mark.parametrize("other", FOREIGN_COOKIES)
@pytest.mark.parametrize("form", ["{other}; {own}", "{own}; {other}", "{other};{own};{other}"])
def test_cookies_of_other_programs_do_not_matter(server, other, form):
    name = server.cookie.partition("=")[0]
    sent = form.replace("{other}", other).replace("{own}", server.cookie).replace("{name}", name)
    assert server.ask("/", headers={"Cookie": sent}).status == 200
    assert "let in" in refused(server.ask("/", headers={"Cookie": other.replace("{name}", name)}))


def test_secrets_are_random_and_not_shown():
    one, other = Keys(), Keys()
    found = {one.token, one.cookie, other.token, other.cookie}
    assert len(found) == 4 and all(len(each) >= 43 for each in found)
    assert not any(each in repr([one, other]) for each in found)


# --------------------------------------------------------------------- what may run


def test_the_page_runs_its_own_modules_and_its_import_map_alone(server):
    answer = server.ask("/")
    policy = dict(
        part.strip().partition(" ")[::2]
        for part in answer.headers["Content-Security-Policy"].split(";")
    )
    (text,) = re.findall(rb'<script type="importmap">(.*?)</script>', answer.content, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(text).digest()).decode()
    assert policy["script-src"] == f"'self' 'sha256-{digest}'"
    assert policy["default-src"] == policy["connect-src"] == "'self'"
    assert {policy[key] for key in ("object-src", "base-uri", "form-action")} == {"'none'"}
    assert "unsafe" not in str(policy) and "*" not in str(policy)
    assert "sha256" not in page_policy(b"<script>alert(1)</script>")


def test_the_page_has_nothing_inline_but_its_import_map():
    page = (PAGE / "index.html").read_text()
    scripts = re.findall(r"<script\b([^>]*)>(.*?)</script>", page, re.DOTALL)
    assert all("src=" in head or "importmap" in head for head, _ in scripts)
    assert not re.search(r"<style|\sstyle=|\son\w+=|javascript:", page)


# ------------------------------------------------------------------------ WebSockets


@pytest.mark.parametrize(
    "headers",
    [
        {"Cookie": None},
        {"Cookie": "carillon_studio_1=x"},
        {"Origin": None},
        {"Origin": "http://evil.example"},
        {"Sec-Fetch-Site": "cross-site"},
    ],
)
def test_websockets_need_cookie_and_origin(server, headers):
    with pytest.raises(InvalidStatus) as caught:
        server.talk(headers)
    assert caught.value.response.status_code == 403


@pytest.mark.parametrize("name", ["evil.example", "127.0.0.1.evil.example", "0.0.0.0"])
def test_websockets_by_foreign_names_are_refused(server, name):
    """As a page does that had its own name pointed at this machine."""
    stream = socket.create_connection(("127.0.0.1", server.port), timeout=SECONDS)
    host = f"{name}:{server.port}"
    with pytest.raises(InvalidStatus) as caught:
        server.talk({"Origin": f"http://{host}"}, address=f"ws://{host}/socket", sock=stream)
    assert caught.value.response.status_code == 403


@pytest.mark.parametrize("path", ["/", "/sockets", "/page/main.js", "/socket/", "/socket/../x"])
def test_there_is_one_websocket(server, path):
    with pytest.raises(InvalidStatus) as caught:
        server.talk(address=f"ws://{server.host}{path}")
    assert caught.value.response.status_code in (403, 404)


# ---------------------------------------------------------------------------- where


@pytest.mark.parametrize(("host", "address"), [("127.0.0.1", "127.0.0.1"), ("::1", "::1")])
def test_it_listens_where_it_is_told_and_nowhere_else(host, address):
    try:
        listener = listen(host, None)
    except UserError:
        pytest.skip(f"this machine has no {host}")
    with listener:
        assert listener.getsockname()[0] == address
    assert collect(StudioOptions, argparse.Namespace()).host == "127.0.0.1"
