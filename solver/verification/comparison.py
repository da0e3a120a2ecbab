"""How far a spectrum is from another that is taken for the truth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.fem.geometry import blocks_with_coarse, prolongation
from carillon.fem.model import RIGID_MODES, ElasticModel
from carillon.files.atomic import by_stem
from solver.assembly.sparse import assembled
from solver.files.modes_file import ModesFile, read_elastic, require_same_solid
from solver.response.contact import interpolation
from solver.subspace.spectrum import clusters
from solver.verification.matching import SAME, match_clusters, mode_overlaps, recognised
from solver.verification.materials import material_difference, on_one_mesh
from solver.verification.residuals import residual_scale

Array = NDArray[np.float64]

DEPENDENT = 1e-10
"""Share of the largest eigenvalue of products of vectors below which these are dependent."""
AUDIBLE_FIRST, AUDIBLE_LAST = 7, 60
"""Mode numbers, from 1, of the frequency errors that are reported for coarsened models."""


@dataclass
class SpectrumComparison:
    """Errors of a candidate against the truth; rigid modes are left out.

    Attributes
    ----------
    eigenvalue_relative_error
        Median, 90th percentile and maximum of |lambda - truth| / truth.
    frequency_rms_relative_error
        Root mean square over all compared modes.
    frequency_rms_relative_error_7_60, frequency_max_relative_error_7_60
        The same and the maximum over modes 7..60, or as many as there are.
    subspace_angle_max
        Largest M-weighted principal angle [rad] between a cluster of the truth and the same modes
        of the candidate, on the truth's mesh; the last cluster, which the end of the spectrum may
        cut, is left out.  NaN if there is no other.
    residual_max
        Largest residual ratio of the candidate, recomputed from the K and M in its file.
    modes_compared
        Number of elastic modes compared.
    clusters
        First and last mode number of every cluster of the truth but the last, and its angle [rad].
    matched
        Frequency errors of the modes that are the same by their shapes, whatever their numbers, see
        `matching.recognised`, and how many of these have `moved` to another number;
        None on the truth's own mesh, where numbers tell.
    material
        In what the material differs, see `materials`; None where it is the same.
    """

    candidate: str
    truth: str
    eigenvalue_relative_error: dict[str, float]
    frequency_rms_relative_error: float
    frequency_rms_relative_error_7_60: float
    frequency_max_relative_error_7_60: float
    subspace_angle_max: float
    residual_max: float
    modes_compared: int
    clusters: list[dict[str, Any]]
    matched: dict[str, Any] | None = None
    material: dict[str, Any] | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain dictionary, ready for JSON, without what there is not."""
        return {name: value for name, value in asdict(self).items() if value is not None}


@dataclass(frozen=True)
class FrequencyErrors:
    """Relative errors of the frequencies of modes `first`..`last`, matched by index.

    Attributes
    ----------
    rms, mean
        Root mean square and signed mean.
    worst, worst_mode
        The error of largest magnitude, with its sign, and the mode that has it.
    """

    first: int
    last: int
    rms: float
    mean: float
    worst: float
    worst_mode: int


def frequency_errors(errors: Array, last: int) -> FrequencyErrors:
    """Summary of the relative `errors` (k,) of modes 7, 8, ... up to `last`, if there are so many.

    Examples
    --------
    >>> frequency_errors(np.array([0.25, -0.5, 1.0]), last=8)
    FrequencyErrors(first=7, last=8, rms=0.395..., mean=-0.125, worst=-0.5, worst_mode=8)
    """
    part = errors[: last - RIGID_MODES]
    worst = int(np.argmax(np.abs(part)))
    first = RIGID_MODES + 1
    return FrequencyErrors(
        first,
        RIGID_MODES + len(part),
        float(np.sqrt(np.mean(part**2))),
        float(np.mean(part)),
        float(part[worst]),
        first + worst,
    )


def eigenvalue_errors(values: Array, exact: Array) -> dict[str, float]:
    """Median, 90th percentile and maximum of |values - exact| / exact, matched by index.

    Examples
    --------
    >>> eigenvalue_errors(np.array([1.0, 2.5, 4.0]), np.array([1.0, 2.0, 4.0]))["max"]
    0.25
    """
    error = np.abs(values / exact - 1.0)
    return {
        "median": float(np.median(error)),
        "p90": float(np.quantile(error, 0.9)),
        "max": float(error.max()),
    }


def compare_files(candidate: str | Path, truth: str | Path) -> SpectrumComparison:
    """Compare two modes files of one solid, of any meshes and discretisations.

    Raises
    ------
    UserError
        If a file is unusable or holds no elastic mode to compare, or they are of other solids.
    """
    (found,) = compare_each([candidate], truth).values()
    return found


def compare_each(
    candidates: Iterable[str | Path], truth: str | Path
) -> dict[str, SpectrumComparison]:
    """Compare several modes files with one that is taken for the truth.

    See `carillon.files.atomic.by_stem` for the names of the comparisons.

    Raises
    ------
    UserError
        See `compare_files`.
    """
    exact = read_elastic(truth)
    matrix = assembled(exact.model)[1]
    found = {}
    for label, name in by_stem(candidates).items():
        candidate = read_elastic(name)
        require_same_solid([truth, name], [exact, candidate])
        found[label] = _compared(name, candidate, str(truth), exact, matrix)
    return found


def _compared(
    candidate: str, a: ModesFile, truth: str, b: ModesFile, M: sp.csr_matrix
) -> SpectrumComparison:
    """Errors of a candidate, the mass matrix of the truth being at hand."""
    count = min(len(a.eigenvalues), len(b.eigenvalues))
    elastic = slice(RIGID_MODES, count)
    values, exact = a.eigenvalues[elastic], b.eigenvalues[elastic]
    shift = a.frequencies[elastic] / b.frequencies[elastic] - 1.0
    audible = frequency_errors(shift, AUDIBLE_LAST)
    modes = on_mesh_of(b, a)
    angles = _cluster_angles(modes, b, M, count)
    return SpectrumComparison(
        candidate,
        truth,
        eigenvalue_errors(values, exact),
        frequency_errors(shift, count).rms,
        audible.rms,
        abs(audible.worst),
        max((cluster["angle"] for cluster in angles), default=float("nan")),
        float(recomputed_residuals(a, *assembled(a.model)).max()),
        count - RIGID_MODES,
        angles,
        None if modes is a.modes else _matched(modes, a, b, M),
        material_difference(a.model, b.model),
    )


def recomputed_residuals(file: ModesFile, K: sp.csr_matrix, M: sp.csr_matrix) -> Array:
    """Residual ratios (k,) by these matrices, see `solver.verification.residuals`."""
    assert file.modes is not None
    mass_modes = M @ file.modes
    residual = K @ file.modes - mass_modes * file.eigenvalues
    scale = residual_scale(file.eigenvalues) * np.linalg.norm(mass_modes, axis=0)
    return np.asarray(np.linalg.norm(residual, axis=0) / scale)


def is_independent(gram: Array) -> bool:
    """Whether vectors with these products are independent, far beyond rounding."""
    squares = np.linalg.eigvalsh(gram)
    return bool(squares[0] > DEPENDENT * squares[-1])


def subspace_angles(modes: Array, truth: Array, M: sp.csr_matrix, groups: list[slice]) -> Array:
    """Largest M-weighted principal angle [rad] of each group of columns.

    The truth's block (n, k) is M-orthonormal; the candidate's, which may come from another mesh, is
    made so group by group; one whose modes are not independent is at a right angle.  The sine is
    taken from the part of the truth outside the candidate's span, which is accurate for small
    angles too.
    """
    angles = np.empty(len(groups))
    for index, group in enumerate(groups):
        inside, exact = modes[:, group], truth[:, group]
        gram = inside.T @ (M @ inside)
        if not is_independent(gram):
            angles[index] = 0.5 * np.pi
            continue
        factor = np.linalg.cholesky(gram)
        inside = np.linalg.solve(factor, inside.T).T
        outside = exact - inside @ (inside.T @ (M @ exact))
        square = np.linalg.eigvalsh(outside.T @ (M @ outside))[-1]
        angles[index] = np.arcsin(min(1.0, np.sqrt(max(square, 0.0))))
    return angles


def _matched(modes: Array, a: ModesFile, b: ModesFile, M: sp.csr_matrix) -> dict[str, Any]:
    """Errors of the frequencies of `a`, whose `modes` are on the mesh of `b`, matched by shape.

    Modes of a cluster of either are compared as a space, and matched in their order.
    """
    assert b.modes is not None
    others = modes[:, RIGID_MODES:]
    # A partner for each mode of the truth, or for as many as the candidate has.
    elastic = slice(RIGID_MODES, min(len(b.eigenvalues), len(a.eigenvalues)))
    exact = b.modes[:, elastic]
    rows, columns = clusters(b.eigenvalues[elastic]), clusters(a.eigenvalues[RIGID_MODES:])
    matching = match_clusters(mode_overlaps(exact, others, M @ others), rows, columns)
    errors = a.frequencies[RIGID_MODES:][matching.partners] / b.frequencies[elastic] - 1.0
    moved = matching.partners != np.arange(len(errors))
    return {
        **recognised(errors, matching.overlaps),
        "moved": int((moved & (matching.overlaps >= SAME)).sum()),
        "overlap_median": float(np.median(matching.overlaps)),
    }


def _cluster_angles(
    modes: Array, b: ModesFile, M: sp.csr_matrix, count: int
) -> list[dict[str, Any]]:
    """Angle of every cluster of `b` but the last to the same `modes` on its mesh."""
    assert b.modes is not None
    elastic = slice(RIGID_MODES, count)
    groups = clusters(b.eigenvalues[elastic])[:-1]
    if not groups:
        return []
    angles = subspace_angles(modes[:, elastic], b.modes[:, elastic], M, groups)
    return [
        {
            "first": RIGID_MODES + 1 + group.start,
            "last": RIGID_MODES + group.stop,
            "angle": float(angle),
        }
        for group, angle in zip(groups, angles, strict=True)
    ]


def on_mesh_of(fine: ModesFile, file: ModesFile) -> Array:
    """Modes of `file` on the nodes of `fine`, as far as that mesh can tell them.

    Those of a coarsening are prolonged, and those of any other mesh or discretisation interpolated.
    """
    assert file.modes is not None
    if on_one_mesh(file.model, fine.model):
        return file.modes
    blocks = None
    if isinstance(fine.model, ElasticModel) and isinstance(file.model, ElasticModel):
        blocks = blocks_with_coarse(fine.mesh, file.mesh)
    if blocks is None:
        nodal = interpolation(file.model, fine.mesh.nodes)
    else:
        nodal = prolongation(blocks)
    return np.asarray(sp.kron(nodal, sp.identity(3), format="csr") @ file.modes)
