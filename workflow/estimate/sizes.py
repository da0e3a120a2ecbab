"""What decides how long a job takes: the sizes of its work, read from its command."""

from __future__ import annotations

import re
import shlex
from collections import defaultdict
from collections.abc import Mapping

import pandas as pd

from solver.coarsening.forest import FOREST
from solver.refinement.work import is_clearly_less
from workflow.estimate.solids import NamedSolid, is_followed, size_of

ORIGINS = 8
"""Rows of a sample, one for each corner of the block."""

LEAST_LEAF = 4
"""Rows of a leaf of a tree that ends for want of rows, as a multiple of `min_leaf`."""


def options_of(command: str) -> dict[str, str]:
    """First values of a command's options by name; an option without one has an empty text.

    Examples
    --------
    >>> options_of("python -m solver scaling --modes 8 --ranks 1,2 --weak > log")
    {'modes': '8', 'ranks': '1,2', 'weak': ''}
    """
    pairs = re.findall(r" --([a-z-]+)(?: ([^\s>-]\S*))?", command)
    return {name.replace("-", "_"): value for name, value in pairs}


def solid_of(command: str) -> NamedSolid | None:
    """The solid that a command divides into voxels or cells, if it does."""
    options = options_of(command)
    if "resolution" not in options:
        return None
    words = shlex.split(command)
    names = ("fill", "components", "discretisation")
    how = {name: options[name] for name in names if name in options}
    return NamedSolid(words[words.index("solver") + 2], int(options["resolution"]), **how)


def is_solved_in_full(command: str) -> bool:
    """Whether a command that coarsens a solid solves the fine one at once, as it decides itself."""
    options, solid = options_of(command), solid_of(command)
    if solid is None or options.get("coarsen") != FOREST or solid.discretisation != "voxel":
        return False
    if "refine_to" in options and float(options["refine_to"]) == 0.0:
        return False
    if not is_followed(solid, options["material"], int(options.get("seed", 0))):
        return True
    size = size_of(solid)
    return not is_clearly_less(size.fine, size.coarse, int(options["modes"]), options["method"])


def sizes_of(jobs: pd.DataFrame, fits_per_second: Mapping[str, float]) -> list[dict[str, float]]:
    """Sizes of every job of `plan` by name, see `rules.yaml`; one that it has not is 1."""
    made: dict[str, dict[str, float]] = {}
    result = []
    for job in jobs.itertuples():
        options, solid = options_of(job.command), solid_of(job.command)
        read = [made[file] for file in job.inputs if file in made]
        sizes: dict[str, float] = defaultdict(lambda: 1.0)
        for name in ("unknowns", "modes"):
            sizes[name] = max((each[name] for each in read), default=1.0)
        sizes["rows"] = ORIGINS * sum(each["samples"] for each in read if "samples" in each)
        sizes |= {name: _number(value) for name, value in options.items()}
        if solid is not None:
            sizes["unknowns"] = size_of(solid).fine
        if "samples" in sizes:
            sizes["samples"] /= sizes["shards"]
            sizes["fits"] = sizes["samples"] / fits_per_second[options["objective"]]
        if "structure_rows" in sizes:
            sizes["structure_rows"] = min(sizes["structure_rows"], sizes["rows"])
            enough = sizes["structure_rows"] / (LEAST_LEAF * sizes["min_leaf"])
            sizes["leaves"] = max(2.0, min(sizes["max_leaves"], enough))
        result.append(sizes)
        made |= dict.fromkeys(job.outputs, sizes)
    return result


def _number(value: str) -> float:
    """Size that an option is: its number, the length of its list, 2 if it stands alone."""
    try:
        return max(1.0, float(value))
    except ValueError:
        return 1.0 + value.count(",") if value else 2.0
