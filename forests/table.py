"""Fig. 9: displacement error on random blocks, cost per block and storage of every coarsening."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from carillon.progress import track
from dataset_gen.block import prolongation
from dataset_gen.element import Array
from dataset_gen.objectives import fit
from dataset_gen.objectives.patterns import corner_strains, pattern_of, straining_motions
from dataset_gen.serial import serial_blas
from forests.baselines import average, galerkin
from forests.evaluate import coarsen
from forests.model import Model

RANGES = ((0.0, 10.0), (100.0, 10_000.0))
"""Ranges of Young's modulus in GPa: the trained one and one far outside."""

FORCES = 64
"""Random forces on each block."""

SOLID = 255


@dataclass(frozen=True)
class Method:
    """A coarsening (m, 8) -> (m, 8) and the bytes it stores."""

    name: str
    coarsen: Callable[[Array], Array]
    storage: int


def methods_of(model: Model) -> list[Method]:
    """All coarsenings of the table."""

    def direct(objective: str) -> Callable[[Array], Array]:
        return lambda young: fit(objective, young, model.poisson).moduli

    return [
        Method("average", average, 0),
        Method("Galerkin", galerkin, 0),
        Method("Chen et al. 2015, fitted on the spot", direct("chen2015"), 0),
        Method(f"{model.objective}, fitted on the spot", direct(model.objective), 0),
        Method(f"{model.objective}, forests", lambda young: coarsen(model, young), model.nbytes),
    ]


def displacement_errors(young: Array, moduli: Array, forces: Array, poisson: float) -> Array:
    """Relative displacement error (m, k) of solid blocks (m, 8) under nodal forces (81, k).

    The coarse displacements are interpolated trilinearly to the block's 27 nodes; the error is
    `|P u_c - u| / |u|`, both without rigid motion.
    """
    pattern = pattern_of(SOLID, poisson)
    motions = straining_motions()
    strains = corner_strains(poisson) @ motions
    balanced = pattern.without_null(forces)
    fields = pattern.without_null(prolongation() @ motions)
    fine = np.linalg.solve(pattern.assemble(young), balanced[None])
    weighted = np.repeat(moduli, 6, axis=1)[:, :, None] * strains
    coarse = fields @ np.linalg.solve(strains.T @ weighted, (fields.T @ balanced)[None])
    return np.asarray(np.linalg.norm(coarse - fine, axis=1) / np.linalg.norm(fine, axis=1))


def _seconds_per_block(method: Method, young: Array) -> float:
    method.coarsen(young)
    start = time.perf_counter()
    method.coarsen(young)
    return (time.perf_counter() - start) / len(young)


@serial_blas
def table(model: Model, blocks: int = 1000, seed: int = 0) -> dict[str, Any]:
    """Rows of Fig. 9 on `blocks` random solid blocks of each range, on one core.

    Two loads: Gaussian forces on all 27 nodes as in the paper, and the inertia of a trilinear
    motion balanced by that of a rigid one, which is what vibration does to a block.
    """
    generator = np.random.default_rng(seed)
    pattern = pattern_of(SOLID, model.poisson)
    rigid = pattern.mass @ pattern.rigid
    inertia = pattern.mass @ pattern.interpolation @ straining_motions()
    inertia = inertia - rigid @ np.linalg.solve(pattern.rigid.T @ rigid, pattern.rigid.T @ inertia)
    loads = {
        "nodal": generator.standard_normal((81, FORCES)),
        "inertial": inertia @ generator.standard_normal((inertia.shape[1], FORCES)),
    }
    rows = []
    for low, high in RANGES:
        young = generator.uniform(max(low, 1e-3 * high), high, (blocks, 8))
        for method in track(methods_of(model), f"{low:g}..{high:g} GPa", unit="method"):
            moduli = method.coarsen(young)
            row: dict[str, Any] = {
                "range_gpa": [low, high],
                "method": method.name,
                "seconds_per_block": _seconds_per_block(method, young),
                "storage_bytes": method.storage,
            }
            for name, forces in loads.items():
                errors = displacement_errors(young, moduli, forces, model.poisson)
                row[f"mean_error_{name}"] = float(errors.mean())
                row[f"median_error_{name}"] = float(np.median(errors))
            rows.append(row)
    return {"blocks": blocks, "forces": FORCES, "seed": seed, "rows": rows}


def as_text(result: dict[str, Any]) -> str:
    """The result of `table` in columns."""
    lines = [
        f"relative displacement error on {result['blocks']} random solid blocks, "
        f"{result['forces']} forces each",
        f"{'GPa':<12}{'method':<38}{'us/block':>9}{'MB':>7}{'nodal':>9}{'median':>9}"
        f"{'inertial':>10}{'median':>9}",
    ]
    for row in result["rows"]:
        low, high = row["range_gpa"]
        lines.append(
            f"{f'{low:g}..{high:g}':<12}{row['method']:<38}{1e6 * row['seconds_per_block']:>9.2f}"
            f"{row['storage_bytes'] / 1e6:>7.1f}{row['mean_error_nodal']:>9.4f}"
            f"{row['median_error_nodal']:>9.4f}{row['mean_error_inertial']:>10.4f}"
            f"{row['median_error_inertial']:>9.4f}"
        )
    return "\n".join(lines)
