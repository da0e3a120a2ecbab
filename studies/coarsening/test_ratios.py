"""Errors of coarse models by Poisson's ratio: what is compared, and that forests serve all."""

import json

import pytest

from carillon.errors import UserError
from solver.analysis.problem import ProblemOptions
from studies.coarsening.ratios import COARSENINGS, OWN, REFINED, lines_of, rate_ratios

BOX = ProblemOptions("builtin:box", 12)
RATIOS = (0.1, 0.45)
ALLOWED = 0.05


@pytest.fixture(scope="module")
def found():
    return rate_ratios([BOX], RATIOS, ALLOWED)


def test_forests_are_as_good_at_all_ratios_and_fits_are_not(found):
    low, high = found["rows"]
    assert low["ddfem"]["rms"] < 0.02 and high["ddfem"]["rms"] < 0.04
    assert high[OWN]["rms"] > 1.5 * high["ddfem"]["rms"]
    assert all(row[REFINED]["rms"] < ALLOWED for row in found["rows"])


def test_rows_are_those_of_the_ratios_and_are_printed(found):
    assert [row["poisson"] for row in found["rows"]] == list(RATIOS)
    assert all(row["coarse_n_dofs"] <= row["refined_n_dofs"] for row in found["rows"])
    text = "\n".join(lines_of(found))
    assert all(name in text for name in (*COARSENINGS, REFINED, "builtin:box", "0.45"))


def test_the_command_writes_what_it_measures(tmp_path, run_cli):
    out = tmp_path / "ratios.json"
    words = ["study", "ratios", "builtin:box", "--resolution", 8, "--ratios", 0.33, "--out", out]
    done = run_cli("solver", *words[1:], check=True)
    (row,) = json.loads(out.read_text())["rows"]
    assert row["poisson"] == 0.33 and f"{row['ddfem']['rms']:.1%}" in done.stdout


def test_ratios_that_forests_are_not_for_are_refused():
    with pytest.raises(UserError, match="ratios 0 to 0.49, the model has -0.1"):
        rate_ratios([BOX], [-0.1], ALLOWED)
