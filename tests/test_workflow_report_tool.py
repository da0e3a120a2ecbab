"""What Snakemake itself draws and reports: the picture of the rules, and marks for its report."""

from __future__ import annotations

import re
from types import SimpleNamespace

import jinja2
import pytest
import rule_graph
from docutils.core import publish_parts

from carillon.errors import UserError
from tests.workflow_runs import CHECKOUT
from workflow.studies import catalogue, marks

CAPTIONS = sorted((CHECKOUT / "workflow" / "studies" / "captions").glob("*.rst"))
RULES = [CHECKOUT / "Snakefile", *(CHECKOUT / "workflow" / "rules").glob("*.smk")]


def rendered(caption: str) -> str:
    """A caption as Snakemake's report shows it; fails on what reStructuredText does not allow."""
    wildcards = SimpleNamespace(model="bar", shape="bar", solid="bar")
    job = SimpleNamespace(wildcards=wildcards, config={"title": "A run"})
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined)
    text = environment.from_string(caption).render(snakemake=job)
    parts = publish_parts(text, writer="html", settings_overrides={"halt_level": 2})
    return str(parts["html_body"])


def test_picture_of_the_rules_shows_the_default_run(plan):
    """If it fails: python docs/extensions/rule_graph.py"""
    jobs = plan()
    picture = rule_graph.PICTURE.read_text()
    assert set(re.findall(r">(\w+)</text>", picture)) == set(jobs) - {"all", "total"}


def test_arrows_of_a_graph_leave_the_target_out():
    graph = '0[label = "all"];\n1[label = "second"];\n2[label = "first"];\n1 -> 0\n2 -> 1\n'
    assert rule_graph.pairs(graph) == [("first", "second")]


def test_without_graphviz_a_sentence_says_what_is_missing(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match="install Graphviz"):
        rule_graph.draw([("first", "second")])


@pytest.mark.parametrize("path", CAPTIONS, ids=lambda path: path.stem)
def test_captions_are_sentences(path):
    assert rendered(path.read_text()).rstrip().removesuffix("</div>").count(".</p>")


def test_every_caption_is_used_and_exists():
    sources = "".join(path.read_text() for path in RULES)
    named = {*re.findall(r"captions/(\w+)\.rst", sources), "table"}
    for study in catalogue.ALL.values():
        named |= {study.caption, *(figure.caption for figure in study.figures)}
    assert named == {path.stem for path in CAPTIONS}


@pytest.mark.parametrize("study", catalogue.STUDIES, ids=lambda study: study.name)
def test_every_table_says_what_it_shows_and_only_its_csv_file_is_marked(study):
    assert study.entries and all(entry.shows for entry in study.entries.values())
    files = marks.tables(study, "folder")
    assert files == [
        f"folder/tables/{name}.{kind}" for name in study.entries for kind in ("csv", "md", "json")
    ]
    marked = [file for file in files if "report" in getattr(file, "flags", {})]
    assert marked == [f"folder/tables/{name}.csv" for name in study.entries]
