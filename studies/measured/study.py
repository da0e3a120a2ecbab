"""What the study is made of."""

from studies.base.study import Config, Figure, Study
from workflow.arguments import options

MEASURED = Study(
    name="measured",
    title="Measured and published frequencies",
    results="results:MeasuredStudy",
    tables=("summary", "solids", "waiting", "frequencies", "provenance"),
    measured=lambda config: ["measured.json"],
    figures=(Figure("errors", "plots:errors_figure", "measured.json"),),
)


def arguments(config: Config) -> list[str]:
    """What is measured."""
    part = config["measured"]
    return options({**part, "solids": ",".join(part["solids"])})
