"""`python -m sound clip`: a synthesised clip to design after."""

from __future__ import annotations

import argparse
import json

from carillon.arguments import positive_number, whole_number
from carillon.errors import UserError
from sound.bounds import sample_rate

NAMES = ("metal", "wood", "piano")
LONGEST_SECONDS = 60.0
"""Length of a clip that is long enough for every strike to die away."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("instrument", choices=NAMES, help="what is struck")
    pitch = parser.add_mutually_exclusive_group()
    pitch.add_argument("--note", help="lowest partial as a note, such as C4 or F#3")
    pitch.add_argument("--pitch", type=positive_number, help="lowest partial [Hz]")
    parser.add_argument("--seconds", type=positive_number, default=2.0, help="length (default 2)")
    parser.add_argument(
        "--rate", type=sample_rate, default=44_100, help="samples per second (default 44100)"
    )
    parser.add_argument(
        "--seed", type=whole_number(0), default=0, help="of imperfections and noise (default 0)"
    )
    parser.add_argument("--json", action="store_true", help="print the partials as JSON")
    parser.add_argument("--out", metavar="FILE.wav", required=True, help="sound file to write")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from sound.clips.extraction import SHORTEST_SAMPLES
    from sound.clips.instruments import note_hertz, synthesised
    from sound.clips.wav import ENDINGS, PEAK, write_wav
    from sound.outputs import require_output

    require_output(arguments.out, ENDINGS)
    shortest = SHORTEST_SAMPLES / arguments.rate
    if not shortest <= arguments.seconds <= LONGEST_SECONDS:
        raise UserError(
            f"--seconds {arguments.seconds:g}: expected {shortest:.3g} to {LONGEST_SECONDS:g}"
        )
    pitch = arguments.pitch if arguments.note is None else note_hertz(arguments.note)
    options = (arguments.seconds, arguments.rate, arguments.seed)
    sound = synthesised(arguments.instrument, pitch, *options)
    samples = sound.modal_part() + sound.residual
    write_wav(arguments.out, samples, sound.rate, peak=True)
    if arguments.json:
        scale = PEAK / abs(samples).max()
        content = {
            **sound.evidence,
            "frequencies_hz": sound.frequencies.tolist(),
            "dampings_per_second": sound.dampings.tolist(),
            "amplitudes": (scale * sound.amplitudes).tolist(),
        }
        print(json.dumps(content, indent=2))
        return 0
    low, high = sound.frequencies[[0, -1]]
    print(
        f"{arguments.out}: {arguments.seconds:g} s of struck {arguments.instrument}, "
        f"{len(sound.frequencies)} partials from {low:.2f} to {high:.2f} Hz"
    )
    return 0
