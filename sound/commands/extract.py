"""`carillon extract`: the modes of sound clips."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from carillon.command_line.counts import counted
from carillon.errors import UserError
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from carillon.parameters.quantities import Count
from sound.clips.formats import CLIP_FORMATS

if TYPE_CHECKING:  # Their imports take long, and `--help` needs none.
    from sound.clips.extraction import ModalSound
    from sound.clips.targets import Targets


@parameters
class ExtractOptions:
    """Clips whose modes are extracted, and what is written of them."""

    clips: tuple[str, ...] = option(REQUIRED, f"a strike each, as {CLIP_FORMATS}", metavar="CLIP")
    modes: Count | None = option(
        None,
        "modes to keep, shared by all clips, those that carry most (default: all)",
    )
    allow_clipped: bool = option(False, "leave out samples at full scale, rather than refuse")
    json: bool = option(False, "print JSON instead of tables")
    out: str | None = option(None, "write the same JSON to a file, too", metavar="FILE.json")
    residual: str | None = option(
        None, "write what is left of one clip without its modes", metavar="FILE.wav"
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, ExtractOptions, positional=("clips",))


def run(arguments: argparse.Namespace) -> int:
    """Extract, write and print."""
    from carillon.files.atomic import atomic_path
    from sound.clips.files import clip_names, extract_file
    from sound.clips.targets import share_frequencies
    from sound.clips.wav import ENDINGS, write_wav
    from sound.outputs import require_output

    options = collect(ExtractOptions, arguments)
    if options.residual is not None and len(options.clips) > 1:
        raise UserError(
            f"--residual writes what is left of one clip, {len(options.clips)} were given"
        )
    if options.out is not None:
        require_output(options.out, (".json",), options.clips)
    if options.residual is not None:
        require_output(options.residual, ENDINGS, options.clips)
    visible, allow_clipped = sys.stderr.isatty(), options.allow_clipped
    sounds = [
        extract_file(clip, visible=visible, allow_clipped=allow_clipped) for clip in options.clips
    ]
    targets = share_frequencies(clip_names(options.clips), sounds, options.modes)
    if options.residual is not None:
        write_wav(options.residual, sounds[0].residual, sounds[0].rate)
    content = _content(options.clips, sounds, targets)
    if options.out is not None:
        with atomic_path(options.out) as temporary:
            temporary.write_text(json.dumps(content, indent=2) + "\n")
    print(json.dumps(content, indent=2) if options.json else "\n".join(_lines(content)))
    return 0


def _content(clips: Sequence[str], sounds: list[ModalSound], targets: Targets) -> dict[str, Any]:
    from sound.clips.audibility import heard_partials

    return {
        "clips": [
            {
                "file": clip,
                "rate_hz": sound.rate,
                **sound.evidence,
                "heard_hz": heard_partials(sound).frequencies.tolist(),
            }
            for clip, sound in zip(clips, sounds, strict=True)
        ],
        "names": list(targets.names),
        "frequencies_hz": targets.frequencies.tolist(),
        "dampings_per_second": targets.dampings.tolist(),
        "amplitudes": targets.amplitudes.tolist(),
    }


def _line(clip: dict[str, Any]) -> str:
    from sound.clips.audibility import heard_in_words
    from sound.clips.extraction import remarks

    line = (
        f"{clip['file']}: strike at {clip['strike_seconds']:.4f} s, "
        f"{counted(clip['order'], 'mode')} found, "
        f"which explain {100.0 * clip['explained']:.2f} % of the energy"
    )
    return "; ".join([line, heard_in_words(clip["heard_hz"]), *remarks(clip)])


def _lines(content: dict[str, Any]) -> list[str]:
    from sound.levels import DECAY_NEPERS, decibels

    lines = [_line(clip) for clip in content["clips"]]
    names = content["names"]
    lines.append(
        "  ".join(["    Hz", "      1/s", "60 dB in s", *(f"{name:>22}" for name in names)])
    )
    loudest = [max(row) for row in content["amplitudes"]]
    columns = zip(*content["amplitudes"], strict=True)
    modes = zip(content["frequencies_hz"], content["dampings_per_second"], columns, strict=True)
    for hertz, damping, column in modes:
        parts = [
            f"{value:12.3e} {decibels(value / top):6.1f} dB" if value > 0.0 else " " * 22
            for value, top in zip(column, loudest, strict=True)
        ]
        fall = DECAY_NEPERS / damping
        lines.append("  ".join([f"{hertz:9.2f}", f"{damping:8.3f}", f"{fall:10.3f}", *parts]))
    return lines
