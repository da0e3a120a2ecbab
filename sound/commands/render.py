"""`python -m sound render`: the sound of a strike, as WAV."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carillon.arguments import number_between, positive_number, whole_number
from carillon.errors import UserError
from carillon.options import REQUIRED, add_options, collect, option
from sound.bounds import require_length, sample_rate

if TYPE_CHECKING:  # Their imports take long, and `--help` needs none.
    import numpy as np
    from numpy.typing import NDArray

    from sound.project.design_file import Design
    from sound.rendering.listening import Listening
    from sound.rendering.solid import SoundingSolid

    Array = NDArray[np.float64]

LONGEST_SECONDS = 600.0
"""Length of a sound that somebody may want to hear."""
LONGEST_CONTACT = 1.0
"""Duration of a force [s] that still strikes rather than pushes."""
LEAST_IMPULSE, LARGEST_IMPULSE = 1e-6, 1e6
"""What somebody may strike with [N s]."""


@dataclass(frozen=True)
class PointOptions:
    """Where a solid is struck, by one of the three."""

    target: str | None = option(None, "strike where a target was assigned", metavar="NAME")
    vertex: int | None = option(None, "strike a vertex of the surface", type=whole_number(0))
    at: list[float] | None = option(
        None,
        "strike the surface near a point, in the coordinates of the mesh that was designed, as in "
        "a project; of modes.h5 alone [m]",
        type=number_between(-1e18, 1e18),
        nargs=3,
        metavar=("X", "Y", "Z"),
    )


@dataclass(frozen=True)
class ImpulseOptions:
    """How a solid is struck, by one of the two."""

    impulse: list[float] | None = option(
        None,
        "impulse [N s]",
        type=number_between(-LARGEST_IMPULSE, LARGEST_IMPULSE, "N s"),
        nargs=3,
        metavar=("FX", "FY", "FZ"),
    )
    strength: float = option(
        1.0,
        "impulse along the inward normal [N s] (default 1, which sounds as loud as the clip)",
        type=number_between(LEAST_IMPULSE, LARGEST_IMPULSE, "N s"),
    )


@dataclass(frozen=True)
class RenderOptions:
    """What sounds, and the sound that is written."""

    file: str = option(REQUIRED, "design.h5, or modes.h5 of the solver")
    out: str = option(REQUIRED, "file to write (WAV)")
    seconds: float | None = option(None, "length (default: until it decays)", type=positive_number)
    rate: int = option(44_100, "samples per second", type=sample_rate)
    contact_seconds: float = option(
        0.0,
        "duration of the force, half a sine (default 0: an impulse)",
        type=number_between(0.0, LONGEST_CONTACT, "s"),
    )
    no_residual: bool = option(False, "modes only, without the rest of the clips")
    like: str | None = option(
        None,
        "for modes.h5 of a designed object: dampings, points, loudness, residuals of a design",
        metavar="DESIGN",
    )
    damping: list[float] | None = option(
        None,
        "for modes.h5: Rayleigh damping, coefficients of mass [1/s] and stiffness [s] "
        "(default 30 1e-6)",
        type=number_between(0.0, 1e9),
        nargs=2,
        metavar=("ALPHA", "BETA"),
    )
    json: bool = option(False, "print what sounds as JSON")


@dataclass
class _Scene:
    """What is struck, where and how: the solid, its loudness, a point and an impulse there.

    `distance` is that of the point from the one that was named [m].
    """

    solid: SoundingSolid
    listening: Listening | None
    position: Array
    distance: float
    impulse: Array


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser.add_mutually_exclusive_group(required=True), PointOptions)
    add_options(parser.add_mutually_exclusive_group(), ImpulseOptions)
    add_options(parser, RenderOptions, positional=("file",))


def run(arguments: argparse.Namespace) -> int:
    """Render, write, and say what sounds."""
    import numpy as np

    from sound.clips.wav import ENDINGS, PEAK, write_wav
    from sound.outputs import require_output
    from sound.rendering.render import Hit, render, ringing_seconds

    options = collect(RenderOptions, arguments)
    require_output(options.out, ENDINGS, [options.file, options.like or options.file])
    if options.seconds is not None and options.seconds > LONGEST_SECONDS:
        raise UserError(f"--seconds {options.seconds:g}: expected at most {LONGEST_SECONDS:g}")
    if options.seconds is not None:
        require_length(options.seconds, options.rate)
    scene = _scene(options, collect(PointOptions, arguments), collect(ImpulseOptions, arguments))
    hit = Hit(0.0, scene.position, scene.impulse)
    sound = render(
        scene.solid,
        [hit],
        options.seconds or ringing_seconds(scene.solid),
        options.rate,
        options.contact_seconds,
        scene.listening,
        not options.no_residual,
    )
    gain = 1.0 if scene.listening is None else scene.listening.gain(scene.position)
    peak = float(np.abs(sound).max(initial=0.0))
    if scene.listening is None and peak > 0.0:
        gain = PEAK / peak
        sound, peak = gain * sound, PEAK
    write_wav(options.out, sound, options.rate)
    summary = _summary(options, scene, gain, peak)
    print(json.dumps(summary) if options.json else _sentence(summary))
    if peak > 1.0:
        print(f"sound: {peak:.2f} of full scale; lower --strength for players", file=sys.stderr)
    return 0


def _scene(options: RenderOptions, point: PointOptions, strike: ImpulseOptions) -> _Scene:
    import numpy as np

    position, inward, distance, solid, listening = _point_of_solid(options, point)
    if strike.impulse is None:
        return _Scene(solid, listening, position, distance, strike.strength * inward)
    impulse = np.array(strike.impulse)
    strength = float(np.linalg.norm(impulse))
    if strength < LEAST_IMPULSE:
        raise UserError(
            "--impulse: expected three numbers [N s], not all of them 0; "
            f"{strength:g} N s in all is less than {LEAST_IMPULSE:g}"
        )
    return _Scene(solid, listening, position, distance, impulse)


def _point_of_solid(
    options: RenderOptions, point: PointOptions
) -> tuple[Array, Array, float, SoundingSolid, Listening | None]:
    """Struck point, inward normal there, distance from the point named, the solid, and how its
    clips are heard if it has some."""
    from carillon.files import kind_of
    from solver.files.modes_file import read_modes
    from solver.response.response import Damping
    from sound.project.design_file import read_design
    from sound.rendering.listening import Listening
    from sound.rendering.solid import SoundingSolid

    has_modes = kind_of(options.file, "a Carillon design or modes file (HDF5)")[0] == "modes"
    if not has_modes and (options.damping or options.like):
        raise UserError("--damping and --like go with modes.h5; a design has dampings of its own")
    if options.damping and options.like:
        raise UserError("--damping and --like exclude each other; a design tells all dampings")
    if has_modes and not options.like:
        file = read_modes(options.file)
        damping = Damping(*options.damping) if options.damping else Damping()
        return *_own_point(point, file.model), SoundingSolid.of_modes(file, damping), None
    design = read_design(options.like or options.file)
    if has_modes:
        solid = SoundingSolid.of_truth(read_modes(options.file), design)
    else:
        solid = SoundingSolid.of_design(design)
    return *_surface_point(point, design), solid, Listening.of_design(design, solid)


def _surface_point(point: PointOptions, design: Design) -> tuple[Array, Array, float]:
    """Struck point of a design's surface, inward normal there, distance from the point named."""
    if point.target is not None:
        strikes = {strike.name: strike for strike in design.strikes}
        if point.target not in strikes:
            raise UserError(
                f"--target {point.target}: the design has no such target, expected one of "
                f"{', '.join(strikes)}"
            )
        strike = strikes[point.target]
        return strike.position, strike.inward, 0.0
    import trimesh

    from sound.strikes import locate

    surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
    what = "--at" if point.vertex is None else "--vertex"
    strike = locate(surface, what, point.at, point.vertex, design.unit)
    return strike.position, strike.inward, strike.distance


def _own_point(point: PointOptions, model: Any) -> tuple[Array, Array, float]:
    """Struck point of a model's own surface, inward normal there, distance from the point named."""
    import numpy as np

    from solver.response.surface import REACH, surface_of
    from sound.strikes import TOO_FAR

    if point.at is None:
        raise UserError(
            "a modes file knows neither targets nor the vertices of a surface; strike it --at a "
            "point, or name its design by --like"
        )
    surface = surface_of(model)
    longest = float(np.ptp(surface.points, axis=0).max())
    reach = max(TOO_FAR * longest, REACH * surface.edge)
    position, inward = surface.place(np.array(point.at), "--at", reach)
    return position, inward, float(np.linalg.norm(position - point.at))


def _summary(options: RenderOptions, scene: _Scene, gain: float, peak: float) -> dict[str, Any]:
    solid = scene.solid
    amplitudes = gain * solid.amplitudes(scene.position[None], scene.impulse[None])[0]
    heard = solid.frequencies < options.rate / 2.0
    return {
        "out": str(Path(options.out)),
        "rate_hz": options.rate,
        "position_m": scene.position.tolist(),
        "distance_m": scene.distance,
        "impulse_newton_seconds": scene.impulse.tolist(),
        "gain": gain,
        "peak": peak,
        "frequencies_hz": solid.frequencies[heard].tolist(),
        "dampings_per_second": solid.dampings[heard].tolist(),
        "amplitudes": amplitudes[heard].tolist(),
        "modes_left_out": int((~heard).sum()),
    }


def _sentence(summary: dict[str, Any]) -> str:
    hertz = summary["frequencies_hz"]
    span = f", {min(hertz):.4g} to {max(hertz):.4g} Hz" if hertz else ""
    text = f"{summary['out']}: {len(hertz)} modes{span}, peak {summary['peak']:.3g} of full scale"
    if summary["modes_left_out"]:
        text += f"; {summary['modes_left_out']} above half the sampling rate are left out"
    return text
