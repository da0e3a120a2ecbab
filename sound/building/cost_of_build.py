"""Errors, distance and verdict of a design before and after it is built of real materials."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from sound.design.pitch import partials_off
from sound.project.design import Design
from sound.rendering.verdict import with_verdict


def with_cost_of_build(field: Design, design: Design) -> Design:
    """A design that was built, with a verdict, and beside it what its field was like.

    `evidence["build"]` then has, `before` and `after`, median and worst error of the partials, the
    largest distance from a clip [dB] and the word of the verdict, of which those by the sound are
    left out where the clips cannot be had.
    """
    judged = with_verdict(design)
    told = {
        **judged.evidence["build"],
        "before": _told(with_verdict(field)),
        "after": _told(judged),
    }
    return replace(judged, evidence={**judged.evidence, "build": told})


def _told(design: Design) -> dict[str, Any]:
    told: dict[str, Any] = {**partials_off(design.frequencies, design.targets)}
    verdict = design.evidence.get("verdict")
    if verdict:
        told["distance_db"] = max(each["distance_db"] for each in verdict["likeness"])
        told["verdict"] = verdict["word"]
    return told
