"""Faust: a modal model that is struck at several points, like those of mesh2faust.

mesh2faust's models are banks of `pm.modeFilter`, or `pm.modalModel` in newer libraries, whose
filters differ between versions in phase and level, and in single precision miss low frequencies.
Here every mode is a rotation in the plane that decays, with the impulse response
a exp(-d t) sin(2 pi f t) exactly.
"""

import re
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from carillon import __version__
from carillon.arrays import Array
from carillon.files.atomic import atomic_path
from sound.levels import DECAY_NEPERS
from sound.project.design import Design
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid

LEAST_DAMPING = 1e-3
"""Least damping [1/s], since Faust's models need finite decay times."""

_TEMPLATE = Template("""\
declare name "$name";
declare description "Modes of a solid, struck at one of $n_positions points";
declare author "Carillon $version";
import("stdfaust.lib");

// An impulse f [N s] along the inward normal of the struck point sounds as
//   sum over modes n of f * amplitude(p, n) * exp(-d t) * sin(2 pi f t),  d = ln(1000) / t60.
// frequency [Hz], t60 [s] (decay by 60 dB); amplitude(p, n) in samples of full scale per N s:
// |u_n . inward| of the mass-normalised mode u_n [kg^-1/2] at point p, times the gain there, with
// which 1 N s sounds as loud as the clip of a target.  What clips hold besides modes is left out.
// Points (position in m):
$points
nModes = $n_modes;
nPositions = $n_positions;
frequency(n) = ba.take(n + 1, ($frequencies));
t60(n) = ba.take(n + 1, ($t60s));
amplitude(p, n) = waveform{$amplitudes}, int(p * nModes + n) : rdtable : audible(n);
audible(n) = *(frequency(n) < ma.SR / 2);

// Impulse response exp(-d t) sin(2 pi f t).
mode(f, t60) = (turn ~ (_, _)) : !, _
with {
    decay = pow(0.001, 1 / (t60 * ma.SR));
    c = decay * cos(2 * ma.PI * f / ma.SR);
    s = decay * sin(2 * ma.PI * f / ma.SR);
    turn(x, y, push) = c * x - s * y + push, s * x + c * y;
};
model(p) = _ <: par(n, nModes, *(amplitude(p, n)) : mode(frequency(n), t60(n))) :> _;

// A force of half a sine with unit sum, from the moment the gate opens; one sample if it is short.
force(gate, duration) = select2(age < count, 0, sin(ma.PI * (age + 0.5) / count)) * level * struck
with {
    start = gate > gate';
    struck = start : max ~ _;
    age = (+(1) : min(1 << 30) : *(1 - start)) ~ _;
    count = max(1, rint(duration * ma.SR));
    level = sin(ma.PI / (2 * count));
};

position = nentry("h:strike/[0]position[style:menu{$menu}]", 0, 0, nPositions - 1, 1);
impulse = hslider("h:strike/[1]impulse[unit:N s]", 1, 0, 10, 0.01);
contact = hslider("h:strike/[2]contact[unit:ms]", 0, 0, 20, 0.01) / 1000;
gate = button("h:strike/[3]gate");

process = force(gate, contact) * impulse : model(position);
""")


def write_faust(path: str | Path, design: Design, points: int) -> None:
    """Write a `.dsp` with the targets' struck points and `points` others all over the surface.

    Raises UserError if the file cannot be written.
    """
    text = faust_program(design, points, Path(path).stem)
    with atomic_path(path) as temporary:
        temporary.write_text(text)


def faust_program(design: Design, points: int, name: str) -> str:
    """The program's text."""
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    names, positions, inward = _struck_points(design, points)
    gains = np.array([[listening.gain(position)] for position in positions])
    amplitudes = gains * solid.amplitudes(positions, inward)
    t60s = DECAY_NEPERS / np.maximum(solid.dampings, LEAST_DAMPING)
    listed = [
        f"//   {number} {label}: {', '.join(f'{x:.6g}' for x in position)}"
        for number, (label, position) in enumerate(zip(names, positions))
    ]
    content: dict[str, Any] = {
        "name": _plain(name),
        "version": __version__,
        "points": "\n".join(listed),
        "n_modes": len(solid.frequencies),
        "n_positions": len(names),
        "frequencies": _numbers(solid.frequencies),
        "t60s": _numbers(t60s),
        "amplitudes": _numbers(amplitudes.ravel()),
        "menu": ";".join(f"'{label}':{number}" for number, label in enumerate(names)),
    }
    return _TEMPLATE.substitute(content)


def _struck_points(design: Design, points: int) -> tuple[list[str], Array, Array]:
    """Names, positions (p, 3) and inward normals (p, 3) of the targets and of other points."""
    import trimesh

    from solver.response.vertices import inward_normals, spread

    strikes = design.strikes
    positions = np.array([strike.position for strike in strikes])
    inward = np.array([strike.inward for strike in strikes])
    names = [_plain(strike.name) for strike in strikes]
    if points:
        used = np.unique(design.surface_faces)
        chosen = used[spread(design.surface_vertices[used], positions, points)]
        others = design.surface_vertices[chosen]
        surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
        positions = np.concatenate([positions, others])
        inward = np.concatenate([inward, inward_normals(surface, others)])
        names += [f"vertex {vertex}" for vertex in chosen]
    return names, positions, inward


def _plain(name: str) -> str:
    return re.sub(r"[^\w .+-]", "_", name)


def _numbers(values: Array) -> str:
    return ", ".join(f"{value:.9g}" for value in values)
