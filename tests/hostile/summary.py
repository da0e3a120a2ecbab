"""What was tried, refused, killed and how long it took: a table at the end of a session."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

HOSTILE = "hostile"
"""Name of what the report of a row holds: its room, whether it is a control, seconds."""
KILL = "kill"
"""The same of a kill: the command, seconds."""

Told = tuple[Mapping[str, Sequence], bool]
"""What the report of a test holds, and whether the test has passed."""


def lines(told: Iterable[Told]) -> list[str]:
    """The tables as lines; none if nothing was hostile."""
    rows: dict[str, list] = defaultdict(lambda: [0, 0, 0, 0, 0.0])
    kills: dict[str, list] = defaultdict(lambda: [0, 0, 0.0])
    for held, passed in told:
        if HOSTILE in held:
            room, control, seconds = held[HOSTILE]
            add(rows[room], 2 if control else 0, passed, seconds)
        if KILL in held:
            command, seconds = held[KILL]
            add(kills[command], 0, passed, seconds)
    heads = ("hostile", "refused", "controls", "work", "seconds")
    return [*_table(heads, rows), *_table(("kills", "equal", "seconds"), kills)]


def add(row: list, place: int, passed: bool, seconds: float) -> None:
    """Count one at `place`, as passed beside it, and its seconds in the last place."""
    row[place] += 1
    row[place + 1] += passed
    row[-1] += seconds


def _table(heads: Sequence[str], rows: Mapping[str, list]) -> list[str]:
    if not rows:
        return []
    total = [sum(column) for column in zip(*rows.values())]
    found = [" " * 26 + "".join(f"{head:>9}" for head in heads)]
    for name, row in [*rows.items(), ("total", total)]:
        counts = "".join(f"{count:9}" for count in row[:-1])
        found.append(f"{name:26}{counts}{row[-1]:9.1f}")
    return found
