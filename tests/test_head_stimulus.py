"""What a listener compares heads by: sounds from directions at two ears."""

import numpy as np
import pytest

from sound.heads.head_space import HeadSpace
from sound.heads.stimulus import (
    BURST_SECONDS,
    DIRECTIONS,
    LEAD_SECONDS,
    at_ears,
    direction_of,
    noise_bursts,
)
from tests.head_calibration import made_heads

LEFT = np.array([0.0, 1.0, 0.0])
CLICK = np.eye(1, 4096)[0]


@pytest.fixture(scope="module")
def space() -> HeadSpace:
    return made_heads(3, 30.0, seed=3)


def test_a_direction_that_was_measured_sounds_as_it_was(space):
    head = space.heads[1]
    number = int(np.argmax(head.directions @ LEFT))
    heard = at_ears(head, head.directions[number], CLICK)
    heard_below = slice(round(20_000.0 / head.rate * len(heard)))
    spectrum = np.abs(np.fft.rfft(heard, axis=0))[heard_below]
    expected = np.abs(np.fft.rfft(head.filters[number], len(heard))).T[heard_below]
    # A delay by a share of a sample rings for ever, but is cut off: 0.02 dB.
    np.testing.assert_allclose(spectrum, expected, rtol=0.005)


def test_delays_between_ears_are_those_of_the_head(space):
    head = space.heads[0]
    number = int(np.argmax(head.directions @ LEFT))
    heard = at_ears(head, head.directions[number], CLICK)
    count = len(heard)
    alone = np.fft.rfft(head.filters[number].T, count, axis=0)
    delay = np.angle(np.fft.rfft(heard, axis=0) / alone)
    low = slice(1, count // 200)
    frequencies = np.arange(count // 2 + 1)[low] * head.rate / count
    found = -np.unwrap(delay, axis=0)[low] / (2.0 * np.pi * frequencies[:, None])
    expected = LEAD_SECONDS + head.delays[number]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-6)
    assert expected[0] < expected[1]


def test_a_source_is_filtered_as_a_click_is(space):
    # Below the highest frequencies, at which delays by a share of a sample ring.
    source = np.exp(-(((np.arange(4096) - 500.0) / 20.0) ** 2))
    direction = direction_of(4)
    click = at_ears(space.heads[2], direction, CLICK)
    heard = at_ears(space.heads[2], direction, source)
    for ear in range(2):
        expected = np.convolve(source, click[:, ear])[: len(heard)]
        np.testing.assert_allclose(heard[:, ear], expected, atol=1e-3 * np.abs(expected).max())


def test_bursts_are_the_same_of_a_seed_and_come_and_go():
    noise = noise_bursts(48_000.0, 7)
    np.testing.assert_array_equal(noise, noise_bursts(48_000.0, 7))
    assert not np.array_equal(noise, noise_bursts(48_000.0, 8))
    burst = round(BURST_SECONDS * 48_000)
    assert noise[0] == noise[burst - 1] == 0.0 and not noise[burst : burst + 1000].any()


def test_directions_of_a_generation_differ_from_those_of_the_next():
    """All pairs of a generation meet all directions, and all are unit vectors."""
    met = {(number % 4, number % len(DIRECTIONS)) for number in range(4 * len(DIRECTIONS))}
    assert len(met) == 4 * len(DIRECTIONS)
    for number in range(len(DIRECTIONS)):
        assert np.linalg.norm(direction_of(number)) == pytest.approx(1.0)
    np.testing.assert_allclose(direction_of(3), [0.5, -np.sqrt(0.75), 0.0], atol=1e-12)
