"""Summary of a design as `carillon design` prints it: plain values, and sentences."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from carillon.command_line.counts import counted
from carillon.fem.geometry.size import length_in_words, lengths_in_words
from sound.design.objective import fall
from sound.project.build import too_thin

if TYPE_CHECKING:  # Its import takes long, and `--help` needs none.
    from sound.project.design import Design

_COSTS = ("cost_start", "cost", "frequency_cost", "amplitude_cost")
_EFFORT = ("seconds", "evaluations", "evaluations_per_minute", "workers", "method", "ended_by")
_ENDINGS = {
    "met": "; ended early: its frequencies are met, and the cost falls no more",
    "interrupt": "; ended on request",
}
"""End of the summary's first line by what ended a search, empty if that was its budget."""
FAR_DAMPINGS = 1.5
"""Factor by which the dampings of a material are, in the median, far from those of the clips."""
STIFFEST, SOFTEST = 1.2e12, 1e6
"""Young's moduli [Pa] of diamond and of soft rubber."""


def summarise(design: Design) -> dict[str, Any]:
    """The outcome as plain values."""
    from sound.design.pitch import partials_off, rms_off_partials

    evidence, targets = design.evidence, design.targets
    which = targets.sounding
    off = partials_off(design.frequencies, targets)
    assert design.damping is not None
    ratios = (design.damping.dampings / targets.dampings)[which]
    loss = design.damping.loss_factors
    return {
        **{key: evidence[key] for key in _COSTS},
        "fall": fall(evidence["cost_start"], evidence["cost"]),
        **{key: evidence[key] for key in _EFFORT},
        "extents_m": np.ptp(design.surface_vertices, axis=0).tolist(),
        "modes": len(design.frequencies),
        # Two modes of one frequency may have one partial.
        "partials": len(np.unique(targets.frequencies[which])),
        "left_out_hz": [] if targets.left_out is None else targets.left_out.tolist(),
        "left_out_share_of_loudness": targets.left_out_share,
        "targets": [strike.name for strike in design.strikes],
        "target_distances_m": [strike.distance for strike in design.strikes],
        "frequency_error_median_cents": off["median_cents"],
        "frequency_error_max_cents": off["worst_cents"],
        "coarse_rms_cents": rms_off_partials(design.coarse_frequencies, targets),
        "fine_rms_cents": None
        if design.fine is None
        else rms_off_partials(design.frequencies, targets),
        "checks": evidence["checks"],
        "young_min_pa": float(design.young.min()),
        "young_max_pa": float(design.young.max()),
        "density_kg_per_m3": design.model.density,
        "poisson": design.model.poisson,
        "listen": None if design.heard is None else design.settings["listen"],
        "damping_source": design.settings.get("damping", {}).get("source"),
        "damping_ratios": ratios.tolist(),
        "regions": _regions(design),
        "loss_factors": [] if loss is None else np.unique(loss).tolist(),
        "mass_damping_per_second": design.damping.mass_per_second,
        "residual_max": evidence["residual_max"],
        "verdict": evidence.get("verdict"),
        "build": evidence.get("build"),
    }


def _distance_sentence(verdict: dict[str, Any] | None) -> list[str]:
    """How far sounds are from their clips, with all their levels."""
    if not verdict or not verdict.get("likeness"):
        return []
    worst = max(verdict["likeness"], key=lambda each: each["distance_db"])
    return [
        f"levels over time and frequency {worst['distance_db']:.1f} dB (rms) from the clip's; "
        f"silence would be {worst['silence_db']:.1f}"
    ]


def _place_sentence(listen: dict[str, Any] | None) -> list[str]:
    if listen is None:
        return []
    way = "as a sphere" if listen["radiation"] == "sphere" else f"by {listen['radiation']}"
    at = ", ".join(f"{each:g}" for each in listen["at"])
    return [f"amplitudes are those heard at ({at}), where its surface moves the air {way}"]


def _regions(design: Design) -> list[dict[str, Any]]:
    """Name, moduli, density and Poisson's ratio of the regions of a design, in their order."""
    table = design.model.regions
    rows = np.zeros(len(design.young), int) if design.fine_region is None else design.fine_region
    found = []
    for name in dict.fromkeys(table.names):
        own = [row for row, each in enumerate(table.names) if each == name]
        young = design.young[np.isin(rows, own)]
        if not len(young):  # Cells are of it in parts only.
            continue
        found.append(
            {
                "name": name,
                "young_min_pa": float(young.min()),
                "young_max_pa": float(young.max()),
                "density_kg_per_m3": float(table.density[own[0]]),
                "poisson": table.laws[own[0]].poisson,
            }
        )
    return found


def sentences(out: Path, design: Design, summary: dict[str, Any]) -> str:
    """The outcome in words, a line each."""
    return "\n".join(
        [
            f"cost {summary['cost_start']:.4g} -> {summary['cost']:.4g} ({summary['fall']:.1%} "
            f"less) in {summary['seconds']:.1f} s and "
            f"{counted(summary['evaluations'], 'evaluation')} "
            f"({summary['evaluations_per_minute']:,.0f} a minute, "
            f"{counted(summary['workers'], 'worker')})"
            f"{_ENDINGS.get(summary['ended_by'], '')}",
            f"frequencies of {counted(summary['partials'], 'partial')} among "
            f"{counted(summary['modes'], 'mode')}: "
            f"median error {summary['frequency_error_median_cents']:.1f} cents, worst "
            f"{summary['frequency_error_max_cents']:.1f} cents; "
            f"residuals of the modes up to {summary['residual_max']:.1e}",
            *_left_out_sentence(summary),
            _rms_sentence(summary),
            *_material_sentences(design, summary),
            *_place_sentence(summary["listen"]),
            _damping_sentence(summary),
            *_build_sentences(summary["build"]),
            *_distance_sentence(summary["verdict"]),
            *([summary["verdict"]["sentence"]] if summary["verdict"] else []),
            f"design: {out}; solid {lengths_in_words(summary['extents_m'])}",
        ]
    )


def _left_out_sentence(summary: dict[str, Any]) -> list[str]:
    hertz = summary["left_out_hz"]
    if not hertz:
        return []
    listed = ", ".join(f"{each:.0f}" for each in hertz)
    share = summary["left_out_share_of_loudness"]
    return [
        f"left out, since no mode can have them: partials at {listed} Hz, {share:.0%} of loudness"
    ]


def _rms_sentence(summary: dict[str, Any]) -> str:
    coarse, fine = summary["coarse_rms_cents"], summary["fine_rms_cents"]
    if fine is None:
        return f"from their targets (rms): {coarse:.1f} cents"
    return (
        f"from their targets (rms): {coarse:.1f} cents on the coarse solid, {fine:.1f} on the fine "
        f"one, by {counted(len(summary['checks']), 'check')}"
    )


def _material_sentences(design: Design, summary: dict[str, Any]) -> list[str]:
    regions = summary["regions"]
    lines = []
    for each in regions:
        low, high = (each[f"young_{end}_pa"] / 1e9 for end in ("min", "max"))
        ratio = "its own elasticity along each axis"
        if each["poisson"] is not None:
            ratio = f"Poisson's ratio {each['poisson']:.3g}"
        name = f"{each['name']}: " if len(regions) > 1 else ""
        density = each["density_kg_per_m3"]
        lines.append(
            f"{name}Young's modulus {low:.3g} to {high:.3g} GPa, density {density:.4g} kg/m^3, "
            f"{ratio}"
        )
    low, high = design.young.min(), design.young.max()
    least, most = design.settings["material"]["young_bounds"] or (low, high)
    beyond = np.mean((design.young < 0.999 * least) | (design.young > 1.001 * most))
    if beyond:
        lines[-1] += f"; {beyond:.1%} of the voxels are beyond young_bounds"
    if high > STIFFEST or low < SOFTEST:
        than = "stiffer than diamond" if high > STIFFEST else "softer than rubber"
        lines.append(
            f"warning: that is {than}; look at the size of the solid, or let its density give way "
            "(young_bounds below material)"
        )
    return lines


def _build_sentences(build: dict[str, Any] | None) -> list[str]:
    """Shares of the materials, errors before and after, and whether parts are too thin to print;
    empty of a continuous field."""
    if build is None:
        return []
    used = [each for each in build["materials"] if each["volume_m3"]]
    whole = sum(each["volume_m3"] for each in used)
    shares = ", ".join(f"{each['name']} {each['volume_m3'] / whole:.1%}" for each in used)
    what = "one material a region"
    if build["at_least_m"] is not None:
        cubes = "single voxels" if build["voxels"] == 1 else "cubes"
        what = f"{cubes} of {length_in_words(build['at_least_m'])}"
    size = f"{build['size']:.3f} times as large as its mesh" if build["size"] != 1.0 else ""
    before, rounded, after = build["before"], build["rounded"], build["after"]
    text = (
        f"what that costs: partials off by {_off(before)} before, {_off(rounded)} in the nearest "
        f"materials, {_off(after)} as built, by {counted(build['evaluations'], 'evaluation')}"
    )
    if "distance_db" in before and "distance_db" in after:
        text += (
            f"; from the clip {before['distance_db']:.1f} dB ({before['verdict']}) before, "
            f"{after['distance_db']:.1f} dB ({after['verdict']}) as built"
        )
    lines = [f"built of {shares}, in {what}{', ' if size else ''}{size}", text]
    if fault := too_thin(build["at_least_m"]):
        lines.append(f"warning: {fault}")
    return lines


def _off(told: dict[str, float]) -> str:
    return f"{told['median_cents']:.1f} cents (worst {told['worst_cents']:.1f})"


def _damping_sentence(summary: dict[str, Any]) -> str:
    low, median, high = np.quantile(summary["damping_ratios"], (0.25, 0.5, 0.75))
    factors, by = summary["loss_factors"], "the regions' own damping"
    if factors:
        by = f"loss factors of {min(factors):.2g} to {max(factors):.2g}"
    text = (
        f"dampings by {by}: {median:.2f} of "
        f"the clips' (median), half of them {low:.2f} to {high:.2f}"
    )
    far = max(median, 1.0 / median) > FAR_DAMPINGS
    if summary["damping_source"] == "material" and far:
        rings = "shorter" if median > 1.0 else "longer"
        text += (
            f"; it rings {rings} than its clips: take their dampings (damping: {{source: clips}}), "
            "another damping of the regions, or more regions of the damping"
        )
    return text
