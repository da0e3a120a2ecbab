"""`carillon scene`: solids that fall, roll and strike each other, heard and seen.

Reads a scene (YAML): designs, modes files, meshes and balls of named materials, where they are and
how they move. Writes what two ears hear (WAV), and, if asked for, a video, a page on which any
object can be struck, an animated glTF, and a list of impacts.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carillon.command_line.counts import counted
from carillon.errors import UserError
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from sound.outputs import WavOptions

if TYPE_CHECKING:  # Their imports take long, and `--help` needs none.
    from sound.levels import SoundLevel
    from sound.scenes.performance import Performance
    from sound.scenes.scene import Scene

EXAMPLES = """examples:
  carillon scene scene.yaml --out scene.wav --page scene.html
  carillon scene scene.yaml --out scene.wav --video scene.mp4 --gltf scene.glb
  carillon scene builtin:bars --notes "C6 E6 G6 C7" --out tune.wav --page tune.html
"""
BARS = "builtin:bars"
NAMED = 3
"""Greatest number of objects that a line names."""
SLOWEST = 1e-3
"""Speed [m/s] below which an object rests."""
OUTPUTS = {
    "out": (".wav",),
    "video": (".mp4", ".webm"),
    "gltf": (".gltf", ".glb"),
    "page": (".html", ".htm"),
    "impacts": (".csv",),
}
"""Options that name files to write, and endings that these may have."""


@parameters
class SceneOptions:
    """What is played, and what is written of it."""

    scene: str = option(REQUIRED, f"scene (YAML), or {BARS}, a row of bars that a ball strikes")
    out: str = option(REQUIRED, "file for what is heard (WAV)", metavar="SCENE.wav")
    video: str | None = option(None, "film of it, with its sound", metavar="SCENE.mp4|.webm")
    page: str | None = option(
        None, "page that plays it, and lets any object be struck", metavar="SCENE.html"
    )
    gltf: str | None = option(None, "what moves, for other tools", metavar="SCENE.glb|.gltf")
    impacts: str | None = option(
        None, "list of impacts: when, what, where, how hard", metavar="IMPACTS.csv"
    )
    notes: str | None = option(
        None, f"of {BARS}: names of notes, such as 'C6 E6 G6'", metavar="NOTES"
    )
    raw: bool = option(
        False,
        "samples as they are computed, even beyond full scale, which is that of the scene, or 1 Pa "
        "for auto, and without a fade",
    )
    json: bool = option(False, "print what happened as JSON")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, SceneOptions, positional=("scene",))
    add_options(parser, WavOptions)


def run(arguments: argparse.Namespace) -> int:
    """Play the scene, write, and say what happened."""
    options = collect(SceneOptions, arguments)
    scene = _scene(options)
    _require_outputs(options, scene)
    from sound.scenes.playing.play import perform

    performance = perform(scene, raw=options.raw)
    _write(options, collect(WavOptions, arguments), performance)
    summary = _summary(options, performance)
    if options.json:
        print(json.dumps(summary))
    else:
        print(_sentence(summary, performance.level), *_pitches(performance), sep="\n")
        print(_end(summary["moving_at_end_metres_per_second"]))
    return 0


def _scene(options: SceneOptions) -> Scene:
    if options.scene == BARS:
        from sound.scenes.playing.tune import tune_of

        if options.notes is None:
            raise UserError(f"{BARS}: name the notes that its bars sound, by --notes 'C6 E6 G6'")
        return tune_of(options.notes)
    if options.notes is not None:
        raise UserError(f"--notes goes with {BARS}; found {options.scene}")
    from sound.scenes.scene_file import load_scene

    return load_scene(options.scene)


def _require_outputs(options: SceneOptions, scene: Scene) -> None:
    from sound.outputs import require_output

    inputs = [*scene.files, *([] if options.scene == BARS else [options.scene])]
    seen: dict[Path, str] = {}
    for name, endings in OUTPUTS.items():
        file = getattr(options, name)
        if file is None:
            continue
        require_output(file, endings, inputs)
        path = Path(file).absolute()
        if path in seen:
            raise UserError(f"--{name} {file}: is --{seen[path]}, too; name another file")
        seen[path] = name


def _write(options: SceneOptions, wav: WavOptions, performance: Performance) -> None:
    from sound.clips.wav import write_wav

    sound, rate = performance.sound, performance.rate
    write_wav(options.out, sound, rate, bits=wav.bits, seed=wav.dither_seed)
    if options.impacts is not None:
        from sound.scenes.performance import write_impacts

        write_impacts(options.impacts, performance)
    if options.gltf is not None:
        from sound.export.scene_gltf import write_scene_gltf

        binary = Path(options.gltf).suffix.lower() == ".glb"
        write_scene_gltf(options.gltf, performance, binary)
    if options.page is not None:
        from studio.scene.page import write_scene_page

        write_scene_page(options.page, performance)
    if options.video is not None:
        from sound.scenes.film.film import write_film

        write_film(options.video, performance)


def _summary(options: SceneOptions, performance: Performance) -> dict[str, Any]:
    import numpy as np

    from sound.levels import HEARD, HIGHEST_HEARD, decibels

    impacts = performance.impacts
    lowest = {
        each.name: float(voice.frequencies.min())
        for each, voice in zip(performance.picture.objects, performance.voices)
        if voice is not None and len(voice.frequencies)
    }
    return {
        "files": {name: getattr(options, name) for name in OUTPUTS},
        "seconds": len(performance.sound) / performance.rate,
        "rate_hz": performance.rate,
        "objects": len(performance.voices),
        "extents_m": {
            each.name: np.ptp(each.vertices, axis=0).tolist()
            for each in performance.picture.objects
        },
        "modes": sum(len(each.frequencies) for each in performance.voices if each is not None),
        "impacts": len(impacts),
        "first_impact_seconds": impacts[0].seconds if impacts else None,
        "hardest_impact_newton_seconds": max(
            (float((each.impulse**2).sum() ** 0.5) for each in impacts), default=None
        ),
        "accuracy": _accuracies(performance),
        "lowest_hz": lowest,
        "above_hearing": [name for name, hertz in lowest.items() if hertz > HIGHEST_HEARD],
        "moving_at_end_metres_per_second": {
            name: speed
            for name, speed in performance.picture.end_speeds().items()
            if speed >= SLOWEST
        },
        "moved_metres": performance.moved,
        "timings": performance.timings,
        "full_scale_pascal": 1.0 / performance.scale,
        "full_scale_decibels": decibels(1.0 / performance.scale / HEARD),
        **({} if performance.level is None else performance.level.as_dict()),
    }


def _accuracies(performance: Performance) -> dict[str, dict[str, Any] | None]:
    """How far frequencies of each object that sounds are expected to be off; None if unknown."""
    from sound.scenes.expected_cents import in_cents

    accuracies = performance.accuracies or [None] * len(performance.voices)
    names = [each.name for each in performance.picture.objects]
    known = zip(names, accuracies, performance.voices)
    return {
        name: None if accuracy is None else {**accuracy, **in_cents(accuracy)}
        for name, accuracy, voice in known
        if voice is not None
    }


def _pitches(performance: Performance) -> list[str]:
    """A line for each object that sounds; those that sound alike share one."""
    from sound.levels import HIGHEST_HEARD
    from sound.scenes.expected_cents import told

    accuracies = performance.accuracies or [None] * len(performance.voices)
    names: dict[str, list[str]] = {}
    for each, accuracy, voice in zip(performance.picture.objects, accuracies, performance.voices):
        if voice is not None and len(voice.frequencies):
            lowest = float(voice.frequencies.min())
            unheard = ", which nobody hears" if lowest > HIGHEST_HEARD else ""
            span = f"{len(voice.frequencies)} modes from {lowest:,.1f} Hz{unheard}"
            line = f"{span}, {told(accuracy)}"
            names.setdefault(line, []).append(each.name)
    return [f"{_listed(alike)}: {line}" for line, alike in names.items()]


def _end(speeds: dict[str, float]) -> str:
    """Whether objects still move at the end, and how fast [m/s]."""
    if not speeds:
        return "all objects rest at the end"
    fastest = sorted(speeds, key=lambda name: -speeds[name])
    told = _listed([f"{name} ({speeds[name]:.2g} m/s)" for name in fastest])
    return f"{told} still {'moves' if len(speeds) == 1 else 'move'} at the end"


def _listed(names: list[str]) -> str:
    rest = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"{', '.join(names[:NAMED])}{rest}"


def _sizes(extents: dict[str, list[float]]) -> str:
    from carillon.fem.geometry.size import lengths_in_words

    return ", ".join(f"{name} {lengths_in_words(sides)}" for name, sides in extents.items())


def _sentence(summary: dict[str, Any], level: SoundLevel | None) -> str:
    files = [name for name in summary["files"].values() if name is not None]
    return (
        f"{', '.join(files)}: {summary['seconds']:.4g} s, "
        f"{counted(summary['objects'], 'object')} with {counted(summary['modes'], 'mode')}, "
        f"{counted(summary['impacts'], 'impact')}; full scale is "
        f"{summary['full_scale_pascal']:.3g} Pa{'' if level is None else f'; {level.in_words()}'}\n"
        f"sizes: {_sizes(summary['extents_m'])}"
    )
