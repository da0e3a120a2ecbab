"""Rates that were measured on a machine, and the file that they are kept in."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from carillon.errors import UserError
from carillon.files import atomic_path, cause
from carillon.places import require_file
from workflow.strict_schema import first_mistake, reason

SCHEMA = Path(__file__).parent.parent / "schemas" / "rates.schema.yaml"
PACKAGED = Path(__file__).parent / "rates.json"
"""Rates that come with the package."""

VERSION = 1

ASSUMED_SHARE = 0.5
"""What is taken for `Rates.serial_share` where it was not measured."""


@dataclass(frozen=True)
class Law:
    """A quantity of a solver run: factor x unknowns^unknowns x modes^modes.

    Examples
    --------
    >>> Law(2.0, 1.5, 1.0)(100, 3)
    6000.0
    """

    factor: float
    unknowns: float
    modes: float

    def __call__(self, unknowns: float, modes: float) -> float:
        return float(self.factor * unknowns**self.unknowns * modes**self.modes)


@dataclass(frozen=True)
class Cost:
    """Seconds on one core and memory [MB] of a solver run, beyond those of one without work."""

    seconds: Law
    memory_mb: Law


@dataclass(frozen=True)
class Rates:
    """What was measured, see `workflow/schemas/rates.schema.yaml`.

    Attributes
    ----------
    made : where and when.
    numbers, fits_per_second : costs by name.
    measured_share : share of a solver run that more cores do not shorten, if that was measured.
    laws : costs of solver runs by name.
    up_to : largest sizes that were measured.
    how : how, in a sentence for each kind.
    """

    made: Mapping[str, Any]
    numbers: Mapping[str, float]
    measured_share: float | None
    fits_per_second: Mapping[str, float]
    laws: Mapping[str, Cost]
    up_to: Mapping[str, int]
    how: Mapping[str, str]

    @property
    def origin(self) -> str:
        """Machine, commit and date in a line."""
        made = self.made
        return (
            f"{made['processor']}, {made['cores']} cores, {made['memory_gb']:.0f} GB, "
            f"{made['blas']}, commit {made['commit']}, {made['date']}"
        )

    @property
    def unmeasured(self) -> str:
        """One sentence if it is not known how far more cores help; else empty."""
        if self.measured_share is not None:
            return ""
        return (
            f"the machine was too busy, load {self.made['load']:g} on {self.made['cores']} cores, "
            f"to measure how far more cores shorten a solver run; {ASSUMED_SHARE:.0%} of it is "
            "taken to stay as it is"
        )

    @property
    def serial_share(self) -> float:
        """Share of a solver run on one core that more cores do not shorten."""
        return ASSUMED_SHARE if self.measured_share is None else self.measured_share


def rates_of(values: Mapping[str, Any], where: str) -> Rates:
    """Rates from the plain values of their file.

    Raises
    ------
    UserError
        With one sentence about the first value that does not fit; `where` begins it.
    """
    schema = yaml.safe_load(SCHEMA.read_text())
    mistake = first_mistake(schema, values)
    if mistake is not None:
        place = ".".join(map(str, mistake.absolute_path)) or "contents"
        raise UserError(
            f"{where}: {place}: {reason(mistake)}; expected rates made by "
            "python -m workflow estimate --measure --rates FILE"
        )
    laws = {
        name: Cost(Law(**cost["seconds"]), Law(**cost["memory_mb"]))
        for name, cost in values["laws"].items()
    }
    return Rates(
        values["made"],
        values["numbers"],
        values["serial_share"],
        values["fits_per_second"],
        laws,
        values["up_to"],
        values["how"],
    )


def load_rates(path: str | Path = PACKAGED) -> Rates:
    """Read a file of rates.

    Raises
    ------
    UserError
        If it cannot be read, is no JSON, or holds anything else.
    """
    try:
        values = json.loads(require_file(path, "rates (JSON)").read_text())
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({cause(error)}), expected rates") from None
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: is no JSON ({error}); measure the rates again") from None
    return rates_of(values, str(path))


def save_rates(path: str | Path, values: Mapping[str, Any]) -> None:
    """Write the plain values of rates atomically."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(values, indent=2) + "\n")
