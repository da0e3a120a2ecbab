"""Writes the page of a scene: one file that opens in any browser, without server or network."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.files.atomic import atomic_path
from sound.levels import dithered
from sound.scenes.expected_cents import in_cents
from sound.scenes.performance import GROUND, Appearance, Impact, Performance, Voice
from studio.binary import pack
from studio.standalone.content import halved, index_type, stepped
from studio.standalone.page import PAGE, assembled

HERE = Path(__file__).resolve().parent
STYLES = (PAGE / "studio.css", PAGE / "solid.css", HERE / "scene.css")
PROCESSOR = HERE / "processor.js"
LARGE_BYTES = 25_000_000
"""Size of a page in bytes above which it is named."""
Arrays = dict[str, tuple[str, Any]]
GROUND_ON_PAGE = 65_535
"""Number of the ground on the page, where numbers of objects have 16 bits and no sign."""
LOUDEST_STRIKE = 0.7
"""Level of a strike by hand where an object is loudest, as a share of full scale, with all modes at
their peak together."""
QUIETEST_STRIKE = 0.1
"""Least level of a strike as strong as an object's hardest impact, which would else hardly be
heard; a share of full scale."""


def write_scene_page(path: str | Path, performance: Performance) -> None:
    """Write a scene as one page: played, turned, and struck anywhere.

    A line of progress says how large the file is where it is larger than `LARGE_BYTES`.  Raises
    UserError if the file cannot be written, or parts of the performance do not fit each other.
    """
    text = page_of(performance)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    if len(text) > LARGE_BYTES:
        triangles = sum(len(each.faces) for each in performance.picture.objects)
        modes = sum(0 if each is None else len(each.frequencies) for each in performance.voices)
        seconds = len(performance.sound) / performance.rate
        say(
            f"{path}: {len(text) / 1e6:.0f} MB for {triangles:,} triangles, {modes:,} modes and "
            f"{seconds:.0f} s of sound; coarser meshes and fewer modes would make it smaller"
        )


def page_of(performance: Performance) -> str:
    """The page as text."""
    return assembled(HERE, PROCESSOR, STYLES, performance.title, content(performance))


def content(performance: Performance) -> bytes:
    """A message as `studio.binary` has them, which the page reads.

    Surfaces and gains are as exact as on pages of designs, see `studio.standalone.content`; motion
    has single precision; the sound is FLAC of 24 bits, without loss of these.  Raises UserError if
    parts of the performance do not fit each other, or hold what is no number.
    """
    _require_whole(performance)
    picture, motion = performance.picture, performance.picture.motion
    sound = flac(performance.sound, performance.rate)
    times = motion.times
    lasts = [len(performance.sound) / performance.rate, float(times[-1])]
    header: dict[str, Any] = {
        "event": "scene",
        "title": performance.title,
        "seconds": max(lasts),
        "step_s": float(times[1] - times[0]) if len(times) > 1 else 1.0,
        "ground_m": None if picture.ground is None else float(picture.ground),
        "camera": {
            "position_m": [float(x) for x in picture.camera.position],
            "target_m": [float(x) for x in picture.camera.target],
            "degrees": float(picture.camera.degrees),
        },
        "sound_bytes": len(sound),
        "objects": [],
    }
    arrays: Arrays = {
        "sound": ("u2", np.frombuffer(sound + b"\0" * (len(sound) % 2), "<u2")),
        "moved": ("f4", motion.positions),
        "turned": ("f4", motion.rotations),
        **_impacts(performance.impacts),
    }
    accuracies = performance.accuracies or [None] * len(picture.objects)
    for number, (appearance, voice) in enumerate(zip(picture.objects, performance.voices)):
        own, entry = _surface(appearance)
        if voice is not None and len(voice.frequencies) > 0:
            own |= _modes(voice)
            entry["expected_cents"] = in_cents(accuracies[number]).get("expected_cents_rms")
            entry |= _strike(voice, [e for e in performance.impacts if number in e.pair])
        header["objects"].append(entry)
        arrays |= {f"{name}_{number}": values for name, values in own.items()}
    return pack(header, arrays)


def flac(sound: Array, rate: int) -> bytes:
    """A file of samples (s, 2) [full scale] of 24 bits, with dither; what is beyond full scale is
    cut off."""
    import soundfile

    file = io.BytesIO()
    # libsndfile takes the upper bits of whole numbers of 32 bits.
    soundfile.write(file, dithered(sound, 24) << 8, rate, format="FLAC", subtype="PCM_24")
    return file.getvalue()


def _require_whole(performance: Performance) -> None:
    picture = performance.picture
    count, motion = len(picture.objects), picture.motion
    steps = len(motion.times)
    shapes: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
        "positions": (motion.positions.shape, (steps, count, 3)),
        "rotations": (motion.rotations.shape, (steps, count, 4)),
        "voices": ((len(performance.voices),), (count,)),
        "sound": (performance.sound.shape, (len(performance.sound), 2)),
    }
    for appearance, voice in zip(picture.objects, performance.voices):
        if voice is not None:
            gains = (len(appearance.vertices), len(voice.frequencies))
            shapes[f"gains of '{appearance.name}'"] = (voice.gains.shape, gains)
    for name, (own, expected) in shapes.items():
        if own != expected:
            raise UserError(f"scene '{performance.title}': {name} {own}, expected {expected}")
    if steps == 0:
        raise UserError(f"scene '{performance.title}': its motion has no times")
    held = [performance.sound, motion.positions, motion.rotations]
    held += [voice.gains for voice in performance.voices if voice is not None]
    held += [np.array([(e.seconds, e.duration, *e.impulse) for e in performance.impacts])]
    if not all(np.isfinite(each).all() for each in held):
        raise UserError(f"scene '{performance.title}': its motion or sound holds what is no number")


def _impacts(impacts: list[Impact]) -> Arrays:
    pairs = np.array([e.pair for e in impacts], int).reshape(-1, 2)
    impulses = np.array([e.impulse for e in impacts], float).reshape(-1, 3)
    return {
        "impact_seconds": ("f8", [e.seconds for e in impacts]),
        "impact_pairs": ("u2", np.where(pairs == GROUND, GROUND_ON_PAGE, pairs)),
        "impact_places": ("f4", np.array([e.position for e in impacts], float).reshape(-1, 3)),
        "impact_impulses": ("f8", np.linalg.norm(impulses, axis=1)),
        "impact_durations": ("f8", [e.duration for e in impacts]),
    }


def _surface(appearance: Appearance) -> tuple[Arrays, dict[str, Any]]:
    low, step, places = stepped(np.asarray(appearance.vertices, float))
    kind = index_type(len(appearance.vertices))
    entry = {
        "name": appearance.name,
        "colour": [float(part) for part in appearance.colour],
        "origin_m": low.tolist(),
        "step_m": step,
    }
    return {"places": ("u2", places), "triangles": (kind, appearance.faces)}, entry


def _modes(voice: Voice) -> Arrays:
    loudest, halves = halved(voice.gains)
    return {
        "hertz": ("f8", voice.frequencies),
        "dampings": ("f8", voice.dampings),
        "loudest": ("f8", loudest),
        "halves": ("u2", halves),
    }


def _strike(voice: Voice, impacts: list[Impact]) -> dict[str, float]:
    """Of a strike by hand: as an object's hardest impact, as far as that is well heard."""
    loudest = float(np.abs(voice.gains).sum(axis=1).max(initial=0.0)) or 1.0
    hardest = max((float(np.linalg.norm(e.impulse)) for e in impacts), default=np.inf)
    impulse = np.clip(hardest, QUIETEST_STRIKE / loudest, LOUDEST_STRIKE / loudest)
    contact = float(np.median([e.duration for e in impacts])) if impacts else 0.0
    return {"impulse_ns": float(impulse), "contact_s": contact}
