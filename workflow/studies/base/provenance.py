"""The table of where results come from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from workflow.studies.base.entry import Row


def rows_of(results: Any) -> list[Row]:
    """Rows of the table `provenance` from the `origins` of results: records by file."""
    return [_row(file, origin) for file, origin in results.origins.items()]


def _row(file: str, origin: Mapping[str, Any]) -> Row:
    parameters = _unpacked(origin.get("parameters", "{}"))
    versions = _unpacked(origin.get("versions", "{}"))
    keys = ("command", "commit", "config_hash", "blas", "processor", "cores")
    return {
        "file": file,
        **{key: origin.get(key) for key in keys},
        "seed": parameters.get("seed"),
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
    }


def _unpacked(text: Any) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads(text) if isinstance(text, str) else text
    return loaded
