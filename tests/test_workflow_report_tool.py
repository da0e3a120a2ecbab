"""What Snakemake itself draws and reports: the picture of the rules, and marks for its report."""

from __future__ import annotations

import re

import pytest

from carillon.errors import UserError
from tests.workflow_runs import CHECKOUT, planned, snakemake
from workflow import rule_graph


def test_picture_of_the_rules_shows_the_default_run(tmp_path):
    """If it fails: python -m workflow.rule_graph > docs/rules.svg"""
    jobs = planned(snakemake(tmp_path, "--dry-run", "--cores", 2))
    picture = (CHECKOUT / "docs" / "rules.svg").read_text()
    assert set(re.findall(r">(\w+)</text>", picture)) == set(jobs) - {"all", "total"}


def test_arrows_of_a_graph_leave_the_target_out():
    graph = '0[label = "all"];\n1[label = "second"];\n2[label = "first"];\n1 -> 0\n2 -> 1\n'
    assert rule_graph.pairs(graph) == [("first", "second")]


def test_without_graphviz_a_sentence_says_what_is_missing(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match="install Graphviz"):
        rule_graph.draw([("first", "second")])
