"""Histories of searches, as designs keep them and as the page gets them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sound.project.design import HISTORY, HISTORY_TYPE


def rows_of(history: NDArray[np.void]) -> list[dict[str, float]]:
    """A design's history as the page gets it, one row for each entry."""
    return [dict(zip(HISTORY, entry, strict=True)) for entry in history.tolist()]


def history_of(rows: Sequence[Mapping[str, Any]]) -> NDArray[np.void]:
    """The history of a design whose rows are these."""
    return np.array([tuple(row[name] for name in HISTORY) for row in rows], HISTORY_TYPE)
