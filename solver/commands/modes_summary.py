"""What `modes` says of its result: attributes of the file, JSON, and a few lines of text."""

import json
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.fem.geometry.size import sizes_in_words
from solver.accuracy.solving import AccuracyRequest, Solved
from solver.analysis.options import SolverOptions
from solver.analysis.phases import ByRank
from solver.files.modes_file import ESTIMATE, FINE_TAKEN, frequencies
from solver.refinement.errors import (
    DIVIDED_CELLS,
    FINE_BLOCKS,
    FROM_FINE,
    FROM_SOLID,
    WORST,
    in_words,
)

REFINED = {FINE_BLOCKS: "blocks fine", DIVIDED_CELLS: "cells divided"}
"""Words for what is counted as refined."""
LOWEST_HEARD = 20.0
"""Lowest frequency that is heard [Hz]."""
FAR = 0.05
"""Expected distance of the frequencies from the solid's, rms, above which advice is given."""
NEARER = "; a larger --resolution comes nearer, and --accuracy 0.01 finds which"
EXPECTED = {FROM_FINE: "error against the voxels", FROM_SOLID: "distance from the solid"}
"""Words for the expected errors."""

UNCORRECTED = (
    "not corrected: eigenvalues are too high, often by 5 to 15%; leave out --corrections 0 to "
    "correct them"
)


def attributes_of(
    solved: Solved, solver: SolverOptions, accuracy: AccuracyRequest, elapsed: float
) -> dict[str, Any]:
    """Plain values for the modes file, on rank 0; none on the others.

    `elapsed` is the wall time [s] of all that was solved and estimated on the way.
    """
    problem, solid, modes = solved.problem, solved.solid, solved.modes
    if problem is None:
        return {}
    seconds = {**problem.seconds, **modes.seconds}
    if solved.achieved:
        refined = accuracy.refine_to is not None or accuracy.accuracy is not None
        rest = max(elapsed - sum(problem.seconds.values()) - sum(modes.seconds.values()), 0.0)
        seconds["refinement" if refined else ESTIMATE] = rest
    attributes: dict[str, Any] = {
        "method": solver.method,
        "discretisation": solid.discretisation,
        "coarsen": solid.coarsen,
        "mesh": solid.mesh,
        "resolution": solid.resolution,
        "material": solid.material,
        "seed": solid.seed,
        "interface": solver.interface,
        "fine_n_dofs": problem.fine.n_dofs,
        **problem.coarsening,
        **modes.evidence,
        **solved.achieved,
        "timings": seconds,
    }
    if solid.wall is not None:
        attributes |= {"wall": solid.wall, "wall_side": solid.wall_side}
    if solid.up is not None:
        attributes["up"] = solid.up
    if solver.tolerance is not None:
        attributes["tolerance"] = solver.tolerance
    return attributes


def print_json(attributes: dict[str, Any], solved: Solved, out: str, by_rank: ByRank) -> None:
    """Print attributes, sizes, frequencies and what each rank took as one JSON object."""
    assert solved.problem is not None
    summary = {
        **attributes,
        "extents_m": solved.problem.extents,
        "voxel_extents_m": solved.problem.voxel_extents,
        "frequencies_hz": frequencies(solved.modes.values).tolist(),
        "out": out,
        "phases_by_rank": by_rank,
    }
    print(json.dumps(summary))


def print_summary(attributes: dict[str, Any], solved: Solved, out: str) -> None:
    """Print the main figures in words."""
    assert solved.problem is not None
    problem, hertz = solved.problem, frequencies(solved.modes.values)
    total = sum(attributes["timings"].values())
    elastic = hertz[solved.modes.rigid :]
    span = f"{elastic[0]:.2f} to {elastic[-1]:.2f} Hz" if len(elastic) else "none elastic"
    added = attributes.get("modes_added", 0)
    late = f", {added} found after the first search" if added else ""
    print(
        f"{out}: {len(hertz)} modes of {attributes['n_dofs']:,} unknowns, {span}{late}; "
        f"{sizes_in_words(problem.extents, problem.voxel_extents)}; "
        f"{attributes['rigid_modes']} rigid, largest 2-norm residual "
        f"{attributes['residual_max']:.1e}, orthogonal to {attributes['orthogonality']:.1e}, "
        f"{total:.1f} s on {attributes['ranks']} rank{'s' if attributes['ranks'] > 1 else ''}"
    )
    if len(elastic) and elastic[-1] < LOWEST_HEARD:
        print(f"all modes are below hearing ({LOWEST_HEARD:g} Hz); see the size and its unit")
    if attributes["method"] == "hcms" and "corrections" not in attributes:
        print(UNCORRECTED)
    if attributes.get("inertia_count", -1) == attributes.get("inertia_expected"):
        print(_counted(attributes, hertz))
    if "missed_tolerance" in attributes:
        print(
            f"tolerance missed: {attributes['corrections']} corrections reached an eigenvalue "
            f"error of {attributes['eigenvalue_error_estimate']:.1e}, "
            f"{attributes['missed_tolerance']:.1e} was asked for"
        )
    if FINE_TAKEN in attributes:
        print(f"the fine solid was solved: {attributes[FINE_TAKEN]}")
        attributes = {k: v for k, v in attributes.items() if not k.startswith(FROM_FINE)}
    counts = "".join(
        f"; {attributes[what]:,} {words}" for what, words in REFINED.items() if what in attributes
    )
    for prefix, words in EXPECTED.items():
        if f"{prefix}_rms" in attributes:
            far = attributes[f"{prefix}_rms"] > FAR and prefix == FROM_SOLID
            print(f"expected {words} {in_words(attributes, prefix)}{counts}{NEARER if far else ''}")
    if "missed_accuracy" in attributes:
        rms = 100.0 * attributes["missed_accuracy"]
        print(
            f"{rms:g}% rms and {WORST * rms:g}% at worst were asked for, which dividing "
            f"cells up to {attributes['n_dofs']:,} unknowns does not reach: raise --resolution, or "
            "give --accuracy, which does"
        )


def _counted(attributes: dict[str, Any], hertz: Array) -> str:
    """Sentence on how many eigenvalues were counted, found and written."""
    below = float(frequencies(np.array([attributes["inertia_at"]]))[0])
    count = attributes["inertia_count"]
    return (
        f"none is missing: {count} eigenvalues below {below:.2f} Hz were counted, {count} found, "
        f"of which the {len(hertz)} lowest are written"
    )


def phase_table(by_rank: ByRank) -> str:
    """Lines for people: of each phase what the ranks took on average, and the busiest one.

    Examples
    --------
    >>> took = {"seconds": [2.0, 2.0], "processor_seconds": [1.0, 2.0]}
    >>> took |= {"waiting_seconds": [1.0, 0.0], "peak_memory_bytes": [1e9, 2e9]}
    >>> print(phase_table({"assembly": took}))
    phase          seconds  processor seconds: mean, most  by rank  ratio  longest wait  peak so far
    assembly          2.00                     1.50  2.00        1   1.33          1.00       2.0 GB
    """
    head = "seconds  processor seconds: mean, most  by rank  ratio  longest wait  peak so far"
    lines = [f"{'phase':<14} {head}"]
    for name, took in by_rank.items():
        busy = took["processor_seconds"]
        most, mean = max(busy), sum(busy) / len(busy)
        ratio = f"{most / mean:.2f}" if mean else "-"
        lines.append(
            f"{name:<14} {max(took['seconds']):7.2f}  {mean:23.2f} {most:5.2f}  "
            f"{busy.index(most):7d}  {ratio:>5}  {max(took['waiting_seconds']):12.2f}"
            f"  {max(took['peak_memory_bytes']) / 1e9:8.1f} GB"
        )
    return "\n".join(lines)
