"""Constants of the objective `calibrated`, fitted once to spectra of random solids.

They are few: per class of void patterns one factor for every set of octants that the pattern's
symmetries exchange, two exponents, one share of lumped mass, and Poisson's ratio of the fits.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError

FILE = "calibration.json"
"""Beside this module; `carillon calibrate` of version 0.1 wrote it."""


@dataclass(frozen=True)
class Calibration:
    """What `calibrated` multiplies the computed moduli with."""

    factors: Array
    """(256, 8) factors on the moduli of a block of one material, by void pattern; rows of patterns
    that are not the least of their class under the cube's symmetries are not used."""
    galerkin_filled: float
    galerkin_void: float
    """Exponent of Galerkin's answer to contrast in blocks without and with void cells; the rest is
    the answer of `oversampled`."""
    lumped_share: float
    """Share of row-sum lumped mass in coarse cells whose octants are all filled."""
    poisson: float
    """Poisson's ratio that blocks are fitted at, whatever that of the solid."""
    ratios: tuple[float, float]
    """Least and largest Poisson's ratio of the solids that these moduli are for."""
    provenance: dict[str, Any]
    """How the constants were found."""


def parse(content: Mapping[str, Any]) -> Calibration:
    """Calibration from the content of its JSON file.

    Raises UserError if an entry is missing or not a positive number.
    """
    try:
        factors = np.ones((256, 8))
        for mask, row in content["factors"].items():
            factors[int(mask)] = row
        share, poisson = content["galerkin_share"], content["poisson"]
        return Calibration(
            factors,
            float(share["filled"]),
            float(share["partly_void"]),
            float(content["lumped_share"]),
            float(poisson["fitted"]),
            (float(poisson["least"]), float(poisson["largest"])),
            dict(content.get("provenance", {})),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(
            f"calibration: {error!r} is missing or not a number; take {FILE} of this version"
        ) from None


@cache
def default_calibration() -> Calibration:
    """The calibration that belongs to this version."""
    return parse(json.loads(resources.files(__package__).joinpath(FILE).read_text()))
