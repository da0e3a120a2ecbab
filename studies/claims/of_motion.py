"""Claims about shapes, motion and sound (Fig. 8, Fig. 12, Fig. 13)."""

from typing import Any

from studies.base.numbers import show
from studies.claims.findings import (
    EXACT,
    IN_PART,
    NOT,
    REPRODUCED,
    SIMILAR,
    UNMEASURED,
    Finding,
    ends,
    files,
    named,
)
from studies.claims.results import Claims
from workflow.variants import VARIANTS

SAME_SHAPE, ROUGH_SHAPE = 0.999, 0.9
"""Likeness of a mode that is the truth's, and that has its rough motion."""
STILL = 1.0
"""Relative difference of a motion from the true one that no motion at all would have."""


def shapes(claims: Claims) -> Finding:
    """Fig. 8: the first elastic mode."""
    tables = claims.of_model("shapes")
    by_method = {
        method: [
            row["likeness"]
            for table in tables.values()
            for row in table.rows
            if row["method"] == method
        ]
        for method in (VARIANTS["hcms"].label, EXACT)
    }
    rough, corrected = (min(values) for values in by_method.values())
    if corrected < SAME_SHAPE:
        verdict = NOT
    else:
        verdict = REPRODUCED if rough > ROUGH_SHAPE else IN_PART
    text = (
        f"Least likeness of mode 7 over {len(tables)} solids: {show(rough, 'fraction')} by HCMS, "
        f"{show(corrected, 'fraction')} after error correction."
    )
    return Finding(verdict, text, files(claims, "-shapes.json"))


def response(claims: Claims) -> Finding:
    """Fig. 12: motion after a strike."""
    coarse, fine = (strikes(claims, VARIANTS[name].label) for name in ("ddfem_hcms_ec", "hcms_ec"))
    text = (
        "Relative difference of the motion over the first periods: on the fine mesh at most "
        f"{show(max(row['difference'] for row in fine), 'percent')}"
    )
    if coarse:
        differences = [row["difference"] for row in coarse]
        text += f", on the coarsened one {ends(differences, 'percent')}"
        if max(differences) <= SIMILAR:
            verdict = REPRODUCED
        else:
            verdict = IN_PART if max(differences) < STILL else NOT
        text += " (100 % is what no motion at all would differ by)"
    else:
        verdict = UNMEASURED
    return Finding(
        verdict,
        f"{text}. Curves are on the pages of the validation.",
        files(claims, "-responses.json"),
    )


def scene(claims: Claims) -> Finding:
    """Fig. 13: spectrograms."""
    strike = strikes(claims, VARIANTS["ddfem_hcms_ec"].label)
    single = (
        f"single strikes, {ends([row['distance_decibels'] for row in strike], 'small')} dB (rms) "
        "apart on the coarsened mesh"
        if strike
        else "single strikes of the fine mesh"
    )
    if claims.scene is None:
        return Finding(
            IN_PART if strike else UNMEASURED,
            f"No scene in this run; {single}, stand on the pages of the validation.",
            files(claims, "-responses.json"),
        )
    apart = [
        f"{row['title']} {show(row['distance_decibels'], 'small')} dB"
        for row in claims.scene.rows
        if row.get("distance_decibels")
    ]
    beside = f", off the truth’s by (rms) {', '.join(apart)}" if apart else ""
    text = f"The same scene by each is below{beside}; {single}, are on the pages of the validation."
    return Finding(IN_PART, text, (named(claims, claims.scene), *files(claims, "-responses.json")))


def strikes(claims: Claims, method: str) -> list[dict[str, Any]]:
    """Differences of a method's motion and sound from the truth's, of every model that has it."""
    tables = claims.of_model("responses").values()
    return [row for table in tables for row in table.rows if row["method"] == method]
