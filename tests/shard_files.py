"""Whole shards written from memory and read into it (test support)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dataset_gen.shards import Shard, in_order, iterate_shard, write_rows
from dataset_gen.tasks import ROW


def write_shard(path: str | Path, shard: Shard) -> None:
    """Write a shard that is in memory."""
    rows = np.empty(len(shard.fine), dtype=ROW)
    for name in ROW.names:
        rows[name] = getattr(shard, name)
    write_rows(path, shard.settings, [rows], shard.provenance)


def read_shard(path: str | Path) -> Shard:
    """Read and validate one whole shard."""
    pieces = list(iterate_shard(path))
    columns = {
        name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in ROW.names
    }
    whole = replace(pieces[0].settings, stop=pieces[-1].stop)
    return Shard(settings=whole, provenance=pieces[0].provenance, **columns)


def read_shards(paths: Sequence[str | Path]) -> list[Shard]:
    """Read shards that belong together, in order."""
    shards = {str(path): read_shard(path) for path in paths}
    ordered = in_order(paths, [shards[str(path)].settings for path in paths])
    return [shards[str(path)] for path, _ in ordered]
