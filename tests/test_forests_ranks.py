"""Training on several MPI ranks: the same forests, and no rank left waiting after an error."""

import h5py
import numpy as np
import pytest

from dataset_gen.generate import generate
from dataset_gen.settings import ShardOptions
from forests import load_model
from tests.rank_counts import TO_THREE
from tests.shard_files import write_shard
from workflow.commands.digest import digest

pytestmark = pytest.mark.mpi

OPTIONS = ("--trees", 2, "--max-leaves", 200, "--structure-rows", 20_000)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ranks")
    whole = generate(ShardOptions(140_000, 1, objective="chen2015"), progress=False)
    write_shard(folder / "0.h5", whole.part(0, 70_000))
    write_shard(folder / "1.h5", whole.part(70_000, 140_000))
    return folder


@pytest.fixture(scope="module")
def reference(folder, run_cli):
    run_cli("forests", *command(folder, "alone.h5"), check=True)
    return load_model(folder / "alone.h5")


def command(folder, name):
    return ("train", folder / "0.h5", folder / "1.h5", *OPTIONS, "--out", folder / name)


@pytest.mark.parametrize("ranks", TO_THREE)
def test_forests_do_not_depend_on_the_number_of_ranks(ranks, folder, reference, mpiexec):
    path = folder / f"{ranks}.h5.model"
    mpiexec(ranks, "forests", *command(folder, path.name), check=True)
    found = load_model(path)
    assert digest(path) == digest(folder / "alone.h5")
    assert found.scores == reference.scores
    assert found.provenance["ranks"] == ranks


FEW_IN_TOP = """
import sys
from forests.__main__ import main
from forests.training import growing

growing.TOP_SAMPLES = 8000
sys.exit(main())
"""


def test_rows_find_their_subtrees_where_the_top_has_a_sample_alone(folder, tmp_path, mpiexec):
    program = tmp_path / "program.py"
    program.write_text(FEW_IN_TOP)
    data = ("--samples", 60_000, "--seed", 2, *OPTIONS, "--tree", 3)
    for ranks in (1, 3):
        mpiexec(ranks, program, "grow", *data, "--out", tmp_path / f"{ranks}.h5", check=True)
    assert digest(tmp_path / "1.h5") == digest(tmp_path / "3.h5")


def test_trees_grown_by_jobs_of_their_own_make_the_same_forests(folder, reference, run_cli):
    shards = (folder / "0.h5", folder / "1.h5")
    trees = [folder / f"tree-{job}.h5" for job in range(4)]
    for job, path in enumerate(trees):
        run_cli("forests", "grow", *shards, *OPTIONS, "--tree", job, "--out", path, check=True)
    run_cli("forests", *command(folder, "jobs.h5"), "--structure", *trees, check=True)
    found = load_model(folder / "jobs.h5")
    for name, values in vars(reference.forests).items():
        np.testing.assert_array_equal(getattr(found.forests, name), values)


def sentences(done):
    return [line for line in done.stderr.splitlines() if line.startswith(("forests", "carillon"))]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param("train missing.h5", "missing.h5", marks=pytest.mark.nightly),
        pytest.param("train 0.h5 0.h5", "overlap", marks=pytest.mark.nightly),
        pytest.param("train 0.h5 --depth 0", "depth", marks=pytest.mark.nightly),
        ("grow 0.h5 --tree 9", "tree 9 of 2 x 3"),
    ],
)
def test_bad_input_is_one_sentence_on_all_ranks(arguments, message, folder, mpiexec):
    done = mpiexec(3, "forests", *arguments.split(), "--out", "new.h5", cwd=folder)
    assert done.returncode == 2
    (line,) = sentences(done)
    assert message in line
    assert not (folder / "new.h5").exists()


PROGRAM = """
import sys
from carillon.errors import UserError
from carillon.processes import ranks
from forests.__main__ import main
from forests.training import dataset

def read(*arguments, whole=dataset.read_runs):
    if ranks.world().rank == {rank}:
        raise UserError("planted")
    return whole(*arguments)

dataset.read_runs = read
sys.exit(main())
"""


@pytest.mark.parametrize("rank", [pytest.param(0, marks=pytest.mark.nightly), 2])
def test_an_error_on_one_rank_ends_all(rank, folder, tmp_path, mpiexec):
    path = tmp_path / "program.py"
    path.write_text(PROGRAM.format(rank=rank))
    done = mpiexec(3, path, *command(folder, "new.h5"))
    assert done.returncode == 2
    assert sentences(done) == ["forests train: planted"]
    assert not (folder / "new.h5").exists()


@pytest.mark.nightly
def test_errors_carry_the_name_that_was_typed(folder, mpiexec):
    done = mpiexec(2, "carillon", "train", "0.h5", "0.h5", "--out", "new.h5", cwd=folder)
    assert done.returncode == 2
    (line,) = sentences(done)
    assert line.startswith("carillon train: ") and "overlap" in line


@pytest.mark.nightly
def test_a_damaged_shard_is_named_and_nothing_is_written(folder, tmp_path, mpiexec):
    path = tmp_path / "damaged.h5"
    path.write_bytes((folder / "0.h5").read_bytes())
    with h5py.File(path, "r+") as file:
        file["coarse"][5] = 1.0
    done = mpiexec(2, "forests", "train", path, "--out", tmp_path / "new.h5")
    assert done.returncode == 2
    (line,) = sentences(done)
    assert "damaged.h5" in line
    assert not (tmp_path / "new.h5").exists()
