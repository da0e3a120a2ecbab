"""What a set of sounds for a game engine consists of: strengths, variations, rate."""

from typing import Annotated

from carillon.parameters import Check, Within, option, parameters
from carillon.parameters.quantities import between
from sound.bounds import LARGEST_IMPULSE, LEAST_IMPULSE, ContactSeconds, SampleRate

Strength = Annotated[float, between(LEAST_IMPULSE, LARGEST_IMPULSE), "an impulse [N s]"]


def _different(strengths: tuple[float, ...]) -> tuple[float, ...]:
    if len(set(strengths)) < len(strengths):
        found = " ".join(f"{each:g}" for each in strengths)
        raise ValueError(f"found {found}, expected each strength once")
    return strengths


@parameters
class SoundSetOptions:
    """Strikes of a set of sounds, and how they are rendered."""

    strengths: Annotated[
        tuple[Strength, ...], Within(min_length=1, max_length=16), Check(_different)
    ] = option(
        (0.25, 0.5, 1.0),
        "for a folder: impulses along the inward normal [N s] (default 0.25 0.5 1)",
        metavar="STRENGTH",
    )
    variations: Annotated[int, between(1, 32)] = option(
        3, "for a folder: sounds of each point and strength, the others struck near by"
    )
    contact_seconds: ContactSeconds = option(
        0.0,
        "for a folder: what the force of the hardest strike, half a sine, lasts longer than that "
        "of the clips; softer strikes last longer yet",
    )
    rate: SampleRate = option(48_000, "for a folder: samples per second")
    seed: Annotated[int, between(0, 2**32 - 1)] = option(
        0, "for a folder: of the variations' points"
    )
