"""`python -m tests.hostile [ROOM...] [-k WORDS]`: hostile inputs, tried and counted."""

import argparse
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.hostile import summary
from tests.hostile.cases import Case
from tests.hostile.suite import Suite
from tests.hostile.tables import TABLES
from tests.hostile.zoo import Zoo
from tests.zygote import Zygote


def main() -> int:
    """Try all rows, or those named; status 1 if one ends otherwise than it should."""
    parser = argparse.ArgumentParser(prog="python -m tests.hostile", description=__doc__)
    parser.add_argument("rooms", nargs="*", metavar="ROOM", help=f"{', '.join(TABLES)} (all)")
    parser.add_argument("-k", metavar="WORDS", default="", help="rows whose names contain this")
    parser.add_argument("--list", action="store_true", help="only print the rows' names")
    arguments = parser.parse_args()
    unknown = set(arguments.rooms) - set(TABLES)
    if unknown:
        parser.error(f"no such room: {', '.join(unknown)}")
    chosen = {
        room: [row for row in TABLES[room].rows if arguments.k in row.name]
        for room in arguments.rooms or TABLES
    }
    if arguments.list:
        print("\n".join(f"{room} {row.name}" for room, rows in chosen.items() for row in rows))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        zygote = Zygote()
        suite = Suite(zygote, Zoo.made(Path(folder, "zoo"), zygote), Path(folder))
        told = [found for room in chosen for found in _tried(suite, chosen[room])]
        zygote.close()
    print("\n".join(summary.lines(told)))
    return 0 if all(passed for _, passed in told) else 1


def _tried(suite: Suite, rows: Iterable[Case]) -> Iterator[summary.Told]:
    """Try rows; print what is wrong with one."""
    for row in rows:
        begin, passed = time.perf_counter(), True
        try:
            suite.check(row)
        except AssertionError as error:
            print(error, flush=True)
            passed = False
        seconds = time.perf_counter() - begin
        yield {summary.HOSTILE: [row.room, row.control, seconds]}, passed


if __name__ == "__main__":
    sys.exit(main())
