"""The table of where results come from."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from studies.base.conditions import versions_of
from studies.base.entry import Row

KEYS = ("command", "commit", "config_hash", "blas", "processor", "cores")


def rows_of(results: Any) -> Iterator[Row]:
    """Rows of the table `provenance` from the `origins` of results: records by file."""
    for file, origin in results.origins.items():
        yield {
            "file": file,
            **{key: origin.get(key) for key in KEYS},
            "seed": json.loads(origin.get("parameters", "{}")).get("seed"),
            "versions": versions_of(origin),
        }
