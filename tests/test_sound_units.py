"""Figures have one unit on the command line and on the studio's page."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sound.__main__ import main
from sound.clips.wav import write_wav
from sound.commands.design_summary import sentences, summarise
from sound.project.design import Design, MaterialDamping
from sound.synthesis.sinusoids import damped_sinusoids
from tests.small_design import small_design

RATE, DAMPING = 8000, 9.0


def designed(**targets) -> Design:
    """A small design as a search leaves it, its dampings the material's: half the clips'."""
    costs = {"cost_start": 2.0, "cost": 1.0, "frequency_cost": 0.6, "amplitude_cost": 0.4}
    effort = {
        "seconds": 1.0,
        "evaluations": 9,
        "evaluations_per_minute": 540.0,
        "workers": 1,
        "ended_by": "budget",
    }
    others = {"method": "hybrid", "checks": [], "residual_max": 1e-9}
    made = small_design()
    return replace(
        made,
        targets=replace(made.targets, **targets),
        evidence=costs | effort | others,
        settings={"material": {"young_bounds": None}},
        damping=MaterialDamping(None, 0.0, 0.5 * made.targets.dampings),
    )


def test_errors_of_frequencies_are_in_cents():
    design = designed()
    summary = summarise(design)
    off = 1200.0 * np.abs(np.log2(design.frequencies / design.targets.frequencies))
    assert summary["frequency_error_median_cents"] == pytest.approx(np.median(off))
    assert summary["frequency_error_max_cents"] == pytest.approx(off.max())
    said = sentences(Path("design.h5"), design, summary)
    assert f"median error {np.median(off):.1f} cents, worst {off.max():.1f} cents" in said
    assert "left out" not in said and "it rings longer" not in said


def test_partials_without_a_mode_and_dampings_far_from_the_clips_are_told():
    design = designed(left_out=np.array([812.4, 1400.0]), left_out_share=0.08)
    said = sentences(Path("design.h5"), design, summarise(design))
    assert "left out, since no mode can have them: partials at 812, 1400 Hz, 8% of loudness" in said
    damped = replace(design, settings={**design.settings, "damping": {"source": "material"}})
    summary = summarise(damped)
    assert summary["left_out_hz"] == [812.4, 1400.0] and summary["damping_source"] == "material"
    said = sentences(Path("design.h5"), damped, summary)
    assert "it rings longer than its clips: take their dampings (damping: {source: clips})" in said


def test_moduli_that_no_material_has_are_told():
    design = designed()
    said = sentences(Path("design.h5"), design, summarise(design))
    assert "warning" not in said
    for factor, words in ((1e6, "stiffer than diamond"), (1e-4, "softer than rubber")):
        made = replace(design, young=factor * design.young)
        assert words in sentences(Path("design.h5"), made, summarise(made))


@pytest.mark.parametrize(
    ("ended_by", "says"), [("met", "its frequencies are met"), ("interrupt", "on request")]
)
def test_a_search_that_ended_early_says_why(ended_by, says):
    design = designed()
    assert "ended" not in sentences(Path("design.h5"), design, summarise(design))
    early = replace(design, evidence={**design.evidence, "ended_by": ended_by})
    assert says in sentences(Path("design.h5"), early, summarise(early))


def test_a_damping_stands_beside_the_time_of_60_decibels(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("CARILLON_CACHE", str(tmp_path / "cache"))
    values = np.array([[440.0], [DAMPING], [0.5], [0.0]])
    write_wav(tmp_path / "clip.wav", damped_sinusoids(*values, RATE, RATE // 2), RATE)
    assert main(["extract", str(tmp_path / "clip.wav")]) == 0
    line, head, row = capsys.readouterr().out.splitlines()
    assert "% of the energy" in line
    assert head.split()[:6] == ["Hz", "1/s", "60", "dB", "in", "s"]
    assert float(row.split()[2]) == pytest.approx(math.log(1000.0) / DAMPING, abs=1e-3)
