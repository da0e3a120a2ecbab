"""Numbers that pages quote are those of the kept tables and of the code."""

import json
import re
from functools import cache
from importlib import import_module

import pytest
import yaml

from carillon.fem.geometry.builtin import BUILTINS, THIN, TRIALS
from studies.base.numbers import show
from studies.base.table import Table, read_csv_table
from studies.claims.results import HERE, MEASURED, REFERENCE
from tests.documentation import CHECKOUT

QUOTED = yaml.safe_load((HERE / "quoted_numbers.yaml").read_text())
WALL_TIMES = {
    "SLEPc, fine mesh": ("slepc", None),
    "HCMS": ("hcms", "slepc"),
    "HCMS + EC": ("hcms_ec", "slepc"),
    "`--method auto`, to 10⁻⁶": ("fastest", "slepc"),
    "SLEPc to 10⁻³": ("slepc_rough", None),
    "`--method auto`, to 10⁻³": ("fastest_rough", "slepc_rough"),
    "the same from coarse modes (`--refine`)": ("refined", "slepc_rough"),
    "DDFEM\\*, then SLEPc": ("ddfem", "slepc"),
    "DDFEM\\* + `auto`, to 10⁻⁶": ("ddfem_ec_accurate", "ddfem"),
    "the same, to 10⁻²": ("ddfem_ec", "slepc"),
    "the same, warm": ("ddfem_ec_warm", "slepc"),
}
"""Methods of the rows of the table of wall times, and what their speed-ups are over."""


@cache
def kept(name: str) -> Table:
    """A table of the reference."""
    return read_csv_table(CHECKOUT / REFERENCE / f"{name}.csv")


def words(page: str) -> str:
    """Text of a page in one line."""
    return " ".join((CHECKOUT / page).read_text(encoding="utf-8").split())


def number(table: str, where: dict, column: str, kind: str = "times", **end: bool) -> str:
    """A number of a kept table as pages quote it."""
    rows = [row for row in kept(table).rows if where.items() <= row.items()]
    values = [row[column] for row in rows]
    if end:
        return show(min(values) if "least" in end else max(values), kind).rstrip("×")
    (value,) = values
    return show(value, kind).rstrip("×")


def constant(place: str, factor: float = 1) -> str:
    """A constant of the code as pages quote it."""
    module, _, name = place.partition(":")
    return f"{factor * getattr(import_module(module), name):,g}"


@pytest.mark.parametrize("quoted", QUOTED, ids=lambda quoted: quoted["sentence"][:40])
def test_quoted_numbers_are_those_of_tables_and_code(quoted):
    numbers = [number(**each) for each in quoted.get("numbers", ())]
    constants = [constant(each, quoted.get("factor", 1)) for each in quoted.get("constants", ())]
    sentence = re.sub(r"\{\}", "%s", quoted["sentence"].replace("%", "%%"))
    assert sentence % (*numbers, *constants) in words(quoted["page"])


def test_arpack_without_a_factorisation_took_what_the_page_says():
    (row,) = json.loads(MEASURED.read_text(encoding="utf-8")).values()
    times = row["seconds"]
    seconds = [times[name] for name in ("arpack_regular", "slepc", "ddfem_ec", "ddfem_ec_warm")]
    ratios = [seconds[0] / seconds[2], seconds[0] / seconds[3]]
    text = words("docs/results/measured.md")
    assert "it took {:.1f} s for {} modes".format(seconds[0], row["modes"]) in text
    assert (
        "SLEPc took {:.2f} s, and the coarse model {:.2f} s cold and {:.3f} s".format(*seconds[1:])
        in text
    )
    assert "{:.0f} and {:.0f} times as long".format(*ratios) in text
    assert f"`{row['provenance']['command']}`" in text


def test_the_tutorial_names_all_solids_that_come_along():
    section = words("docs/tutorials/modes.md").split("`builtin:NAME` with")[1].split(". ")[0]
    assert {*BUILTINS, *THIN, *TRIALS} <= set(re.findall(r"[a-z]+(?:-[a-z]+)*", section))


def test_the_table_of_wall_times_is_that_of_the_reference():
    page = (CHECKOUT / "docs" / "results" / "measured.md").read_text(encoding="utf-8")
    section = page.split("## Wall time\n")[1].split("\n### ")[0]
    lines = re.findall(r"^\|(.*)\|$", section, re.MULTILINE)
    solids, _, unknowns, *rows = ([cell.strip() for cell in line.split("|")] for line in lines)
    by_solid = {row["model"]: row for row in kept("paper/tables/methods").rows}
    assert set(by_solid) == set(solids[1:])
    for cell, solid in zip(unknowns[1:], solids[1:], strict=True):
        row = by_solid[solid]
        assert cell == f"{row['dof_fine']:,}, {row['dof_coarse']:,}"
    assert [row[0] for row in rows] == list(WALL_TIMES)
    for label, *cells in rows:
        method, base = WALL_TIMES[label]
        for cell, solid in zip(cells, solids[1:], strict=True):
            seconds = by_solid[solid][method]
            found = re.fullmatch(r"([\d.]+)(?: \(([\d.]+)\))?", cell)
            assert found, cell
            for text, value in zip(
                found.groups(), (seconds, by_solid[solid][base] / seconds if base else None)
            ):
                assert (text is None) == (value is None), (label, solid)
                if text is not None:
                    digits = len(text.partition(".")[2])
                    assert float(text) == pytest.approx(value, abs=0.5001 * 10.0**-digits)
