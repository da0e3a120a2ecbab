"""A tune: a ball bounces down a row of bars, one for each note."""

from pathlib import Path
from typing import Any

from carillon.errors import UserError
from sound.clips.instruments import note_hertz
from sound.scenes.bodies import body_of
from sound.scenes.scene import Scene
from sound.scenes.scene_file import scene_of

MOST_NOTES = 64
GRAVITY = 9.81
BEAT_SECONDS = 0.36
"""Time from one bar to the next [s]."""
RESTITUTION = 0.8
GAP = 0.02
"""Gap between neighbouring bars [m]."""
BALL_RADIUS = 0.012
AFTERWARDS_SECONDS = 2.5
"""Time after the last note, in which its bar rings [s]."""
BAR = {
    "mesh": "builtin:bar",
    "material": "aluminium",
    "rotation": [0.0, 0.0, 90.0],
    "fixed": True,
    "friction": 0.0,
    "restitution": RESTITUTION,
    "collision": "hull",
    "count": 20,
    "resolution": 32,
}
BALL = {"name": "ball", "radius": BALL_RADIUS, "material": "steel", "count": 0, "friction": 0.0}


def tune_of(notes: str) -> Scene:
    """The scene of a tune, a bar for each of the notes, named C6 or F#5, with blanks or commas
    between.

    A ball that lands on a bar with the speed w leaves it with e w, and is back at the bar's height
    after 2 e w / g.  Each bar is lower than the one before by w^2 (1 - e^2) / (2 g), which makes up
    for the loss of a bounce, so all bounces are alike and take (1 + e) w / g.  Raises UserError if
    there are no notes, too many, or one has no such name.
    """
    names = notes.replace(",", " ").split()
    if not 1 <= len(names) <= MOST_NOTES:
        raise UserError(f"--notes: found {len(names)} notes, expected 1 to {MOST_NOTES}")
    pitches = [_hertz(name) for name in names]
    sizes = {pitch: _size(pitch) for pitch in set(pitches)}
    landing = GRAVITY * BEAT_SECONDS / (1.0 + RESTITUTION)
    drop = landing**2 * (1.0 - RESTITUTION**2) / (2.0 * GRAVITY)
    step = max(width for width, _ in sizes.values()) + GAP
    top = drop * len(names) + 0.1
    bars: list[dict[str, Any]] = []
    for number, (name, pitch) in enumerate(zip(names, pitches)):
        height = top - number * drop - sizes[pitch][1]
        place = [number * step, 0.0, height]
        bars.append({**BAR, "name": f"{number + 1} {name}", "pitch": pitch, "position": place})
    above = landing**2 / (2.0 * GRAVITY)
    speed = step / BEAT_SECONDS
    start = [-speed * landing / GRAVITY, 0.0, top + BALL_RADIUS + above]
    ball = {**BALL, "restitution": RESTITUTION, "position": start, "velocity": [speed, 0.0, 0.0]}
    middle = 0.5 * step * (len(names) - 1)
    seconds = landing / GRAVITY + BEAT_SECONDS * len(names) + AFTERWARDS_SECONDS
    described = {
        "title": " ".join(names),
        "seconds": round(seconds, 3),
        "objects": [ball, *bars],
        "listener": {"position": [middle, -1.0, 0.5 * top], "facing": [middle, 0.0, 0.5 * top]},
    }
    return scene_of(described, Path())


def _hertz(name: str) -> float:
    try:
        return note_hertz(name)
    except (UserError, ValueError) as error:
        raise UserError(f"--notes: {error}") from None


def _size(pitch: float) -> tuple[float, float]:
    """Width of a bar of that pitch [Hz], and height of its top above its centre of mass [m]."""
    described = {"objects": [{**BAR, "name": "bar", "pitch": pitch}]}
    shape = body_of(scene_of(described, Path()).objects[0]).shape.vertices
    return float(shape[:, 1].max() - shape[:, 1].min()), float(shape[:, 2].max())
