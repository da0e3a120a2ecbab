"""What a shard holds, for people and for scripts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dataset_gen.objectives.quadratic import MODULUS_FLOOR
from dataset_gen.shards import UNIT, read_shard


def describe(path: str | Path) -> dict[str, Any]:
    """Validate the shard at `path` and summarise it.

    Raises
    ------
    UserError
        See `dataset_gen.shards.read_shard`.
    """
    shard = read_shard(path)
    floor = MODULUS_FLOOR * shard.fine.max(axis=1, keepdims=True)
    return {
        "path": str(path),
        "objective": shard.objective,
        "poisson": shard.poisson,
        "seed": shard.seed,
        "samples": [shard.start, shard.stop],
        "unit": UNIT,
        "largest_modulus": float(shard.fine.max()),
        "partly_void": float((shard.fine == 0).any(axis=1).mean()),
        "converged": float(shard.converged.mean()),
        "at_floor": float((shard.coarse <= floor * (1 + 1e-9)).mean()),
        "median_residual": float(np.median(shard.residual)),
        "provenance": shard.provenance,
    }


def as_text(summary: dict[str, Any]) -> str:
    """The result of `describe` as lines."""
    first, past = summary["samples"]
    return "\n".join(
        [
            f"{summary['path']}: samples {first}..{past - 1} of seed {summary['seed']}",
            f"objective {summary['objective']}, Poisson's ratio {summary['poisson']}",
            f"largest fine modulus {summary['largest_modulus']:.4g} {summary['unit']}",
            f"partly void {summary['partly_void']:.1%}, converged {summary['converged']:.1%}, "
            f"moduli at the floor {summary['at_floor']:.1%}",
            f"median residual {summary['median_residual']:.4f}",
            f"commit {summary['provenance'].get('commit', 'unknown')}",
        ]
    )
