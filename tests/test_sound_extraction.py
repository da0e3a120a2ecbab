"""Modes of clips: what a synthesised clip was made of comes back, and bad clips are refused."""

import numpy as np
import pytest
import soundfile

from carillon.errors import UserError
from sound.clips.candidates import esprit
from sound.clips.extent import ending, second_strike, strike_sample
from sound.clips.extraction import ModalSound, extract
from sound.clips.free_vibration import LONGEST_BLOW, is_clipped
from sound.clips.glide import glide
from sound.clips.instruments import synthesised
from sound.clips.least_squares import fitted_coefficients, normal_matrix, refined
from sound.clips.mode_search import further
from sound.clips.wav import read_wav
from sound.synthesis.sinusoids import correlations, damped_sinusoids, exponents_of

RATE = 8000
FREQUENCY_TOLERANCE, DAMPING_TOLERANCE = 1e-3, 0.05


def modes(count: int, highest: float, seed: int, lowest: float = 50.0) -> ModalSound:
    """Modes from `lowest` to `highest` [Hz], the higher the quicker, within 12 dB of each other."""
    random = np.random.default_rng(seed)
    steps = np.arange(count) + random.uniform(-0.3, 0.3, count)
    frequencies = lowest * (highest / lowest) ** (np.clip(steps, 0.0, count - 1) / (count - 1))
    return ModalSound(
        frequencies=frequencies,
        dampings=(2.0 + 0.002 * frequencies) * random.uniform(0.7, 1.4, count),
        amplitudes=10.0 ** (-random.uniform(0.0, 12.0, count) / 20.0),
        phases=random.uniform(-np.pi, np.pi, count),
        residual=np.zeros(0),
        rate=0,
        evidence={},
    )


def sampled(true: ModalSound, rate: int, seconds: float, decibels: float = 20.0) -> np.ndarray:
    """The modes in white noise `decibels` below them."""
    values = (true.frequencies, true.dampings, true.amplitudes, true.phases)
    clean = damped_sinusoids(*values, rate, round(seconds * rate))
    noise = np.random.default_rng(7).standard_normal(len(clean))
    return clean + noise * np.sqrt(np.mean(clean**2)) * 10.0 ** (-decibels / 20.0)


def single(frequency: float, damping: float, seconds: float, rate: int = RATE) -> np.ndarray:
    one = np.ones(1)
    return damped_sinusoids(
        frequency * one, damping * one, one, 0.0 * one, rate, round(seconds * rate)
    )


def assert_same(actual: ModalSound, true: ModalSound) -> None:
    assert len(actual.frequencies) == len(true.frequencies)
    np.testing.assert_allclose(actual.frequencies, true.frequencies, rtol=FREQUENCY_TOLERANCE)
    np.testing.assert_allclose(actual.dampings, true.dampings, rtol=DAMPING_TOLERANCE)
    np.testing.assert_allclose(actual.amplitudes, true.amplitudes, rtol=0.1)


@pytest.mark.parametrize(
    ("rate", "count", "seconds", "highest"),
    [
        (8000, 5, 1.0, 3000.0),
        (8000, 20, 2.0, 3500.0),
        (22_050, 10, 1.0, 9000.0),
        (44_100, 30, 2.0, 15_000.0),
        (96_000, 8, 1.0, 15_000.0),
    ],
)
def test_parameters_come_back_at_20_decibels(rate, count, seconds, highest):
    true = modes(count, highest, seed=count)
    sound = extract(sampled(true, rate, seconds), rate)
    assert_same(sound, true)
    assert sound.evidence["order"] == count
    assert sound.evidence["explained"] == pytest.approx(1.0 / 1.01, abs=2e-3)


def test_parameters_come_back_from_a_stereo_file_with_silence_before_the_strike(tmp_path):
    true = modes(6, 3000.0, seed=1)
    strike = 1234
    clip = np.concatenate([np.zeros(strike), 0.1 * sampled(true, RATE, 1.0, 40.0)])
    clip += 1e-4 * np.random.default_rng(2).standard_normal(len(clip))
    path = tmp_path / "clip.wav"
    soundfile.write(path, np.stack([0.8 * clip, clip], axis=1), RATE, subtype="PCM_24")
    sound = extract(*read_wav(path))
    assert sound.evidence["strike_seconds"] == pytest.approx(strike / RATE, abs=1e-3)
    np.testing.assert_allclose(sound.frequencies, true.frequencies, rtol=FREQUENCY_TOLERANCE)
    np.testing.assert_allclose(sound.dampings, true.dampings, rtol=DAMPING_TOLERANCE)
    np.testing.assert_allclose(sound.amplitudes, 0.1 * true.amplitudes, rtol=0.1)


def test_errors_are_those_that_the_noise_allows():
    true = modes(12, 3500.0, seed=3)
    scores = []
    for decibels in (15.0, 30.0, 45.0):
        sound = extract(sampled(true, RATE, 1.0, decibels), RATE)
        deviations = np.array(sound.evidence["damping_deviations_per_second"])
        scores.append((sound.dampings - true.dampings) / deviations)
    # Of 36 standard normal numbers the largest is about 2.4, their root mean square 1 +- 0.12.
    assert np.abs(scores).max() < 5.0
    assert 0.6 < np.sqrt(np.mean(np.square(scores))) < 1.6


@pytest.mark.parametrize("damping", [2.0, 30.0])
def test_two_modes_a_bandwidth_apart_are_told_apart(damping):
    frequencies = np.array([1000.0, 1000.0 + damping / np.pi])
    values = (frequencies, [damping, 1.2 * damping], [1.0, 0.7], [0.3, 2.0], np.zeros(0))
    true = ModalSound(*map(np.array, values), rate=0, evidence={})
    sound = extract(sampled(true, RATE, 1.5), RATE)
    assert len(sound.frequencies) == 2
    np.testing.assert_allclose(sound.frequencies, true.frequencies, rtol=FREQUENCY_TOLERANCE)
    np.testing.assert_allclose(sound.dampings, true.dampings, rtol=DAMPING_TOLERANCE)


def test_peaks_of_a_zero_padded_spectrum_agree():
    from scipy.signal import find_peaks
    from scipy.signal.windows import hann

    clip = sampled(modes(10, 3500.0, seed=5, lowest=150.0), RATE, 1.0, 40.0)
    sound = extract(clip, RATE)
    size = 1 << 18
    spectrum = np.abs(np.fft.rfft(clip * hann(len(clip)), size))
    width = 30 * size // RATE
    peaks = find_peaks(spectrum, height=0.002 * spectrum.max(), distance=width)[0] * RATE / size
    highest = peaks[np.abs(peaks[:, None] - sound.frequencies).argmin(axis=0)]
    np.testing.assert_allclose(highest, sound.frequencies, atol=0.5)
    strong = sound.energies > 0.02 * sound.energies.max()
    np.testing.assert_allclose(highest[strong], sound.frequencies[strong], atol=0.2)


def test_modes_and_residual_add_up_to_the_clip():
    clip = sampled(modes(6, 3000.0, seed=6), RATE, 0.5)
    sound = extract(clip, RATE)
    start = len(clip) - len(sound.residual)
    np.testing.assert_allclose(sound.modal_part() + sound.residual, clip[start:], atol=1e-10)


def test_strongest_modes_are_kept_and_the_residual_is_without_the_others_too():
    clip = sampled(modes(6, 3000.0, seed=6), RATE, 0.5)
    everything, three = extract(clip, RATE), extract(clip, RATE, modes=3)
    strongest = np.sort(np.argsort(everything.energies)[-3:])
    np.testing.assert_array_equal(three.frequencies, everything.frequencies[strongest])
    np.testing.assert_array_equal(three.residual, everything.residual)
    assert three.evidence["explained"] < three.evidence["explained_by_all"]


def test_loudness_does_not_matter():
    clip = sampled(modes(4, 3000.0, seed=8), RATE, 0.5)
    loud, quiet = extract(clip, RATE), extract(1e-3 * clip, RATE)
    np.testing.assert_allclose(quiet.frequencies, loud.frequencies, rtol=1e-9)
    np.testing.assert_allclose(quiet.amplitudes, 1e-3 * loud.amplitudes, rtol=1e-6)


def test_the_noise_of_a_blow_is_no_mode():
    true = synthesised("metal", 700.0, 1.0, 16_000, seed=1)
    knock = 20.0 * true.residual  # 8 dB below the sum of all partials
    sound = extract(true.modal_part() + knock, 16_000)
    apart = np.abs(sound.frequencies[:, None] / true.frequencies - 1.0).min(axis=1)
    assert (apart < FREQUENCY_TOLERANCE).all()
    assert np.sum((sound.residual - knock[-len(sound.residual) :]) ** 2) < 0.2 * np.sum(knock**2)


@pytest.mark.parametrize("seed", range(8))
def test_noise_of_any_seed_holds_no_mode(seed):
    with pytest.raises(UserError, match="no modes that stand out"):
        extract(np.random.default_rng(seed).standard_normal(4000), RATE)


def test_what_stands_out_of_the_rest_is_found():
    true = modes(5, 3000.0, seed=11, lowest=200.0)
    hertz = further(sampled(true, RATE, 1.0), RATE).imag * RATE / (2.0 * np.pi)
    assert (np.abs(hertz[:, None] / true.frequencies - 1.0).min(axis=0) < 0.02).all()
    assert not len(further(noise(RATE), RATE))


def test_a_clip_that_swells_at_its_end_overflows_nowhere():
    clip = sampled(modes(4, 3000.0, seed=13), RATE, 4.0)
    clip[-400:] += 3e-4 * np.exp(np.arange(400) / 60.0) * np.sin(np.arange(400))
    with np.errstate(over="raise", invalid="raise"):
        assert len(extract(clip, RATE).frequencies) >= 4


@pytest.mark.parametrize("gain", [1.6, pytest.param(2.5, marks=pytest.mark.nightly)])
def test_clipped_samples_have_no_say(gain):
    true = modes(5, 3000.0, seed=5)
    clip = sampled(true, RATE, 1.0, 60.0)
    gain /= np.abs(clip).max()
    clipped = np.clip(gain * clip, -1.0, 1.0)
    sound = extract(clipped, RATE)
    assert sound.evidence["clipped_samples"] == np.count_nonzero(is_clipped(clipped)) > 20
    np.testing.assert_allclose(sound.frequencies, true.frequencies, rtol=FREQUENCY_TOLERANCE)
    np.testing.assert_allclose(sound.dampings, true.dampings, rtol=DAMPING_TOLERANCE)
    np.testing.assert_allclose(sound.amplitudes, gain * true.amplitudes, rtol=0.01)


def test_modes_are_those_that_ring_after_the_blow():
    true = modes(5, 3000.0, seed=5)
    clip = sampled(true, RATE, 1.0, 40.0)
    blow = round(0.006 * RATE)
    driven = 0.5 * np.random.default_rng(3).standard_normal(blow) * np.abs(clip).max()
    sound = extract(np.concatenate([driven, clip]), RATE)
    assert 0.005 < sound.evidence["blow_seconds"] <= LONGEST_BLOW
    assert 0.02 < sound.evidence["blow_share"] < 0.5
    np.testing.assert_allclose(sound.frequencies, true.frequencies, rtol=FREQUENCY_TOLERANCE)


def test_hum_is_no_mode():
    true = modes(3, 3000.0, seed=9, lowest=300.0)
    clip = sampled(true, RATE, 1.0, 40.0) + 0.05 * single(50.0, 0.0, 1.0)
    assert_same(extract(clip, RATE), true)


def noise(count: int = 4000) -> np.ndarray:
    return np.random.default_rng(0).standard_normal(count)


@pytest.mark.parametrize(
    ("clip", "message"),
    [
        (np.zeros(4000), "is silent"),
        (np.full(4000, np.nan), "has samples that are not finite"),
        (noise(), "no modes that stand out"),
        (np.eye(1, 4000)[0], "falls silent 1 sample after its strike"),
        (single(440.0, 0.0, 1.0) + 1e-3 * noise(RATE), "does not decay"),
        (single(440.0, -3.0, 1.0), "does not decay"),
        (single(30.0, 5.0, 0.06), "less than 3 periods of its lowest mode"),
        (single(400.0, 5.0, 0.02), "ends or falls silent .* samples after its strike"),
    ],
)
def test_clips_that_are_no_strike_are_answered_in_one_sentence(clip, message):
    with pytest.raises(UserError, match=message) as error:
        extract(clip, RATE)
    assert "\n" not in str(error.value)


def test_more_modes_than_there_are_cannot_be_asked_for():
    clip = sampled(modes(3, 3000.0, seed=9), RATE, 0.5)
    with pytest.raises(UserError, match="5 modes asked for, more than the 3 that were extracted"):
        extract(clip, RATE, modes=5)


@pytest.mark.parametrize("before", [0, 1, 700])
def test_strike_is_found(before):
    clip = np.concatenate([np.zeros(before), single(300.0, 8.0, 0.5)])
    clip += 1e-3 * noise(len(clip))
    assert abs(strike_sample(clip) - before) <= 2


def test_esprit_finds_exponents_and_their_number():
    exponents = np.array([-0.01 + 0.3j, -0.02 + 0.32j, -0.002 - 1.0j])
    signal = np.exp(np.outer(np.arange(200), exponents)).sum(axis=1)
    signal += 1e-6 * (noise(400).reshape(2, 200) * [[1.0], [1.0j]]).sum(axis=0)
    estimated = esprit(signal)
    assert len(estimated) == 3
    np.testing.assert_allclose(np.sort_complex(estimated), np.sort_complex(exponents), atol=1e-6)


def test_normal_matrix_is_that_of_the_columns():
    exponents = exponents_of(np.array([300.0, 310.0, 50.0]), np.array([5.0, 40.0, 0.1]), RATE)
    directions = np.array([1.0 + 2.0j, 0.5j, -1.0])
    n = np.arange(3000)[:, None]
    powers = np.exp(n * exponents)
    columns = np.concatenate([powers, directions * n * powers], axis=1)
    real = np.concatenate([columns.real, -columns.imag], axis=1)
    dense = real.T @ real
    scale = np.sqrt(np.diag(dense))
    error = (normal_matrix(exponents, directions, len(n)) - dense) / np.outer(scale, scale)
    assert np.abs(error).max() < 1e-9
    signal = noise(3000)
    sums = np.stack([signal @ powers, (n[:, 0] * signal) @ powers])
    np.testing.assert_allclose(correlations(exponents, signal), sums, rtol=1e-9)


def test_least_squares_refines_exponents():
    true = modes(4, 3000.0, seed=10)
    clip = sampled(true, RATE, 0.5, 200.0)
    start = exponents_of(1.0005 * true.frequencies, 1.2 * true.dampings, RATE)
    exponents = refined(start, fitted_coefficients(start, clip), clip, 30)[0]
    exact = exponents_of(true.frequencies, true.dampings, RATE)
    np.testing.assert_allclose(exponents, exact, rtol=1e-8)


def test_a_clean_steady_tone_is_refused_at_once():
    """Without noise, what its end leaves in all bands would be searched for minutes."""
    tone = 0.5 * np.sin(2.0 * np.pi * 440.0 * np.arange(44_100) / 44_100)
    with pytest.raises(UserError, match="440.* does not fade"):
        extract(tone, 44_100)


def test_modes_of_a_clean_clip_are_found_once():
    frequencies = np.array([145.08, 533.05, 569.33, 1326.89, 2152.06])
    seconds = np.arange(44_100) / 44_100
    waves = np.exp(-np.outer([6.0, 6.6, 6.6, 9.5, 15.1], seconds))
    waves *= np.sin(2.0 * np.pi * np.outer(frequencies, seconds))
    clip = np.array([0.4, 0.1, 2e-3, 0.02, 0.1]) @ waves
    sound = extract(clip.astype(np.float32), 44_100)
    assert len(sound.frequencies) == len(frequencies)
    np.testing.assert_allclose(sound.frequencies, frequencies, rtol=1e-6)


@pytest.mark.parametrize("gain", [1.0, 0.3])
def test_of_two_strikes_the_first_is_taken_and_the_second_told(gain):
    true = modes(5, 3000.0, seed=5)
    clip = sampled(true, RATE, 1.0, 60.0)
    later = round(0.4 * RATE)
    twice = np.pad(clip, (0, later))
    twice[later:] += gain * clip
    assert second_strike(clip, RATE) is None
    sound = extract(twice, RATE)
    assert 0.37 < sound.evidence["second_strike_seconds"] <= 0.4
    assert len(sound.residual) < later
    np.testing.assert_allclose(sound.frequencies, true.frequencies, rtol=FREQUENCY_TOLERANCE)


def test_modes_that_beat_are_no_second_strike():
    assert second_strike(single(400.0, 3.0, 1.0) + 0.95 * single(404.0, 3.0, 1.0), RATE) is None


@pytest.mark.parametrize("cents", [-150.0, 100.0, 400.0])
def test_a_tone_that_glides_is_told(cents):
    hertz, seconds = 120.0, 0.08
    t = np.arange(RATE) / RATE
    rise = hertz * (2.0 ** (cents / 1200.0) - 1.0)
    phase = 2.0 * np.pi * (hertz * t - rise * seconds * np.expm1(-t / seconds))
    clip = np.exp(-12.0 * t) * np.sin(phase) + 0.2 * single(310.0, 10.0, 1.0)
    clip += 1e-3 * np.random.default_rng(0).standard_normal(len(clip))
    found = glide(clip, RATE)
    assert found is not None and found.hertz == pytest.approx(hertz, rel=0.04)
    assert found.cents == pytest.approx(cents, rel=0.15)


def test_steady_modes_do_not_glide():
    random = np.random.default_rng(7)
    for each in range(6):
        clip = sampled(modes(5, 1000.0, seed=each), RATE, 1.0, 30.0)
        assert glide(clip + 1e-3 * random.standard_normal(len(clip)), RATE) is None
    assert glide(single(400.0, 3.0, 1.0) + 0.95 * single(404.0, 5.0, 1.0), RATE) is None


@pytest.mark.parametrize("fade", [0.0, 0.05, 0.15])
def test_silence_and_fades_at_either_end_do_not_matter(fade):
    true = modes(6, 3000.0, seed=5)
    clip = sampled(true, RATE, 1.0, 40.0)[:5000]
    faded = round(fade * RATE)
    clip[len(clip) - faded :] *= np.linspace(1.0, 0.0, faded)
    sound = extract(np.pad(clip, (800, 4000)), RATE)
    np.testing.assert_allclose(sound.frequencies, true.frequencies, rtol=FREQUENCY_TOLERANCE)
    np.testing.assert_allclose(sound.dampings, true.dampings, rtol=DAMPING_TOLERANCE)
    end = (800 + len(clip) - faded) / RATE
    assert end - 0.3 * fade - 0.002 <= sound.evidence["end_seconds"] <= end + 0.05 * fade


def test_a_clip_that_is_not_faded_is_searched_to_its_end():
    for seed in range(6):
        clip = sampled(modes(6, 3000.0, seed=seed), RATE, 1.0, 40.0)
        assert ending(clip, RATE) >= 0.99 * len(clip)
        assert ending(clip[:3000], RATE) >= 2970
