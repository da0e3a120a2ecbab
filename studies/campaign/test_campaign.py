"""The campaign: what its cells are, how they are judged, and that a failed one stops no other."""

import json
import shlex
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from studies.campaign.cells import cells_of, validation_arguments
from studies.campaign.results import FAILED, MISSED, PASSED, WRONG, Campaign, end_of
from studies.campaign.running import validated
from studies.campaign.study import CAMPAIGN
from studies.campaign.verdict import as_json, as_junit
from studies.campaign.verdict import main as verdict
from tests.pages import assert_self_contained, page_of
from tests.workflow_runs import PROFILE, TINY, planned, snakemake
from workflow import settings
from workflow.__main__ import main
from workflow.configuration.whole import completed

MODELS = {
    "box": {"mesh": "builtin:box", "resolution": 8, "title": "A <box> & more"},
    "bar": {"mesh": "builtin:bar", "resolution": 8},
    "ghost": {"mesh": "ghost.obj", "resolution": 8},
}
PART = {"models": MODELS, "materials": ["uniform", "noise"], "seeds": [3], "ranks": [1, 2]}


def criterion(key: str, found: float | None, limit: float) -> dict:
    met = found is not None and found <= limit
    return {
        "group": "hcms_ec",
        "key": key,
        "label": f"The {key}",
        "found": found,
        "limit": limit,
        "shown": str(found),
        "required": f"≤ {limit}",
        "verdict": "met" if met else "missed",
    }


def result(end: str, *criteria: dict, reason: str | None = None) -> dict:
    return {
        "command": f"carillon validate 'a {end}'",
        "seconds": 1.5,
        "provenance": {},
        "passed": end == PASSED,
        "reason": reason,
        "wrong": ["HCMS + EC"] if end == WRONG else [],
        "advice": f"Advice of what is {end}.",
        "criteria": list(criteria),
        **({} if reason else {"page": "validation/box.html"}),
    }


@pytest.fixture
def config(tmp_path) -> dict:
    given = {"models": {"box": dict(MODELS["bar"])}, "campaign": PART, "mesh_folder": str(tmp_path)}
    (tmp_path / "given.yaml").write_text(yaml.safe_dump(given, sort_keys=False))
    complete = settings.complete([tmp_path / "given.yaml"])
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(complete, sort_keys=False))
    return complete


@pytest.fixture
def study(tmp_path, config) -> Campaign:
    """Eight cells: one that was not run, one that is wrong, one that missed a limit, and others."""
    folder = tmp_path / "campaign"
    results = {
        0: result(PASSED, criterion("residual", 0.5, 1.0)),
        1: result(MISSED, criterion("residual", 3.0, 1.0), criterion("rigid", 6, 6)),
        3: result(WRONG, criterion("counted", None, 9.0)),
        5: result(FAILED, reason="solver modes: \x1b[1mno <memory> & no room"),
        6: result(PASSED, criterion("residual", 0.9, 1.0)),
    }
    for number, cell in enumerate(cells_of(config)):
        path = folder / "cells" / f"{cell.path}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        content = results.get(number, result(PASSED, criterion("residual", 0.1, 1.0)))
        path.write_text(json.dumps(content))
    return Campaign(folder)


def test_cells_are_all_solids_that_are_there_with_everything(config):
    cells = cells_of(config)
    assert len(cells) == 2 * 2 * 1 * 2 and {cell.solid for cell in cells} == {"box", "bar"}
    assert len({cell.path for cell in cells}) == len(cells)


def test_the_arguments_of_a_cell_are_those_of_validate(config):
    words = validation_arguments(config, cells_of(config)[3])
    told = shlex.join(words)
    assert words[0] == "builtin:box"
    for part in ("--material noise", "--seed 3", "--ranks 2", "--modes 60", "--tolerance 1e-07"):
        assert part in told
    assert "frequency_rms=0.3 frequency_worst=1" in told
    config["campaign"]["models"]["box"]["mesh"] = "builtin:gong"
    with pytest.raises(settings.UserError, match=r"campaign\.models\.box\.mesh"):
        completed(config)


def test_the_worst_come_first(study):
    ends = [end_of(each) for each in study.found.values()]
    assert ends == [FAILED, WRONG, MISSED, *[PASSED] * 5]
    shares = [each["criteria"][0]["found"] for each in list(study.found.values())[3:]]
    assert shares == sorted(shares, reverse=True)
    assert study.headline == "Failed: 3 of 8 cells (1 not run, 1 wrong, 1 missed)."


def test_programs_read_the_verdict(study, tmp_path, capsys):
    path = tmp_path / "verdict.json"
    path.write_text(json.dumps(as_json(study)))
    assert verdict(str(path)) == 1 and capsys.readouterr().out.startswith("Failed: 3 of 8")
    content = json.loads(path.read_text())
    assert not content["passed"] and len(content["cells"]) == 8
    assert content["cells"][0]["reason"].startswith("solver modes:")
    root = ElementTree.fromstring(as_junit(study).encode())
    suites = {suite.get("name"): suite for suite in root}
    assert set(suites) == {"A <box> & more", "Bar"}
    totals = [sum(int(suite.get(key)) for suite in root) for key in ("tests", "failures", "errors")]
    assert totals == [8, 2, 1]
    (error,) = root.iter("error")
    assert "no <memory> & no room" in error.get("message")
    assert error.text.endswith("carillon validate 'a not run'")


def test_a_campaign_whose_cells_all_pass_passes(study, tmp_path):
    for path in study.folder.rglob("cells/*/*.json"):
        path.write_text(json.dumps(result(PASSED, criterion("residual", 0.1, 1.0))))
    again = Campaign(study.folder)
    assert again.passed and again.headline == "Passed: all 8 cells."
    (tmp_path / "verdict.json").write_text(json.dumps(as_json(again)))
    assert verdict(str(tmp_path / "verdict.json")) == 0


def test_the_page_shows_every_cell_and_how_to_repeat_it(study, tmp_path):
    page = page_of(CAMPAIGN, study, tmp_path / "page.html")
    assert_self_contained(page)
    source = page.source
    order = [source.index(f"a {end}&#39;") for end in (FAILED, WRONG, MISSED, PASSED)]
    assert order == sorted(order)
    assert source.count('<pre class="config">') == 8
    assert "Without ghost: there is no" in source and "no &lt;memory&gt; &amp; no room" in source
    assert "Advice of what is wrong." in source and "Failed: 3 of 8 cells" in source


def test_a_validation_that_fails_is_a_result(tmp_path):
    log = tmp_path / "cell.log"
    words = ["builtin:gong", "--resolution", "8"]
    found = validated(words, tmp_path / "a cell", cores=1, log=log)
    assert not found["passed"] and found["criteria"] == []
    assert "builtin:gong: no such built-in object" in found["reason"]
    assert found["command"].startswith("carillon validate builtin:gong --resolution 8 --out '")


def test_a_dry_run_plans_a_validation_for_each_cell(tmp_path):
    options = ("--profile", PROFILE, "--configfile", TINY, "--dry-run", "--cores", 2)
    found = planned(snakemake(tmp_path, *options, "campaign"))
    cells = len(cells_of(settings.complete([TINY])))
    assert found == {
        "campaign": 1,
        "save_config": 1,
        "validate_cell": cells,
        "judge_campaign": 1,
        "tabulate_campaign": 1,
        "build_campaign": 1,
        "total": cells + 5,
    }


@pytest.mark.nightly
def test_a_tiny_campaign_goes_on_past_a_cell_that_fails(tmp_path):
    """The plate is too thin for so few voxels, so that its cells cannot be run."""
    thin = {"mesh": "builtin:cymbal", "resolution": 8}
    box = {"mesh": "builtin:box", "resolution": 8}
    part = {"models": {"thin": thin, "box": box}, "materials": ["random"], "seeds": [0]}
    config = yaml.safe_load(TINY.read_text())
    config["campaign"] = {**part, "ranks": [2], "modes": 20}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    options = ("--profile", PROFILE, "--configfile", "config.yaml", "--cores", 2)
    done = snakemake(tmp_path, *options, "campaign")
    assert done.returncode == 1 and "Failed: 1 of 2 cells (1 not run)." in done.stdout
    folder = Path(tmp_path, config["results_dir"], "campaign")
    cells = json.loads((folder / "verdict.json").read_text())["cells"]
    assert [cell["verdict"] for cell in cells] == [FAILED, PASSED]
    assert "thinner than a voxel" in cells[0]["reason"]
    assert (folder / "report.html").exists() and (folder / "junit.xml").exists()
    # The command repeats the cell, from the working directory.
    words = shlex.split(cells[1]["command"])
    assert words[:2] == ["carillon", "validate"]
    assert main(words[1:-1] + [str(tmp_path / "again")]) == 0
