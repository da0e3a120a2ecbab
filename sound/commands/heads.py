"""`carillon heads`: measured heads of a folder, and a blend of them.

Lists the SOFA files of a folder (AES69, convention SimpleFreeFieldHRIR): how far each is from the
mean of all and from the nearest other one, in dB over directions, bands and delays.  With `--out`
their blend is written as one more, by which scenes are heard (`listener: {hrtf: FILE.sofa}`): all
heads alike, or with weights, or that of a calibration, the blend that a listener preferred.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from carillon.command_line.counts import counted
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from carillon.parameters.quantities import File

if TYPE_CHECKING:  # Their imports take long, and `--help` needs none.
    from carillon.arrays import Array
    from sound.heads.head_space import HeadSpace
    from sound.heads.measured_head import MeasuredHead

EXAMPLES = """examples:
  carillon heads cipic/
  carillon heads cipic/ --mix subject_003=2 subject_021=1 --out mixed.sofa
  carillon heads cipic/ --calibration mine.json --out mine.sofa"""


@parameters
class HeadsOptions:
    """Heads to list, and the blend to write."""

    folder: File = option(REQUIRED, "folder of measured heads (SOFA)")
    out: File | None = option(None, "blend to write (SOFA)", metavar="FILE.sofa")
    json: bool = option(False, "print as JSON")


@parameters
class BlendOptions:
    """Weights of the blend, given or of a calibration; those of all heads are alike if by none."""

    mix: tuple[str, ...] | None = option(
        None,
        "heads by the names of their files, and their weights, of which the sum is made 1",
        metavar="NAME=WEIGHT",
    )
    calibration: File | None = option(
        None, "calibration of these heads (JSON)", metavar="FILE.json"
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, HeadsOptions, positional=("folder",))
    add_options(parser.add_mutually_exclusive_group(), BlendOptions)


def run(arguments: argparse.Namespace) -> int:
    """List, blend, write."""
    from sound.heads.head_space import head_files, read_heads
    from sound.heads.sofa_file import write_sofa
    from sound.outputs import require_output

    options, blended = collect(HeadsOptions, arguments), collect(BlendOptions, arguments)
    if options.out is not None:
        require_output(options.out, [".sofa"], head_files(options.folder))
    elif blended.mix is not None or blended.calibration is not None:
        raise UserError("a blend is written to a file; give --out FILE.sofa")
    visible = sys.stderr.isatty()
    space = read_heads(options.folder, tell=lambda name: say(f"reading {name}", visible))
    rows = [_row(space, number) for number in range(len(space.heads))]
    content: dict[str, Any] = {"heads": rows}
    if options.out is not None:
        weights, comment = _weights(space, blended)
        head = space.blend(weights, "blend")
        write_sofa(options.out, head.responses(), "blend", comment)
        content |= {"out": options.out, "weights": dict(zip(space.titles, weights.tolist()))}
    if options.json:
        print(json.dumps(content, indent=2))
        return 0
    print("\n".join(_lines(rows)))
    if options.out is not None:
        print(f"{options.out}: blend of {counted(len(space.heads), 'head')}, {comment}")
    return 0


def _row(space: HeadSpace, number: int) -> dict[str, Any]:
    head = space.heads[number]
    distances = np.linalg.norm(space.features - space.features[number], axis=1)
    others = np.delete(distances, number)
    return {
        "name": head.title,
        "directions": len(head.directions),
        "rate_hz": head.rate,
        "distance_metres": head.distance,
        "interaural_delay_seconds": _widest_delay(head),
        "from_mean_db": float(np.linalg.norm(space.features.mean(axis=0) - space.features[number])),
        "nearest": None if not len(others) else _nearest(space, distances, number),
        "nearest_db": float(others.min()) if len(others) else None,
    }


def _nearest(space: HeadSpace, distances: Array, number: int) -> str:
    far = np.where(np.arange(len(distances)) == number, np.inf, distances)
    return space.titles[int(np.argmin(far))]


def _widest_delay(head: MeasuredHead) -> float:
    """Greatest delay [s] between the ears."""
    return float(np.abs(head.delays[:, 1] - head.delays[:, 0]).max())


def _weights(space: HeadSpace, blended: BlendOptions) -> tuple[Array, str]:
    """Weights (S,) of the heads, and a comment on where they are from."""
    from sound.heads.calibration import load_calibration

    count = len(space.heads)
    if blended.calibration is not None:
        calibration = load_calibration(blended.calibration, space)
        return space.weights(calibration.best), calibration.comment
    if blended.mix is None:
        return np.full(count, 1.0 / count), "all alike"
    weights = np.zeros(count)
    for each in blended.mix:
        name, _, value = each.rpartition("=")
        if name not in space.titles:
            raise UserError(
                f"--mix {each}: no head {name!r}, expected one of {', '.join(space.titles[:10])}"
            )
        try:
            weights[space.titles.index(name)] = float(value)
        except ValueError:
            raise UserError(f"--mix {each}: {value!r} is no number, expected NAME=WEIGHT") from None
    if not (np.isfinite(weights).all() and weights.sum() > 0.0):
        raise UserError(
            f"--mix: weights of sum {weights.sum():g}, expected more than 0; give numbers"
        )
    return weights / weights.sum(), f"with {', '.join(blended.mix)}"


def _lines(rows: list[dict[str, Any]]) -> list[str]:
    width = max(4, *(len(row["name"]) for row in rows))
    lines = [f"{'head':{width}}  directions     Hz     m  delay us  from mean dB  nearest dB"]
    for row in rows:
        nearest = "" if row["nearest"] is None else f"{row['nearest_db']:10.2f} {row['nearest']}"
        lines.append(
            f"{row['name']:{width}}  {row['directions']:10} {row['rate_hz']:6.0f} "
            f"{row['distance_metres']:5.2f} {1e6 * row['interaural_delay_seconds']:9.0f} "
            f"{row['from_mean_db']:13.2f}  {nearest}"
        )
    return lines
