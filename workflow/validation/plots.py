"""Figures of the page."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from solver.response.response import SAMPLE_RATE_HERTZ, spectrogram
from solver.response.response_file import ResponseFile
from studies.base.colours import COLOURS
from studies.base.media import COLOUR_MAP, highest_hertz, spectrogram_figure
from studies.base.table import Table
from workflow.report.convergence_plot import visible
from workflow.report.plots import LINES
from workflow.validation.evidence import COARSENED, SOLVED, Evidence
from workflow.validation.limits import angles_allowed, eigenvalue_error
from workflow.variants import TRUTH, VARIANTS

Array = NDArray[np.float64]

BINS = 24
"""Bars of the histogram of moduli."""
LIMITED: dict[str, Any] = {"linewidth": 0.9, "linestyle": (0, (1, 2))}
"""Lines of limits."""
SMALLEST_ANGLE = 1e-10
"""Angles [rad] below this are drawn there."""


def errors_figure(evidence: Evidence, errors: Table) -> Figure:
    """Frequencies, and relative errors of eigenvalues and frequencies, by mode number."""
    tolerances = evidence.tolerances
    mode = [row["mode"] for row in errors.rows]
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(9.6, 3.3))
    for variant in evidence.shown:
        left.plot(mode, [row[variant] for row in errors.rows], **_line(variant))
    for variant in evidence.compared:
        for axes, quantity in ((middle, "eigenvalue"), (right, "frequency")):
            values = [row[f"{variant}_{quantity}"] for row in errors.rows]
            axes.semilogy(mode, visible(values), **_line(variant))
    _limit(middle, eigenvalue_error(evidence).limit, SOLVED)
    if COARSENED in evidence.shown:
        _limit(right, tolerances["frequency_worst"], COARSENED)
    left.set(ylabel="frequency [Hz]", title="Natural frequencies")
    left.set_ylim(bottom=0)
    left.legend(loc="lower right")
    middle.set(ylabel="|relative error| [1]", title="Error of the eigenvalue")
    right.set(ylabel="|relative error| [1]", title="Error of the frequency")
    for axes in (left, middle, right):
        axes.set(xlabel="mode number", xlim=(mode[0], max(mode[-1], mode[0] + 1)))
    return figure


def shapes_figure(evidence: Evidence) -> Figure:
    """Angles between the truth's clusters and each method's, by mode number."""
    figure, axes = plt.subplots(figsize=(4.7, 3.1))
    for variant in evidence.compared:
        clusters = evidence.compared[variant]["clusters"]
        mode = [0.5 * (cluster["first"] + cluster["last"]) for cluster in clusters]
        angle = [max(cluster["angle"], SMALLEST_ANGLE) for cluster in clusters]
        axes.semilogy(mode, np.degrees(angle), ".", ms=4, **_line(variant, line=False))
    _angle_limits(axes, evidence)
    axes.set(xlabel="mode number", ylabel="angle [°]", title="Angle to the ground truth")
    figure.legend(loc="outside lower center", ncols=len(evidence.compared), columnspacing=1.0)
    return figure


def moduli_figure(young: Array) -> Figure:
    """Histogram of Young's moduli (m,) [Pa], its bars in the colours of the picture."""
    decades = np.log10(young)
    low, high = float(decades.min()), float(decades.max())
    uniform = high - low < 1e-6
    edges = np.linspace(low - 0.5, high + 0.5, 2) if uniform else np.linspace(low, high, BINS + 1)
    counts, _ = np.histogram(decades, edges)
    middles = 0.5 * (edges[1:] + edges[:-1])
    shade = np.zeros(1) if uniform else (middles - low) / (high - low)
    figure, axes = plt.subplots(figsize=(4.7, 2.4))
    left, width = 10.0 ** edges[:-1], np.diff(10.0**edges)
    axes.bar(left, counts, width, align="edge", color=plt.get_cmap(COLOUR_MAP)(shade))
    axes.set_xscale("log")
    axes.grid(axis="x", visible=False)
    axes.set(xlabel="Young’s modulus [Pa]", ylabel="voxels", title="Moduli")
    return figure


def motion_figure(response: ResponseFile) -> Figure:
    """Displacement of the observed point over time, and how far each method is from the truth."""
    truth = response.responses[TRUTH].displacement
    direction = np.linalg.svd(truth, full_matrices=False)[2][0]
    milliseconds = 1e3 * response.seconds
    peak = float(np.linalg.norm(truth, axis=1).max())
    factor, unit = _length_unit(peak)
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(7.6, 4.9), sharex=True, height_ratios=(1.5, 1)
    )
    for variant in response.responses:
        displacement = response.responses[variant].displacement
        above.plot(milliseconds, factor * displacement @ direction, **_line(variant))
        if variant != TRUTH:
            # At the first instant nothing has moved yet.
            difference = np.linalg.norm(displacement - truth, axis=1)[1:] / peak
            below.semilogy(milliseconds[1:], visible(difference), **_line(variant))
    above.set(ylabel=f"displacement [{unit}]", title="Motion of the observed point")
    below.set(
        xlabel="time after the strike [ms]",
        ylabel="|difference| [1]",
        title="Difference from the ground truth, over its largest displacement",
    )
    below.set_xlim(0.0, milliseconds[-1])
    figure.legend(
        *above.get_legend_handles_labels(),
        loc="outside lower center",
        ncols=len(response.responses),
        columnspacing=1.2,
    )
    return figure


def sound_figure(response: ResponseFile, variant: str) -> Figure:
    """Spectrogram of a sound, in levels below the loudest of the truth's."""
    responses = response.responses
    loudest = float(spectrogram(responses[TRUTH].sound)[2].max())
    highest = highest_hertz((part.sound, SAMPLE_RATE_HERTZ) for part in responses.values())
    return spectrogram_figure(responses[variant].sound, loudest, highest)


def _length_unit(peak: float) -> tuple[float, str]:
    """Unit that makes a length [m] a number above 1, if there is one, and its share of a metre."""
    units = ((1.0, "m"), (1e3, "mm"), (1e6, "µm"), (1e9, "nm"))
    return next((pair for pair in units if peak * pair[0] >= 1.0), units[-1])


def _line(variant: str, line: bool = True) -> dict[str, Any]:
    style = {"color": COLOURS[variant], "label": VARIANTS[variant].label}
    return style | LINES[variant] if line else style


def _limit(axes: Any, value: float, variant: str) -> None:
    axes.axhline(value, color=COLOURS[variant], **LIMITED)


def _angle_limits(axes: Any, evidence: Evidence) -> None:
    clusters = evidence.compared[SOLVED]["clusters"]
    if not clusters:
        return
    groups = [(cluster["first"], cluster["last"]) for cluster in clusters]
    limit = evidence.tolerances["subspace_angle"]
    allowed = angles_allowed(evidence, groups) if limit is None else np.full(len(groups), limit)
    mode = [0.5 * (first + last) for first, last in groups]
    axes.semilogy(mode, np.degrees(allowed), color=COLOURS[SOLVED], **LIMITED)
