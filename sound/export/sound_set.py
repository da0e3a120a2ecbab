"""Sounds of one design for a game engine: points, strengths and variations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.command_line.counts import counted
from carillon.errors import UserError
from sound.clips.wav import as_wav
from sound.export.level_table import LevelRow, level_of
from sound.export.mastering import mastered
from sound.export.modal_model import StruckPoint
from sound.export.names import file_name, file_names
from sound.export.sound_set_options import SoundSetOptions
from sound.project.design import Design
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, render
from sound.rendering.rendered_sound import ringing_seconds
from sound.rendering.solid import SoundingSolid
from sound.strikes import longest_side

MOST_SOUNDS = 2_000
"""Greatest number of sounds of a set."""
NEARBY = 0.06
"""Greatest distance of a variation's point from its own, over the surface's longest side."""
TRIALS = 4096
"""Random points among which those near by are looked for."""
CLIP_CONTACT = 2e-4
"""Duration [s] that the force of a clip's strike is taken to have; its spectrum is the clip's."""
HERTZ_EXPONENT = -0.2
"""A contact lasts as the speed, and so the impulse, to this power (Johnson, Contact Mechanics,
section 11.4)."""


@dataclass(frozen=True)
class SetSound:
    """A sound of a set: its file's name and content, and its row of the table.

    `gain` is what the rendered sound was multiplied by.
    """

    content: bytes
    gain: float
    level: LevelRow


def require_count(points: int, options: SoundSetOptions) -> None:
    """Refuse a set of too many sounds.

    Raises UserError if there were more than `MOST_SOUNDS`.
    """
    count = points * len(options.strengths) * options.variations
    if count > MOST_SOUNDS:
        raise UserError(
            f"{counted(points, 'point')}, {counted(len(options.strengths), 'strength')} and "
            f"{counted(options.variations, 'variation')} make {count:,} sounds, "
            f"expected at most {MOST_SOUNDS:,}; name fewer"
        )


def rendered_set(
    design: Design, name: str, points: Sequence[StruckPoint], options: SoundSetOptions
) -> Iterator[SetSound]:
    """The sounds of points, strengths (the softest first) and variations, one after the other.

    Each is mastered by itself, see `sound.export.mastering`.  `gain_db` of its level is 0 here,
    since it needs all of them, see `sound.export.level_table.with_gains`.  The points of variations
    depend on the seed and on the number of their own point alone.  Raises UserError if the sounds
    are too many.
    """
    require_count(len(points), options)
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    seconds = ringing_seconds(solid)
    strengths = sorted(options.strengths)
    for row, (label, point) in enumerate(zip(file_names([each.name for each in points]), points)):
        near = _points_near(design, point, options, row)
        for number, strength in enumerate(strengths, start=1):
            contact = added_contact(options.contact_seconds, strength / strengths[-1])
            for variation, (position, inward) in enumerate(near, start=1):
                hit = Hit(0.0, position, strength * inward)
                sound = render(solid, [hit], seconds, options.rate, contact, listening)
                made, gain = mastered(sound, options.rate)
                level = LevelRow(
                    f"{file_name(name, 'solid')}_{label}_s{number}_v{variation}.wav",
                    point.name,
                    strength,
                    variation,
                    0.0,
                    level_of(float(np.abs(made).max(initial=0.0))),
                    level_of(float(np.sqrt(np.mean(made**2)))),
                    level_of(float(np.abs(sound).max(initial=0.0))),
                    len(made) / options.rate,
                    contact,
                    *position.tolist(),
                )
                yield SetSound(as_wav(made, options.rate, 24), gain, level)


def added_contact(hardest: float, strength: float) -> float:
    """Duration [s] of a force that makes a clip as dull as a strike of a relative strength is.

    The clip holds the spectrum of its own contact, so the hardest strike, of the strength 1, takes
    `hardest` [s] alone, as long as the squares of durations add up, which is what the spectra of
    short forces do.

    Examples
    --------
    >>> added_contact(0.0, 1.0), round(added_contact(0.0, 0.25), 6)
    (0.0, 0.000172)
    """
    longer = (hardest**2 + CLIP_CONTACT**2) * strength ** (2.0 * HERTZ_EXPONENT)
    return float(np.sqrt(max(0.0, longer - CLIP_CONTACT**2)))


def _points_near(
    design: Design, point: StruckPoint, options: SoundSetOptions, row: int
) -> list[tuple[Array, Array]]:
    """Positions and inward normals of the variations: the point, then others at random near to it.

    They lie on the surface evenly; a direction is that of the nearest vertex.
    """
    import trimesh

    from solver.response.vertices import inward_normals

    found = [(point.position, point.inward)]
    count = options.variations - 1
    if not count:
        return found
    surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
    reach = NEARBY * longest_side(surface)
    corners = np.asarray(surface.triangles)
    middles = corners.mean(axis=1)
    sizes = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    near = np.linalg.norm(middles - point.position, axis=1) < reach + sizes
    areas = np.where(near, surface.area_faces, 0.0)
    random = np.random.default_rng([options.seed, row])
    triangles = corners[random.choice(len(corners), TRIALS, p=areas / areas.sum())]
    first, second = random.uniform(size=(2, TRIALS, 1))
    side = np.sqrt(first)  # evenly over a triangle (Turk, Graphics Gems, 1990)
    weights = np.concatenate([1.0 - side, side * (1.0 - second), side * second], axis=1)
    positions = np.einsum("tk,tkx->tx", weights, triangles)
    away = np.linalg.norm(positions - point.position, axis=1)
    # Those within reach come first, in the order in which they were drawn.
    positions = positions[np.argsort(away > reach, kind="stable")[:count]]
    return found + list(zip(positions, inward_normals(surface, positions)))
