"""Forests that are trained within seconds (test support)."""

from __future__ import annotations

from pathlib import Path

from tests.conftest import Run


def train_small_forests(folder: Path, run_cli: Run) -> Path:
    """Forests for Poisson's ratio 0.25 from few blocks; close to the fit, not as close as usual."""
    shard, forests = folder / "shard.h5", folder / "forests.h5"
    generate = ["generate", "--samples", 3000, "--seed", 7, "--out", shard]
    run_cli("dataset_gen", *generate, check=True)
    run_cli("forests", "train", shard, "--trees", 2, "--out", forests, check=True)
    return forests
