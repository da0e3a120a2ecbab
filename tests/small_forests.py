"""Forests that are trained within seconds (test support)."""

from collections.abc import Sequence
from pathlib import Path

from conftest import Run
from dataset_gen.shards import Shard
from forests.model import Model
from forests.training.dataset import Dataset, dataset_of
from forests.training.options import TrainingOptions
from forests.training.ranks import Ranks
from forests.training.train import model_of, train_trees


def train(
    dataset: Dataset | Sequence[Shard],
    training: TrainingOptions | None = None,
    workers: int = 1,
    progress: bool = True,
) -> Model:
    """Forests of shards in memory, trained in this process."""
    training = training or TrainingOptions()
    data = dataset if isinstance(dataset, Dataset) else dataset_of(dataset)
    trained = train_trees(data, training, Ranks(), workers, progress)
    assert trained is not None
    return model_of(data, training, trained)


def train_small_forests(folder: Path, run_cli: Run) -> Path:
    """Forests for Poisson's ratio 0.25 from few blocks; close to the fit, not as close as usual."""
    shard, forests = folder / "shard.h5", folder / "forests.h5"
    generate = ["generate", "--samples", 3000, "--seed", 7, "--out", shard]
    run_cli("dataset_gen", *generate, check=True)
    run_cli("forests", "train", shard, "--trees", 2, "--out", forests, check=True)
    return forests
