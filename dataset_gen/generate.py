"""Draw samples and fit them, over as many workers as asked for, with the same result for any."""

from __future__ import annotations

import numpy as np
from joblib import Parallel, delayed

from carillon import provenance
from carillon.errors import UserError
from carillon.progress import track
from dataset_gen.element import DEFAULT_POISSON
from dataset_gen.objectives import DEFAULT_OBJECTIVE, fit, require_objective, require_poisson
from dataset_gen.sampling import samples, shard_range
from dataset_gen.shards import Shard

TASK_ROWS = 2048
"""Samples a worker fits at a time."""


def generate(
    total: int,
    seed: int = 0,
    shard: int = 0,
    shards: int = 1,
    objective: str = DEFAULT_OBJECTIVE,
    poisson: float = DEFAULT_POISSON,
    workers: int = 1,
    progress: bool = True,
) -> Shard:
    """Fit one shard of the first `total` samples of `seed`.

    Raises
    ------
    UserError
        For an unknown objective, an impossible split, seed, Poisson's ratio or number of workers.
    """
    require_objective(objective)
    require_poisson(poisson)
    if workers < 1:
        raise UserError(f"{workers} workers requested, expected at least 1")
    start, stop = shard_range(total, shard, shards)
    young = samples(seed, start, stop)
    parts = [young[row : row + TASK_ROWS] for row in range(0, len(young), TASK_ROWS)]
    pool = Parallel(n_jobs=workers, return_as="generator")
    tasks = pool(delayed(fit)(objective, part, poisson) for part in parts)
    fits = list(
        track(tasks, f"fitting {objective}", total=len(parts), unit="task", visible=progress)
    )
    return Shard(
        objective=objective,
        poisson=poisson,
        seed=seed,
        start=start,
        stop=stop,
        fine=young,
        coarse=np.concatenate([part.moduli for part in fits]),
        residual=np.concatenate([part.residual for part in fits]),
        converged=np.concatenate([part.converged for part in fits]),
        provenance=provenance.record(
            {"seed": seed, "samples": total, "objective": objective, "poisson": poisson}
        ),
    )
