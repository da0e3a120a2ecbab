"""The modes of a clip do not depend on the format that it is written in."""

import numpy as np
import pytest

from sound.clips.files import extract_file
from sound.synthesis.sinusoids import damped_sinusoids
from studies.recordings.formats import RATES, SUBTYPES, Format, write_as

HIGHEST_RATE = 192_000
FREQUENCIES = np.array([220.0, 415.0, 1130.0, 2620.0, 4875.0, 7440.0])
DAMPINGS = np.array([6.0, 9.0, 14.0, 25.0, 40.0, 55.0])
AMPLITUDES = np.array([0.2, 0.15, 0.2, 0.1, 0.15, 0.1])


@pytest.fixture(scope="module")
def original() -> np.ndarray:
    """Six modes below 8 kHz."""
    phases = np.linspace(0.0, 5.0, len(FREQUENCIES))
    return damped_sinusoids(
        FREQUENCIES, DAMPINGS, AMPLITUDES, phases, HIGHEST_RATE, HIGHEST_RATE // 4
    )


# Every rate and every format of samples has its turn in mono and in stereo.
ALL = [
    Format(rate, subtype, 1 + (place + other) % 2)
    for place, rate in enumerate(RATES)
    for other, subtype in enumerate(SUBTYPES)
]


@pytest.mark.parametrize("form", ALL, ids=lambda form: form.title)
def test_modes_are_the_same_to_a_cent_in_every_format(tmp_path, original, form):
    write_as(form, original, HIGHEST_RATE, tmp_path / "clip.wav")
    sound = extract_file(tmp_path / "clip.wav")
    cents = 1200.0 * np.abs(np.log2(sound.frequencies / FREQUENCIES[:, None]))
    nearest = cents.argmin(axis=1)
    assert cents.min(axis=1).max() < 1.0
    # Nothing beside them but what 8 bits add.
    others = np.delete(sound.amplitudes, nearest)
    assert len(set(nearest)) == len(FREQUENCIES)
    assert others.max(initial=0.0) < 0.02
    np.testing.assert_allclose(sound.dampings[nearest], DAMPINGS, rtol=0.02)
