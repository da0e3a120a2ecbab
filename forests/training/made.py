"""Samples that a training draws and fits itself: how many, of which moduli, fitted how."""

import re
from collections.abc import Sequence
from dataclasses import fields
from typing import Annotated, Any

from carillon.errors import UserError
from carillon.fem.element import DEFAULT_POISSON
from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import Count, Number, PoissonRatio
from dataset_gen.objectives import DATASET_OBJECTIVES, DEFAULT_OBJECTIVE
from dataset_gen.sampling import DISTRIBUTIONS
from dataset_gen.settings import Settings, ShardOptions, settings_of
from forests.training.dataset import Dataset, made_dataset, open_dataset

_COUNT = re.compile(r"[0-9]{1,19}(\.[0-9]{1,19})?(e\+?[0-9]{1,2})?", re.ASCII | re.IGNORECASE)


def whole_number(text: str) -> int:
    """A count such as 1250000000 or 1.25e9.

    Raises ValueError if it is no whole number.

    Examples
    --------
    >>> whole_number("1.25e9"), whole_number("3000")
    (1250000000, 3000)
    """
    if _COUNT.fullmatch(text) and float(text).is_integer():
        return int(text) if text.isdigit() else int(float(text))
    raise ValueError(f"found {text!r:.60}, expected a whole number such as 3000 or 1.25e9")


@parameters
class SampleOptions:
    """Samples that are made where they are used, in the place of shards."""

    samples: Count | None = option(
        None,
        "samples to make where they are used, in the place of shards, such as 1.25e9; they are the "
        "ones that generate writes",
        read=whole_number,
    )
    data_seed: Number | None = option(None, "of these samples (that of the splits)")
    objective: Annotated[str, OneOf(*DATASET_OBJECTIVES)] = option(
        DEFAULT_OBJECTIVE, "of their fits"
    )
    poisson: PoissonRatio = option(
        DEFAULT_POISSON,
        "Poisson's ratio of the solids; calibrated serves 0 to 0.49 by one fit",
    )
    distributions: tuple[str, ...] = option(
        ("uniform",),
        "distributions of their moduli, which share the samples: uniform or log-uniform (default "
        "uniform), with another range [GPa] as uniform:0:20",
    )

    def parts(self, seed: int) -> list[Settings]:
        """Settings of the samples of each distribution, `seed` being that of the splits.

        Raises UserError if there are no samples, a distribution is unknown or named twice, or its
        range is impossible.
        """
        if self.samples is None:
            raise UserError(
                "no training data: found neither shards nor --samples; name the shards that "
                "generate has written, or how many samples to make"
            )
        if self.samples < len(self.distributions):
            raise UserError(
                f"{self.samples} samples of {len(self.distributions)} distributions: expected at "
                "least one of each"
            )
        share, left = divmod(self.samples, len(self.distributions))
        parts = [
            settings_of(
                ShardOptions(
                    share + (number < left),
                    seed if self.data_seed is None else self.data_seed,
                    objective=self.objective,
                    poisson=self.poisson,
                    **_range_of(words),
                )
            )
            for number, words in enumerate(self.distributions)
        ]
        for number, part in enumerate(parts):
            if part.moduli in [other.moduli for other in parts[:number]]:
                raise UserError(
                    f"distribution {self.distributions[number]!r} is there twice; name each once"
                )
        return parts


SAMPLE_NAMES = tuple(field.name for field in fields(SampleOptions))
"""Names of what can be said of samples."""


def training_data(
    shards: Sequence[str], made: SampleOptions, seed: int, own: slice = slice(None)
) -> Dataset:
    """The shards as one dataset, or else samples that are made where they are used.

    `seed`: of the splits; `own`: shards that are checked whole, see `open_dataset`. Raises
    UserError if there are both or none, or they cannot be used.
    """
    if not shards:
        return made_dataset(made.parts(seed))
    if made.samples is not None:
        raise UserError(
            f"found {len(shards)} shards and {made.samples:,} samples to make, expected one of both"
        )
    for name in SAMPLE_NAMES:
        if getattr(made, name) != getattr(SampleOptions(), name):
            raise UserError(
                f"found shards and {name.replace('_', '-')} {getattr(made, name)}, which is for "
                "samples that are made where they are used; leave it out, as shards have their own"
            )
    return open_dataset(shards, own)


def _range_of(words: str) -> dict[str, Any]:
    name, *ends = words.split(":")
    try:
        low, high = map(float, ends) if ends else (None, None)
    except ValueError:
        low = high = None
        name = words
    if name not in DISTRIBUTIONS:
        raise UserError(
            f"distribution {words!r:.60}: expected {' or '.join(DISTRIBUTIONS)}, or with a range "
            "in GPa as uniform:0:20"
        )
    return {"distribution": name, "low": low, "high": high}
