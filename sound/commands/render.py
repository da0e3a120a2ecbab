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


@dataclass
class _Scene:
    """What is struck, where and how: the solid, its loudness, a point and an impulse there."""

    solid: SoundingSolid
    listening: Listening | None
    position: Array
    impulse: Array


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("file", metavar="FILE", help="design.h5, or modes.h5 of the solver")
    point = parser.add_mutually_exclusive_group(required=True)
    point.add_argument("--target", metavar="NAME", help="strike where a target was assigned")
    point.add_argument("--vertex", type=whole_number(0), help="strike a vertex of the surface")
    point.add_argument(
        "--at",
        type=number_between(-1e9, 1e9, "m"),
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="strike the surface near a point [m]",
    )
    impulse = parser.add_mutually_exclusive_group()
    impulse.add_argument(
        "--impulse",
        type=number_between(-LARGEST_IMPULSE, LARGEST_IMPULSE, "N s"),
        nargs=3,
        metavar=("FX", "FY", "FZ"),
        help="impulse [N s]",
    )
    impulse.add_argument(
        "--strength",
        type=number_between(LEAST_IMPULSE, LARGEST_IMPULSE, "N s"),
        default=1.0,
        help="impulse along the inward normal [N s] (default 1, which sounds as loud as the clip)",
    )
    parser.add_argument("--seconds", type=positive_number, help="length (default: until it decays)")
    parser.add_argument(
        "--rate", type=sample_rate, default=44_100, help="samples per second (default 44100)"
    )
    parser.add_argument(
        "--contact-seconds",
        type=number_between(0.0, LONGEST_CONTACT, "s"),
        default=0.0,
        help="duration of the force, half a sine (default 0: an impulse)",
    )
    parser.add_argument(
        "--no-residual", action="store_true", help="modes only, without the rest of the clips"
    )
    parser.add_argument(
        "--like",
        metavar="DESIGN",
        help="for modes.h5 of a designed object: dampings, points, loudness, residuals of a design",
    )
    parser.add_argument(
        "--damping",
        type=number_between(0.0, 1e9),
        nargs=2,
        metavar=("ALPHA", "BETA"),
        help="for modes.h5: Rayleigh damping, coefficients of mass [1/s] and stiffness [s] "
        "(default 30 1e-6)",
    )
    parser.add_argument("--out", required=True, help="file to write (WAV)")
    parser.add_argument("--json", action="store_true", help="print what sounds as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Render, write, and say what sounds."""
    import numpy as np

    from sound.clips.wav import ENDINGS, PEAK, write_wav
    from sound.outputs import require_output
    from sound.rendering.render import Hit, render, ringing_seconds

    require_output(arguments.out, ENDINGS, [arguments.file, arguments.like or arguments.file])
    if arguments.seconds is not None and arguments.seconds > LONGEST_SECONDS:
        raise UserError(f"--seconds {arguments.seconds:g}: expected at most {LONGEST_SECONDS:g}")
    if arguments.seconds is not None:
        require_length(arguments.seconds, arguments.rate)
    scene = _scene(arguments)
    hit = Hit(0.0, scene.position, scene.impulse)
    sound = render(
        scene.solid,
        [hit],
        arguments.seconds or ringing_seconds(scene.solid),
        arguments.rate,
        arguments.contact_seconds,
        scene.listening,
        not arguments.no_residual,
    )
    gain = 1.0 if scene.listening is None else scene.listening.gain(scene.position)
    peak = float(np.abs(sound).max(initial=0.0))
    if scene.listening is None and peak > 0.0:
        gain = PEAK / peak
        sound, peak = gain * sound, PEAK
    write_wav(arguments.out, sound, arguments.rate)
    summary = _summary(arguments, scene, gain, peak)
    print(json.dumps(summary) if arguments.json else _sentence(summary))
    if peak > 1.0:
        print(f"sound: {peak:.2f} of full scale; lower --strength for players", file=sys.stderr)
    return 0


def _scene(arguments: argparse.Namespace) -> _Scene:
    import numpy as np

    position, inward, solid, listening = _point_of_solid(arguments)
    if arguments.impulse is None:
        return _Scene(solid, listening, position, arguments.strength * inward)
    impulse = np.array(arguments.impulse)
    strength = float(np.linalg.norm(impulse))
    if strength < LEAST_IMPULSE:
        raise UserError(
            "--impulse: expected three numbers [N s], not all of them 0; "
            f"{strength:g} N s in all is less than {LEAST_IMPULSE:g}"
        )
    return _Scene(solid, listening, position, impulse)


def _point_of_solid(
    arguments: argparse.Namespace,
) -> tuple[Array, Array, SoundingSolid, Listening | None]:
    """Struck point, inward normal there, the solid, and how its clips are heard if it has some."""
    from carillon.files import kind_of
    from solver.files.modes_file import read_modes
    from solver.response.response import Damping
    from sound.project.design_file import read_design
    from sound.rendering.listening import Listening
    from sound.rendering.solid import SoundingSolid

    has_modes = kind_of(arguments.file, "a Carillon design or modes file (HDF5)")[0] == "modes"
    if not has_modes and (arguments.damping or arguments.like):
        raise UserError("--damping and --like go with modes.h5; a design has dampings of its own")
    if arguments.damping and arguments.like:
        raise UserError("--damping and --like exclude each other; a design tells all dampings")
    if has_modes and not arguments.like:
        file = read_modes(arguments.file)
        damping = Damping(*arguments.damping) if arguments.damping else Damping()
        return *_voxel_point(arguments, file.mesh), SoundingSolid.of_modes(file, damping), None
    design = read_design(arguments.like or arguments.file)
    if has_modes:
        solid = SoundingSolid.of_truth(read_modes(arguments.file), design)
    else:
        solid = SoundingSolid.of_design(design)
    return *_surface_point(arguments, design), solid, Listening.of_design(design, solid)


def _surface_point(arguments: argparse.Namespace, design: Design) -> tuple[Array, Array]:
    """Struck point of a design's surface and inward normal there."""
    if arguments.target is not None:
        strikes = {strike.name: strike for strike in design.strikes}
        if arguments.target not in strikes:
            raise UserError(
                f"--target {arguments.target}: the design has no such target, expected one of "
                f"{', '.join(strikes)}"
            )
        strike = strikes[arguments.target]
        return strike.position, strike.inward
    import trimesh

    from sound.strikes import locate

    surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
    what = "--at" if arguments.vertex is None else "--vertex"
    strike = locate(surface, what, arguments.at, arguments.vertex)
    return strike.position, strike.inward


def _voxel_point(arguments: argparse.Namespace, mesh: Any) -> tuple[Array, Array]:
    """Struck point of the voxels' surface and inward normal there."""
    import numpy as np

    from solver.response.contact import surface_node, surface_normals

    if arguments.at is None:
        raise UserError(
            "a modes file knows neither targets nor the vertices of a surface; strike it --at a "
            "point, or name its design by --like"
        )
    nodes, outward = surface_normals(mesh)
    index = surface_node(mesh, np.array(arguments.at), "--at")
    return mesh.nodes[nodes[index]], -outward[index]


def _summary(
    arguments: argparse.Namespace, scene: _Scene, gain: float, peak: float
) -> dict[str, Any]:
    solid = scene.solid
    amplitudes = gain * solid.amplitudes(scene.position[None], scene.impulse[None])[0]
    heard = solid.frequencies < arguments.rate / 2.0
    return {
        "out": str(Path(arguments.out)),
        "rate_hz": arguments.rate,
        "position_m": scene.position.tolist(),
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
