"""What a shard is made of: the settings that decide about its rows, and nothing else."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from carillon import __version__
from carillon.errors import UserError
from carillon.fem import block, element
from carillon.fem.element import DEFAULT_POISSON
from carillon.parameters import REQUIRED, OneOf, option, parameters
from carillon.parameters.quantities import Count, NonNegative, Number, PoissonRatio, Positive
from dataset_gen import objectives, sampling
from dataset_gen.objectives import (
    DATASET_OBJECTIVES,
    DEFAULT_OBJECTIVE,
    fitted_at,
    require_objective,
    require_poisson,
)
from dataset_gen.sampling import DISTRIBUTIONS, Moduli, moduli, shard_range

SEED_BITS = 63
"""Seeds fit into a signed integer of the file format."""

_ROW_MAKERS = (
    Path(block.__file__),
    Path(element.__file__),
    Path(sampling.__file__),
    Path(objectives.__file__).parent,
)
"""Files and folders that samples and fits come from."""


@cache
def code_of_rows() -> str:
    """Short SHA-256 of the code and constants that samples and fits come from.

    Rows of one version of Carillon may still change while it is being worked on.
    """
    digest = hashlib.sha256()
    for path in _ROW_MAKERS:
        for file in sorted(path.iterdir()) if path.is_dir() else [path]:
            if file.suffix in (".py", ".json"):
                digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:12]


@parameters
class ShardOptions:
    """One of several nearly equal shards of the first samples of a seed, and how to fit them."""

    samples: Count = option(REQUIRED, "of all shards")
    seed: Number = option(0, "of the samples")
    shard: Number = option(0, "number of this shard")
    shards: Count = option(1, "number of all shards")
    objective: Annotated[str, OneOf(*DATASET_OBJECTIVES)] = option(DEFAULT_OBJECTIVE, "of the fits")
    poisson: PoissonRatio = option(
        DEFAULT_POISSON, "Poisson's ratio of the solids; calibrated serves 0 to 0.49 by one fit"
    )
    distribution: Annotated[str, OneOf(*DISTRIBUTIONS)] = option("uniform", "of the fine moduli")
    low: NonNegative | None = option(None, "least modulus [GPa] (0 or 0.01)")
    high: Positive | None = option(None, "largest modulus [GPa] (10 or 1000)")


@dataclass(frozen=True)
class Settings:
    """Samples start..stop-1 of a seed, their moduli drawn in low..high [GPa], and how to fit them.

    `poisson` is the ratio of the fits, which `calibrated` has one of for all solids. Equal settings
    give equal rows on one kind of machine, however the work is divided.
    """

    objective: str
    poisson: float
    seed: int
    start: int
    stop: int
    distribution: str
    low: float
    high: float
    version: str
    code: str

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.stop - self.start

    @property
    def moduli(self) -> Moduli:
        """Where the fine moduli are drawn from."""
        return Moduli(self.distribution, self.low, self.high)

    def as_dict(self) -> dict[str, Any]:
        """Plain values by name."""
        return asdict(self)

    def difference(self, other: Settings) -> str | None:
        """The first setting that `other` has different, in words; None if there is none."""
        for name, mine in self.as_dict().items():
            theirs = other.as_dict()[name]
            if mine != theirs:
                return f"{_LABELS.get(name, name)} {mine} where {theirs} is asked for"
        return None


_LABELS = {
    "poisson": "Poisson's ratio",
    "start": "first sample",
    "stop": "samples up to",
    "low": "moduli from",
    "high": "moduli up to",
    "version": "Carillon",
    "code": "samples or fits by the code",
}


def settings_of(options: ShardOptions) -> Settings:
    """Settings of a shard.

    Raises UserError for an unknown objective or distribution, an impossible split, seed, range of
    moduli or Poisson's ratio.
    """
    require_objective(options.objective, DATASET_OBJECTIVES)
    require_poisson(options.objective, options.poisson)
    if not 0 <= options.seed < 1 << SEED_BITS:
        raise UserError(f"seed {options.seed}: expected 0 or more, and less than 2^{SEED_BITS}")
    drawn = moduli(options.distribution, options.low, options.high)
    start, stop = shard_range(options.samples, options.shard, options.shards)
    return Settings(
        objective=options.objective,
        poisson=fitted_at(options.objective, float(options.poisson)),
        seed=options.seed,
        start=start,
        stop=stop,
        distribution=drawn.distribution,
        low=drawn.low,
        high=drawn.high,
        version=__version__,
        code=code_of_rows(),
    )


def settings_from(values: Mapping[str, Any]) -> Settings:
    """Settings from the plain values of `Settings.as_dict`.

    Raises KeyError, TypeError, ValueError if a value is missing or no such value.
    """
    types = get_type_hints(Settings)
    return Settings(**{name: convert(values[name]) for name, convert in types.items()})
