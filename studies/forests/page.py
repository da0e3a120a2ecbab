"""The study of the forests as one page."""

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
    values = {
        **findings(study),
        "model": model,
        "samples": model["scores"].get("training_samples"),
        "plural": "s" * (model["trees"] > 1),
    }
    drawn = {name: plot(study.drawn(name), text, name) for name, text in FIGURES.items()}
    return StudyPage(
        title="What are the forests worth?",
        kicker="study of the regression forests",
        lede=html(
            """Forests that have learned the fit <b>{model[objective]}</b> coarsen a block of
            2×2×2 voxels without fitting it. What do they lose against the fit, what do they cost,
            and what would other trainings or more data give?""",
            model=model,
        ),
        sections=[
            section(
                "Verdict",
                tiles(
                    (
                        "{forest[mean_error]:fraction}",
                        """mean squared displacement error of the <b>forests</b> on solid
                            blocks, uniform moduli, nodal forces, relative to the fine
                            displacements; {fit[mean_error]:fraction} by the fit itself,
                            {forest[min_mean_error]:fraction} by the best element there can be""",
                        "ddfem_hcms_ec",
                    ),
                    (
                        "{forest[seconds_per_block]:seconds}",
                        """a block on one core; the <b>fit</b> on the spot takes
                            {fit[seconds_per_block]:seconds}, {speed_up:times} as long""",
                        "speed",
                    ),
                    (
                        "{model[memory_bytes]:bytes}",
                        """<b>storage</b>: {model[trees]} tree{plural} in each of the two forests,
                            {model[leaves]:count} leaves""",
                    ),
                    (
                        "{samples:count}",
                        "<b>blocks</b> were trained on, eight rows each",
                        "proof",
                    ),
                    **values,
                ),
            ),
            section(
                "Single blocks",
                drawn["blocks"],
                grid(tables["blocks"]),
                grid(tables["every-block"], by="blocks"),
                id="blocks",
            ),
            section("Ways to train", drawn["variants"], grid(tables["variants"]), id="trainings"),
            section("Rows", drawn["curve"], grid(tables["curve"]), id="curve"),
            section("Cost", grid(tables["cost"]), drawn["sizes"], grid(tables["sizes"])),
            section("The forests", grid(tables["model"]), menu="Forests", id="model"),
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
