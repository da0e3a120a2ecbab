"""Strikes and the sound to make of them, as `carillon.render` takes them."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from carillon.parameters import REQUIRED, Within, option, parameters
from carillon.parameters.quantities import Point, RayleighDamping, between
from sound.bounds import LARGEST_IMPULSE, LONGEST_SOUND, ContactSeconds, SampleRate
from sound.rendering.heard_solid import HeardSolid
from sound.rendering.render import Hit
from sound.rendering.strike_list import Point as StruckPoint

Points = Annotated[tuple[Point, ...], Within(min_length=1), "points of the surface [m]"]
Impulse = Annotated[float, between(-LARGEST_IMPULSE, LARGEST_IMPULSE), "an impulse [N s]"]
Time = Annotated[float, between(0.0, LONGEST_SOUND), "time of a strike [s]"]
Length = Annotated[float, Within(gt=0.0, le=LONGEST_SOUND), "length of the sound [s]"]


@parameters
class StrikesOfCall:
    """Strikes of one solid, and how their sound is made."""

    at: Points | None = option(REQUIRED)
    target: str | None = option(REQUIRED, "name of the target that is struck")
    strength: tuple[Impulse, ...] = option(REQUIRED, "impulses along the inward normal [N s]")
    times: tuple[Time, ...] = option(REQUIRED, "times of the strikes [s]")
    seconds: Length | None = option(REQUIRED)
    rate: SampleRate = option(REQUIRED, "samples per second [Hz]")
    contact_seconds: ContactSeconds = option(REQUIRED, "duration of the force [s]")
    damping: RayleighDamping | None = option(REQUIRED)

    def __post_init__(self) -> None:
        if self.at is not None and self.target is not None:
            raise ValueError("expected at, the points that are struck, or target, the name of one")
        count = len(self.at or [self.target])
        for name in ("strength", "times"):
            if len(getattr(self, name)) not in (1, count):
                expected = "1" if count == 1 else f"1 or {count}"
                raise ValueError(f"{name}: {len(getattr(self, name))} of them, expected {expected}")

    def hits(self, heard: HeardSolid) -> list[Hit]:
        """The strikes of a solid.

        Raises UserError if it has no such target, or several and none is named, or a point is far
        from its surface.
        """
        if self.at is None:
            target = heard.only_target() if self.target is None else self.target
            points = [("target", StruckPoint(target=target))]
        else:
            points = [("at", StruckPoint(at=each)) for each in self.at]
        count = len(points)
        times, strengths = np.broadcast_to(self.times, count), np.broadcast_to(self.strength, count)
        return [
            Hit(float(begin), position, float(impulse) * inward, distance)
            for begin, impulse, (position, inward, distance) in zip(
                times, strengths, heard.places(points)
            )
        ]


def listed(values: ArrayLike, axes: int) -> Any:
    """Numbers or arrays as lists that are nested so deep at least, whatever they hold."""
    return np.array(values, dtype=object, ndmin=axes).tolist()
