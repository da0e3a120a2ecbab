"""The report of a run as a study: what it is made from, and which figures it draws."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from studies.base.study import Config, Figure, Study
from workflow import settings, solids, variants

MEASURES = {
    "convergence": "convergence.models",
    "methods": "times.models",
    "scaling": "scaling.models",
}
"""Keys of the configuration that name the measured models, by the file of the result."""


def _by_variant(
    config: Config, names: Callable[[Mapping[str, Any]], Iterable[str]], pattern: str
) -> list[str]:
    return [
        pattern.format(model=name, variant=variant)
        for name, model in config["models"].items()
        for variant in names(model)
    ]


def _measured(config: Config) -> list[str]:
    models = config["models"]
    further = [name for name in models if variants.further_of(models[name])]
    return [
        "forests/forests.json",
        "forests/table.json",
        *(f"dataset/{name}.json" for name in settings.own_shards(config)),
        *_by_variant(config, variants.variants_of, "models/{model}/{variant}.h5"),
        *(f"models/{name}/comparisons.json" for name in models),
        *(f"models/{name}/further_comparisons.json" for name in further),
        *solids.measured_files(config, MEASURES),
    ]


def _beside(config: Config) -> list[str]:
    models = config["models"]
    return [
        *_by_variant(config, variants.shown_of, "figures/{model}-mode-{variant}.png"),
        *(f"figures/{model}-mode.json" for model in models),
        *(f"validation/tables/{model}-criteria.json" for model in models),
    ]


REPORT = Study(
    name="report",
    package="workflow.report",
    folder="",
    title="This run",
    results="results:Run",
    tables=(
        *("summary", "frequencies", "errors", "coarsening", "times", "phases", "evidence"),
        *("design", "provenance", "methods", "spreads", "ratios", "convergence", "scaling"),
        *("blocks", "training"),
    ),
    target=False,
    measured=_measured,
    beside=_beside,
    figures=(
        Figure("{model}-spectrum", "plots:spectrum_figure", "tables/frequencies.json", of="models"),
        Figure(
            "{model}-convergence",
            "convergence_plot:convergence_figure",
            "models/{model}/convergence.json",
            of="convergence.models",
        ),
        Figure(
            "{model}-scaling",
            "studies.scaling.plot:scaling_figure",
            "models/{model}/scaling.json",
            of="scaling.models",
        ),
        Figure("times", "plots:times_figure", "tables/times.json"),
        Figure("methods", "plots:methods_figure", "tables/methods.json"),
    ),
)
