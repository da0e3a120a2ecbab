"""Forests that the workflow trains: their data, shard by shard, and how they are trained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from carillon.errors import UserError
from dataset_gen.sampling import moduli
from forests.training.variants import VARIANTS
from workflow.arguments import options

TRAINING = (
    *("trees", "depth", "max_leaves", "min_leaf", "structure_rows", "prior", "uniform_weight"),
    *("transform", "grower", "seed"),
)
"""Options of `forests.training.train.TrainingOptions`, which takes long to load."""


@dataclass(frozen=True)
class Training:
    """Data and training of one model.

    Attributes
    ----------
    section
        Where it stands in the configuration, for messages; empty for the run's own.
    dataset, forests
        Its sections of the configuration.
    poisson
        Poisson's ratio of the blocks.
    """

    section: str
    dataset: Mapping[str, Any]
    forests: Mapping[str, Any]
    poisson: float

    @property
    def distributions(self) -> list[str]:
        """Distributions of the fine moduli."""
        return list(self.dataset["distributions"])

    @property
    def shards(self) -> list[str]:
        """Names of all shards, without folder and ending."""
        return self.first_shards(self.dataset["shards"])

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
    def train_arguments(self) -> list[str]:
        """Arguments of `forests grow` and `forests train` that say how."""
        return options({name: self.forests[name] for name in TRAINING})

    @property
    def trees(self) -> range:
        """Numbers of the trees of both forests."""
        return range(2 * self.forests["trees"])

    def check(self) -> None:
        """Check what a schema cannot say.

        Raises
        ------
        UserError
            If a range is of no distribution in use or is none, or shards would be empty.
        """
        where = f"{self.section}dataset"
        for name, (low, high) in self.dataset["ranges"].items():
            if name not in self.distributions:
                raise UserError(
                    f"{where}.ranges: {name!r} is not among the distributions "
                    f"{', '.join(self.distributions)}"
                )
            try:
                moduli(name, low, high)
            except UserError as error:
                raise UserError(f"{where}.ranges: {error}") from None
        fewest = min(map(self.samples_of, self.distributions))
        if fewest < self.dataset["shards"]:
            raise UserError(
                f"{where}.shards: {fewest} samples of a distribution cannot be split into "
                f"{self.dataset['shards']} shards"
            )


def own(config: Mapping[str, Any]) -> Training:
    """The forests of the run."""
    return Training("", config["dataset"], config["forests"], config["poisson"])


def study(config: Mapping[str, Any]) -> Training:
    """The trainings that the study of the forests compares: on data of the default forests."""
    plan = default(config)
    rows = config["forests_study"]["structure_rows"]
    return replace(plan, forests={**plan.forests, "structure_rows": rows})


def check_study(config: Mapping[str, Any]) -> None:
    """Check that the default forests' data suffice for the study, and that its trainings exist.

    Raises
    ------
    UserError
        If they do not.
    """
    requested, data = config["forests_study"], config["default_forest"]["dataset"]
    if requested["shards"] > data["shards"]:
        raise UserError(
            f"forests_study.shards: {requested['shards']} of {data['shards']} shards of a "
            "distribution, see default_forest.dataset.shards"
        )
    if max(requested["curve_rows"]) > 8 * data["samples"]:
        raise UserError(
            f"forests_study.curve_rows: {max(requested['curve_rows']):,} rows, but "
            f"default_forest.dataset.samples gives {8 * data['samples']:,}"
        )
    for name in requested["variants"] or ():
        if name not in VARIANTS:
            known = ", ".join(VARIANTS)
            raise UserError(f"forests_study.variants: {name!r} is unknown, choose from {known}")


def default(config: Mapping[str, Any]) -> Training:
    """The forests that come with the package."""
    part = config["default_forest"]
    return Training("default_forest.", part["dataset"], part["forests"], config["poisson"])
