"""The suite as a fixture of pytest; the zoo is made once, whichever process needs it first."""

import time
from dataclasses import replace

import pytest
from _pytest.mark.structures import ParameterSet

from tests.hostile import summary
from tests.hostile.cases import ZOO, Case, Table
from tests.hostile.suite import Suite
from tests.hostile.zoo import Zoo
from tests.once import once


def parameters(table: Table) -> list[ParameterSet]:
    """The rows of a table for `pytest.mark.parametrize`.

    With every change, a row of each kind is run as a process, the others inside the process of the
    tests; the nightly tier runs them all as processes.
    """
    kinds: set[tuple[str, str]] = set()
    found = []
    for row in table.rows:
        kind = (row.arguments[0] if len(row.arguments) > 1 else "", _kind(row))
        marks = [pytest.mark.nightly] if kind in kinds or not row.usual else []
        if marks and _can_be_inside(row) and row.usual:
            found.append(pytest.param(replace(row, inside=True), id=f"{row.name}, inside"))
        elif not marks:
            kinds.add(kind)
        found.append(pytest.param(row, id=row.name, marks=marks))
    return found


def _kind(row: Case) -> str:
    if row.control:
        return "control"
    if not _can_be_inside(row):
        return "rights or space"
    return "file" if row.files or any(ZOO in word for word in row.arguments) else "argument"


def _can_be_inside(row: Case) -> bool:
    """Whether it needs no limits: what is valid may compute for long, and leave what it likes."""
    return not row.control and not row.plain and row.file_size == Case.file_size


@pytest.fixture(scope="session")
def zoo(zygote, together) -> Zoo:
    with once(together / "zoo-made") as made:
        finished = made / "finished"
        if not finished.exists():
            found = Zoo.made(together / "zoo", zygote)
            finished.touch()
            return found
    return Zoo(together / "zoo")


@pytest.fixture(scope="session")
def suite(zygote, zoo, tmp_path_factory) -> Suite:
    return Suite(zygote, zoo, tmp_path_factory.mktemp("hostile"))


@pytest.fixture
def tried(suite, record_property):
    """Run one row; what it was and how long it took goes into the summary of the session."""

    def try_one(case: Case) -> None:
        begin = time.perf_counter()
        try:
            suite.check(case)
        finally:
            seconds = time.perf_counter() - begin
            record_property(summary.HOSTILE, [case.room, case.control, seconds])

    return try_one
