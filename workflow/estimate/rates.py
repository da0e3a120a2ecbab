"""The file of rates that were measured on a machine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from carillon.files.paths import cause, require_file
from carillon.files.yaml_input import read_own_yaml
from workflow.estimate.laws import Rates
from workflow.strict_schema import first_mistake, reason

SCHEMA = Path(__file__).parent.parent / "schemas" / "rates.schema.yaml"
PACKAGED = Path(__file__).with_name("rates.json")
"""Rates that come with the package."""

VERSION = 3
MOST_BYTES = 1 << 20
"""Bytes that a file of rates may have."""


def checked(values: Any, where: str) -> Rates:
    """The values of a file of rates, if they are some.

    Raises
    ------
    UserError
        With one sentence about the first value that does not fit; `where` begins it.
    """
    mistake = first_mistake(read_own_yaml(SCHEMA), values)
    if mistake is not None:
        place = ".".join(map(str, mistake.absolute_path)) or "contents"
        raise UserError(
            f"{where}: {place}: {reason(mistake)}; expected rates made by "
            "python -m workflow estimate --measure --rates FILE"
        )
    return dict(values)


def load_rates(path: str | Path = PACKAGED) -> Rates:
    """Read a file of rates.

    Raises
    ------
    UserError
        If it cannot be read, is no JSON, or holds anything else.
    """
    try:
        with open(require_file(path, "rates (JSON)"), "rb") as stream:
            content = stream.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise UserError(f"{path}: longer than {MOST_BYTES:,} bytes, expected rates (JSON)")
        values = json.loads(content)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({cause(error)}), expected rates") from None
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: is no JSON ({error}); measure the rates again") from None
    return checked(values, str(path))
