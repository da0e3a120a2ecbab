"""The study of the forests as one page."""

from __future__ import annotations

from functools import partial
from typing import Any

from dataset_gen.objectives import closed_form
from studies.base.page import StudyPage, origins, section
from studies.base.parts import grid, html, plot, tiles
from studies.base.table import Table
from studies.forests.results import ForestsStudy

FIGURES = {
    "blocks": """Mean relative squared displacement error under nodal forces over the cost per
        block, both axes logarithmic; further down and further left is better. The dashed line is
        the least error of any element.""",
    "variants": """Root mean square of the error of log E on fresh blocks against the fit, by
        distribution of the moduli; solid blocks filled, partly void ones hollow. The axis is
        logarithmic.""",
    "curve": """The same error over the rows trained on; both axes are logarithmic. Where a curve
        flattens, more data do not help.""",
    "sizes": """Time of a block over the storage of the forests, both axes logarithmic: forests
        that outgrow a cache wait for memory.""",
}


def page(study: ForestsStudy, tables: dict[str, Table]) -> StudyPage:
    """Build the page from the tables and figures of the study; nothing is computed anew."""
    model = study.model
    say = partial(
        html, model=model, samples=model["scores"].get("training_samples"), **findings(study)
    )
    drawn = {name: plot(study.drawn(name), text, name) for name, text in FIGURES.items()}
    return StudyPage(
        title="What are the forests worth?",
        kicker="study of the regression forests",
        lede=say("""Forests that have learned the fit <b>{model[objective]}</b> coarsen a block of
            2×2×2 voxels without fitting it. What do they lose against the fit, what do they cost,
            and what would other trainings or more data give?"""),
        sections=[
            section(
                "verdict",
                "Verdict",
                tiles(
                    (
                        say("{forest[mean_error]:fraction}"),
                        say("""mean squared displacement error of the <b>forests</b> on solid
                            blocks, uniform moduli, nodal forces, relative to the fine
                            displacements; {fit[mean_error]:fraction} by the fit itself,
                            {forest[min_mean_error]:fraction} by the best element there can be"""),
                        "ddfem_hcms_ec",
                    ),
                    (
                        say("{forest[seconds_per_block]:seconds}"),
                        say("""a block on one core; the <b>fit</b> on the spot takes
                            {fit[seconds_per_block]:seconds}, {speed_up:times} as long"""),
                        "speed",
                    ),
                    (
                        say("{model[memory_bytes]:bytes}"),
                        say(
                            """<b>storage</b>: {model[trees]} tree{} in each of the two forests,
                            {model[leaves]:count} leaves""",
                            "s" * (model["trees"] > 1),
                        ),
                    ),
                    (
                        say("{samples:count}"),
                        say("<b>blocks</b> were trained on, eight rows each"),
                        "proof",
                    ),
                ),
            ),
            section(
                "blocks",
                "Single blocks",
                drawn["blocks"],
                grid(tables["blocks"]),
                grid(tables["every-block"], by="blocks"),
            ),
            section("trainings", "Ways to train", drawn["variants"], grid(tables["variants"])),
            section("curve", "Rows", drawn["curve"], grid(tables["curve"])),
            section("cost", "Cost", grid(tables["cost"]), drawn["sizes"], grid(tables["sizes"])),
            section("model", "The forests", grid(tables["model"]), menu="Forests"),
            origins(tables["provenance"]),
        ],
    )


def findings(study: ForestsStudy) -> dict[str, Any]:
    """The numbers of the page's head: the forests beside the fit that they learned."""
    objective = study.model["objective"]
    blocks = study.result("blocks")
    first = blocks[0]
    rows = {
        row["method"]: row
        for row in blocks
        if all(row[key] == first[key] for key in ("range_gpa", "distribution", "fill", "scaled_by"))
    }
    forest = next(row for name, row in rows.items() if name.startswith(f"{objective}, forests"))
    fit = rows[f"{closed_form(objective)}, fitted on the spot"]
    return {
        "forest": forest,
        "fit": fit,
        "speed_up": fit["seconds_per_block"] / forest["seconds_per_block"],
    }
