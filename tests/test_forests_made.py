"""Training on samples that are never stored, and training that was killed: the same forests."""

import numpy as np
import pytest

from carillon.errors import UserError
from dataset_gen.generate import generate
from dataset_gen.settings import ShardOptions
from forests.training import dataset, growing, leaf_fit
from forests.training.dataset import dataset_of, made_dataset
from forests.training.kept import Kept, folder_of
from forests.training.made import SampleOptions, whole_number
from forests.training.options import TrainingOptions, parameters_of
from forests.training.ranks import Ranks
from forests.training.train import train_trees, write_forests
from tests.small_forests import train
from workflow.commands.digest import digest

QUICK = TrainingOptions(trees=1, max_leaves=150, structure_rows=30_000, seed=5)
SAMPLES = 20_000


@pytest.fixture(scope="module")
def made():
    return made_dataset(
        SampleOptions(samples=SAMPLES, distributions=("uniform", "log-uniform:0.1:90")).parts(5)
    )


@pytest.fixture(scope="module")
def forests(made, tmp_path_factory):
    """File of the forests of the samples, trained without a break."""
    path = tmp_path_factory.mktemp("made") / "forests.h5"
    write_forests(path, made, QUICK, Ranks(), progress=False)
    return path


@pytest.mark.parametrize("shards", [1, 7])
def test_stored_samples_make_the_same_forests(shards, made, forests, tmp_path):
    half = {"samples": SAMPLES // 2, "seed": 5, "shards": shards}
    stored = [
        generate(ShardOptions(**half, shard=number, **how), progress=False)
        for how in ({}, {"distribution": "log-uniform", "low": 0.1, "high": 90.0})
        for number in range(shards)
    ]
    shuffled = dataset_of(stored[::-1])
    assert parameters_of(shuffled, QUICK) == parameters_of(made, QUICK)
    write_forests(tmp_path / "stored.h5", shuffled, QUICK, Ranks(), workers=2, progress=False)
    assert digest(tmp_path / "stored.h5") == digest(forests)


class Dying(Kept):
    """What is kept of a training that dies right after it has kept something a number of times."""

    lives = 2

    def _count(self):
        self.lives -= 1
        if self.lives == 0:
            raise InterruptedError

    def keep_tree(self, *arguments):
        super().keep_tree(*arguments)
        self._count()

    def keep_sums(self, state):
        super().keep_sums(state)
        self._count()


def test_a_training_that_dies_again_and_again_ends_with_the_same_forests(
    made, forests, tmp_path, monkeypatch
):
    monkeypatch.setattr(dataset, "BLOCK", 4096)
    monkeypatch.setattr(leaf_fit, "SLICE_SECONDS", 0.0)
    monkeypatch.setattr(leaf_fit, "COSTLY", 0.0)
    path = tmp_path / "forests.h5"
    deaths = 0
    while True:
        kept = Dying(path, parameters_of(made, QUICK))
        try:
            train_trees(made, QUICK, Ranks(), progress=False, kept=kept, keep_seconds=0.0)
            break
        except InterruptedError:
            deaths += 1
    assert deaths >= 3 and folder_of(path).is_dir()
    write_forests(path, made, QUICK, Ranks(), progress=False)
    assert digest(path) == digest(forests)
    assert not folder_of(path).exists()


def test_a_kept_tree_under_the_name_of_another_is_refused(made, tmp_path):
    path = tmp_path / "forests.h5"
    kept = Dying(path, parameters_of(made, QUICK))
    with pytest.raises(InterruptedError):
        train_trees(made, QUICK, Ranks(), progress=False, kept=kept)
    (folder_of(path) / "tree-0.h5").rename(folder_of(path) / "tree-1.h5")
    with pytest.raises(UserError, match="is tree 0; remove it"):
        write_forests(path, made, QUICK, Ranks(), progress=False)


def test_what_a_link_names_is_emptied_at_the_end(made, tmp_path):
    path, elsewhere = tmp_path / "forests.h5", tmp_path / "elsewhere"
    elsewhere.mkdir()
    folder_of(path).symlink_to(elsewhere)
    write_forests(path, made, QUICK, Ranks(), progress=False)
    assert path.exists() and not any(elsewhere.iterdir())


def test_what_another_training_has_kept_is_refused(made, tmp_path):
    path = tmp_path / "forests.h5"
    kept = Dying(path, parameters_of(made, QUICK))
    with pytest.raises(InterruptedError):
        train_trees(made, QUICK, Ranks(), progress=False, kept=kept)
    other = TrainingOptions(trees=1, max_leaves=150, structure_rows=30_000, seed=6)
    with pytest.raises(UserError, match="seed 5 where 6 is asked for.* remove .*training"):
        write_forests(path, made, other, Ranks(), progress=False)
    assert not path.exists() and folder_of(path).is_dir()


def test_trees_do_not_depend_on_threads_where_their_tops_have_a_sample_alone(made, monkeypatch):
    monkeypatch.setattr(growing, "TOP_SAMPLES", 3000)
    one, other = (train(made, QUICK, workers, progress=False) for workers in (1, 3))
    for name, values in vars(one.forests).items():
        np.testing.assert_array_equal(values, getattr(other.forests, name))
    assert one.scores["r2_log"] > 0.9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "found neither shards nor --samples"),
        ({"samples": 10, "distributions": ("normal",)}, "expected uniform or log-uniform"),
        ({"samples": 10, "distributions": ("uniform:1",)}, "as uniform:0:20"),
        ({"samples": 10, "distributions": ("uniform:3:2",)}, "expected low < high"),
        (
            {"samples": 10, "distributions": ("uniform", "uniform:0:10")},
            "'uniform:0:10' is there twice",
        ),
        (
            {"samples": 1, "distributions": ("uniform", "log-uniform")},
            "1 samples of 2 distributions: expected at least one of each",
        ),
    ],
)
def test_samples_that_cannot_be_made_are_refused(options, message):
    with pytest.raises(UserError, match=message):
        SampleOptions(**options).parts(0)


@pytest.mark.parametrize("text", ["1.5", "many", "1e400", "nan", ""])
def test_counts_that_are_none_are_refused(text):
    with pytest.raises(ValueError, match="expected a whole number"):
        whole_number(text)


def test_blocks_of_any_number_of_samples_are_not_listed():
    huge = made_dataset(SampleOptions(samples=10**18).parts(0))
    assert huge.run_of(huge.blocks()[-1])[1] == 10**18
    (first, *_), *_ = huge.spread(4000)
    assert 0 <= first[0] < first[1] < 10**18


def test_options_of_samples_are_refused_beside_shards(run_cli, tmp_path):
    """They would change nothing."""
    words = ("0.h5", "--data-seed", 3, "--out", tmp_path / "f.h5")
    done = run_cli("forests", "train", *words)
    assert done.returncode == 2 and "found shards and data-seed 3" in done.stderr


def test_shards_and_samples_at_once_are_refused(run_cli, tmp_path):
    done = run_cli("forests", "train", "0.h5", "--samples", "1e3", "--out", tmp_path / "f.h5")
    assert done.returncode == 2
    assert "found 1 shards and 1,000 samples to make, expected one of both" in done.stderr
