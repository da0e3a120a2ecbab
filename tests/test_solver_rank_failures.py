"""A rank that is killed, or fails alone, ends all ranks in whichever phase they are."""

import uuid
from pathlib import Path

import pytest

from tests.failing_ranks import SENTENCE
from tests.hostile.killing import MARK, require_none_left

pytestmark = pytest.mark.mpi

PROGRAM = Path(__file__).with_name("failing_ranks.py")
RANKS = 3
BAR = "builtin:bar --resolution 16 --material smooth --modes 20".split()
LANCZOS = ["--method", "lanczos", "--check-inertia"]
HCMS = ["--method", "hcms", "--subdomains", "6"]
IN_LANCZOS = (
    *("solid", "partition", "analysis", "assembly", "lanczos", "correction", "inertia"),
    *("verification", "estimate", "writing"),
)
IN_HCMS = ("analysis", "hcms", "correction")
FIRST = (("killed", "lanczos"), ("raises", "hcms"))
"""What every change tries."""


def failures():
    """How a rank fails, and which, the method, and the phase."""
    for method, options, phases in (("lanczos", LANCZOS, IN_LANCZOS), ("hcms", HCMS, IN_HCMS)):
        for number, phase in enumerate(phases):
            for how in ("killed", "raises"):
                marks = () if (how, phase) in FIRST else pytest.mark.nightly
                name = f"{how} in {phase}, {method}"
                yield pytest.param(how, number % RANKS, options, phase, id=name, marks=marks)


@pytest.mark.parametrize(("how", "rank", "options", "phase"), list(failures()))
def test_a_rank_that_fails_ends_all_and_leaves_no_file(
    how, rank, options, phase, tmp_path, mpiexec
):
    mark = uuid.uuid4().hex
    words = (*BAR, *options, "--out", tmp_path / "modes.h5")
    done = mpiexec(RANKS, PROGRAM, how, rank, phase, *words, env={MARK: mark})
    assert done.returncode != 0
    require_none_left(mark)
    assert "Traceback" not in done.stderr
    assert ("on signal 9" in done.stderr) == (how == "killed")
    said = [line for line in done.stderr.splitlines() if line.startswith("solver modes:")]
    assert said == ([f"solver modes: {SENTENCE}"] if how == "raises" else [])
    # What a killed writer leaves under a temporary name the next one removes.
    assert all(path.name.startswith(".") for path in tmp_path.iterdir())
    assert phase == "writing" or not list(tmp_path.iterdir())
