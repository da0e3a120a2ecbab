"""The suite as a fixture of pytest; the zoo is made once, whichever process needs it first."""

from __future__ import annotations

import fcntl
import os
import time

import pytest
from _pytest.mark.structures import ParameterSet

from tests.hostile import summary
from tests.hostile.cases import Case, Table
from tests.hostile.suite import Suite
from tests.hostile.zoo import Zoo


def parameters(table: Table) -> list[ParameterSet]:
    """The rows of a table for `pytest.mark.parametrize`."""
    return [
        pytest.param(row, id=row.name, marks=[] if row.usual else pytest.mark.nightly)
        for row in table.rows
    ]


@pytest.fixture(scope="session")
def zoo(zygote, tmp_path_factory) -> Zoo:
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder = shared / "zoo"
    with open(shared / "zoo.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        finished = shared / "zoo.finished"
        if not finished.exists():
            made = Zoo.made(folder, zygote)
            finished.touch()
            return made
    return Zoo(folder)


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
