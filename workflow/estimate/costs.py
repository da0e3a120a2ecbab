"""What jobs take: medians of earlier runs, scaled by one plain law a kind of jobs."""

import math
import re
import shlex
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.fem.geometry import hexmesh_from_voxels, load_surface, voxelize
from carillon.processes.threads import allowed_cores
from solver.rank_scaling import ALONE, speed_up, thread_speed_up
from workflow import settings
from workflow.estimate.jobs import RESULTS, plan

PACKAGED = Path(__file__).with_name("measured.csv")
"""Medians of a run with the preset `laptop` and one with `tiny`, on two cores of an AMD EPYC, and
for `generate_shard`, `grow_tree` and `train_forests` jobs of 200,000 samples and of a million with
45,000 leaves, on one core, since the runs' own do little but start."""
START = 1.5
"""Time that a job of any kind takes to start [s]."""
OTHER_SECONDS = 4.0
"""Time of a job without a benchmark file, such as one that draws a picture [s]."""
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


FIT_MICROSECONDS, SAMPLE_MICROSECONDS = 12.0, 1.0
"""Processor time of a fit by the default objective, and of reading and preparing a sample."""
ROW_MICROSECONDS, LEAF_MICROSECONDS = 1.0, 80.0
"""Processor time of growing a tree, for each row of both kinds and for each leaf."""


class Law(NamedTuple):
    """Stage of a kind of jobs, and how their time and their files grow.

    Parameters
    ----------
    time, files
        Power of every size, which are numbers of the job's command by their option and `unknowns`
        of its solid.
    shared
        Whether twice the cores take half the time.
    ranked
        Whether ranks and their threads shorten the time as `solver.rank_scaling` says; a job that
        is neither takes the same time on more cores.
    """

    stage: str
    time: dict[str, float] = {}
    files: dict[str, float] = {}
    shared: bool = False
    ranked: bool = False


_OTHERS = Law("tables, pictures, report")
_VARIANTS = "HCMS and other variants"
_SOLVE = {"unknowns": 1.2, "modes": 0.6}
_READ = {"unknowns": 1.0, "modes": 0.6}
LAWS = {
    "generate_shard": Law("data generation", {"fits": 1.0}, {"samples": 1.0}, True),
    "describe_shard": Law("data generation", {"samples": 0.5}),
    "grow_tree": Law("growing trees", {"growing": 1.0}, {"leaves": 1.0}, True),
    "train_forests": Law("fitting leaves", {"fitting": 1.0}, {"leaves": 1.0}, True),
    "rate_forests": Law("errors on single blocks", {"blocks": 0.75, "materials": 1.0}),
    "find_modes": Law(_VARIANTS, _SOLVE, {"unknowns": 1.0, "modes": 1.0}, ranked=True),
    "find_modes truth": Law("ground truth", _SOLVE, {"unknowns": 1.0, "modes": 1.0}, ranked=True),
    "follow_convergence": Law(_VARIANTS, _SOLVE | {"steps": 0.8}, ranked=True),
    "time_methods": Law(_VARIANTS, _SOLVE | {"runs": 1.0, "tune": 1.0}, ranked=True),
    "measure_scaling": Law(_VARIANTS, _SOLVE | {"ranks": 1.0, "weak": 1.0}),
    "compare_with_truth": Law(_OTHERS.stage, _READ),
    "audit_spectra": Law("validation", _READ),
    "strike_solid": Law("validation", _READ, {"unknowns": 0.5}),
    "validate_model": Law("validation"),
}
"""Laws by kind, or by rule for all variants; jobs of any other take the same time at any size."""
STAGES = list(dict.fromkeys(law.stage for law in LAWS.values()))


def with_work(jobs: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """The jobs of `plan` with their `stage`, and what their time and their files grow with.

    `work` and `content` have no unit; `kind` is that of a rule that others are made from. By
    `rank_speed_up` and `speed_up` a solve is faster than on one rank, and than on one core.
    """
    kinds = jobs["kind"].str.replace("_(in_full|of_run)$", "", regex=True)
    laws = [LAWS.get(kind, LAWS.get(kind.split(" ")[0], _OTHERS)) for kind in kinds]
    sizes = [_sizes(job, config) for job in jobs.itertuples()]
    gains = [
        _gains(job.cores, job.ranks, each) if law.ranked else (1.0, 1.0)
        for law, job, each in zip(laws, jobs.itertuples(), sizes)
    ]
    shares = [cores if law.shared else 1 for law, cores in zip(laws, jobs["cores"])]
    return jobs.assign(
        kind=kinds,
        stage=[law.stage for law in laws],
        work=[_product(law.time, each) / n for law, each, n in zip(laws, sizes, shares)],
        content=[_product(law.files, each) for law, each in zip(laws, sizes)],
        rank_speed_up=[by_ranks for by_ranks, _ in gains],
        speed_up=[by_ranks * by_threads for by_ranks, by_threads in gains],
    )


def load_medians(folders: Iterable[str | Path] = ()) -> pd.DataFrame:
    """Medians by kind of `work` and its `seconds`, of `content` and the `megabytes` of its files.

    `speed_up` is that of the ranks and threads which the work was measured on. Those of former
    results in `folders` replace the packaged ones.

    Raises UserError if a folder holds no results of a run.
    """
    packaged = pd.read_csv(PACKAGED, index_col="kind")
    own = [_finished_jobs(Path(folder)) for folder in folders]
    if not own:
        return packaged
    medians = pd.concat(own).groupby("kind")[list(packaged)].median()
    return medians.combine_first(packaged)[list(packaged)]


def with_costs(jobs: pd.DataFrame, medians: pd.DataFrame) -> pd.DataFrame:
    """The jobs of `with_work` with `known`, `core_hours`, `hours`, `memory_gb`, `kept_gb`.

    `times` is their work over that of the median; its seconds count by what ranks and threads make
    of it there and here. A job that is not known takes a few seconds, or the limit of its rule if
    that has one.
    """
    of_kind = medians.reindex(jobs["kind"]).set_index(jobs.index)
    times = jobs["work"] / of_kind["work"]
    slower = times * of_kind["speed_up"] / jobs["speed_up"]
    seconds = START + (of_kind["seconds"] - START).clip(lower=0.0) * slower
    limits = (60.0 * jobs["minutes"].astype(float)).fillna(OTHER_SECONDS)
    hours = seconds.fillna(limits) / 3600.0
    megabytes = of_kind["megabytes"] * jobs["content"] / of_kind["content"]
    return jobs.assign(
        known=seconds.notna() | jobs["minutes"].isna(),
        times=times,
        hours=hours,
        core_hours=hours * jobs["cores"],
        memory_gb=jobs["memory_mb"].astype(float).fillna(0.0) / 1000.0,
        kept_gb=megabytes.fillna(0.0) / 1000.0,
    )


def _finished_jobs(folder: Path) -> pd.DataFrame:
    """The jobs of a run with benchmark files in its folder of results, and what they took."""

    def below(name: str) -> Path:
        return folder / Path(name).relative_to(RESULTS)

    config = settings.complete([folder / "config.yaml"])
    jobs = with_work(plan(config, allowed_cores()), config)
    jobs = jobs[[bool(name) and below(name).is_file() for name in jobs["benchmark"]]]
    if jobs.empty:
        raise UserError(f"{folder}: holds no benchmark files, expected results of a run")
    files = [[file for file in map(below, names) if file.is_file()] for names in jobs["outputs"]]
    return jobs.assign(
        seconds=[benchmarked_seconds(below(name)) for name in jobs["benchmark"]],
        megabytes=[sum(file.stat().st_size for file in each) / 1e6 for each in files],
    )


def benchmarked_seconds(file: Path) -> float:
    """Wall time of a job by its benchmark file [s].

    Raises UserError if it is none.
    """
    try:
        return float(pd.read_csv(file, sep="\t", nrows=1)["s"].iloc[0])
    except (ValueError, LookupError, OSError):
        raise UserError(f"{file}: expected a benchmark file of Snakemake") from None


def _gains(cores: int, ranks: int, sizes: Mapping[str, float]) -> tuple[float, float]:
    """How many times as fast a solve is by its ranks, as far as they have cores, and by threads."""
    ranks = min(ranks, cores)
    unknowns, modes = sizes.get("unknowns", 1.0), sizes.get("modes", 1.0)
    by_ranks = speed_up(unknowns, modes, ranks, ALONE * unknowns)
    return by_ranks, thread_speed_up(cores // ranks)


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
    return sizes | _training_sizes(config)


def _training_sizes(config: Mapping[str, Any]) -> dict[str, float]:
    """Samples and leaves of the run's own forests, and processor time of training them [us]."""
    dataset, forests = config["dataset"], config["forests"]
    samples, fit = float(dataset["samples"]), FIT_COSTS[dataset["objective"]]
    of_shard = samples / len(dataset["distributions"]) / dataset["shards"]
    rows = min(ORIGINS * samples, float(forests["structure_rows"]))
    leaves = min(forests["max_leaves"], rows / forests["min_leaf"] / 2.0)
    made = 0.0 if dataset["store"] else FIT_MICROSECONDS * fit
    per_sample = SAMPLE_MICROSECONDS + made
    return {
        "samples": of_shard,
        "fits": of_shard * fit,
        "leaves": leaves,
        "growing": rows * (ROW_MICROSECONDS + per_sample / ORIGINS) + leaves * LEAF_MICROSECONDS,
        "fitting": samples * (per_sample + ORIGINS * forests["trees"] * _adding(leaves)),
    }


def _adding(leaves: float) -> float:
    """Processor time of adding a row to its leaf [us]: 0.14 of 45,000 leaves, 0.3 of a million.

    The more leaves there are, the fewer of their sums are in the processor's caches.
    """
    return 0.01 * float(leaves) ** 0.25


def option_sizes(command: str) -> dict[str, float]:
    """Numbers of a shell command by option: of a list its length, of an option alone 2.

    Examples
    --------
    >>> option_sizes("python -m solver scaling --modes 8 --ranks 1,2 --weak > log")
    {'modes': 8.0, 'ranks': 2.0, 'weak': 2.0}
    """
    sizes = {}
    for name, value in re.findall(r" --([a-z-]+)(?: ([^\s>-]\S*))?", command):
        try:
            sizes[name] = max(1.0, float(value))
        except ValueError:
            sizes[name] = 1.0 + value.count(",") if value else 2.0
    return sizes


@cache
def unknowns(mesh: str, resolution: int) -> float:
    """Unknowns of a solid on `resolution` voxels along its longest side, from a coarse count.

    Raises UserError if the file of the mesh cannot be read.
    """
    if not mesh.startswith(BUILTIN_PREFIX) and not Path(mesh).is_file():
        return TYPICAL * resolution**3
    surface, counted = load_surface(mesh, is_sheet=True), min(resolution, COUNTED)
    try:
        voxels = voxelize(surface, counted, "winding", "largest", mesh)
    except UserError:  # walls thinner than these voxels, or a surface that one follows
        return TYPICAL * resolution**3
    return float(hexmesh_from_voxels(voxels).n_dofs * (resolution / counted) ** 3)
