"""The page that sets the optimisers beside each other, by several seeds on the recorded solids."""

from collections.abc import Iterator
from functools import cached_property
from typing import Any

from studies.base.conditions import IN_COLUMNS, Record, Repeats, measured
from studies.base.page import StudyPage, section
from studies.base.parts import grid, html
from studies.base.results import Results
from studies.base.table import Column, Row, Table, hidden, spread, table
from studies.sounds.examples import COMPARISON, examples
from studies.sounds.tables import METHODS


class ComparedSounds(Results):
    """The folder of all examples, those whose clips are strikes of a known material."""

    @cached_property
    def compared(self) -> dict[str, dict[str, Any]]:
        """Outputs of `sound benchmark` by example."""
        recorded = (name for name, each in examples(self.config).items() if each.recorded)
        return {name: self.read_json(f"{name}/{COMPARISON}") for name in recorded}

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of every comparison."""
        return {name: each["provenance"] for name, each in self.compared.items()}


COMPARED = measured(
    lambda results: results.origins,
    lambda results: Repeats(f"{results.config['sound']['compare_seeds']} seeds", IN_COLUMNS),
)


@table(
    hidden("example", "Example"),
    Column("title", "Solid"),
    Column("method", "Optimiser"),
    Column("cost_start", "Cost before", "score"),
    spread("cost_end", "after", "score"),
    spread("fall", "Fall", "share"),
    spread("evaluations", "Evaluations", "count"),
    spread("fine_rms_cents", "From targets, rms [cents]", "fraction", "cents"),
    spread("seconds", "Time", "seconds", shown=False),
    keys="example method",
    conditions=COMPARED,
)
def comparison(results: ComparedSounds) -> Iterator[Row]:
    """The hybrid optimiser beside its two parts alone on solids whose clips are strikes of a known
    material, with checks on the fine solid, for {config[sound][compare_seconds]:count} s each:
    medians, smallest and largest values of {config[sound][compare_seeds]} seeds. Costs and
    distances are those of the fine solid. L-BFGS makes no use of its seed, so that its spread is
    that of the clock."""
    for name, compared in results.compared.items():
        title = examples(results.config)[name].title
        for row in compared["rows"]:
            falls = {key: row[key] / 100.0 for key in row if key.startswith("fall_percent")}
            falls = {key.replace("_percent", ""): value for key, value in falls.items()}
            method = METHODS[row["method"]]
            yield {**row, **falls, "example": name, "title": title, "method": method}


def page(results: ComparedSounds, tables: dict[str, Table]) -> StudyPage:
    """Build the page from its table."""
    return StudyPage(
        title="Optimisers by several seeds",
        kicker="sound design",
        lede="Does the hybrid find better materials than its parts, or was it luck?",
        sections=[section("Optimisers", grid(tables["comparison"]))],
        footer=html("""This page holds all of its numbers; its table is also a file in
            <span class="file">tables/</span> beside it."""),
    )
