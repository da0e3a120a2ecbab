"""Forests that the workflow trains: their data, shard by shard, and how they are trained."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from workflow.arguments import options

TRAINING = (
    *("trees", "depth", "max_leaves", "min_leaf", "structure_rows", "prior", "uniform_weight"),
    *("transform", "grower", "seed"),
)
"""Options of `forests.training.options.TrainingOptions`, which takes long to load."""


@dataclass(frozen=True)
class Training:
    """Data and training of one model."""

    dataset: Mapping[str, Any]
    forests: Mapping[str, Any]
    """Its sections of the configuration."""
    poisson: float
    """Poisson's ratio of the blocks."""

    @property
    def distributions(self) -> list[str]:
        """Distributions of the fine moduli."""
        return list(self.dataset["distributions"])

    @property
    def shards(self) -> list[str]:
        """Names of all shards, without folder and ending; none if samples are not stored."""
        return self.first_shards(self.dataset["shards"]) if self.dataset["store"] else []

    def first_shards(self, count: int) -> list[str]:
        """Names of the first shards of each distribution."""
        return [f"{name}-{shard}" for name in self.distributions for shard in range(count)]

    def samples_of(self, distribution: str) -> int:
        """Samples of a distribution: an equal part of all, the first ones take what is left."""
        share, left = divmod(self.dataset["samples"], len(self.distributions))
        return int(share) + (self.distributions.index(distribution) < left)

    def generate_arguments(self, distribution: str, shard: int | str) -> list[str]:
        """Arguments of `dataset_gen generate` for one shard."""
        how = {
            "samples": self.samples_of(distribution),
            "shard": shard,
            **{key: self.dataset[key] for key in ("shards", "seed", "objective")},
            "poisson": self.poisson,
            "distribution": distribution,
            **dict(zip(("low", "high"), self.dataset["ranges"].get(distribution, ()))),
        }
        return options(how)

    @property
    def data_arguments(self) -> list[str]:
        """Arguments of `forests grow` and `forests train` beside the shards, if there are any."""
        if self.dataset["store"]:
            return ["--checked"]  # by the job that describes each
        ranges = self.dataset["ranges"]
        distributions = [
            ":".join(map(str, (name, *ranges.get(name, ())))) for name in self.distributions
        ]
        samples = {"samples": self.dataset["samples"], "data_seed": self.dataset["seed"]}
        fits = {"objective": self.dataset["objective"], "poisson": self.poisson}
        return options(samples | fits | {"distributions": distributions})

    @property
    def train_arguments(self) -> list[str]:
        """Arguments of `forests grow` and `forests train` that say how."""
        return options({name: self.forests[name] for name in TRAINING})

    def cores(self, usual: int) -> int:
        """Cores of a job that grows a tree or fits leaves; `usual`: those of a single process."""
        ranks, threads = self.forests["ranks"], self.forests["threads"]
        return int(ranks * threads if threads else max(ranks, usual if ranks == 1 else 1))

    @property
    def trees(self) -> range:
        """Numbers of the trees of both forests."""
        return range(2 * self.forests["trees"])


def own(config: Mapping[str, Any]) -> Training:
    """The forests of the run."""
    return Training(config["dataset"], config["forests"], config["poisson"])


def default(config: Mapping[str, Any]) -> Training:
    """The forests that come with the package."""
    part = config["default_forest"]
    return Training(part["dataset"], part["forests"], config["poisson"])
