"""Keys of the study in the configuration, and what its jobs take."""

from typing import Annotated, Any

from annotated_types import Ge, Le, MinLen

from carillon.parameters import OneOf, option, parameters
from carillon.parameters.sentences import ParameterError
from workflow.configuration.forests import BaseMaterials, Blocks, Leaves, Rows, Shards
from workflow.configuration.resources import JobLimits
from workflow.configuration.run import Configuration
from workflow.configuration.section import File, Several

VARIANTS: dict[str, dict[str, Any]] = {
    "ratios, variance splits (paper)": {"transform": "ratio", "grower": "best"},
    "ratios, log target": {"transform": "ratio-log", "grower": "best"},
    "bounded ratios, log target": {"transform": "bounded", "grower": "best"},
    "logarithms": {"grower": "best"},
    "logarithms, extra-trees": {"grower": "extra"},
    "ratios, log target, linear splits": {"transform": "ratio-log"},
    "bounded ratios, linear splits": {"transform": "bounded"},
    "logarithms, linear splits": {},
    "the same, 1 tree": {"trees": 1},
    "the same, 6 trees": {"trees": 6},
}
"""Trainings that are compared, as what they change of the default one."""
CurveRows = Annotated[
    Several[Annotated[int, Ge(1000), Le(100_000_000_000)]],
    MinLen(2),
    "training rows of the learning curve, eight to a sample of default_forest [1]",
]


@parameters
class ForestsStudySection:
    """The study of the default forests by blocks, rows and ways to train; target forests_study
    computes it.
    """

    model: File | None = option(
        None,
        "forests that are studied, relative to the working directory; those of the package if "
        "null, or if there are none those of target default_forest",
    )
    blocks: Blocks = option(
        10_000, "random blocks of each kind in the table of errors on single blocks [1]"
    )
    materials: BaseMaterials = option(8)
    shards: Shards = option(
        1,
        "first shards of each distribution of default_forest that the ways to train are compared "
        "on [1]",
    )
    variants: Several[Annotated[str, OneOf(*VARIANTS)]] | None = option(
        None, "names of the ways to train that are compared; all that forests variants has if null"
    )
    curve_rows: CurveRows = option((100_000, 300_000, 1_000_000, 3_000_000, 10_000_000, 30_000_000))
    variant_leaves: Leaves = option(
        4000,
        "leaves of a tree at most where trainings are compared; few enough that all use them up "
        "[1]",
    )
    structure_rows: Rows = option(
        2_000_000,
        "rows that splits are chosen from in both comparisons; too few leave the storage unused "
        "[1]",
    )
    timed_blocks: Blocks = option(100_000, "blocks that are timed at once [1]")
    largest: Annotated[float, Ge(1), Le(100_000)] = option(
        600, "storage of the largest forests that are timed [MB]"
    )

    def check_in(self, run: Configuration) -> None:
        """Check that the data of the default forests suffice.

        Raises ParameterError if they do not.
        """
        data = run.default_forest.dataset
        if self.shards > data.shards:
            reason = f"{self.shards} of {data.shards} shards of a distribution"
            raise ParameterError(("shards",), f"{reason}, see default_forest.dataset.shards")
        rows, most = max(self.curve_rows), 8 * data.samples
        if rows > most:
            reason = f"{rows:,} rows, but default_forest.dataset.samples gives {most:,}"
            raise ParameterError(("curve_rows",), reason)


SECTIONS = {"forests_study": ForestsStudySection}
LIMITS = {
    "benchmark_forests": JobLimits("times of the forests in their study", 2000, 30),
    "compare_trainings": JobLimits(
        "variants of the training in the study of the forests", 8000, 240
    ),
    "follow_learning": JobLimits("learning curve in the study of the forests", 8000, 240),
}
