"""Tables, numbers and aligned modes of the report."""

import doctest
from types import SimpleNamespace

import numpy as np
import pytest

from solver.files.modes_file import FINE_TAKEN
from solver.response.response import FLOOR_DECIBELS, decibels
from studies.base import numbers
from studies.base.colours import COLOURS, themed
from studies.base.media import cropped, highest_hertz, spectrogram_figure
from studies.base.numbers import show
from studies.base.style import svg
from studies.base.table import Column, Table
from workflow.report.design_tables import costs, design, spread_of
from workflow.report.mode_pictures import aligned, cluster
from workflow.report.plots import methods_figure

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
        model=SimpleNamespace(rigid_modes=6),
    )


def test_modes_are_aligned_whatever_their_sign_scale_and_turn_in_a_cluster():
    generator = np.random.default_rng(3)
    nodes = generator.random((20, 3))
    modes = generator.standard_normal((60, 9))
    frequencies = [0, 0, 0, 0, 0, 0, 100.0, 100.4, 180.0]
    truth = modes_file(frequencies, modes, nodes)
    assert cluster(truth.frequencies, 6) == [6, 7]
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


def timed(slepc: float, cold: float, error: float) -> dict:
    """Output of `solver benchmark --design`, as far as the headline needs it."""
    worst = {"max": 1e-4}
    return {
        "provenance": {},
        "runs": {"slepc": 1},
        "resolution": 24,
        "modes": 100,
        "dof_fine": 9000,
        "dof_coarse": 2000,
        "seconds": {
            "precompute": 0.5,
            "slepc": slepc,
            "fastest": slepc / 4,
            "ddfem_rough": 2 * cold,
            "ddfem_ec": cold,
            "ddfem_ec_warm": cold / 8,
        },
        "eigenvalue_error": dict.fromkeys(
            ("fastest", "ddfem_rough", "ddfem_ec", "ddfem_ec_warm"), worst
        ),
        "frequency_error": {
            "ddfem": {"rms_7_60": error, "worst_7_60": -3 * error},
            "average": {"rms_7_60": 0.3, "worst_7_60": 0.5},
        },
    }


def headlines(methods: dict, summary: list[dict]) -> dict[str, Table]:
    """The tables that the costs of a design are told from."""
    results = SimpleNamespace(methods=methods, titles=dict(zip(methods, methods)), config={})
    forests = {"method": "calibrated, forests", "training_seconds": 8.0}
    return {
        "design": design(results),
        "summary": Table("summary", "", [], summary),
        "blocks": Table("blocks", "", [], [forests]),
    }


def single(title: str, speed_up: float, left: int) -> dict:
    """A row of the summary, of a solid of 17,745 unknowns."""
    return {"title": title, "speed_up": speed_up, "coarse_unknowns": left, "unknowns": 17745}


def test_the_headline_is_that_of_all_solids_and_of_equal_problems():
    bare = {**timed(4.0, 0.5, 0.02), "seconds": {"precompute": 0.5, "slepc": 4.0, "ddfem_ec": None}}
    methods = {"Bell": timed(4.0, 0.2, 0.02), "Pan": timed(1.0, 0.1, 0.03), "Cells": bare}
    table = headlines(methods, [])["design"]
    assert [row["title"] for row in table.rows] == ["Bell", "Pan"]
    assert spread_of(table, "cold") == pytest.approx((15.0, 10.0, 20.0))
    assert spread_of(table, "warm") == pytest.approx((120.0, 80.0, 160.0))
    assert spread_of(table, "cold_same") == pytest.approx((2.0, 2.0, 2.0))
    assert spread_of(table, "error") == pytest.approx((0.025, 0.02, 0.03))
    assert spread_of(table, "fine") == pytest.approx((4.0, 4.0, 4.0))
    assert spread_of(headlines({"Cells": bare}, [])["design"], "cold") is None


def test_where_it_does_not_pay_is_named():
    tables = headlines({"Bell": timed(4.0, 0.2, 0.02), "Pitcher": timed(4.0, 0.2, 0.08)}, [])
    _, rough = costs(tables)
    assert "Pitcher (8.0 % rms, worst 24 %)" in rough and "Bell" not in rough
    tables["summary"].rows[:] = [single("Bell", 5.0, 4053), single("Pitcher", 0.38, 15228)]
    told = costs(tables)[-1]
    assert "It did not pay: Pitcher (0.38×, 15,228 of 17,745 unknowns left)." in told
    assert "would not have paid" not in told
    assert told.startswith("A single spectrum to 5 % is another matter")
    assert costs(tables, 0.0)[-1].startswith(
        "Single spectra are those of coarse elements throughout"
    )


def test_a_solid_that_was_left_fine_is_told_as_such():
    rows = [single("Pitcher", 1.0, 17745), {**single("Jug", 1.1, 17745), FINE_TAKEN: "too soft"}]
    tables = headlines({"Bell": timed(4.0, 0.2, 0.02)}, rows)
    told = costs(tables)[-1]
    assert "and the fine model was solved: Pitcher; Jug (too soft)." in told
    assert "It was slower than SLEPc on none of the solids." in told
    assert "none of the solids" in costs(tables)[1]


def test_a_solid_that_is_not_heard_has_a_spectrogram_too():
    rate = 44100
    silence = np.zeros(rate // 4)
    tone = np.sin(2.0 * np.pi * 3000.0 * np.arange(rate // 4) / rate)
    assert highest_hertz([(tone, rate), (silence, rate)]) == highest_hertz([(tone, rate)])
    with np.errstate(all="raise"):
        levels = decibels(silence, 0.0)
        figure = spectrogram_figure(silence, 0.0, highest_hertz([(silence, rate)]), rate)
    assert (levels == FLOOR_DECIBELS).all() and figure.axes


def test_a_run_that_times_nothing_has_an_empty_figure_of_times():
    empty = Table("methods", "", [Column("model", "Model")], [])
    (axes,) = methods_figure(SimpleNamespace(table=lambda name: empty)).axes
    assert not axes.containers
