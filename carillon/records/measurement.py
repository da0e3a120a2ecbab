"""Provenance of what was timed: also vector registers, memory, ranks, threads and date."""

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from carillon.processes.memory import memory_bytes
from carillon.processes.threads import allowed_threads
from carillon.records.provenance import compiled_for, record


def measured(
    parameters: dict[str, Any], ranks: int | Sequence[int] = 1, threads: int | None = None
) -> dict[str, Any]:
    """Provenance of a measurement made just now: plain values, ready for JSON or HDF5.

    `ranks` may be several numbers of MPI ranks that were measured one after the other; `threads`,
    of each rank, are what the process may use if None.
    """
    from carillon.numerics.simd_width import LANES  # whose import takes half a second

    counts = [ranks] if isinstance(ranks, int) else ranks
    return {
        **record(parameters),
        "compiled_for": compiled_for(),
        "vector_bits": 64 * LANES,
        "memory_bytes": memory_bytes(),
        "ranks": ", ".join(map(str, counts)),
        "threads": allowed_threads() if threads is None else threads,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }
