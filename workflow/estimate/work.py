"""How much work a job is, by one plain law a rule."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.fem.geometry import hexmesh_from_voxels, load_surface, voxelize
from workflow import settings

ORIGINS = 8
"""Rows of a sample, one for each corner of its block."""

TYPICAL = 0.8
"""Unknowns of a compact solid over the cube of its resolution, for a mesh that is absent."""

COUNTED = 24
"""Resolution up to which voxels are counted; beyond, their number grows with its cube."""

FIT_COSTS = {
    "energy": 12.6,
    "chen2015": 1.76,
    "inertial": 1.02,
    "oversampled": 1.0,
    "hybrid": 0.97,
    "factored": 0.97,
    "calibrated": 1.0,
    "sampled-energy": 600.0,
}
"""Time of a fit by objective, in units of a fit with the default objective `calibrated`."""


class Law(NamedTuple):
    """Stage of a rule's jobs, and how their time and their files grow.

    Parameters
    ----------
    time, files
        Power of every size, which are numbers of the job's command by their option and `unknowns`
        of its solid.
    shared
        Whether twice the cores take half the time; other jobs take the same time on more cores.
    """

    stage: str
    time: dict[str, float] = {}
    files: dict[str, float] = {}
    shared: bool = False


OTHERS = "tables, pictures, report"
_VARIANTS = "HCMS and other variants"
_SOLVE = {"unknowns": 1.2, "modes": 0.6}
_READ = {"unknowns": 1.0, "modes": 0.6}
LAWS = {
    "generate_shard": Law("data generation", {"fits": 1.0}, {"samples": 1.0}, True),
    "describe_shard": Law("data generation", {"samples": 0.5}),
    "train_forests": Law("growing trees", {"rows": 0.9, "trees": 1.0}, {"rows": 0.5}, True),
    "rate_forests": Law("errors on single blocks", {"blocks": 0.75, "materials": 1.0}),
    "find_modes": Law(_VARIANTS, _SOLVE, {"unknowns": 1.0, "modes": 1.0}),
    "find_modes truth": Law("ground truth", _SOLVE, {"unknowns": 1.0, "modes": 1.0}),
    "follow_convergence": Law(_VARIANTS, _SOLVE | {"steps": 0.8}),
    "time_methods": Law(_VARIANTS, _SOLVE | {"runs": 1.0, "tune": 1.0}),
    "measure_scaling": Law(_VARIANTS, _SOLVE | {"ranks": 1.0, "weak": 1.0}),
    "compare_with_truth": Law(OTHERS, _READ),
    "audit_spectra": Law("validation", _READ),
    "strike_solid": Law("validation", _READ, {"unknowns": 0.5}),
    "validate_model": Law("validation"),
}
"""Laws by rule, or by rule and variant."""

STAGES = list(dict.fromkeys(law.stage for law in LAWS.values()))


def law_of(kind: str, variant: str = "") -> Law:
    """The law of a kind of jobs; those of any other take the same time whatever their sizes."""
    return LAWS.get(f"{kind} {variant}", LAWS.get(kind, Law(OTHERS)))


def with_work(jobs: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """The jobs of `plan` with their kind, their stage and the sizes that time and files go by.

    Columns added are `kind`, the rule that such jobs are measured by; `stage`; `work` and
    `content`, without a unit, in proportion to which time and files grow.
    """
    kinds = jobs["rule"].str.replace("_(in_full|of_run)$", "", regex=True)
    laws = list(map(law_of, kinds, jobs["variant"]))
    sizes = [_sizes(job, config) for job in jobs.itertuples()]
    shares = [cores if law.shared else 1 for law, cores in zip(laws, jobs["cores"])]
    return jobs.assign(
        kind=kinds,
        stage=[law.stage for law in laws],
        work=[_product(law.time, each) / n for law, each, n in zip(laws, sizes, shares)],
        content=[_product(law.files, each) for law, each in zip(laws, sizes)],
    )


def _product(powers: Mapping[str, float], sizes: Mapping[str, float]) -> float:
    return math.prod(sizes.get(name, 1.0) ** power for name, power in powers.items())


def _sizes(job: Any, config: Mapping[str, Any]) -> dict[str, float]:
    """Sizes of a job by name: numbers of its command, and those of the model that it reads."""
    sizes, words = option_sizes(job.command), shlex.split(job.command)
    if "resolution" in sizes:
        mesh = words[words.index("study" if "study" in words else "solver") + 2]
        sizes["unknowns"] = unknowns(mesh, int(sizes["resolution"]))
    elif job.model in config["models"]:
        model = config["models"][job.model]
        mesh = settings.located(config, model["mesh"])
        sizes["unknowns"] = unknowns(mesh, model["resolution"])
        sizes["modes"] = float(model["modes"] or config["solver"]["modes"])
    dataset = config["dataset"]
    samples = float(dataset["samples"])
    sizes["samples"] = samples / dataset["shards"]
    sizes["fits"] = sizes["samples"] * FIT_COSTS[dataset["objective"]]
    rows = ORIGINS * samples * len(dataset["distributions"])
    sizes["rows"] = min(rows, float(config["forests"]["structure_rows"]))
    return sizes


def option_sizes(command: str) -> dict[str, float]:
    """Numbers of a shell command by option: of a list its length, of an option alone 2.

    Examples
    --------
    >>> option_sizes("python -m solver scaling --modes 8 --ranks 1,2 --weak > log")
    {'modes': 8.0, 'ranks': 2.0, 'weak': 2.0}
    """
    options = re.findall(r" --([a-z-]+)(?: ([^\s>-]\S*))?", command)
    return {name: _number(value) for name, value in options}


def _number(value: str) -> float:
    """An option's number, the length of its list, or 2 if it stands alone."""
    try:
        return max(1.0, float(value))
    except ValueError:
        return 1.0 + value.count(",") if value else 2.0


@cache
def unknowns(mesh: str, resolution: int) -> float:
    """Unknowns of a solid on `resolution` voxels along its longest side, from a coarse count.

    Raises
    ------
    UserError
        If the file of the mesh cannot be read.
    """
    if not mesh.startswith(BUILTIN_PREFIX) and not Path(mesh).is_file():
        return TYPICAL * resolution**3
    surface, counted = load_surface(mesh), min(resolution, COUNTED)
    try:
        voxels = voxelize(surface, counted, "winding", "largest", mesh)
    except UserError:  # walls thinner than these voxels
        return TYPICAL * resolution**3
    return float(hexmesh_from_voxels(voxels).n_dofs * (resolution / counted) ** 3)
