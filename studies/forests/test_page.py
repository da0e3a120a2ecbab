"""The default forests and their study: what is planned, mistakes, and a miniature end to end."""

import json

import pytest

from carillon.errors import UserError
from forests import default as default_forests
from studies.base.table import read_table
from studies.forests.study import FORESTS
from tests.pages import finished_page
from tests.workflow_runs import CHECKOUT, LAPTOP, finished
from workflow import settings
from workflow.configuration.whole import completed


def test_default_forests_are_trained_tree_by_tree_as_those_of_a_run_and_not_in_it(plan):
    jobs = plan("default_forest")
    assert jobs["generate_default_shard"] == 2 * 8
    assert jobs["grow_default_tree"] == 2 * 3
    assert jobs["train_default_forest"] == jobs["describe_default_forest"] == 1
    assert "generate_shard" not in jobs and "find_modes" not in jobs
    default = plan()
    assert default["grow_tree"] == 2 * 3
    assert not {"grow_default_tree", "compare_on_blocks", "rate_objectives"} & set(default)


def test_the_default_forests_are_named_as_seen_from_the_checkout(monkeypatch):
    monkeypatch.chdir(CHECKOUT)
    assert settings.forest_files() == ["forests/default.h5"]
    monkeypatch.chdir(CHECKOUT / "tests")
    assert settings.forest_files() == [str(CHECKOUT / "forests" / "default.h5")]


@pytest.mark.parametrize("named", [True, False])
def test_the_study_takes_forests_that_are_named_or_the_default_ones(tmp_path, monkeypatch, named):
    config = settings.complete([LAPTOP])
    monkeypatch.setattr(default_forests, "default_path", lambda: tmp_path / "default.h5")
    config["forests_study"]["model"] = "own.h5" if named else None
    files = settings.forest_files(config["forests_study"]["model"])
    assert files == ["own.h5" if named else str(tmp_path / "default.h5")]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"shards": 9}, "forests_study.shards: 9 of 8 shards"),
        ({"curve_rows": [1000, 10**9]}, "forests_study.curve_rows: 1,000,000,000 rows, but"),
        ({"variants": ["magic"]}, r"forests_study.variants\[0\]: found 'magic', expected one of"),
    ],
)
def test_a_study_beyond_its_data_is_answered_in_one_sentence(changes, says):
    config = settings.complete([LAPTOP])
    config["forests_study"] |= changes
    with pytest.raises(UserError, match=says):
        completed(config)


@pytest.fixture(scope="module")
def miniature(tmp_path_factory):
    """Folder of the results of tiny default forests and of their study."""
    folder = tmp_path_factory.mktemp("forests-study")
    return finished(folder, "default_forest", "forests_study") / "results-tiny"


@pytest.mark.nightly
def test_tiny_default_forests_hold_the_trees_grown_apart(miniature):
    summary = json.loads((miniature / "default_forest" / "forests.json").read_text())
    assert summary["trees"] == 1
    assert summary["scores"]["r2_log_solid"] > 0.8
    assert len(list((miniature / "default_forest" / "trees").iterdir())) == 2


@pytest.mark.nightly
def test_the_page_of_a_miniature_study_holds_its_tables_and_figures(miniature):
    finished_page(FORESTS, miniature / "forests_study")


@pytest.mark.nightly
def test_a_miniature_study_finds_that_more_rows_help(miniature):
    few, many = read_table(miniature / "forests_study" / "tables" / "curve.json").rows
    assert few["rows"] < many["rows"] <= 24000
    assert many["scores0_rms_log_solid"] < few["scores0_rms_log_solid"]
    variants = read_table(miniature / "forests_study" / "tables" / "variants.json").rows
    assert [row["variant"] for row in variants] == ["logarithms", "logarithms, linear splits"]
