"""What the study is made of."""

from __future__ import annotations

from studies.base.study import Figure, Study

PARTS = ("model", "blocks", "benchmark", "variants", "curve")

FORESTS = Study(
    name="forests_study",
    package="studies.forests",
    folder="forests_study",
    title="The default forests",
    results="results:ForestsStudy",
    page="page:page",
    measured=lambda config: [f"{part}.json" for part in PARTS],
    figures=(
        Figure("blocks", "plots:blocks_figure", "blocks.json"),
        Figure("variants", "plots:variants_figure", "variants.json"),
        Figure("curve", "plots:curve_figure", "curve.json"),
        Figure("sizes", "plots:sizes_figure", "benchmark.json"),
    ),
)
