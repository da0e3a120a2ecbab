"""What the studio's server answers to its page, and how it begins and ends."""

import asyncio
import io
import json
import os
import re
import signal
import socket
import stat
import subprocess
import sys
import wave
from pathlib import Path
from types import SimpleNamespace
from urllib.request import urlopen

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from carillon.__main__ import main
from carillon.errors import UserError
from carillon.parameters.schema import schema_of
from sound.project.design_file import write_design
from sound.project.project import Project
from studio.binary import pack, unpack
from studio.feed import LONGEST_FEED, Feed
from studio.interface import CLIP_PARTS, EXPORTS
from studio.server import browser
from studio.server.serve import FIRST_PORT, address_of, listen
from tests.patience import wait_for
from tests.programs import CHECKOUT, checkout_environment
from tests.small_design import small_design
from tests.studio_server import SECONDS, next_event, reply_of, served


@pytest.fixture(scope="module")
def server():
    with served() as found:
        yield found


# -------------------------------------------------------------------------- answers


def test_the_page_and_all_files_that_it_names_are_there(server):
    page = server.ask("/").content.decode()
    named = re.findall(r'(?:src|href)="(/page/[^"]+)"', page)
    mapped = json.loads(re.findall(r'<script type="importmap">(.*?)</script>', page, re.DOTALL)[0])
    named += [each for each in mapped["imports"].values() if not each.endswith("/")]
    assert len(named) > 4
    types = {"css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
    for address in named:
        answer = server.ask(address)
        assert answer.status == 200, address
        assert answer.headers.get_content_type() == types[address.rpartition(".")[2]]


def test_a_file_that_has_not_changed_is_not_sent_again(server):
    mark = server.ask("/page/main.js").headers["ETag"]
    again = server.ask("/page/main.js", headers={"If-None-Match": mark})
    assert again.status == 304 and not again.content
    assert server.ask("/page/main.js", headers={"If-None-Match": '"other"'}).status == 200


def test_the_surface_is_one_binary_answer(server):
    header, arrays = unpack(server.ask("/surface/1").content)
    state = server.studio.state()["solid"]
    assert header["event"] == "surface" and header["number"] == 1
    assert arrays["positions"].shape == arrays["inward"].shape == (state["vertices"], 3)
    assert arrays["triangles"].shape == (state["triangles"], 3)
    assert arrays["triangles"].max() < state["vertices"]
    assert server.ask("/surface/2").status == 404


def test_arrays_of_binary_messages_begin_where_views_of_them_may():
    arrays = {"a": ("f4", np.arange(3.0)), "b": ("f8", np.ones((2, 2))), "c": ("u4", [])}
    message = pack({"says": "Glöckchen"}, arrays)
    header, found = unpack(message)
    begin = 4 + int.from_bytes(message[:4], "little")
    assert begin % 8 == 0 and header["says"] == "Glöckchen"
    assert [each["name"] for each in header["arrays"]] == ["a", "b", "c"]
    assert {name: each.tolist() for name, each in found.items()} == {
        "a": [0.0, 1.0, 2.0],
        "b": [[1.0, 1.0], [1.0, 1.0]],
        "c": [],
    }
    with pytest.raises(ValueError):
        pack({"cost": float("nan")}, {})


def test_clips_can_be_heard_and_seen(server):
    for part in CLIP_PARTS:
        answer = server.ask(f"/clip/c1/{part}")
        assert answer.headers.get_content_type() == "audio/wav"
        with wave.open(io.BytesIO(answer.content)) as sound:
            assert sound.getframerate() == 44_100
    spectrum = server.ask("/clip/c1/spectrum").json
    assert len(spectrum["hertz"]) == len(spectrum["decibels"]) and max(spectrum["decibels"]) == 0.0
    for path in ("/clip/c9/sound", "/clip/c9/spectrum", "/clip/c1/tail"):
        answer = server.ask(path)
        assert answer.status == 404 and answer.error


def test_comparisons_of_heads_can_be_heard(server):
    for path in ("/heads/0/A", "/heads/0/after?stimulus=strike"):
        answer = server.ask(path)
        assert answer.status == 200 and answer.headers["Content-Type"] == "audio/wav"
        assert answer.content.startswith(b"RIFF")
    refused = {"/heads/1/A": 400, "/heads/0/C": 404, "/heads/x/A": 404, "/heads/-1/A": 404}
    refused |= {"/heads/0/A?stimulus=music": 404, f"/heads/{'9' * 40}/A": 404}
    for path, status in refused.items():
        answer = server.ask(path)
        assert answer.status == status and answer.error


@pytest.mark.parametrize("kind", EXPORTS)
def test_designs_are_taken_home_as_files(server, kind):
    answer = server.ask(f"/export/{kind}?target=rim")
    assert answer.status == 200 and answer.content
    told = answer.headers["Content-Disposition"]
    assert told.startswith("attachment") and told.endswith(f".{kind}")
    assert server.ask("/export/wav?target=nowhere").status == 400


def test_the_schema_of_projects_is_told(server):
    assert server.ask("/schema.json").json == json.loads(json.dumps(schema_of(Project)))


def test_what_is_sent_arrives(server):
    content = os.urandom(3 << 20)
    answer = server.upload("mesh", "Müller's pan.stl", content)
    assert answer.status == 200 and answer.json["mesh"].startswith("m")
    assert server.studio.uploads[-1] == ("mesh", "Müller's pan.stl", len(content))
    pieces = iter([b"RIFF", b"x" * 5000])
    assert server.ask("/clip?name=a.wav", "POST", pieces).json["clip"].startswith("c")
    assert server.studio.uploads[-1] == ("clip", "a.wav", 5004)


def test_a_fault_of_the_studios_own_is_told_as_such(server, monkeypatch, capsys):
    async def broken(*_: object) -> bytes:
        raise ZeroDivisionError("secret detail")

    monkeypatch.setattr(server.studio, "surface", broken)
    monkeypatch.setattr(server.studio, "call", broken)
    answer = server.ask("/surface/1")
    assert answer.status == 500 and "secret" not in answer.error and "itself" in answer.error
    with server.talk() as page:
        assert "secret" not in reply_of(page, {"id": 1, "do": "undo"})["error"]
    assert "secret detail" in capsys.readouterr().err


# -------------------------------------------------------------------------- messages


def test_a_page_is_told_the_state_the_history_and_the_bank_first(server):
    with server.talk() as page:
        state, history, bank = (page.recv(timeout=SECONDS) for _ in range(3))
    assert json.loads(state)["event"] == "state"
    assert json.loads(history) == {"event": "history", "rows": [], "checks": []}
    header, arrays = unpack(bank)
    n_modes, n_vertices = len(arrays["hertz"]), server.studio.state()["solid"]["vertices"]
    assert header["event"] == "bank" and header["surface"] == 1
    assert arrays["dampings"].shape == (n_modes,) and arrays["young"].shape == (n_vertices,)
    assert arrays["gains"].shape == (n_vertices, n_modes)
    assert arrays["struck"].shape == (len(header["targets"]), n_modes)


def test_all_pages_hear_of_a_change_and_the_caller_before_its_reply(server):
    with server.talk() as one, server.talk() as other:
        revisions = [next_event(each, "state")["revision"] for each in (one, other)]
        one.send(json.dumps({"id": 5, "do": "add_target", "vertex": 7, "name": "other"}))
        assert next_event(other, "state")["targets"][-1]["name"] == "other"
        seen = []
        while not seen or "reply" not in seen[-1]:
            message = one.recv(timeout=SECONDS)
            seen += [json.loads(message)] if isinstance(message, str) else []
        assert seen[-1] == {"reply": 5}
        states = [each for each in seen if each.get("event") == "state"]
        assert states and states[-1]["revision"] > revisions[0]
        assert reply_of(one, {"id": 6, "do": "remove_target", "target": "other"}) == {"reply": 6}


def test_calls_reach_the_studio_as_they_are(server):
    with server.talk() as page:
        message = {"id": 1, "do": "change_target", "target": "rim", "without": [440.0]}
        assert reply_of(page, message) == {"reply": 1}
    assert server.studio.calls[-1] == ("change_target", {"target": "rim", "without": [440.0]})


def test_what_is_slow_does_not_hold_up_a_stop(server, monkeypatch):
    released = asyncio.Event()

    async def call(name: str, arguments: object) -> None:
        if name == "save":
            await released.wait()
        else:
            released.set()

    monkeypatch.setattr(server.studio, "call", call)
    with server.talk() as page:
        page.send(json.dumps({"id": 1, "do": "save", "name": "pan"}))
        assert reply_of(page, {"id": 2, "do": "stop"}) == {"reply": 2}
        assert reply_of(page, {"id": 3, "do": "stop"})["reply"] in (1, 3)


def test_progress_of_a_search_comes_by_itself(server):
    with server.talk() as page:
        assert reply_of(page, {"id": 1, "do": "optimise"}) == {"reply": 1}
        costs = [next_event(page, "progress")["cost"] for _ in range(3)]
        assert costs == sorted(costs, reverse=True)
        assert reply_of(page, {"id": 2, "do": "stop"}) == {"reply": 2}
        assert reply_of(page, {"id": 3, "do": "forget_material"}) == {"reply": 3}


def test_a_slow_page_gets_the_newest_bank_and_no_backlog():
    feed = Feed()
    for number in range(1000):
        feed.put(b"bank %d" % number, newest="bank")
        feed.send({"revision": number}, newest="state")
    feed.send({"reply": 1})
    assert [asyncio.run(feed.next()) for _ in range(3)] == [
        b"bank 999",
        '{"revision":999}',
        '{"reply":1}',
    ]


def test_a_page_that_was_away_is_sent_the_newest_bank_and_few_others(server):
    """What is on its way in buffers comes as well; the rest is skipped."""
    changes = 300
    with server.talk(max_queue=1) as page:
        next_event(page, "state")
        for _ in range(changes):
            server.soon(server.studio.changed)
        newest, numbers = unpack(server.studio.bank())[0]["number"], []
        while not numbers or numbers[-1] < newest:
            message = page.recv(timeout=SECONDS)
            if isinstance(message, bytes):
                numbers.append(unpack(message)[0]["number"])
    assert numbers == sorted(numbers) and len(numbers) < changes / 2


def test_a_page_that_keeps_too_much_waiting_is_cut_off_and_others_are_not(server):
    feed = Feed()
    for number in range(LONGEST_FEED + 1):
        assert not feed.closed
        feed.put(str(number))
    assert feed.closed and asyncio.run(feed.next()) is None
    with server.talk() as page:
        next_event(page, "state")
        before = set(server.studio.feeds)
        with server.talk() as idle:
            next_event(idle, "state")
            (feed,) = set(server.studio.feeds) - before
            server.soon(feed.close)
            with pytest.raises(ConnectionClosed) as caught:
                while True:
                    idle.recv(timeout=SECONDS)
        assert caught.value.rcvd is not None and caught.value.rcvd.code == 1013
        assert reply_of(page, {"id": 1, "do": "stop"}) == {"reply": 1}


def test_nothing_is_kept_for_pages_that_are_gone(server):
    for _ in range(5):
        with server.talk() as page:
            next_event(page, "state")
    wait_for(lambda: not server.studio.feeds, "the end of the feeds")


def test_numbers_that_json_does_not_have_are_not_sent():
    with pytest.raises(ValueError):
        Feed().send({"cost": float("inf")})


# ------------------------------------------------------------------ beginning and end


def test_a_port_in_use_is_told_and_the_next_free_one_taken_if_none_was_asked_for():
    with listen("127.0.0.1", None) as first, listen("127.0.0.1", None) as second:
        ports = [each.getsockname()[1] for each in (first, second)]
        assert ports[0] != ports[1] and FIRST_PORT <= ports[0]
        with pytest.raises(UserError, match=f"127.0.0.1:{ports[0]}: .*--port"):
            listen("127.0.0.1", ports[0])
        assert address_of(first, "127.0.0.1") == f"http://127.0.0.1:{ports[0]}/"
        assert address_of(first, "0.0.0.0") == f"http://127.0.0.1:{ports[0]}/"
        assert address_of(first, "::1") == f"http://[::1]:{ports[0]}/"


@pytest.mark.parametrize("host", ["nonsense name", "256.1.1.1", "", "a" * 300])
def test_an_address_that_is_none_of_this_machine_is_told(host):
    with pytest.raises(UserError, match="--host"):
        listen(host, None)


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_server_ends_in_order_with_a_page_open(ending):
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.studio_stub"],
        cwd=CHECKOUT,
        env=checkout_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        address, _, token = process.stdout.readline().strip().partition("/?token=")
        host = address.removeprefix("http://")
        with urlopen(f"{address}/?token={token}", timeout=SECONDS) as answer:
            cookie = answer.headers["Set-Cookie"].partition(";")[0]
        headers = {"Cookie": cookie, "Origin": address}
        with connect(f"ws://{host}/socket", additional_headers=headers, max_size=None) as page:
            next_event(page, "state")
            # Somebody connects, and says nothing.
            with socket.create_connection(host.split(":")):  # type: ignore[arg-type]
                process.send_signal(ending)
                with pytest.raises(ConnectionClosed):
                    while True:
                        page.recv(timeout=SECONDS)
                process.wait(SECONDS)
        assert process.returncode == 0 and process.stderr is not None
        assert process.stderr.read() == ""
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


# ------------------------------------------------------------------------- the command


@pytest.fixture
def opened(monkeypatch):
    """What the command opens and serves, which are made up."""
    found: dict[str, object] = {}

    def open_studio(what, workspace, settings):
        found.update(what=what, workspace=workspace)
        return "studio"

    def serve(studio, listener, host, keys, limits=None, ready=None):
        found.update(studio=studio, host=host, keys=keys)
        found["port"] = listener.getsockname()[1]
        ready()

    monkeypatch.setattr("studio.session.open_studio", open_studio, raising=False)
    monkeypatch.setattr("studio.server.serve.serve", serve)
    monkeypatch.setattr("webbrowser.open", lambda url: found.update(url=url) or True)
    monkeypatch.setenv("BROWSER", "made-up")
    return found


@pytest.mark.parametrize(
    ("words", "what", "workspace"),
    [
        ([], None, "carillon-studio"),
        (["builtin:bell"], "builtin:bell", "carillon-studio"),
        (["pans/pan.yaml"], "pans/pan.yaml", "pans"),
        (["pan.stl"], "pan.stl", "."),
        (["pans/pan.yaml", "--workspace", "other"], "pans/pan.yaml", "other"),
    ],
)
def test_the_command_opens_what_it_is_given(
    opened, monkeypatch, tmp_path, capsys, words, what, workspace
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pans").mkdir()
    assert main(["studio", *words, "--no-browser"]) == 0
    assert (opened["what"], opened["workspace"]) == (what, (tmp_path / workspace).resolve())
    assert opened["host"] == "127.0.0.1" and opened["studio"] == "studio"
    shown = capsys.readouterr()
    assert shown.out == f"http://127.0.0.1:{opened['port']}/?token={opened['keys'].token}\n"
    assert str(tmp_path) in shown.err and "other machines" not in shown.err
    assert "url" not in opened


def test_the_browser_is_led_there_without_the_token_on_its_command_line(
    opened, monkeypatch, tmp_path
):
    seen = []

    def thread(target, args, daemon):
        seen.append(Path(args[0].removeprefix("file://")))
        return SimpleNamespace(start=lambda: None)

    monkeypatch.setattr("studio.server.browser.threading.Thread", thread)
    page = browser.open_page("http://127.0.0.1:1/?token=secret", tmp_path)
    assert page == seen[0] and stat.S_IMODE(page.stat().st_mode) == 0o600
    assert "token=secret" in page.read_text() and "secret" not in str(page)
    assert browser.open_page("http://127.0.0.1:1/?token=other", tmp_path) == page
    assert main(["studio", "--workspace", str(tmp_path / "mine")]) == 0
    assert seen[-1].parent == tmp_path / "mine" and not seen[-1].exists()


def test_listening_for_other_machines_is_warned_of(opened, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["studio", "--host", "0.0.0.0", "--no-browser"]) == 0
    assert "other machines" in capsys.readouterr().err


def test_a_finished_design_is_written_as_a_page_without_a_server(
    opened, refuses, monkeypatch, tmp_path, capsys
):
    monkeypatch.chdir(tmp_path)
    write_design("design.h5", small_design())
    assert main(["studio", "design.h5", "--export", "page.html"]) == 0
    assert "page.html: " in capsys.readouterr().out
    assert Path("page.html").read_text().lower().startswith("<!doctype html>")
    assert not opened and not Path("carillon-studio").exists()
    assert "ends in" in refuses(main, "studio", "design.h5", "--export", "page.pdf")
    assert "input" in refuses(main, "studio", "page.html", "--export", "page.html")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--port", "0"], "--port"),
        (["--port", "70000"], "--port"),
        (["--host", "no such name"], "--host"),
        (["--workspace", "/dev/null/x"], "--workspace"),
        (["--export", "page.html"], "name the design"),
        (["--export", "page.html", "nowhere.h5"], "nowhere.h5"),
        (["a", "b"], "unrecognized"),
    ],
)
def test_the_command_refuses_in_one_sentence(opened, refuses, monkeypatch, tmp_path, words, said):
    monkeypatch.chdir(tmp_path)
    assert said in refuses(main, "studio", *words)


def test_a_port_in_use_is_refused_before_anything_is_opened(opened, refuses, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with listen("127.0.0.1", None) as taken:
        port = taken.getsockname()[1]
        assert str(port) in refuses(main, "studio", "--port", str(port))
    assert "what" not in opened and not list(tmp_path.iterdir())


def test_missing_packages_are_named_with_what_installs_them(refuses, monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    sentence = refuses(main, "studio")
    assert "uvicorn" in sentence and "requirements-studio.txt" in sentence
