"""Faust: a modal model that is struck at several points, like those of mesh2faust.

mesh2faust's models are banks of `pm.modeFilter`, or `pm.modalModel` in newer libraries, whose
filters differ between versions in phase and level, and in single precision miss low frequencies.
Here every mode is a rotation in the plane that decays, with the impulse response
a exp(-d t) sin(2 pi f t) exactly.
"""

from pathlib import Path
from string import Template
from typing import Any

from carillon import __version__
from carillon.arrays import Array
from carillon.files.atomic import atomic_path
from sound.export.modal_model import ModalModel
from sound.export.names import plain

_TEMPLATE = Template("""\
declare name "$name";
declare description "Modes of a solid, struck at $struck";
declare author "Carillon $version";
import("stdfaust.lib");

// An impulse f [N s] along the inward normal of the struck point sounds as
//   sum over modes n of f * amplitude(p, n) * exp(-d t) * sin(2 pi f t),  d = ln(1000) / t60.
// frequency [Hz], t60 [s] (decay by 60 dB); amplitude(p, n) in samples of full scale per N s:
// |u_n . inward| of the mass-normalised mode u_n [kg^-1/2] at point p, times the gain there, with
// which 1 N s sounds as loud as the clip of a target.  What clips hold besides modes is left out.
// With a gain of $gain after it, a strike of 1 N s at the loudest point stays within full scale.
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


def write_faust(path: str | Path, model: ModalModel) -> None:
    """Write a `.dsp` that strikes the points of a model; its name is that of the model.

    Raises UserError if the file cannot be written.
    """
    text = faust_program(model)
    with atomic_path(path) as temporary:
        temporary.write_text(text)


def faust_program(model: ModalModel) -> str:
    """The program's text."""
    names = [plain(point.name) for point in model.points]
    listed = [
        f"//   {number} {label}: {', '.join(f'{x:.6g}' for x in point.position)}"
        for number, (label, point) in enumerate(zip(names, model.points))
    ]
    content: dict[str, Any] = {
        "name": plain(model.name),
        "version": __version__,
        "points": "\n".join(listed),
        "gain": f"{model.gain:.4g}",
        "n_modes": len(model.frequencies),
        "n_positions": len(names),
        "struck": "its point" if len(names) == 1 else f"one of {len(names):,} points",
        "frequencies": _numbers(model.frequencies),
        "t60s": _numbers(model.decay_times),
        "amplitudes": _numbers(model.amplitudes.ravel()),
        "menu": ";".join(f"'{label}':{number}" for number, label in enumerate(names)),
    }
    return _TEMPLATE.substitute(content)


def _numbers(values: Array) -> str:
    return ", ".join(f"{value:.9g}" for value in values)
