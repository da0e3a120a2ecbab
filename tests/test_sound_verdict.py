"""Whether a design sounds like its clips, in words."""

import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from solver.response.vertices import inward_normals
from sound.clips.extraction import ModalSound
from sound.project.design import HISTORY_TYPE, Design, MaterialDamping
from sound.rendering.likeness import LIKE_DECIBELS, decay_seconds
from sound.rendering.solid import SoundingSolid
from sound.rendering.verdict import CANNOT, FAR_SHARE, LIKE, NEAR, judged, with_verdict
from sound.rendering.verdict import clips_of as design_clips
from sound.synthesis.sinusoids import damped_sinusoids
from tests.small_design import small_design

RATE = 22_050
DAMPING = 9.0


def own_sounds() -> Design:
    """A design whose targets are what it sounds like."""
    design = small_design()
    solid = SoundingSolid.of_design(design)
    positions = np.array([each.position for each in design.strikes])
    inward = np.array([each.inward for each in design.strikes])
    levels = solid.amplitudes(positions, inward)
    targets = replace(
        design.targets,
        frequencies=design.frequencies,
        dampings=np.full(len(design.frequencies), DAMPING),
        amplitudes=0.2 * levels / levels.max(axis=1, keepdims=True),
        residuals=(np.zeros(RATE),) * 2,
        rates=(RATE,) * 2,
    )
    return replace(design, targets=targets)


def clips_of(design: Design) -> list[ModalSound]:
    """The clips that a design's targets are of."""
    targets = design.targets
    phases, residual = np.zeros(len(targets.frequencies)), np.zeros(RATE)
    return [
        ModalSound(targets.frequencies, targets.dampings, row, phases, residual, RATE, {})
        for row in targets.amplitudes
    ]


def with_targets(design: Design, **changes) -> Design:
    return replace(design, targets=replace(design.targets, **changes))


def test_a_design_that_is_its_clip_is_like_it():
    design = own_sounds()
    verdict = judged(design, clips_of(design))
    assert verdict.word == LIKE and verdict.sentence() == "like the clip"
    assert verdict.median_cents == 0.0
    for each in verdict.likeness:
        assert each.distance_db < 1.0 < each.silence_db
        assert each.decay_ratio == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("factor", "side"), [(2.0 ** (1 / 12), "low"), (2.0 ** (-1 / 12), "high")])
def test_a_partial_a_semitone_off_is_named(factor, side):
    design = own_sounds()
    hertz = design.targets.frequencies.copy()
    loudest = int(np.argmax(design.targets.shares))
    hertz[loudest] *= factor
    design = with_targets(design, frequencies=hertz)
    verdict = judged(design, clips_of(design))
    assert design.targets.shares[loudest] > FAR_SHARE  # and the median does not tell.
    assert verdict.word == NEAR and verdict.median_cents == 0.0
    reason = judged(with_targets(design, frequencies=factor * design.frequencies), clips_of(design))
    assert reason.word in (NEAR, CANNOT)
    assert f"100 cents too {side}" in reason.reason and reason.advice


def test_partials_that_no_mode_has_are_named():
    design = own_sounds()
    louder = with_targets(
        design,
        left_out=np.array([4467.0]),
        left_out_share=0.6,
        frequencies=1.0234 * design.frequencies,  # 40 cents
    )
    verdict = judged(louder, clips_of(louder))
    assert "partials at 4467 Hz" in verdict.reason and "more modes" in verdict.advice
    faint = with_targets(louder, left_out_share=0.05)
    assert "more than 40 cents off" in judged(faint, clips_of(faint)).reason


def test_a_design_that_rings_on_where_the_clip_is_over_is_no_likeness():
    design = own_sounds()
    short = with_targets(design, dampings=np.full(len(design.frequencies), 60.0))
    verdict = judged(design, clips_of(short))
    assert verdict.word != LIKE and "times longer than the clip" in verdict.reason
    assert min(each.decay_ratio for each in verdict.likeness) > 3.0


def test_what_is_advised_about_decay_depends_on_whose_dampings_sound():
    design = own_sounds()
    short = clips_of(with_targets(design, dampings=np.full(len(design.frequencies), 60.0)))
    # The box with equal dampings dies away alike wherever it is struck.
    assert "no other point of this design comes nearer" in judged(design, short).advice
    own = MaterialDamping(None, 0.0, design.targets.dampings)
    damped = replace(
        design, damping=own, settings={**design.settings, "damping": {"source": "material"}}
    )
    assert "damping: {source: clips}" in judged(damped, short).advice


def test_a_wrong_time_of_decay_is_told_beside_another_reason():
    design = own_sounds()
    hertz = 1.06 * design.frequencies
    other = with_targets(design, frequencies=hertz, dampings=np.full(len(hertz), 60.0))
    reason = judged(with_targets(design, frequencies=hertz), clips_of(other)).reason
    assert "cents too low, and it rings" in reason and reason.endswith("longer than the clip")


def test_what_is_unusual_of_a_clip_is_told():
    design = own_sounds()
    short = clips_of(with_targets(design, dampings=np.full(len(design.frequencies), 60.0)))
    told = {
        "explained": 0.99,
        "clipped_samples": 0,
        "second_strike_seconds": 0.21,
        "glide": None,
    }
    loop = [replace(clip, evidence=told) for clip in short]
    assert judged(design, loop).sentence().count("there is another strike at 0.21 s, left out") == 1
    own = [replace(clip, evidence=told) for clip in clips_of(design)]
    assert judged(design, own).sentence().startswith("like the clip; of the clip: there is another")


def test_a_design_whose_clip_is_gone_is_kept(caplog):
    design = own_sounds()
    assert with_verdict(design) is design  # Its settings name no clips.
    gone = replace(design, settings={**design.settings, "targets": [{"clip": "nowhere.wav"}] * 2})
    assert with_verdict(gone) is gone
    silent = [replace(each, amplitudes=0.0 * each.amplitudes) for each in clips_of(design)]
    with pytest.raises(ValueError, match="silent"):
        judged(design, silent)


@pytest.mark.parametrize("rate", [8_000, 44_100])
@pytest.mark.parametrize("damping", [2.0, 7.0, 60.0])
def test_times_of_decay_are_those_of_the_mode(rate, damping):
    one = np.ones(1)
    sound = damped_sinusoids(440.0 * one, damping * one, one, 0.0 * one, rate, 4 * rate)
    assert decay_seconds(sound, rate) == pytest.approx(np.log(1e3) / damping, rel=0.02)
    assert decay_seconds(np.zeros(100), rate) == 0.0


def struck_elsewhere() -> tuple[Design, np.ndarray]:
    """A design whose first clip is the sound of another point, and that point (3,) [m]."""
    design = own_sounds()
    solid, surface = SoundingSolid.of_design(design), surface_of(design)
    middle = np.argmin(np.linalg.norm(surface.vertices - surface.bounds.mean(axis=0), axis=1))
    position = np.asarray(surface.vertices[middle])[None]
    levels = solid.amplitudes(position, inward_normals(surface, position))[0]
    amplitudes = design.targets.amplitudes.copy()
    amplitudes[0] = 0.2 * levels / levels.max()
    return with_targets(design, amplitudes=amplitudes), position[0]


def surface_of(design: Design) -> trimesh.Trimesh:
    return trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_the_point_that_the_clip_sounds_like_is_advised(unit):
    design, position = struck_elsewhere()
    clips = clips_of(design)
    design = replace(design, settings={**design.settings, "unit": unit})
    now = judged(design, clips)
    assert now.word != LIKE
    assert f"] as the point of {design.strikes[0].name} and search again" in now.advice
    at = unit * np.array(
        [float(each) for each in re.findall(r"\[(.*?)\]", now.advice)[0].split(", ")]
    )
    inward = inward_normals(surface_of(design), at[None])[0]
    first = replace(design.strikes[0], position=at, inward=inward)
    there = judged(replace(design, strikes=[first, design.strikes[1]]), clips).likeness[0]
    assert there.excess < 0.8 * now.likeness[0].excess
    assert f"made as loud, is {there.distance_db:.1f} dB" in now.advice
    assert np.linalg.norm(at - position) < 1e-3 or there.distance_db < LIKE_DECIBELS


@pytest.mark.parametrize(
    ("ended_by", "costs", "says"),
    [
        ("budget", [5.0], "it had little time"),
        ("interrupt", [5.0, 4.9], "it had little time"),
        ("budget", [5.0, 4.0, 3.0, 2.0], "the cost still falls"),
        ("budget", [5.0, 3.0, 2.99, 2.98], ""),
        ("met", [5.0, 4.0, 3.0], ""),
    ],
)
def test_to_search_on_is_advised_where_that_may_help(ended_by, costs, says):
    checks = [{"cost": cost} for cost in costs]
    advice = advice_after({"ended_by": ended_by, "checks": checks})
    assert ("search on" in advice) == bool(says) and says in advice


@pytest.mark.parametrize(
    ("costs", "says"),
    [
        ([9.0], "it had little time"),
        (np.linspace(9.0, 1.0, 40), "the cost still falls"),
        (np.concatenate([np.linspace(9.0, 1.0, 20), np.ones(20)]), ""),
    ],
)
def test_a_search_without_checks_tells_by_its_own_history_whether_it_falls(costs, says):
    """Of a former search for other targets, which had lower costs, it tells nothing."""
    rows = [(0.1 * k, k + 1, 0.5, 0.5, 0.0, 0.0) for k in range(30)]
    rows += [(3.0 + 0.1 * k, 31 + k, cost, cost, 0.0, 0.0) for k, cost in enumerate(costs)]
    evidence = {"ended_by": "budget", "checks": [], "evaluations": len(costs)}
    advice = advice_after(evidence, history=np.array(rows, HISTORY_TYPE))
    assert ("search on" in advice) == bool(says) and says in advice


def advice_after(evidence: dict, **changes) -> str:
    """Advice on a design that is a semitone off."""
    design = replace(own_sounds(), evidence=evidence, **changes)
    wrong = with_targets(design, frequencies=1.06 * design.frequencies)
    return judged(wrong, clips_of(design)).advice


def test_modes_that_the_material_damps_otherwise_are_told():
    design = own_sounds()
    dampings = design.targets.dampings.copy()
    dampings[3] *= 0.1
    settings = {**design.settings, "damping": {"source": "material"}}
    made = replace(design, damping=MaterialDamping(None, 0.0, dampings), settings=settings)
    clips = clips_of(with_targets(design, amplitudes=design.targets.amplitudes[:, ::-1]))
    verdict = judged(made, clips)
    assert verdict.word != LIKE and "1 of 8 modes otherwise than the clips" in verdict.reason
    assert "10.0 times slower" in verdict.reason and "{source: clips}" in verdict.advice


def test_a_loud_partial_that_the_strike_does_not_push_is_told_to_be_faint():
    design = own_sounds()
    amplitudes = design.targets.amplitudes.copy()
    faintest = int(np.argmin(amplitudes[0]))
    amplitudes[0, faintest] = 10.0 * amplitudes[0].max()
    loud = with_targets(design, amplitudes=amplitudes)
    hertz = f"{design.frequencies[faintest]:.0f} Hz"
    assert re.search(f"the mode at {hertz} is .* dB too faint", judged(loud, clips_of(loud)).reason)


def test_partials_that_are_left_out_are_no_part_of_the_clip(tmp_path, monkeypatch):
    design = own_sounds()
    (clip, _) = clips_of(design)
    monkeypatch.setattr("sound.rendering.verdict.extract_file", lambda *_: clip)
    gone = float(clip.frequencies[2])
    targets = [{"clip": "a.wav", "without": [gone]}, {"clip": "b.wav"}]
    first, second = design_clips(replace(design, settings={"targets": targets}))
    assert gone not in first.frequencies and gone in second.frequencies


def test_a_clip_that_is_mostly_no_strike_is_told():
    design = own_sounds()
    hum = 0.3 * np.sin(2.0 * np.pi * 310.0 * np.arange(RATE) / RATE)
    verdict = judged(design, [replace(clip, residual=hum) for clip in clips_of(design)])
    assert verdict.word != LIKE
    assert "tones that do not fade evenly" in verdict.reason and "one strike" in verdict.advice


def test_twin_modes_of_a_partial_count_once():
    design = own_sounds()
    hertz = design.frequencies.copy()
    hertz[1] = hertz[0] = 1.1 * hertz[1]
    design = with_targets(design, frequencies=hertz)
    partials = len(hertz) - 1
    assert f"1 of {partials} partials is more" in judged(design, clips_of(design)).reason
