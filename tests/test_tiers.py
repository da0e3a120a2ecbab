"""What of the nightly tests is due: each in its turn, and what is near to a change besides."""

import sys

import pytest

from tests import tiers
from tests.programs import CHECKOUT, run

SECONDS = {f"test_{name}.py": 10.0 * place for place, name in enumerate("abcdefgh", start=1)}
PYTEST_SECONDS = """
12.50s call     tests/test_a.py::test_one[x]
2.25s setup    tests/test_a.py::test_two
0.50s teardown tests/test_b.py::test_three
9.00s call     carillon/processes/mpi_environment.py::carillon.processes.mpi_environment
"""


@pytest.mark.parametrize("first", range(tiers.TURNS))
def test_all_is_run_within_so_many_turns(first):
    run: set[str] = set()
    for turn in range(first, first + tiers.TURNS):
        run |= tiers.choose(SECONDS, [], turn).files
    assert run == set(SECONDS)


def test_turns_take_about_as_long():
    takes = [sum(SECONDS[name] for name in part) for part in tiers.turns(SECONDS)]
    assert max(takes) - min(takes) <= max(SECONDS.values())


def test_a_turn_of_the_measured_tests_takes_half_an_hour_at_most():
    """A turn is run whole, even where it takes longer than the budget; not without end."""
    seconds = tiers.measured()
    most = tiers.BUDGET_SECONDS * 30 / 12
    for turn in range(tiers.TURNS):
        assert sum(seconds[name] for name in tiers.choose(seconds, [], turn).files) <= most


@pytest.mark.parametrize("turn", range(tiers.TURNS))
def test_what_is_near_to_a_change_is_run_as_far_as_time_lasts(turn):
    quarter = tiers.BUDGET_SECONDS / 4
    seconds = {f"test_{number}.py": quarter for number in range(6)}
    in_turn = tiers.choose(seconds, [], turn).files
    assert len(in_turn) == 2
    others = sorted(set(seconds) - in_turn, reverse=True)
    part = tiers.choose(seconds, ["test_unknown.py", *in_turn, *others], turn)
    assert part.related == tuple(others[:2]) and set(part.in_turn) == in_turn
    assert f"{others[0]} (changed)" in str(part)


def test_a_change_is_tried_even_if_the_turn_takes_all_the_time():
    seconds = {f"test_{number}.py": tiers.BUDGET_SECONDS for number in range(tiers.TURNS)}
    seconds["test_new.py"] = tiers.CHANGE_SECONDS
    turn = next(n for n in range(3) if "test_new.py" not in tiers.choose(seconds, [], n).files)
    assert tiers.choose(seconds, ["test_new.py"], turn).related == ("test_new.py",)


def test_what_takes_longer_than_the_budget_has_no_turn():
    seconds = {**SECONDS, "test_long.py": 2 * tiers.BUDGET_SECONDS}
    for turn in range(tiers.TURNS):
        assert "test_long.py" not in tiers.choose(seconds, ["test_long.py"], turn).files


@pytest.mark.parametrize(
    ("changed", "first", "others"),
    [
        ("tests/test_kills.py", "test_kills.py", []),
        ("workflow/commands/digest.py", "test_", ["test_workflow_digest.py", "test_kills.py"]),
        ("workflow/rules/common.smk", "test_", ["test_kills.py", "test_workflow_failures.py"]),
        ("slurm/test-cluster.sh", ".ci/bare-root", ["test_slurm.py"]),
        ("docs/index.md", "test_docs_commands.py", ["test_docs_sound.py"]),
        ("solver/commands/modes.py", "test_", ["test_hostile_solver.py", "test_solver_mpi.py"]),
    ],
)
def test_a_change_has_its_own_tests(changed, first, others):
    found = tiers.nearest([changed])
    assert found[0].startswith(first)
    assert set(others) <= set(found)


def test_a_change_of_one_room_does_not_run_the_others():
    assert not [name for name in tiers.nearest(["studio/page/index.html"]) if "solver" in name]
    assert tiers.nearest([]) == []


def test_every_measured_file_is_there():
    for name in tiers.measured():
        assert (CHECKOUT / name if "/" in name else CHECKOUT / "tests" / name).is_file()


def test_changes_are_told_from_the_main_branch_or_the_last_commit(tmp_path, monkeypatch):
    monkeypatch.setattr(tiers, "CHECKOUT", tmp_path)
    assert (tiers.changed_files(), tiers.turn_of_history()) == ([], 0)

    def git(*words):
        person = ["-c", "user.name=A", "-c", "user.email=a@example.org"]
        run("git", *person, "-C", tmp_path, *words, check=True)

    git("init", "-b", "main")
    for name in ("one", "two", "three", "four"):
        (tmp_path / name).touch()
        git("add", name)
        git("commit", "-m", name)
        if name == "two":
            git("checkout", "-b", "side")
    assert tiers.turn_of_history() == 4
    assert tiers.changed_files() == ["four", "three"]
    git("checkout", "main")
    (tmp_path / "new").touch()
    assert tiers.changed_files() == ["new", "two"]


def test_durations_are_summed_by_file():
    assert tiers.seconds_by_file(PYTEST_SECONDS.splitlines()) == {
        "test_a.py": 14.75,
        "test_b.py": 0.5,
    }


@pytest.mark.parametrize("tier", ["change", "all"])
def test_the_tier_decides_which_tests_are_run(tier):
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "--tier", tier]
    done = run(*command, "tests/test_kills.py", cwd=CHECKOUT)
    assert ("test_there_are_fifty_kills" in done.stdout) == (tier == "all"), done.stdout


@pytest.mark.parametrize(
    ("unless", "changed", "spared"),
    [
        ((), ["studio/feed.py"], True),
        (("studio",), [], True),
        (("studio",), ["solver/__main__.py"], True),
        (("studio",), ["studio/page/main.js"], False),
        (("studio",), ["tests/test_page.py"], False),
    ],
)
def test_pages_are_tried_where_they_have_changed(unless, changed, spared):
    assert tiers.is_spared("test_page.py", {"test_other.py"}, unless, changed) == spared
    assert not tiers.is_spared("test_page.py", {"test_page.py"}, unless, changed)


def test_files_that_were_never_measured_have_their_turn(tmp_path, monkeypatch):
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_new.py").write_text("pytestmark = pytest.mark.nightly")
    (tmp_path / "tests" / "test_fast.py").write_text("")
    monkeypatch.setattr(tiers, "CHECKOUT", tmp_path)
    assert set(tiers.measured()) >= {"test_new.py", "test_kills.py"}
    assert "test_fast.py" not in tiers.measured()
