"""What Snakemake's own report offers of a study, each with a caption in `captions/`.

Paths of captions are seen from the folder of the rules.
"""

from __future__ import annotations

from snakemake.io import report

from workflow.studies.base.study import Figure, Study

CAPTIONS = "../studies/captions"


def tables(study: Study, folder: str) -> list[str]:
    """Files of a study's tables in its `folder`, the CSV files marked."""
    return [
        part
        for name, entry in study.entries.items()
        for part in (
            report(
                f"{folder}/tables/{name}.csv",
                caption=f"{CAPTIONS}/table.rst",
                category="Tables",
                subcategory=study.name,
                labels={"table": name, "shows": entry.shows},
            ),
            f"{folder}/tables/{name}.md",
            f"{folder}/tables/{name}.json",
        )
    ]


def figure(study: Study, drawn: Figure, folder: str) -> list[str]:
    """Files of a figure, the SVG file marked."""
    svg = report(
        f"{folder}/figures/{drawn.file}.svg",
        caption=f"{CAPTIONS}/{drawn.caption}.rst",
        category="Figures",
        subcategory=drawn.group or study.name,
        labels={"figure": drawn.shows},
    )
    return [svg, f"{folder}/figures/{drawn.file}.png"]


def page(study: Study, path: str, category: str = "Report", **labels: str) -> str:
    """The page of a study."""
    return report(
        path,
        caption=f"{CAPTIONS}/{study.caption}.rst",
        category=category,
        labels=labels or {"page": study.title},
    )
