"""Tables of the campaign: every cell, and the solids."""

import math
from collections.abc import Iterator

from studies.base.table import SOLID, Column, Row, hidden, solid, table
from studies.campaign.results import ENDS, Campaign, end_of, nearest, share_of
from studies.campaign.results import FAILED as FAILED


@table(
    SOLID,
    Column("material", "Material"),
    Column("seed", "Seed", "count"),
    Column("ranks", "Ranks", "count"),
    Column("end", "Verdict"),
    Column("missed", "Criteria missed", "count"),
    Column("what", "Nearest"),
    Column("of", "Spectrum"),
    Column("share", "Share of its limit", "small"),
    Column("seconds", "Time", "seconds"),
    hidden("command", "Command"),
    keys="model material seed ranks",
)
def cells(study: Campaign) -> Iterator[Row]:
    """Every cell, the worst first. Nearest: the criterion that is missed by most, or of a cell that
    passed the one that comes nearest to its limit, and what it found as a share of the limit. Of a
    cell that was not run, the reason."""
    for cell, result in study.found.items():
        end, worst = end_of(result), nearest(result)
        row: Row = {
            **solid(study, cell.solid),
            "material": cell.material,
            "seed": cell.seed,
            "ranks": cell.ranks,
            "end": end,
            "seconds": result["seconds"],
            "command": result["command"],
            "missed": sum(each["verdict"] == "missed" for each in result["criteria"]),
        }
        if worst is None:
            row["what"] = result["reason"]
        else:
            row["what"] = f"{worst['label']}: {worst['shown']}, required {worst['required']}"
            share = share_of(worst)
            row["of"], row["share"] = worst["group"], share if math.isfinite(share) else None
        yield row


@table(
    SOLID,
    Column("cells", "Cells", "count"),
    Column("passed", "Passed", "count"),
    Column("missed", "Missed", "count"),
    Column("wrong", "Wrong", "count"),
    Column("not_run", "Not run", "count"),
)
def solids(study: Campaign) -> Iterator[Row]:
    """Cells by how they ended. Wrong: a spectrum is not that of its matrices. Missed: a criterion
    that says something less."""
    for name in study.solids:
        ends = [end_of(each) for cell, each in study.found.items() if cell.solid == name]
        counts = {end.replace(" ", "_"): ends.count(end) for end in ENDS}
        yield {**solid(study, name), "cells": len(ends), **counts}
