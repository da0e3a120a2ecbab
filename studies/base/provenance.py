"""The table of where results come from."""

import json
from collections.abc import Iterator
from typing import Any

from studies.base.conditions import versions_of
from studies.base.table import Column, Row, table

KEYS = ("command", "commit", "config_hash", "blas", "processor", "cores")


@table(
    Column("file", "File"),
    Column("command", "Command"),
    Column("commit", "Commit"),
    Column("seed", "Seed"),
    Column("config_hash", "Parameters' hash"),
    Column("blas", "BLAS"),
    Column("processor", "Processor"),
    Column("cores", "Cores", "count"),
    Column("versions", "Versions"),
)
def provenance(results: Any) -> Iterator[Row]:
    """Origin of every result file: the command, the commit of the code, seed and hash of all
    parameters, and the machine. Training data name neither BLAS nor cores, since their bytes are
    the same with any."""
    for file, origin in results.origins.items():
        yield {
            "file": file,
            **{key: origin.get(key) for key in KEYS},
            "seed": json.loads(origin.get("parameters", "{}")).get("seed"),
            "versions": versions_of(origin),
        }
