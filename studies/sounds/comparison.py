"""The page that sets the optimisers beside each other, by several seeds on the recorded solids."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

from studies.base.conditions import IN_COLUMNS, Record, Repeats, measured
from studies.base.entry import Row
from studies.base.page import rendered
from studies.base.results import Results
from studies.base.table import Table
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


def comparison(results: ComparedSounds) -> Iterator[Row]:
    """Medians and spreads of every optimiser on every solid."""
    for name, compared in results.compared.items():
        title = examples(results.config)[name].title
        for row in compared["rows"]:
            falls = {key: row[key] / 100.0 for key in row if key.startswith("fall_percent")}
            falls = {key.replace("_percent", ""): value for key, value in falls.items()}
            method = METHODS[row["method"]]
            yield {**row, **falls, "example": name, "title": title, "method": method}


def page(results: ComparedSounds, tables: dict[str, Table]) -> str:
    """Build the page from its table."""
    return rendered(
        "studies/sounds/comparison.html.j2",
        title="Optimisers by several seeds",
        table=tables["comparison"],
    )
