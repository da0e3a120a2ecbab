"""Progress: a bar on a terminal, a line a minute in a log file, nothing for short work."""

import io

import pytest

from carillon.command_line import progress
from carillon.command_line.progress import track


class Clock:
    """A clock that stands still until it is moved on."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(progress.time, "monotonic", clock)
    return clock


def lines(capsys, clock, seconds, **options):
    """What `track` prints while each of ten items takes so many seconds."""
    for _ in track(range(10), "fitting", unit="samples", **options):
        clock.now += seconds
    return capsys.readouterr().err.splitlines()


def test_work_of_less_than_a_minute_is_silent(capsys, clock):
    assert lines(capsys, clock, 5.9) == []


def test_one_line_a_minute_tells_count_rate_and_time_left(capsys, clock):
    found = lines(capsys, clock, 20, total=4000, weight=lambda _: 400)
    assert found == [
        "fitting: 1,200 of 4,000 samples, 20 samples/s, 0:02:20 left",
        "fitting: 2,400 of 4,000 samples, 20 samples/s, 0:01:20 left",
        "fitting: 3,600 of 4,000 samples, 20 samples/s, 0:00:20 left",
    ]


def test_what_was_done_before_counts_but_not_for_the_rate(capsys, clock):
    (first, *_) = lines(capsys, clock, 60, total=5000, weight=lambda _: 400, done=1000)
    assert first == "fitting: 1,400 of 5,000 samples, 6.7 samples/s, 0:09:00 left"


def test_the_number_of_items_is_the_total_where_there_is_one(capsys, clock):
    assert lines(capsys, clock, 60)[0] == "fitting: 1 of 10 samples, 0.017 samples/s, 0:09:00 left"


def test_without_a_total_nothing_is_said_about_the_time_left(capsys, clock):
    for _ in track(iter(range(2)), "reading", unit="files"):
        clock.now += 60
    assert capsys.readouterr().err.splitlines()[0] == "reading: 1 files, 0.017 files/s"


def test_invisible_is_invisible(capsys, clock):
    assert lines(capsys, clock, 100, visible=False) == []


def test_a_terminal_gets_a_bar(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    terminal = Terminal()
    monkeypatch.setattr(progress.sys, "stderr", terminal)
    items = track(range(3), "fitting", total=50, unit="samples", weight=lambda _: 10, done=20)
    assert list(items) == [0, 1, 2]
    shown = terminal.getvalue()
    assert "fitting" in shown and "20/50" in shown and "50/50" in shown and "samples/s" in shown
