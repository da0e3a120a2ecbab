"""One shard on several MPI ranks: the same bytes, and no rank left waiting after an error."""

import pytest

from dataset_gen.generate import generate_file
from dataset_gen.journal import journal_of
from dataset_gen.settings import ShardOptions, settings_of
from dataset_gen.shards import origin_of
from dataset_gen.tasks import ShardPlan
from tests.rank_counts import TO_THREE

pytestmark = pytest.mark.mpi

SAMPLES, TASK = 3000, 128

PROGRAM = f"""
import sys, time
from carillon.errors import UserError
from carillon.processes import ranks
from dataset_gen import tasks
from dataset_gen.__main__ import main
from dataset_gen.commands import generate as program

class ShardPlan(tasks.ShardPlan):
    def work(self, task):
        comm, failing = ranks.world(), {{failing}}
        if failing and (comm.rank, task) in failing:
            raise {{error}}("planted")
        if failing and comm.rank != failing[0][0]:
            time.sleep(0.05)  # so that the failing rank gets its share
        return super().work(task)

program.ShardPlan = lambda settings: ShardPlan(settings, {TASK})
sys.exit(main())
"""


def options(path, *more):
    return ("generate", "--samples", SAMPLES, "--seed", 4, *more, "--out", path)


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    path = tmp_path_factory.mktemp("reference") / "shard.h5"
    plan = ShardPlan(settings_of(ShardOptions(SAMPLES, 4)), TASK)
    generate_file(path, plan, origin_of(plan.settings, ShardOptions(SAMPLES)))
    return path.read_bytes()


@pytest.fixture
def program(tmp_path):
    """Write the program: the command line with small tasks, some of which may fail."""

    def write(failing="()", error="UserError"):
        path = tmp_path / "program.py"
        path.write_text(PROGRAM.format(failing=failing, error=error))
        return path

    return write


@pytest.fixture
def path(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    return folder / "shard.h5"


@pytest.mark.parametrize("ranks", TO_THREE)
def test_bytes_do_not_depend_on_the_number_of_ranks(ranks, path, program, reference, mpiexec):
    mpiexec(ranks, program(), *options(path), check=True)
    assert path.read_bytes() == reference
    assert list(path.parent.iterdir()) == [path]
    # A second time, all ranks find that there is nothing to do.
    done = mpiexec(ranks, program(), *options(path), check=True)
    assert done.stderr.count("nothing to do") == 1


def sentences(done):
    return [
        line for line in done.stderr.splitlines() if line.startswith(("dataset_gen", "carillon"))
    ]


@pytest.mark.parametrize("rank", [pytest.param(0, marks=pytest.mark.nightly), 2])
def test_an_error_on_one_rank_ends_all_and_what_was_done_is_kept(
    rank, path, program, reference, mpiexec
):
    # Beyond the window, so that some tasks are in the journal by then.
    done = mpiexec(3, program(str(tuple((rank, task) for task in range(13, 24)))), *options(path))
    assert done.returncode == 2
    assert sentences(done) == ["dataset_gen generate: planted"]
    assert journal_of(path).stat().st_size > TASK * 137 and not path.exists()
    done = mpiexec(2, program(), *options(path), check=True)
    assert "going on after" in done.stderr
    assert path.read_bytes() == reference


@pytest.mark.nightly
def test_a_mistake_of_the_program_on_one_rank_ends_all_with_its_traceback(path, program, mpiexec):
    done = mpiexec(3, program("((1, 2), (1, 3), (1, 4), (1, 5))", "ValueError"), *options(path))
    assert done.returncode not in (0, 2)
    assert "ValueError: planted" in done.stderr


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("program", "more", "sentence"),
    [
        ("dataset_gen", ("--low", "-1"), "expected at least 0 GPa"),
        ("dataset_gen", ("--workers", 2), "ask for more ranks instead"),
        ("carillon", ("--shard", 2), "carillon generate: shard 2 of 1"),
    ],
)
def test_bad_input_is_one_sentence_on_all_ranks(program, more, sentence, path, mpiexec):
    done = mpiexec(3, program, *options(path, *more))
    assert done.returncode == 2
    (line,) = sentences(done)
    assert sentence in line
    assert list(path.parent.iterdir()) == []
