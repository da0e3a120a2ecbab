"""What a measured head tells of directions, beside the spherical one.

    python -m tests.measured_head HEAD.sofa

One click, 1 m away in free air, is heard from ahead, behind, above and below by both heads; printed
are levels in octaves, mean of both ears, and how far they are apart.  Then the delay between the
ears on the horizon beside Woodworth's formula.  Debian's package libmysofa1 brings a head,
/usr/share/libmysofa/MIT_KEMAR_normal_pinna.sofa.
"""

import argparse

import numpy as np

from carillon.arrays import Array
from carillon.command_line.exit_status import run
from sound.heads.measured_head import MeasuredHead, read_head
from sound.radiation.air import SOUND_SPEED
from sound.scenes.audible.hearing import HEAD_RADIUS, Head, heard
from sound.scenes.audible.measured_hearing import heard_measured
from sound.scenes.performance import Motion

RATE = 44_100
OCTAVES = np.array([250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16_000.0])
"""Middles of octaves [Hz]."""
THIRDS = 250.0 * 2.0 ** (np.arange(19) / 3.0)
"""Middles of thirds of octaves [Hz]."""
PAIRS = {
    ("ahead", "behind"): ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    ("30 degrees above", "30 degrees below"): (
        (np.sqrt(0.75), 0.0, 0.5),
        (np.sqrt(0.75), 0.0, -0.5),
    ),
    ("overhead", "ahead"): ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
}
"""Pairs of directions: ahead, left, up."""
AZIMUTHS = range(0, 181, 20)


def click_at(direction: tuple[float, float, float], measured: MeasuredHead | None) -> Array:
    """Sound (s, 2) of a click 1 m away in a direction."""
    source = np.zeros(RATE // 8)
    source[64] = 1.0
    times = np.arange(0.0, 0.2, 0.01)
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1, 1))
    motion = Motion(times, np.tile(direction, (len(times), 1, 1)), turns)
    head = Head(np.zeros(1), np.zeros((1, 3)), np.array([1000.0, 0.0, 0.0]))
    if measured is None:
        return heard(source, motion, 0, head, RATE)
    return heard_measured(source, motion, 0, head, measured, RATE)


def band_levels(sound: Array, middles: Array, octaves: float) -> Array:
    """Levels (b,) [dB] of bands so many octaves wide, of the mean power at both ears over that of a
    click of 1 Pa.
    """
    power = (np.abs(np.fft.rfft(sound, axis=0)) ** 2).mean(axis=1)
    frequencies = np.fft.rfftfreq(len(sound), 1.0 / RATE)
    width = 2.0 ** (octaves / 2.0)
    within = [(frequencies >= hertz / width) & (frequencies < hertz * width) for hertz in middles]
    return np.array([10.0 * np.log10(power[each].mean()) for each in within])


def interaural_delays(measured: MeasuredHead) -> tuple[Array, Array]:
    """Delays (a,) [s] of the right ear after the left one, measured and by Woodworth's formula."""
    azimuths = np.radians(AZIMUTHS)
    level = np.stack([np.cos(azimuths), np.sin(azimuths), 0.0 * azimuths], axis=1)
    corners, weights, _ = measured.mesh.weights(level)
    left, right = np.einsum("ak,ake->ea", weights, measured.delays[corners])
    lateral = np.arcsin(np.clip(level[:, 1], -1.0, 1.0))
    return right - left, HEAD_RADIUS / SOUND_SPEED * (lateral + np.sin(lateral))


def main(file: str) -> None:
    """Measure and print."""
    measured = read_head(file, float(RATE))
    print(f"{measured.title}: {len(measured.directions)} directions at {measured.distance:g} m\n")
    print("levels of a click in octaves [dB], mean of both ears")
    print(" " * 28 + "".join(f"{hertz:8,.0f}" for hertz in OCTAVES) + " Hz")
    for names, directions in PAIRS.items():
        for title, head in (("spherical", None), ("measured", measured)):
            sounds = [click_at(each, head) for each in directions]
            first, second = (band_levels(each, OCTAVES, 1.0) for each in sounds)
            for name, values in zip((*names, "difference"), (first, second, first - second)):
                print(f"{title:10} {name:17}" + "".join(f"{value:8.1f}" for value in values))
            finer = np.subtract(*(band_levels(each, THIRDS, 1.0 / 3.0) for each in sounds))
            most = int(np.argmax(np.abs(finer)))
            most_at = f"{finer[most]:.1f} at {THIRDS[most]:,.0f} Hz"
            print(f"{title:10} most in a third of an octave: {most_at}")
        print()
    print("delay of the right ear after the left one, by azimuth to the left [us]")
    print(f"{'azimuth':10}" + "".join(f"{azimuth:6}" for azimuth in AZIMUTHS))
    found, expected = interaural_delays(measured)
    for title, delays in (("measured", found), ("Woodworth", expected)):
        print(f"{title:10}" + "".join(f"{1e6 * delay:6.0f}" for delay in delays))
    off = 1e6 * np.abs(found - expected)
    print(f"apart by {np.sqrt(np.mean(off**2)):.0f} us (rms), {off.max():.0f} us at most")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.measured_head", description=__doc__)
    parser.add_argument("head", metavar="HEAD.sofa", help="measured head")
    file = parser.parse_args().head
    raise SystemExit(run("measured_head", lambda: main(file)))
