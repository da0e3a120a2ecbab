"""Tables, numbers and aligned modes of the report."""

from __future__ import annotations

import csv
import doctest
from types import SimpleNamespace

import numpy as np
import pytest

from workflow.studies.base import numbers
from workflow.studies.base.colours import COLOURS, themed
from workflow.studies.base.media import cropped
from workflow.studies.base.numbers import show
from workflow.studies.base.style import svg
from workflow.studies.base.table import Column, Table, read_table, write_table
from workflow.studies.report.mode_pictures import aligned, cluster

TABLE = Table(
    "demo",
    "What it shows.",
    [
        Column("model", "Solid", shown=False),
        Column("seconds", "Time", "seconds", "s"),
        Column("error", "Error", "percent"),
    ],
    [{"model": "bell", "seconds": 12.34, "error": 0.01234}, {"model": "bar", "seconds": 0.5}],
)


def test_a_table_survives_its_file_and_programs_get_all_digits(tmp_path):
    write_table(TABLE, tmp_path)
    assert read_table(tmp_path / "demo.json") == TABLE
    lines = (tmp_path / "demo.csv").read_text().splitlines()
    assert lines[:2] == ["# keys: model", "# kinds: text, seconds, percent"]
    rows = list(csv.DictReader(lines[2:]))
    assert rows[0] == {"model": "bell", "seconds [s]": "12.34", "error": "0.01234"}
    assert rows[1]["error"] == ""


def test_people_see_shown_columns_with_few_digits():
    text = TABLE.as_markdown()
    assert "| Time | Error |" in text
    assert "| 12.3 s | 1.2 % |" in text
    assert "| 0.50 s | – |" in text


@pytest.mark.parametrize(
    ("value", "kind", "text"),
    [
        (float("nan"), "small", "–"),
        (0.0, "percent", "0 %"),
        (1e-12, "percent", "< 10⁻⁷ %"),
        (-0.0104, "percent", "−1.0 %"),
        (1234.56, "hertz", "1,234.6"),
        (np.pi / 2, "angle", "90°"),
        (2_500_000, "bytes", "2.50 MB"),
        (12.3, "times", "12×"),
    ],
)
def test_numbers_are_short_and_honest(value, kind, text):
    assert show(value, kind) == text


def test_examples_of_numbers_hold():
    assert doctest.testmod(numbers).failed == 0


def modes_file(frequencies, modes, nodes):
    return SimpleNamespace(
        frequencies=np.asarray(frequencies, dtype=float),
        modes=modes,
        mesh=SimpleNamespace(nodes=nodes),
    )


def test_modes_are_aligned_whatever_their_sign_scale_and_turn_in_a_cluster():
    generator = np.random.default_rng(3)
    nodes = generator.random((20, 3))
    modes = generator.standard_normal((60, 9))
    frequencies = [0, 0, 0, 0, 0, 0, 100.0, 100.4, 180.0]
    truth = modes_file(frequencies, modes, nodes)
    assert cluster(truth.frequencies) == [6, 7]
    turned = modes.copy()
    turn = np.radians(137.0)
    turned[:, 6] = -2.0 * (np.cos(turn) * modes[:, 6] + np.sin(turn) * modes[:, 7])
    turned[:, 7] = np.cos(turn) * modes[:, 7] - np.sin(turn) * modes[:, 6]
    order = generator.permutation(20)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    reference = modes[:, 6].reshape(-1, 3)
    motion, likeness = aligned(
        modes_file(frequencies, turned[rows], nodes[order]), truth, reference
    )
    np.testing.assert_allclose(motion, reference[order], atol=1e-12)
    assert likeness == pytest.approx(1.0)


def test_pictures_are_cropped_alike_to_what_any_of_them_shows():
    pictures = [np.zeros((40, 50, 4), dtype=np.uint8) for _ in range(2)]
    pictures[0][10:12, 20:30, 3] = 255
    pictures[1][20:25, 25:26, 3] = 255
    assert {picture.shape for picture in cropped(pictures, margin=3)} == {(21, 16, 4)}


def test_figures_can_share_a_page_and_follow_its_colours():
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots()
    axes.plot([0, 1], [0, 1], color=COLOURS["hcms_ec"])
    sources = [svg(figure, name) for name in ("one", "two")]
    plt.close(figure)
    assert 'id="one-' in sources[0] and 'id="two-' not in sources[0]
    page = themed(sources[0])
    assert "var(--hcms-ec)" in page and COLOURS["hcms_ec"] not in page
    assert "DejaVu" not in page and "<metadata>" not in page
