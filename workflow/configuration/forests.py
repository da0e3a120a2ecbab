"""Training data and forests: the run's own, and those that come with the package."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from annotated_types import Ge, Le

from carillon.errors import UserError
from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import Seed, WorkersAnywhere
from carillon.parameters.sentences import ParameterError, did_you_mean
from dataset_gen.objectives import DATASET_OBJECTIVES
from dataset_gen.sampling import DISTRIBUTIONS, moduli
from workflow.configuration.section import File, Ranks, Several

if TYPE_CHECKING:
    from workflow.configuration.run import Configuration

Distribution = Annotated[str, OneOf(*DISTRIBUTIONS)]
Modulus = Annotated[float, Ge(0), Le(1e9)]
Range = Annotated[tuple[Modulus, Modulus], "least and largest modulus [GPa]"]
Samples = Annotated[
    int,
    Ge(100),
    Le(1_000_000_000_000),
    "blocks drawn and fitted, over all distributions and shards [1]",
]
Rows = Annotated[
    int,
    Ge(1),
    Le(100_000_000_000),
    "rows of the subset that splits are chosen from, eight to a sample; the leaves are fitted to "
    "all [1]",
]
Leaves = Annotated[
    int,
    Ge(1),
    Le(10_000_000),
    "most leaves of a tree, which decide about the storage [1]",
]
LeafRows = Annotated[int, Ge(1), Le(1_000_000_000), "rows of the subset that a leaf needs [1]"]
Blocks = Annotated[int, Ge(1), Le(1_000_000)]
BaseMaterials = Annotated[
    int,
    Ge(2),
    Le(12),
    "base materials of the databases of metamaterials in the table of errors on single blocks, "
    "void included [1]",
]
Shards = Annotated[
    int,
    Ge(1),
    Le(10_000),
    "files that the samples of each distribution are split into, one job each [1]",
]
Weight = Annotated[float, Ge(1e-9), Le(1e9)]


@parameters
class DatasetSection:
    """Training data of the run's own forests."""

    samples: Samples = option(120_000)
    distributions: Several[Distribution] = option(
        ("uniform", "log-uniform"),
        "distributions of the fine moduli, which share the samples equally; log-uniform for "
        "contrasts of several decades",
    )
    ranges: dict[str, Range] = option(
        dict,
        "least modulus that is not void and largest one, by distribution; 0 to 10 if uniform, "
        "0.01 to 1000 if log-uniform, unless said here [GPa]",
    )
    shards: Shards = option(2)
    seed: Seed = option(0, "seed of the sampled blocks")
    objective: Annotated[str, OneOf(*DATASET_OBJECTIVES)] = option(
        "calibrated",
        "fit objective of dataset_gen; sampled-energy is energy by the paper's 5,000 sampled "
        "forces a block, some hundred times slower",
    )
    store: bool = option(
        True,
        "whether samples are written to shards; false draws and fits them where they are used, "
        "for each tree and for the leaves, which saves the disk and costs time",
    )
    workers: WorkersAnywhere = option(
        1,
        "processes that share the work on one shard, no more than the cores that Snakemake may use"
        " [1]",
    )

    def check_in(self, run: Configuration) -> None:
        """Check the ranges, and that every shard has samples.

        Raises ParameterError if a range is of no distribution in use or is none, or shards would be
        empty.
        """
        for name, (low, high) in self.ranges.items():
            if name not in self.distributions:
                known = ", ".join(self.distributions)
                hint = did_you_mean(name, self.distributions)
                raise ParameterError(
                    ("ranges", name), f"{name!r} is not among the distributions {known}{hint}"
                )
            try:
                moduli(name, low, high)
            except UserError as error:
                raise ParameterError(("ranges", name), str(error)) from None
        fewest = self.samples // len(self.distributions)
        if fewest < self.shards:
            raise ParameterError(
                ("shards",),
                f"{fewest} samples of a distribution cannot be split into {self.shards} shards",
            )


@parameters
class TrainingSection:
    """How forests are trained."""

    trees: Annotated[int, Ge(1), Le(1000)] = option(3, "trees of each of the two forests [1]")
    depth: Annotated[int, Ge(1), Le(60)] = option(20, "largest depth of a tree [1]")
    max_leaves: Leaves = option(30_000)
    min_leaf: LeafRows = option(30)
    structure_rows: Rows = option(5_000_000)
    grower: Literal["linear", "best", "extra"] = option(
        "linear",
        "how splits are chosen, linear by the error of two linear functions, best by the least "
        "variance of the target as in the paper, extra by the better of random ones",
    )
    transform: Literal["log", "ratio"] = option(
        "log",
        "form of features and target, log for logarithms of ratios or ratio for the ratios of the"
        " paper",
    )
    prior: Weight = option(0.5, "rows that the surroundings of a leaf count for in its fit [1]")
    uniform_weight: Weight = option(
        400.0,
        "weight of blocks of one material, which are few in the data but fill most real objects; "
        "1 counts them as any others [1]",
    )
    seed: Seed = option(0, "seed of the trees")
    ranks: Ranks = option(
        1,
        "MPI ranks that share the rows of a tree, and the samples that leaves are fitted to; the "
        "memory of each for growing falls with them [1]",
    )
    threads: WorkersAnywhere | None = option(
        None,
        "threads of each of these ranks; null for one in several ranks and for a tree, and for the "
        "cores of the solver for leaves on one rank [1]",
    )


@parameters
class ForestsSection(TrainingSection):
    """The run's own regression forests, and the table of their errors on single blocks."""

    model: File | None = option(
        None,
        "forests to coarsen by instead of the run's own, which are then not trained; default for "
        "those of the package, or a file relative to the working directory; null trains the run's"
        " own",
    )
    blocks: Blocks = option(
        2000, "random blocks of each kind in the table of errors on single blocks [1]"
    )
    materials: BaseMaterials = option(8)


@parameters
class DefaultDatasetSection(DatasetSection):
    """Training data of the default forests."""

    samples: Samples = option(6_000_000)
    shards: Shards = option(8)
    seed: Seed = option(1, "seed of the sampled blocks")


@parameters
class DefaultTrainingSection(TrainingSection):
    """How the default forests are trained."""

    max_leaves: Leaves = option(45_000)
    min_leaf: LeafRows = option(15)
    structure_rows: Rows = option(20_000_000)


@parameters
class DefaultForestSection:
    """The forests that come with the package; target default_forest trains them."""

    dataset: DefaultDatasetSection = option(DefaultDatasetSection)
    forests: DefaultTrainingSection = option(DefaultTrainingSection)
