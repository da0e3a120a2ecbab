"""What the sound of a strike is made of."""

import json
import os
import re
from dataclasses import replace

import numpy as np
import pytest
import soundfile
from scipy.signal import find_peaks

from carillon.errors import UserError
from carillon.fem.model import RIGID_MODES
from solver import solve
from solver.files.modes_file import read_modes, write_modes
from solver.response.points import interpolation
from solver.response.response import Damping
from sound.__main__ import main
from sound.clips.noise import noise_part
from sound.clips.wav import PEAK
from sound.project.design_file import write_design
from sound.rendering.clip_level import resampled
from sound.rendering.heard_solid import heard_design
from sound.rendering.listening import BEGIN_SECONDS, Listening
from sound.rendering.render import Hit, render, rendered_parts, residual_share
from sound.rendering.solid import SoundingSolid
from sound.synthesis.sinusoids import Bank, ring
from tests.small_design import N_MODES, small_design
from tests.solids import uniform_box

RATE = 44_100


def partial(frequency: float, damping: float, t: np.ndarray) -> np.ndarray:
    """Eq. 3 of the appendix as it is written."""
    return np.where(t >= 0.0, np.exp(-damping * t) * np.sin(2 * np.pi * frequency * t), 0.0)


def measured_partial(sound: np.ndarray, near: float, rate: int) -> tuple[float, float]:
    """Frequency and damping of the partial near a frequency, by peaks of windowed spectra.

    The damping is the fall of the peak from the first half to the second.
    """
    half = len(sound) // 2
    window = np.hanning(half)
    spectra = [np.abs(np.fft.rfft(window * part, 64 * half)) for part in np.split(sound, 2)]
    hertz = np.fft.rfftfreq(64 * half, 1.0 / rate)
    inside = np.abs(hertz - near) < 0.02 * near
    peaks = [np.log(spectrum[inside].max()) for spectrum in spectra]
    whole = np.log(spectra[0])
    index = int(np.argmax(np.where(inside, spectra[0], 0.0)))
    a, b, c = whole[index - 1 : index + 2]
    frequency = hertz[index] + 0.5 * (a - c) / (a - 2 * b + c) * (hertz[1] - hertz[0])
    return frequency, (peaks[0] - peaks[1]) * rate / half


def design_solid() -> tuple[SoundingSolid, Listening]:
    design = small_design()
    solid = SoundingSolid.of_design(design)
    return solid, Listening.of_design(design, solid)


def test_bank_is_the_sum_of_damped_sinusoids_at_any_time():
    random = np.random.default_rng(1)
    f, d = random.uniform(50.0, 15_000.0, 20), random.uniform(1.0, 900.0, 20)
    strikes = [(seconds, random.uniform(0.0, 1.0, 20)) for seconds in (0.31, 0.0, 0.1234567, 0.5)]
    sound = ring(Bank(f, d, RATE), strikes, 20_000)
    t = np.arange(20_000) / RATE
    expected = sum(
        a[k] * partial(f[k], d[k], t - start) for start, a in strikes for k in range(len(f))
    )
    np.testing.assert_allclose(sound, expected, atol=1e-9)


def test_bank_goes_on_where_it_stopped():
    f, d = np.array([440.0, 1000.0]), np.array([3.0, 50.0])
    whole, parts = (Bank(f, d, RATE) for _ in range(2))
    for bank in (whole, parts):
        bank.strike(np.array([1.0, 0.5]))
    pieces = np.concatenate([parts.advance(count) for count in (1, 511, 700, 3000)])
    np.testing.assert_allclose(pieces, whole.advance(4212), atol=1e-12)


def test_modes_beyond_half_the_rate_are_silent_and_low_ones_stay():
    f, d = np.array([100.0, 4000.0, 4001.0]), np.full(3, 5.0)
    one, two = (ring(Bank(f, d, 8000), [(0.0, np.array(a))], 800) for a in ([1, 1, 1], [1, 0, 0]))
    np.testing.assert_array_equal(one, two)


def test_amplitude_is_the_push_on_each_mode():
    design = small_design()
    solid, _ = design_solid()
    strike = design.strikes[1]
    motion = interpolation(design.model, strike.position) @ design.elastic_modes.reshape(
        design.model.mesh.n_nodes, -1
    )
    pushed = motion.reshape(3, N_MODES).T @ (2.5 * strike.inward)
    amplitudes = solid.amplitudes(strike.position[None], 2.5 * strike.inward[None])[0]
    np.testing.assert_allclose(amplitudes, np.abs(pushed), rtol=1e-12)


def test_signs_of_modes_do_not_matter():
    solid, listening = design_solid()
    signs = np.where(np.arange(N_MODES) % 2, -1.0, 1.0)
    hits = [Hit(0.0, small_design().strikes[0].position, np.array([0.3, -1.0, 0.2]))]
    flipped = replace(solid, modes=solid.modes * signs)
    one, two = (render(part, hits, 0.1, listening=listening) for part in (solid, flipped))
    np.testing.assert_allclose(one, two, atol=1e-12)


def test_mixing_a_cluster_does_not_matter():
    solid, _ = design_solid()
    f, d = solid.frequencies.copy(), solid.dampings.copy()
    f[3], d[3] = f[2], d[2]
    turn = np.eye(N_MODES)
    turn[2:4, 2:4] = [[0.6, -0.8], [0.8, 0.6]]
    hits = [Hit(0.0, small_design().strikes[0].position, np.array([1.0, 0.5, 0.2]))]
    pure = replace(solid, frequencies=f, dampings=d)
    mixed = replace(pure, modes=pure.modes @ turn)
    one, two = (render(part, hits, 0.1) for part in (pure, mixed))
    np.testing.assert_allclose(one, two, atol=1e-12 * np.abs(one).max())


def test_weights_are_one_at_a_struck_point_and_blend_between():
    _, listening = design_solid()
    first, second = listening.positions
    assert listening.weights(first).tolist() == [1.0, 0.0]
    np.testing.assert_allclose(listening.weights((first + second) / 2.0), [0.5, 0.5])
    near = listening.weights(first + 1e-3 * (second - first))
    assert near.sum() == pytest.approx(1.0) and near[0] > 0.999


def test_noise_follows_the_impulse_and_the_rate():
    design = small_design()
    solid, listening = design_solid()
    strike = design.strikes[1]
    hits = [Hit(0.1, strike.position, 3.0 * strike.inward)]
    sounds = [
        render(solid, hits, 0.5, 22_050, listening=listening, residual=part)
        for part in (True, False)
    ]
    added = sounds[0] - sounds[1]
    noise, _ = noise_part(design.targets.residuals[1], design.targets.rates[1])
    begun = round(0.9 * len(noise))  # where it is cut off, it fades
    expected = 3.0 * listening.noise_gains[1] * noise[:begun]
    rise = round(BEGIN_SECONDS * design.targets.rates[1])
    assert added[2205] == 0.0  # no file begins with a jump
    expected[:rise] *= 0.5 - 0.5 * np.cos(np.pi * np.arange(rise) / rise)
    np.testing.assert_allclose(added[2205 : 2205 + begun], expected, atol=1e-12)
    assert np.abs(added[2205 + begun :]).max() < np.abs(added).max()
    assert not added[:2205].any()


def test_a_partial_that_was_missed_is_heard_nowhere():
    """Neither at the point of its clip nor between, and the share of the clip is told."""
    design = small_design()
    missed = 0.2 * partial(3210.0, 12.0, np.arange(RATE) / RATE)
    residuals = (design.targets.residuals[0], np.zeros(0))
    louder = (np.pad(residuals[0], (0, RATE - len(residuals[0]))) + missed, residuals[1])
    solid = SoundingSolid.of_design(design)
    first, second = (strike.position for strike in design.strikes)
    peaks = []
    for rest in (residuals, louder):
        heard = replace(design, targets=replace(design.targets, residuals=rest))
        listening = Listening.of_design(heard, solid)
        for position in (first, 0.5 * (first + second)):
            hits = [Hit(0.0, position, np.array([0.0, 0.0, -1.0]))]
            noise = rendered_parts(solid, hits, 1.0, listening=listening)[1]
            peaks.append(np.abs(np.fft.rfft(noise)[3190:3231]).max())
    clip = np.abs(np.fft.rfft(missed)[3190:3231]).max()
    assert max(peaks[2] / clip, 2.0 * peaks[3] / clip) < 10.0 ** (-20.0 / 20.0)
    energy = float(missed @ missed)
    assert listening.missed[0] == pytest.approx(energy / (energy + listening.energies[0]), rel=0.05)
    assert listening.missed[1] == 0.0


def test_share_of_the_noise_is_that_of_its_energy():
    modes = np.sin(np.arange(1000.0))
    assert residual_share(modes, 0.5 * modes) == pytest.approx(0.2)
    assert residual_share(modes, 0.0 * modes) == residual_share(0.0 * modes, 0.0 * modes) == 0.0


def test_resampling_keeps_a_tone():
    t = np.arange(4000) / 8000
    resampled_tone = resampled(np.sin(2 * np.pi * 440.0 * t), 8000, 44_100)
    u = np.arange(len(resampled_tone)) / 44_100
    middle = (u > 0.05) & (u < 0.45)
    np.testing.assert_allclose(
        resampled_tone[middle], np.sin(2 * np.pi * 440.0 * u[middle]), atol=5e-3
    )


def test_a_melody_is_the_sum_of_its_strikes():
    design = small_design()
    solid, listening = design_solid()
    hits = [
        Hit(0.2 * index, strike.position, (1.0 + index) * strike.inward)
        for index, strike in enumerate(design.strikes)
    ]
    single = sum(render(solid, [hit], 0.6, listening=listening) for hit in hits)
    np.testing.assert_allclose(render(solid, hits, 0.6, listening=listening), single, atol=1e-12)


def test_a_longer_contact_excites_high_modes_less():
    solid, _ = design_solid()
    hits = [Hit(0.0, small_design().strikes[0].position, np.array([1.0, 1.0, 1.0]))]
    impulse, push = (render(solid, hits, 0.4, contact_seconds=c) for c in (0.0, 4e-3))
    spectra = [np.abs(np.fft.rfft(sound)) for sound in (impulse, push)]
    hertz = np.fft.rfftfreq(len(impulse), 1.0 / RATE)
    kept = []
    for frequency in solid.frequencies[[0, -1]]:
        near = np.abs(hertz - frequency) < 5.0
        kept.append(spectra[1][near].sum() / spectra[0][near].sum())
    assert kept[0] > 2.0 * kept[1]


def run(arguments: list[object]) -> int:
    return main([str(argument) for argument in arguments])


def test_a_point_is_named_in_the_coordinates_of_the_mesh(tmp_path, capsys):
    design = small_design()
    write_design(tmp_path / "mm.h5", replace(design, settings={**design.settings, "unit": 1e-3}))
    corner = design.strikes[0].position
    words = ["render", tmp_path / "mm.h5", "--json", "--out", tmp_path / "hit.wav", "--at"]
    assert run([*words, *(1e3 * corner)]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["position_m"] == corner.tolist() and summary["distance_m"] < 1e-12
    assert run([*words, *(1e3 * corner + (0.0, 0.0, 50.0))]) == 0
    said = capsys.readouterr()
    summary = json.loads(said.out)
    assert summary["position_m"] == corner.tolist()
    assert summary["distance_m"] == pytest.approx(0.05)
    assert "is 5 cm off the surface" in said.err


def test_partials_of_a_rendered_file_are_the_modes(tmp_path, capsys):
    design = small_design()
    write_design(tmp_path / "design.h5", design)
    out = tmp_path / "hit.wav"
    words = ["render", tmp_path / "design.h5", "--target", "corner", "--no-residual", "--json"]
    assert run([*words, "--seconds", 0.4, "--out", out]) == 0
    printed = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(printed["frequencies_hz"], design.frequencies)
    sound, rate = soundfile.read(out)
    assert rate == RATE and len(sound) == round(0.4 * RATE)
    loud = np.array(printed["amplitudes"]) > 0.05 * max(printed["amplitudes"])
    gaps = np.diff(design.frequencies, prepend=0.0, append=np.inf)
    resolved = loud & (np.minimum(gaps[:-1], gaps[1:]) > 20.0)
    assert resolved.sum() >= 4
    for k in np.flatnonzero(resolved):
        frequency, damping = design.frequencies[k], design.targets.dampings[k]
        measured, decay = measured_partial(sound, frequency, rate)
        assert measured == pytest.approx(frequency, rel=5e-4)
        assert decay == pytest.approx(damping, rel=0.02)
    spectrum = np.abs(np.fft.rfft(np.hanning(len(sound)) * sound))
    assert len(find_peaks(spectrum, height=0.02 * spectrum.max(), distance=20)[0]) <= N_MODES


def test_the_solver_s_modes_can_be_heard(tmp_path, capsys):
    model = uniform_box(6, 4, 2, 0.04)
    result = solve(model, modes=RIGID_MODES + N_MODES, method="slepc")
    path, out = tmp_path / "modes.h5", tmp_path / "hit.wav"
    write_modes(path, model, result.eigenvalues, [result.modes], result.residuals, {}, {})
    words = ["render", path, "--at", 0, 0, 0, "--damping", 5, 2e-7, "--json", "--out", out]
    assert run(words) == 0
    printed = json.loads(capsys.readouterr().out)
    assert run([*words[:2], "--at", 0, 0, -0.1, *words[6:]]) == 0
    moved = capsys.readouterr()
    assert json.loads(moved.out)["position_m"] == printed["position_m"]
    assert "is 10 cm off the surface" in moved.err
    decay = Damping(5.0, 2e-7).decay_per_second(result.eigenvalues[RIGID_MODES:])
    np.testing.assert_allclose(printed["dampings_per_second"], decay)
    np.testing.assert_allclose(
        printed["frequencies_hz"], result.frequencies[RIGID_MODES:], rtol=1e-4
    )
    assert np.abs(soundfile.read(out)[0]).max() == pytest.approx(PEAK)
    write_design(tmp_path / "design.h5", small_design())
    like = ["--like", tmp_path / "design.h5", "--target", "side", "--json"]
    assert run(["render", path, *like, "--out", out]) == 0
    printed = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(printed["dampings_per_second"], small_design().targets.dampings)
    truth = SoundingSolid.of_truth(read_modes(path), small_design())
    strike = small_design().strikes[1]
    gain = printed["scale"] * Listening.of_design(small_design(), truth).gains[1]
    expected = gain * truth.amplitudes(strike.position[None], strike.inward[None])[0]
    np.testing.assert_allclose(printed["amplitudes"], expected)


def test_modes_alone_stand_beside_the_sound(tmp_path, capsys):
    write_design(tmp_path / "design.h5", small_design())
    out, alone, bare = (tmp_path / f"{name}.wav" for name in ("hit", "modes", "bare"))
    words = ["render", tmp_path / "design.h5", "--target", "corner", "--seconds", 0.4, "--json"]
    assert run([*words, "--out", out, "--modes-out", alone]) == 0
    told = json.loads(capsys.readouterr().out)
    assert run([*words, "--out", bare, "--no-residual"]) == 0
    without = json.loads(capsys.readouterr().out)
    whole, modes, same = (soundfile.read(path)[0] for path in (out, alone, bare))
    np.testing.assert_array_equal(modes, same)
    assert told["residual_share"] == pytest.approx(residual_share(modes, whole - modes), rel=1e-4)
    assert told["residual_share"] > 0.0 and without["residual_share"] == 0.0
    assert 0.0 <= told["missed_share"] < told["residual_share"]


@pytest.mark.parametrize("strength", [1e-3, 100.0])
def test_normalised_sounds_reach_full_scale_and_the_gain_is_told(tmp_path, strength, capsys):
    write_design(tmp_path / "design.h5", small_design())
    words = ["render", tmp_path / "design.h5", "--target", "side", "--strength", strength]
    plain, scaled, alone = (tmp_path / f"{name}.wav" for name in ("plain", "scaled", "alone"))
    assert run([*words, "--out", plain, "--raw"]) == 0
    assert run([*words, "--out", scaled, "--modes-out", alone, "--normalise", "--json"]) == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    own, full, modes = (soundfile.read(path)[0] for path in (plain, scaled, alone))
    assert np.abs(full).max() == pytest.approx(told["peak"])
    assert 0.98 < told["peak"] < 1.0
    both = min(len(full), len(own))
    np.testing.assert_allclose(full[:both], told["scale"] * own[:both], rtol=1e-5, atol=1e-9)
    assert np.abs(modes).max() < np.abs(full).max() + 0.05
    assert run([*words, "--out", scaled, "--normalise"]) == 0
    assert f"scaled by {told['scale']:.4g}" in capsys.readouterr().out


def test_what_sounds_is_told_in_short_lines(tmp_path, capsys):
    write_design(tmp_path / "design.h5", small_design())
    out = tmp_path / "hit.wav"
    words = ["render", tmp_path / "design.h5", "--target", "side", "--rate", 2000, "--out", out]
    assert run([*words, "--strength", 99, "--seconds", 600, "--no-residual"]) == 0
    file, *lines = capsys.readouterr().out.splitlines()
    assert file.startswith(f"{out}: 600 s, ") and "ends in silence" in lines[0]
    assert {line.split()[0] for line in lines} >= {"level:", "scaled", "left"}
    assert max(len(line) for line in lines) < 90


def test_modes_too_damped_to_oscillate_are_left_out(tmp_path):
    model = uniform_box(4, 3, 2, 0.05)
    result = solve(model, modes=RIGID_MODES + 4, method="slepc")
    path = tmp_path / "modes.h5"
    write_modes(path, model, result.eigenvalues, [result.modes], result.residuals, {}, {})
    critical = 2.0 * np.sqrt(result.eigenvalues[RIGID_MODES + 1])
    assert len(SoundingSolid.of_modes(read_modes(path), Damping(0.9 * critical)).frequencies) <= 4
    with pytest.raises(UserError, match="none is elastic"):
        SoundingSolid.of_modes(read_modes(path), Damping(1e3 * critical))


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--target", "lid"], "no target 'lid', expected one of corner, side"),
        (["--vertex", 999_999], "there is no vertex 999999"),
        (["--at", 9, 9, 9], "as far from the surface"),
        (["--target", "side", "--impulse", 0, 0, 0], "not all of them 0"),
        (["--target", "side", "--seconds", 1e9], "expected at most 600"),
        (["--target", "side", "--seconds", 1e-300], "expected 1 to"),
        (["--target", "side", "--seconds", 600, "--rate", 768_000], "expected 1 to 67,108,864"),
        (["--target", "side", "--rate", 10**11], "expected at most 768,000"),
        (["--target", "side", "--strength", "nan"], "found nan, expected a finite number"),
        (["--target", "side", "--strength", 1e300], r"expected at most 1e\+06 N s"),
        (["--target", "side", "--impulse", 1e300, 0, 0], r"expected at most 1e\+06 N s"),
        (["--target", "side", "--contact-seconds", 1e9], "expected at most 1 "),
        (["--at", "nan", 0, 0], "found nan, expected a finite number"),
        (["--at", 1e300, 0, 0], r"expected at most 1e\+18 m"),
        (["--target", "side", "--out", "hit.mp3"], "expected a name that ends in .wav"),
        (["--target", "side", "--modes-out", "modes.mp3"], "expected a name that ends in .wav"),
        (["--target", "side", "--out", "x.wav", "--modes-out", "x.wav"], "name another file"),
        (["--target", "side", "--damping", 1, 0], "go with modes.h5"),
        (["--target", "side", "--like", "x.h5"], "go with modes.h5"),
        ([], r"name one of the targets \(--target\): corner, side"),
    ],
)
def test_mistakes_are_answered_in_one_sentence(tmp_path, words, complaint, refuses):
    write_design(tmp_path / "design.h5", small_design())
    command = ["render", tmp_path / "design.h5", "--out", tmp_path / "hit.wav"]
    assert re.search(complaint, refuses(main, *command, *words))
    assert [path.name for path in tmp_path.iterdir()] == ["design.h5"]


def test_the_only_target_of_a_design_need_not_be_named():
    heard = heard_design(small_design())
    assert replace(heard, targets=("side",)).only_target() == "side"
    with pytest.raises(UserError, match="no target; name a point"):
        replace(heard, targets=()).only_target()


def test_other_files_are_refused(tmp_path, refuses):
    (tmp_path / "clip.h5").write_text("no HDF5")
    (tmp_path / "empty.h5").touch()
    (tmp_path / "loop.h5").symlink_to("loop.h5")
    os.mkfifo(tmp_path / "pipe.h5")
    for name in ("clip.h5", "absent.h5", "empty.h5", "loop.h5", "pipe.h5", "."):
        words = ["render", tmp_path / name, "--target", "a", "--out", tmp_path / "hit.wav"]
        assert "expected a Carillon design" in refuses(main, *words)
