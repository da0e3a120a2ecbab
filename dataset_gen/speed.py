"""How fast a shard was written or read, and in how much memory: the figures of every run."""

import time
from pathlib import Path

from carillon.processes.memory import peak_memory

ORIGINS = 8
"""Training rows of a sample: each corner of the block in turn is the origin."""


class Speed:
    """A clock that starts when it is made."""

    def __init__(self) -> None:
        self._start = time.perf_counter()

    def report(self, path: str | Path, samples: int, workers: int = 1) -> str:
        """Rates of `samples` gone through since the start, file size and largest memory."""
        seconds = time.perf_counter() - self._start
        size = Path(path).stat().st_size / 1e6
        rate = samples / seconds
        text = (
            f"{samples:,} samples in {seconds:.1f} s, {rate:,.0f} samples/s = "
            f"{ORIGINS * rate:,.0f} training rows/s; {size:,.1f} MB, {size / seconds:,.1f} MB/s; "
            f"peak memory {peak_memory() / 1e6:,.0f} MB"
        )
        if workers > 1:
            text += f", of a worker {peak_memory(children=True) / 1e6:,.0f} MB"
        return text
