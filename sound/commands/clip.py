"""`carillon clip`: a synthesised clip to design after."""

import argparse
import json
from typing import Annotated

from carillon.command_line.counts import counted
from carillon.errors import UserError
from carillon.parameters import REQUIRED, OneOf, option, parameters
from carillon.parameters.command_line import add_options, collect
from carillon.parameters.quantities import Number, Positive
from sound.bounds import SampleRate

NAMES = ("metal", "wood", "piano")
LONGEST_SECONDS = 60.0
"""Greatest length of a clip [s]; every strike has decayed by then."""


@parameters
class PitchOptions:
    """How high a clip sounds, by one of the two; the instrument's own pitch if by none."""

    note: str | None = option(None, "lowest partial as a note, such as C4 or F#3")
    pitch: Positive | None = option(None, "lowest partial [Hz]")


@parameters
class ClipOptions:
    """A clip to synthesise."""

    instrument: Annotated[str, OneOf(*NAMES)] = option(
        REQUIRED, "what is struck", metavar=f"{{{','.join(NAMES)}}}"
    )
    out: str = option(REQUIRED, "sound file to write", metavar="FILE.wav")
    seconds: Positive = option(2.0, "length")
    rate: SampleRate = option(44_100, "samples per second")
    seed: Number = option(0, "of imperfections and noise")
    json: bool = option(False, "print the partials as JSON")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser.add_mutually_exclusive_group(), PitchOptions)
    add_options(parser, ClipOptions, positional=("instrument",))


def run(arguments: argparse.Namespace) -> int:
    """Synthesise and write."""
    from sound.clips.extraction import SHORTEST_SAMPLES
    from sound.clips.instruments import note_hertz, synthesised
    from sound.clips.wav import ENDINGS, PEAK, write_wav
    from sound.outputs import require_output

    options, pitches = collect(ClipOptions, arguments), collect(PitchOptions, arguments)
    require_output(options.out, ENDINGS)
    shortest = SHORTEST_SAMPLES / options.rate
    if not shortest <= options.seconds <= LONGEST_SECONDS:
        raise UserError(
            f"--seconds {options.seconds:g}: expected {shortest:.3g} to {LONGEST_SECONDS:g}"
        )
    pitch = pitches.pitch if pitches.note is None else note_hertz(pitches.note)
    sound = synthesised(options.instrument, pitch, options.seconds, options.rate, options.seed)
    samples = sound.modal_part() + sound.residual
    write_wav(options.out, samples, sound.rate, peak=True)
    if options.json:
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
        f"{options.out}: {options.seconds:g} s of struck {options.instrument}, "
        f"{counted(len(sound.frequencies), 'partial')} from {low:.2f} to {high:.2f} Hz"
    )
    return 0
