"""Expected errors of the frequencies of scenes, in cents and in words."""

from collections.abc import Mapping
from math import log2
from typing import Any

from solver.refinement.errors import FROM_SOLID

LOWEST = 1e-6
"""Least ratio of a frequency to the right one."""
UNKNOWN = "how far its frequencies are from the solid's is not known"


def cents(share: float) -> float:
    """A relative error of a frequency in cents, hundredths of a semitone.

    Examples
    --------
    >>> round(cents(2.0 ** (1.0 / 12.0) - 1.0)), round(cents(0.01), 1)
    (100, 17.2)
    """
    return 1200.0 * log2(max(1.0 + share, LOWEST))


def in_cents(accuracy: Mapping[str, Any] | None) -> dict[str, float]:
    """Expected error of a body's frequencies [cents], root mean square and worst, as far as known.

    `accuracy` is that of `sound.scenes.solved.SolvedSolid`. What is positive is too high.
    """
    return {
        f"expected_cents_{kind}": round(cents(accuracy[f"{FROM_SOLID}_{kind}"]), 2)
        for kind in ("rms", "worst")
        if accuracy and f"{FROM_SOLID}_{kind}" in accuracy
    }


def told(accuracy: Mapping[str, Any] | None) -> str:
    """The expected error of a body's frequencies in words.

    Examples
    --------
    >>> known = {"solid_frequency_error_rms": 0.002, "solid_frequency_error_worst": 0.005}
    >>> told(known)
    'expected error 3.5 cents rms, worst +8.6 cents'
    >>> told(None)
    "how far its frequencies are from the solid's is not known"
    """
    known = in_cents(accuracy)
    if len(known) < 2:
        return UNKNOWN
    sentence = (
        f"expected error {known['expected_cents_rms']:.2g} cents rms, worst "
        f"{known['expected_cents_worst']:+.2g} cents"
    )
    if accuracy and "missed_accuracy" in accuracy:
        goal = cents(accuracy["missed_accuracy"])
        sentence += f"; {goal:.2g} cents rms were asked for, a higher resolution is nearer"
    return sentence
