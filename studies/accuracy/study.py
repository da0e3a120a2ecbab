"""What the study is made of."""

from studies.base.study import Config, Figure, Study
from workflow.arguments import options

ACCURACY = Study(
    name="accuracy",
    title="Discretisations against references that no mesh made",
    results="results:AccuracyStudy",
    tables=("summary", "levels", "references", "provenance"),
    measured=lambda config: ["accuracy.json"],
    figures=(
        Figure("unknowns", "plots:unknowns_figure", "accuracy.json"),
        Figure("seconds", "plots:seconds_figure", "accuracy.json"),
    ),
)


def arguments(config: Config) -> list[str]:
    """What is measured, and how often."""
    part = config["accuracy"]
    return options({**part, "solids": ",".join(part["solids"])})
