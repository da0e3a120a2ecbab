"""Pictures of the first elastic mode by every variant, turned and scaled alike (Fig. 8)."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from carillon.drawing.solid import DRAWN_AMPLITUDE, Skin, draw, guess_up
from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.faces import surface_quads
from solver.files.modes_file import ModesFile, read_modes
from studies.base.colours import COLOURS, MUTED
from studies.base.media import cropped, save_pixels, solid_picture
from studies.base.style import plain
from workflow.report.plots import LINES
from workflow.report.results import Run
from workflow.variants import TRUTH, VARIANTS

Array = NDArray[np.float64]

COMPARED = (TRUTH, "hcms_ec", "ddfem_hcms_ec")
"""Variants whose spectra the overview shows."""
CLUSTER_WIDTH = 0.05
"""Modes whose frequencies lie this close above the first elastic one count as one space with it."""


def draw_first_elastic_modes(
    results: Run, model: str, paths: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Draw the first elastic mode of every shown variant to `paths`.

    Returns number, frequency and likeness of each.
    """
    truth = read_modes(results.modes_path(model, TRUTH))
    reference = displacement(truth, truth.model.rigid_modes)
    skin = results.skin(model, truth.model)
    view = view_of(truth.mesh, reference, skin)
    description, pictures = {}, []
    shown = results.drawn_variants(model)
    for variant in shown:
        file = read_modes(results.modes_path(model, variant))
        motion, likeness = aligned(file, truth, reference, skin)
        drawn = partial(draw, mesh=file.mesh, displacement=motion, **view)
        pictures.append(solid_picture(drawn))
        description[variant] = {
            "mode": truth.model.rigid_modes + 1,
            "hertz": float(file.frequencies[file.model.rigid_modes]),
            "likeness": likeness,
            "combined": len(cluster(truth.frequencies, truth.model.rigid_modes)),
        }
    for variant, path, picture in zip(shown, paths, cropped(pictures), strict=True):
        save_pixels(picture, path)
        description[variant] |= {"height": picture.shape[0], "width": picture.shape[1]}
    return description


def displacement(file: ModesFile, index: int) -> Array:
    """Mode `index` as displacements (n, 3) of the nodes."""
    assert file.modes is not None
    return file.modes[:, index].reshape(-1, 3)


def cluster(frequencies: Array, rigid: int) -> list[int]:
    """Indices of the modes that share the first elastic frequency, as in symmetric bodies."""
    first = frequencies[rigid]
    near = np.abs(frequencies[rigid:] / first - 1.0) <= CLUSTER_WIDTH
    return [rigid + int(index) for index in np.flatnonzero(near)]


def aligned(
    file: ModesFile, truth: ModesFile, reference: Array, skin: Skin | None = None
) -> tuple[Array, float]:
    """First elastic motion of `file`, signed and turned within its cluster to match the truth's.

    Seen at the nodes, or on the skin that both are drawn as: nodes of cut cells lie outside.

    Returns
    -------
    tuple[Array, float]
        Displacements (n, 3) on the file's own nodes, as long as the truth's there, and their
        likeness: the cosine between both, 1 for the same shape.
    """
    assert file.modes is not None
    basis = file.modes[:, cluster(truth.frequencies, truth.model.rigid_modes)]
    if skin is None:
        # Nodes of a coarsened mesh lie on those of the fine one, or beside them where cells are
        # void.
        target = reference[cKDTree(truth.mesh.nodes).query(file.mesh.nodes)[1]].ravel()
        seen = basis
    else:
        target = skin.seen(reference).ravel()
        seen = skin.seen(basis.reshape(len(reference), -1)).reshape(len(target), -1)
    factors = np.linalg.lstsq(seen, target, rcond=None)[0]
    motion = seen @ factors
    length, target_length = np.linalg.norm(motion), np.linalg.norm(target)
    likeness = float(motion @ target / (length * target_length)) if length > 0 else 0.0
    scale = target_length / max(float(length), 1e-300)
    return (basis @ factors * scale).reshape(-1, 3), likeness


def view_of(mesh: HexMesh, motion: Array, skin: Skin | None = None) -> dict[str, Any]:
    """How all pictures of one mode are drawn, decided by the truth's `mesh` and `motion` (n, 3).

    Arguments of `carillon.drawing.solid.draw`. Colours end at the largest motion that can be
    seen: inside, a body may move more than its surface does.
    """
    seen = motion[np.unique(surface_quads(mesh))] if skin is None else skin.seen(motion)
    largest = float(np.linalg.norm(seen, axis=1).max())
    diagonal = float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
    scale = DRAWN_AMPLITUDE * diagonal / largest
    return {"scale": scale, "limits": (0.0, largest), "up": guess_up(mesh), "skin": skin}


def overview_figure(results: Run, model: str) -> Figure:
    """First elastic mode of the truth and of the fastest method, and the spectra of both."""
    truth = read_modes(results.modes_path(model, TRUTH))
    reference = displacement(truth, truth.model.rigid_modes)
    skin = results.skin(model, truth.model)
    view = view_of(truth.mesh, reference, skin)
    fast = results.shown_variants(model)[-1]
    with plt.rc_context({"figure.constrained_layout.use": False}):
        figure = plt.figure(figsize=(11.6, 3.9))
        for column, variant in enumerate((TRUTH, fast)):
            left = 0.01 + 0.3 * column
            file = truth if variant == TRUTH else read_modes(results.modes_path(model, fast))
            motion, _ = aligned(file, truth, reference, skin)
            body = figure.add_axes((left, 0.0, 0.29, 0.84), projection="3d")
            draw(body, file.mesh, motion, **view)
            figure.text(left + 0.01, 0.93, _label(variant), weight="bold", size=10.5)
            hertz = file.frequencies[file.model.rigid_modes]
            mode = file.model.rigid_modes + 1
            text = f"{file.model.n_dofs:,} unknowns, mode {mode} at {hertz:,.0f} Hz"
            figure.text(left + 0.01, 0.87, text, color=MUTED)
        rows = [row for row in results.table("frequencies").rows if row["model"] == model]
        _plot_spectra(figure.add_axes((0.68, 0.13, 0.305, 0.69)), rows)
        figure.text(0.68, 0.93, plain(results.titles[model]), weight="bold", size=10.5)
        figure.text(0.68, 0.87, f"{len(rows)} natural frequencies", color=MUTED)
    return figure


def _plot_spectra(axes: Any, rows: list[dict[str, Any]]) -> None:
    mode = [row["mode"] for row in rows]
    for variant in (name for name in COMPARED if name in rows[0]):
        kilohertz = [row[variant] / 1e3 for row in rows]
        axes.plot(mode, kilohertz, color=COLOURS[variant], label=_label(variant), **LINES[variant])
    axes.set(xlabel="mode number", ylabel="frequency [kHz]")
    axes.set_xlim(mode[0], mode[-1])
    axes.set_ylim(bottom=0)
    axes.legend(loc="lower right")


def _label(variant: str) -> str:
    return "Ground truth (SLEPc)" if variant == TRUTH else VARIANTS[variant].label
