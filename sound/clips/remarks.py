"""Remarks on the search of a clip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

MOSTLY_MODES = 0.8
"""Least share of a clip's energy in its modes without a remark."""


def remarks(evidence: Mapping[str, Any]) -> list[str]:
    """Remarks, without full stops, on what is unusual in the evidence of a `ModalSound`."""
    sentences = []
    if evidence["explained"] < MOSTLY_MODES:
        sentences.append(
            "the rest is noise, or tones that do not fade evenly, and no material has it"
        )
    if evidence["clipped_samples"]:
        sentences.append(f"{evidence['clipped_samples']} samples at full scale are left out")
    if evidence["second_strike_seconds"] is not None:
        sentences.append(
            f"there is another strike at {evidence['second_strike_seconds']:.2f} s, left out"
        )
    if evidence["glide"] is not None:
        bend = evidence["glide"]
        sentences.append(
            f"its loudest tone glides from {bend['cents']:+.0f} cents to {bend['hertz']:.1f} Hz "
            f"within {bend['seconds']:.2f} s, which no material does"
        )
    return sentences
