"""How far a spectrum is from another that is taken for the truth."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry import blocks_with_coarse, prolongation
from carillon.fem.model import ElasticModel, Solid
from carillon.files.paths import by_stem
from carillon.notebook.card import card, html_or_text, named_values, percent
from solver.assembly.sparse import assembled
from solver.files.modes_file import ModesFile, read_elastic, require_elastic, require_same_solid
from solver.response.points import interpolation
from solver.subspace.weyl import clusters
from solver.verification.fitted import fitted
from solver.verification.matching import (
    AUDIBLE_LAST,
    SAME,
    eigenvalue_errors,
    frequency_errors,
    match_clusters,
    mode_overlaps,
    recognised,
    subspace_angles,
)
from solver.verification.residuals import recomputed_residuals

EQUAL = 1e-9
"""Largest relative difference of two constants that count as the same."""
OF_LATTICE = 0.02
"""Relative difference of mean densities up to which solids of several materials are the same."""


@dataclass
class SpectrumComparison:
    """Errors of a candidate against the truth; rigid modes are left out."""

    candidate: str
    truth: str
    eigenvalue_relative_error: dict[str, float]
    """Median, 90th percentile and maximum of `|lambda - truth| / truth`."""
    frequency_rms_relative_error: float
    """Root mean square over all compared modes."""
    frequency_rms_relative_error_7_60: float
    frequency_max_relative_error_7_60: float
    """The same and the maximum over modes 7..60, or as many as there are."""
    subspace_angle_max: float
    """Largest M-weighted principal angle [rad] between a cluster of the truth and the same modes of
    the candidate, on the truth's mesh; the last cluster, which the end of the spectrum may cut, is
    left out.  NaN if there is no other."""
    residual_max: float
    """Largest residual ratio of the candidate, recomputed from the K and M in its file."""
    modes_compared: int
    """Number of elastic modes compared."""
    clusters: list[dict[str, Any]]
    """First and last mode number of every cluster of the truth but the last, and its angle
    [rad]."""
    matched: dict[str, Any] | None = None
    """Frequency errors of the modes that are the same by their shapes, whatever their numbers, see
    `matching.recognised`, and how many of these have `moved` to another number; None on the truth's
    own mesh, where numbers tell."""
    material: dict[str, Any] | None = None
    """In what the material differs, see `material_difference`; None where it is the same."""

    def __repr__(self) -> str:
        rms, worst = self.frequency_rms_relative_error, self.frequency_max_relative_error_7_60
        return (
            f"<SpectrumComparison of {self.modes_compared} elastic modes: frequencies "
            f"{percent(rms)} off (rms), up to {percent(worst)}>"
        )

    def _repr_html_(self) -> str:
        return html_or_text(self, self._html)

    def _html(self) -> str:
        values = self.eigenvalue_relative_error
        rows = [
            ("frequencies, rms", percent(self.frequency_rms_relative_error)),
            ("frequencies 7 to 60, rms", percent(self.frequency_rms_relative_error_7_60)),
            ("frequencies 7 to 60, worst", percent(self.frequency_max_relative_error_7_60)),
            ("eigenvalues, median", percent(values["median"])),
            ("eigenvalues, 90th percentile", percent(values["p90"])),
            ("eigenvalues, worst", percent(values["max"])),
            ("angle between shapes, largest", f"{np.degrees(self.subspace_angle_max):.2g}°"),
            ("residual, largest", f"{self.residual_max:.1e}"),
        ]
        if self.matched and self.matched["rms"] is not None:
            rows.append(("frequencies matched by shape, rms", percent(self.matched["rms"])))
            rows.append(("modes with another number", f"{self.matched['moved']}"))
        facts = [f"{self.modes_compared} elastic modes compared"]
        if self.material:
            facts.append(f"materials differ in {', '.join(self.material)}")
        return card("Distance from the truth", facts, named_values(rows))

    def as_dict(self) -> dict[str, Any]:
        """Plain dictionary, ready for JSON, without what there is not."""
        return {name: value for name, value in asdict(self).items() if value is not None}


def compare_files(candidate: str | Path, truth: str | Path) -> SpectrumComparison:
    """Compare two modes files of one solid, of any meshes and discretisations.

    Raises UserError if a file is unusable or holds no elastic mode to compare, or they are of other
    solids.
    """
    (comparison,) = compare_each([candidate], truth).values()
    return comparison


def compare_each(
    candidates: Iterable[str | Path], truth: str | Path
) -> dict[str, SpectrumComparison]:
    """Compare several modes files with one that is taken for the truth.

    See `carillon.files.paths.by_stem` for the names of the comparisons. Raises UserError, see
    `compare_files`.
    """
    exact = read_elastic(truth)
    matrix = assembled(exact.model)[1]
    comparisons = {}
    for label, name in by_stem(candidates).items():
        candidate = read_elastic(name)
        require_same_solid([truth, name], [exact, candidate])
        comparisons[label] = _compared(name, candidate, str(truth), exact, matrix)
    return comparisons


def compare_modes(candidate: ModesFile, truth: ModesFile) -> SpectrumComparison:
    """Compare the contents of two modes files; errors are those of `compare_files`."""
    names = ("candidate", "truth")
    files = [require_elastic(file, name) for file, name in zip((candidate, truth), names)]
    require_same_solid(names[::-1], files[::-1])
    return _compared(names[0], candidate, names[1], truth, assembled(truth.model)[1])


def _compared(
    candidate: str, a: ModesFile, truth: str, b: ModesFile, M: sp.csr_matrix
) -> SpectrumComparison:
    assert a.modes is not None
    count, rigid = min(len(a.eigenvalues), len(b.eigenvalues)), b.model.rigid_modes
    elastic = slice(rigid, count)
    values, exact = a.eigenvalues[elastic], b.eigenvalues[elastic]
    shift = a.frequencies[elastic] / b.frequencies[elastic] - 1.0
    audible = frequency_errors(shift, AUDIBLE_LAST, rigid)
    modes = on_mesh_of(b, a)
    angles = _cluster_angles(modes, b, M, count)
    return SpectrumComparison(
        candidate,
        truth,
        eigenvalue_errors(values, exact),
        frequency_errors(shift, count, rigid).rms,
        audible.rms,
        abs(audible.worst),
        max((cluster["angle"] for cluster in angles), default=float("nan")),
        float(recomputed_residuals(*assembled(a.model), a.eigenvalues, a.modes, rigid).max()),
        count - rigid,
        angles,
        None if modes is a.modes else _matched(modes, a, b, M),
        material_difference(a.model, b.model),
    )


def _matched(modes: Array, a: ModesFile, b: ModesFile, M: sp.csr_matrix) -> dict[str, Any]:
    """Errors of the frequencies of `a`, whose `modes` are on the mesh of `b`, matched by shape.

    Modes of a cluster of either are compared as a space, and matched in their order.
    """
    assert b.modes is not None
    rigid = b.model.rigid_modes
    others = modes[:, rigid:]
    # A partner for each mode of the truth, or for as many as the candidate has.
    elastic = slice(rigid, min(len(b.eigenvalues), len(a.eigenvalues)))
    exact = b.modes[:, elastic]
    rows, columns = clusters(b.eigenvalues[elastic]), clusters(a.eigenvalues[rigid:])
    matching = match_clusters(mode_overlaps(exact, others, M @ others), rows, columns)
    errors = a.frequencies[rigid:][matching.partners] / b.frequencies[elastic] - 1.0
    moved = matching.partners != np.arange(len(errors))
    return {
        **recognised(errors, matching.overlaps, rigid),
        "moved": int((moved & (matching.overlaps >= SAME)).sum()),
        "overlap_median": float(np.median(matching.overlaps)),
    }


def _cluster_angles(
    modes: Array, b: ModesFile, M: sp.csr_matrix, count: int
) -> list[dict[str, Any]]:
    """Angle of every cluster of `b` but the last to the same `modes` on its mesh."""
    assert b.modes is not None
    rigid = b.model.rigid_modes
    elastic = slice(rigid, count)
    groups = clusters(b.eigenvalues[elastic])[:-1]
    if not groups:
        return []
    angles = subspace_angles(modes[:, elastic], b.modes[:, elastic], M, groups)
    return [
        {
            "first": rigid + 1 + group.start,
            "last": rigid + group.stop,
            "angle": float(angle),
        }
        for group, angle in zip(groups, angles, strict=True)
    ]


def on_mesh_of(fine: ModesFile, file: ModesFile) -> Array:
    """Modes of `file` on the nodes of `fine`, as far as that mesh can tell them.

    Those of a coarsening are prolonged, and those of any other mesh or discretisation interpolated;
    on finite cells, whose nodes may be outside the solid, fitted inside it.
    """
    assert file.modes is not None
    if on_one_mesh(file.model, fine.model):
        return file.modes
    if isinstance(fine.model, FiniteCellModel):
        return fitted(fine.model, file.model, file.modes)
    blocks = None
    if isinstance(fine.model, ElasticModel) and isinstance(file.model, ElasticModel):
        blocks = blocks_with_coarse(fine.mesh, file.mesh)
    if blocks is None:
        nodal = interpolation(file.model, fine.model.positions)
    else:
        nodal = prolongation(blocks)
    return np.asarray(sp.kron(nodal, sp.identity(3), format="csr") @ file.modes)


def _laws(solid: Solid) -> dict[str, Any]:
    """Elasticity of each region by its name; of those whose axes vary how many laws there are."""
    names = solid.regions.names
    pairs = zip(names, solid.regions.laws, strict=True)
    return {name: law if names.count(name) == 1 else None for name, law in pairs}


def on_one_mesh(one: Solid, other: Solid) -> bool:
    """Whether two solids have the same elements and nodes."""
    return np.array_equal(one.connectivity, other.connectivity) and np.array_equal(
        one.node_grid, other.node_grid
    )


def material_difference(one: Solid, truth: Solid) -> dict[str, Any] | None:
    """In what the material of a solid differs from the truth's; None where it is the same.

    Young's moduli are compared on one mesh alone, since a coarse element has moduli of its own.
    Returns of what differs: `poisson` and `density_kg_per_m3`, each with the solid's own value and
    the truth's; `elasticity` of several materials or anisotropic ones, the names of both; and
    `young`: the number of `cells` that differ, that of `all`, and the `largest` relative difference
    (infinite from zero).
    """
    differing: dict[str, Any] = {}
    for name, a, b in (
        ("poisson", one.poisson, truth.poisson),
        ("density_kg_per_m3", one.density, truth.density),
    ):
        # Cells of several densities hold of each what the lattice makes of it.
        allowed = EQUAL if len(truth.regions) == 1 else OF_LATTICE
        if a is not None and b is not None and abs(a - b) > allowed * abs(b):
            differing[name] = [float(a), float(b)]
    if "poisson" not in differing and _laws(one) != _laws(truth):
        differing["elasticity"] = [sorted(set(each.regions.names)) for each in (one, truth)]
    if on_one_mesh(one, truth) and one.young.shape == truth.young.shape:
        step = np.abs(one.young - truth.young)
        other = step > EQUAL * np.abs(truth.young)
        if other.any():
            # One row a cell, whatever values it has.
            cells = other.reshape(len(other), -1).any(axis=1)
            with np.errstate(divide="ignore"):
                largest = float((step[other] / np.abs(truth.young[other])).max())
            differing["young"] = {"cells": int(cells.sum()), "all": len(cells), "largest": largest}
    return differing or None
