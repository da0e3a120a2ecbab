"""`python -m sound extract`: the modes of sound clips."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carillon.arguments import whole_number
from carillon.errors import UserError

if TYPE_CHECKING:  # Their imports take long, and `--help` needs none.
    from sound.clips.extraction import ModalSound
    from sound.clips.targets import Targets


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("clips", nargs="+", metavar="CLIP.wav", help="a strike each")
    parser.add_argument(
        "--modes",
        type=whole_number(1),
        help="modes to keep, shared by all clips, those that carry most (default: all)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--out", metavar="FILE.json", help="write the same JSON to a file, too")
    parser.add_argument(
        "--residual", metavar="FILE.wav", help="write what is left of one clip without its modes"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from carillon.files import atomic_path
    from sound.clips.files import extract_file
    from sound.clips.targets import share_frequencies
    from sound.clips.wav import ENDINGS, write_wav
    from sound.outputs import require_output

    if arguments.residual is not None and len(arguments.clips) > 1:
        raise UserError(
            f"--residual writes what is left of one clip, {len(arguments.clips)} were given"
        )
    if arguments.out is not None:
        require_output(arguments.out, (".json",), arguments.clips)
    if arguments.residual is not None:
        require_output(arguments.residual, ENDINGS, arguments.clips)
    sounds = [extract_file(clip, visible=sys.stderr.isatty()) for clip in arguments.clips]
    targets = share_frequencies(_names(arguments.clips), sounds, arguments.modes)
    if arguments.residual is not None:
        write_wav(arguments.residual, sounds[0].residual, sounds[0].rate)
    content = _content(arguments.clips, sounds, targets)
    if arguments.out is not None:
        with atomic_path(arguments.out) as temporary:
            temporary.write_text(json.dumps(content, indent=2) + "\n")
    print(json.dumps(content, indent=2) if arguments.json else "\n".join(_lines(content)))
    return 0


def _names(clips: list[str]) -> list[str]:
    """Names of the clips without folder and ending, or numbers where those are not unique."""
    names = [Path(clip).stem for clip in clips]
    unique = len(set(names)) == len(names)
    return names if unique else [f"clip {number + 1}" for number in range(len(names))]


def _content(clips: list[str], sounds: list[ModalSound], targets: Targets) -> dict[str, Any]:
    """What is printed and written."""
    return {
        "clips": [
            {"file": clip, "rate_hz": sound.rate, **sound.evidence}
            for clip, sound in zip(clips, sounds, strict=True)
        ],
        "names": list(targets.names),
        "frequencies_hz": targets.frequencies.tolist(),
        "dampings_per_second": targets.dampings.tolist(),
        "amplitudes": targets.amplitudes.tolist(),
    }


def _lines(content: dict[str, Any]) -> list[str]:
    """A line per clip, then a line per mode with its level in each clip."""
    from math import log10

    lines = [
        f"{clip['file']}: strike at {clip['strike_seconds']:.4f} s, {clip['order']} modes found, "
        f"which explain {100.0 * clip['explained']:.2f} % of the energy"
        for clip in content["clips"]
    ]
    names = content["names"]
    lines.append("  ".join(["    Hz", "      1/s", *(f"{name:>22}" for name in names)]))
    loudest = [max(row) for row in content["amplitudes"]]
    columns = zip(*content["amplitudes"], strict=True)
    modes = zip(content["frequencies_hz"], content["dampings_per_second"], columns, strict=True)
    for hertz, damping, column in modes:
        parts = [
            f"{value:12.3e} {20.0 * log10(value / top):6.1f} dB" if value > 0.0 else " " * 22
            for value, top in zip(column, loudest, strict=True)
        ]
        lines.append("  ".join([f"{hertz:9.2f}", f"{damping:8.3f}", *parts]))
    return lines
