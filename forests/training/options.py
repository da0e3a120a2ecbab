"""Parameters of a training, and all that it depends on."""

from dataclasses import asdict
from itertools import groupby
from typing import Annotated, Any

from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import Count, Number, between
from forests.layout import MOST_LEAVES
from forests.scaling import TRANSFORMS
from forests.training.dataset import Dataset
from forests.training.growers import GROWERS
from forests.training.structure import TreeLimits


@parameters
class TrainingOptions:
    """Parameters of the training."""

    trees: Annotated[int, between(1, 1000)] = option(3, "of each of the two forests")
    depth: Annotated[int, between(1, 1000)] = option(20, "of a tree, at most")
    max_leaves: Annotated[int, between(1, MOST_LEAVES)] = option(
        30_000, "of a tree, at most, but at least one a void pattern; 56 bytes each"
    )
    min_leaf: Count = option(30, "rows of the subset that a leaf needs")
    structure_rows: Count = option(
        5_000_000, "rows of the subset that splits are chosen from, rounded up to 1,024 samples"
    )
    prior: Annotated[float, between(1e-9, 1e9)] = option(
        0.5, "rows that the surroundings of a leaf count for in it"
    )
    uniform_weight: Annotated[float, between(1e-9, 1e9)] = option(
        400.0, "weight of blocks of one material; they are few but fill most real objects"
    )
    transform: Annotated[str, OneOf(*TRANSFORMS)] = option("log", "of the features and the target")
    grower: Annotated[str, OneOf(*GROWERS)] = option("linear", "how splits are chosen")
    seed: Number = option(0, "of the splits")

    @property
    def limits(self) -> TreeLimits:
        """Limits of the growth of a tree."""
        return TreeLimits(self.max_leaves, self.min_leaf, self.depth)

    @property
    def jobs(self) -> range:
        """Numbers of all trees: those of the forest of void origins, then the others."""
        return range(2 * self.trees)

    def kind(self, job: int) -> int:
        """Forest that a tree belongs to."""
        return job // self.trees


def parameters_of(dataset: Dataset, training: TrainingOptions) -> dict[str, Any]:
    """Options of a training and ranges of its samples, for its provenance, without the shards."""
    parts = [asdict(part) for part in dataset.settings]
    names = ("objective", "poisson", "code", "seed", "distribution", "low", "high")
    ranges: list[list[Any]] = []
    for key, same in groupby(parts, key=lambda part: [part[name] for name in names]):
        for part in same:
            if ranges and ranges[-1][:-2] == key and ranges[-1][-1] == part["start"]:
                ranges[-1][-1] = part["stop"]
            else:
                ranges.append([*key, part["start"], part["stop"]])
    shared, own = len(("objective", "poisson", "code")), dict(zip(names, ranges[0]))
    return {
        **asdict(training),
        **{name: own[name] for name in names[:shared]},
        "samples": [each[shared:] for each in ranges],
    }
