"""`carillon render`: the sound of a strike, or of many, as WAV."""

from __future__ import annotations

import argparse
import json
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from carillon.command_line.counts import counted
from carillon.errors import UserError
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from carillon.parameters.quantities import Number, Point, Positive, RayleighDamping, between
from sound.bounds import (
    LARGEST_IMPULSE,
    LEAST_IMPULSE,
    LONGEST_SOUND,
    ContactSeconds,
    SampleRate,
    require_length,
)
from sound.commands.common_options import DampingOptions
from sound.outputs import WavOptions

if TYPE_CHECKING:  # Their imports take long, and `--help` needs none.
    from sound.rendering.heard_solid import HeardSolid
    from sound.rendering.listening import Listening
    from sound.rendering.render import Hit
    from sound.rendering.rendered_sound import RenderedSound
    from sound.rendering.strike_list import Point as StruckPoint

TOLD = 1e-3
"""Least share of the clips' energy in missed tones that is reported."""

_Impulse = Annotated[float, between(-LARGEST_IMPULSE, LARGEST_IMPULSE)]


@parameters
class PointOptions:
    """Where a solid is struck, by one of the four; a design of one target is struck there."""

    target: str | None = option(
        None,
        "strike where a target was assigned (default: the only one of a design)",
        metavar="NAME",
    )
    vertex: Number | None = option(None, "strike a vertex of the surface")
    at: Point | None = option(
        None,
        "strike the surface near a point, in the coordinates of the mesh that was designed, as in "
        "a project; of modes.h5 alone [m]",
        metavar=("X", "Y", "Z"),
    )
    strikes: str | None = option(
        None, "strike many times, as a table says (CSV, see the documentation)", metavar="CSV"
    )


@parameters
class ImpulseOptions:
    """How a solid is struck, by one of the two."""

    impulse: tuple[_Impulse, _Impulse, _Impulse] | None = option(
        None,
        "impulse [N s]",
        metavar=("FX", "FY", "FZ"),
    )
    strength: Annotated[float, between(LEAST_IMPULSE, LARGEST_IMPULSE)] = option(
        1.0,
        "impulse along the inward normal [N s] (default 1, which sounds as loud as the clip); with "
        "--strikes that of lines without one",
    )


@parameters
class RenderOptions:
    """What sounds, and the sound that is written."""

    file: str = option(REQUIRED, "design.h5, or modes.h5 of the solver")
    out: str = option(REQUIRED, "file to write (WAV)")
    seconds: Positive | None = option(
        None,
        "length (default: until it has decayed to -60 dBFS, at most 30 s after the last strike)",
    )
    rate: SampleRate = option(44_100, "samples per second")
    contact_seconds: ContactSeconds = option(
        0.0,
        "duration of the force, half a sine (default 0: an impulse)",
    )
    no_residual: bool = option(False, "modes only, without the noise of the clips")
    modes_out: str | None = option(
        None, "file for the modes alone, just as loud (WAV)", metavar="FILE.wav"
    )
    like: str | None = option(
        None,
        "for modes.h5 of a designed object: dampings, points, loudness, noise of a design",
        metavar="DESIGN",
    )
    damping: RayleighDamping | None = option(
        None,
        "for modes.h5: Rayleigh damping, coefficients of mass [1/s] and stiffness [s] "
        "(default: that of the solid if its file tells, or 30 1e-6)",
        metavar=("ALPHA", "BETA"),
    )
    fade_seconds: Annotated[float, between(0.0, LONGEST_SOUND)] | None = option(
        None,
        "fade at the end (default: a tenth of the length, 0.5 s at most, if the end is louder than "
        "-60 dBFS; none if --raw)",
    )
    json: bool = option(False, "print what sounds as JSON")


@parameters
class ScaleOptions:
    """How samples are scaled, by one of the two; by default they are kept within full scale."""

    normalise: bool = option(False, "scale to full scale, and say by how much")
    raw: bool = option(
        False,
        "samples as they are computed, even beyond full scale: of a design as loud as its clips, "
        "of other modes sums of amplitudes [kg^-1/2 N s]",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser.add_mutually_exclusive_group(), PointOptions)
    add_options(parser.add_mutually_exclusive_group(), ImpulseOptions)
    add_options(parser, RenderOptions, positional=("file",))
    add_options(parser.add_mutually_exclusive_group(), ScaleOptions)
    add_options(parser, WavOptions)
    add_options(parser, DampingOptions)


def run(arguments: argparse.Namespace) -> int:
    """Render, write, and say what sounds."""
    from sound.clips.wav import write_wav
    from sound.rendering.heard_solid import open_heard_solid
    from sound.rendering.rendered_sound import LevelOptions, render_sound

    options, points = collect(RenderOptions, arguments), collect(PointOptions, arguments)
    _require_outputs(options, points)
    source = collect(DampingOptions, arguments).damping_from
    scale = collect(ScaleOptions, arguments)
    heard = open_heard_solid(options.file, options.like, options.damping, source)
    hits = _hits(heard, points, collect(ImpulseOptions, arguments))
    sound = render_sound(
        heard.solid,
        hits,
        options.seconds,
        options.rate,
        options.contact_seconds,
        heard.listening,
        not options.no_residual,
        LevelOptions(scale.raw, scale.normalise, options.fade_seconds),
    )
    format = collect(WavOptions, arguments)
    bits, seed = format.bits, format.dither_seed
    write_wav(options.out, sound.samples, options.rate, bits=bits, seed=seed)
    if options.modes_out is not None:
        write_wav(options.modes_out, sound.modes, options.rate, bits=bits, seed=seed)
    summary = _summary(options, heard, hits, sound)
    print(json.dumps(summary) if options.json else "\n".join(_lines(summary)))
    return 0


def _require_outputs(options: RenderOptions, points: PointOptions) -> None:
    from sound.clips.wav import ENDINGS
    from sound.outputs import require_output

    inputs = [name for name in (options.file, options.like, points.strikes) if name is not None]
    require_output(options.out, ENDINGS, inputs)
    if options.modes_out is not None:
        require_output(options.modes_out, ENDINGS, inputs)
        if Path(options.modes_out).absolute() == Path(options.out).absolute():
            raise UserError(f"--modes-out {options.modes_out}: is --out, too; name another file")
    if options.seconds is not None and options.seconds > LONGEST_SOUND:
        raise UserError(f"--seconds {options.seconds:g}: expected at most {LONGEST_SOUND:g}")
    if options.seconds is not None:
        require_length(options.seconds, options.rate)


def _hits(heard: HeardSolid, points: PointOptions, strike: ImpulseOptions) -> list[Hit]:
    import numpy as np

    from sound.rendering.render import Hit
    from sound.rendering.strike_list import read_strikes

    if points.strikes is not None:
        if strike.impulse is not None:
            raise UserError("--impulse goes with one strike; give strengths in the list")
        return heard.hits(points.strikes, read_strikes(points.strikes), strike.strength)
    ((position, inward, distance),) = heard.places([_point(heard, points)])
    if strike.impulse is None:
        return [Hit(0.0, position, strike.strength * inward, distance)]
    impulse = np.array(strike.impulse)
    strength = float(np.linalg.norm(impulse))
    if strength < LEAST_IMPULSE:
        raise UserError(
            "--impulse: expected three numbers [N s], not all of them 0; "
            f"{strength:g} N s in all is less than {LEAST_IMPULSE:g}"
        )
    return [Hit(0.0, position, impulse, distance)]


def _point(heard: HeardSolid, points: PointOptions) -> tuple[str, StruckPoint]:
    """The point that is struck once, and the option that names it."""
    from sound.rendering.strike_list import Point as StruckPoint

    if points.at is not None:
        return "--at", StruckPoint(None, None, (points.at[0], points.at[1], points.at[2]))
    if points.vertex is not None:
        return "--vertex", StruckPoint(None, points.vertex, None)
    return "--target", StruckPoint(heard.only_target() if points.target is None else points.target)


def _summary(
    options: RenderOptions, heard: HeardSolid, hits: list[Hit], sound: RenderedSound
) -> dict[str, Any]:
    from sound.rendering.render import residual_share

    solid, listening = heard.solid, heard.listening
    audible = solid.frequencies < options.rate / 2.0
    summary: dict[str, Any] = {
        "out": str(Path(options.out)),
        "modes_out": None if options.modes_out is None else str(Path(options.modes_out)),
        "rate_hz": options.rate,
        "seconds": len(sound.samples) / options.rate,
        "strikes": len(hits),
        "scale": sound.scale,
        "peak": float(abs(sound.samples).max(initial=0.0)),
        **sound.level.as_dict(),
        "limited_decibels": sound.limited_decibels,
        "cut_off": sound.cut_off,
        "clip_loudness_lufs": None,
        "loudness_over_clip_lufs": None,
        "frequencies_hz": solid.frequencies[audible].tolist(),
        "dampings_per_second": solid.dampings[audible].tolist(),
        "modes_left_out": int((~audible).sum()),
        "residual_share": residual_share(sound.modes, sound.noise),
        "missed_share": None,
    }
    if listening is not None:
        weights = sum(listening.weights(hit.position) for hit in hits) / len(hits)
        summary["missed_share"] = float(weights @ listening.missed)
    if len(hits) > 1:
        return summary
    (hit,) = hits
    if listening is not None:
        summary |= _beside_clip(listening, hit, sound)
    gain = sound.scale if listening is None else sound.scale * listening.gain(hit.position)
    amplitudes = gain * solid.amplitudes(hit.position[None], hit.impulse[None])[0]
    return summary | {
        "position_m": hit.position.tolist(),
        "distance_m": hit.distance,
        "impulse_newton_seconds": hit.impulse.tolist(),
        "gain": gain,
        "amplitudes": amplitudes[audible].tolist(),
    }


def _beside_clip(listening: Listening, hit: Hit, sound: RenderedSound) -> dict[str, float]:
    """Loudness of the clip of a struck target, and of the sound over as long; none elsewhere.

    Nor is there any of a sound that is cut short or silent.
    """
    from sound.levels import END_DBFS

    loudness, weights = listening.targets.loudness, listening.weights(hit.position)
    target = int(weights.argmax())
    if loudness is None or weights[target] < 1.0 or not sound.samples.any():
        return {}
    is_short = len(sound.samples) < round(loudness.seconds[target] * sound.rate)
    end = sound.level.end_dbfs
    if is_short and end is not None and end > END_DBFS:
        return {}
    return {
        "clip_loudness_lufs": float(loudness.lufs[target]),
        "loudness_over_clip_lufs": sound.relative_loudness(float(loudness.seconds[target])),
    }


def _lines(summary: dict[str, Any]) -> list[str]:
    """What was written, one line for the file and one for each thing that is said of the sound."""
    from sound.levels import SoundLevel, decibels

    hertz, of_clips = summary["frequencies_hz"], summary["missed_share"] is not None
    span = f", {min(hertz):.4g} to {max(hertz):.4g} Hz" if hertz else ""
    level = SoundLevel(*(summary[each.name] for each in fields(SoundLevel))).in_words()
    if summary["cut_off"]:
        level += " since it rings on (--seconds for more)"
    lines = [
        f"{summary['out']}: {summary['seconds']:.3g} s, {counted(len(hertz), 'mode')}{span}",
        f"level: {level}",
    ]
    if summary["clip_loudness_lufs"] is not None:
        lines.append(
            f"over the length of its clip: {summary['loudness_over_clip_lufs']:.1f} LUFS, "
            f"the clip {summary['clip_loudness_lufs']:.1f} LUFS"
        )
    if of_clips and summary["residual_share"] > 0.0:
        lines.append(f"noise of the clips: {summary['residual_share']:.1%} of the energy")
    if summary["scale"] != 1.0:
        factor = summary["scale"]
        lines.append(f"scaled by {factor:.4g} ({decibels(factor):+.1f} dB)")
    if summary["limited_decibels"]:
        lines.append(f"peaks are attenuated by up to {summary['limited_decibels']:.1f} dB")
    if summary["modes_left_out"]:
        many = counted(summary["modes_left_out"], "mode")
        lines.append(f"left out: {many} above half the sampling rate")
    if of_clips and summary["missed_share"] >= TOLD:
        lines.append(
            f"left out: tones with {summary['missed_share']:.1%} of the clips' energy, which are "
            "neither modes nor noise"
        )
    return lines[:1] + [f"  {line}" for line in lines[1:]]
