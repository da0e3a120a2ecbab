"""What the study is made of."""

from dataclasses import replace

from studies.base.study import Config, Figure, Study
from workflow import training

PARTS = ("model", "blocks", "benchmark", "variants", "curve")

FORESTS = Study(
    name="forests_study",
    package="studies.forests",
    title="The default forests",
    results="results:ForestsStudy",
    tables=("model", "blocks", "every-block", "variants", "curve", "cost", "sizes", "provenance"),
    measured=lambda config: [f"{part}.json" for part in PARTS],
    figures=(
        Figure("blocks", "plots:blocks_figure", "blocks.json"),
        Figure("variants", "plots:variants_figure", "variants.json"),
        Figure("curve", "plots:curve_figure", "curve.json"),
        Figure("sizes", "plots:sizes_figure", "benchmark.json"),
    ),
)


def trainings(config: Config) -> training.Training:
    """The trainings that the study compares: on data of the default forests."""
    plan = training.default(config)
    rows = config["forests_study"]["structure_rows"]
    return replace(plan, forests={**plan.forests, "structure_rows": rows})
