"""The jobs of a configuration, from Snakemake's dry run where nothing is done yet."""

import copy
import json
import shlex
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from carillon.errors import UserError, one_line
from carillon.fem.materials import NAMES as MATERIALS
from workflow import settings, solids

RESULTS = "results"
"""Folder of results of a planned run."""
TARGETS = ("all", "figures")
"""Targets of Snakemake that are estimated; what both need belongs to the first."""


def plan(config: Mapping[str, Any], cores_per_node: int, cores: int | None = None) -> pd.DataFrame:
    """Jobs of a complete configuration, whose meshes may be absent.

    Columns are `kind`, the rule, with the variant of a model's modes; `model` (or empty), `target`,
    `cores`, and `ranks` that share them; `memory_mb` and `minutes`, the limits if there are any;
    `command` (of a shell, or empty); `outputs` and `benchmark`, its files below the folder
    `results`.

    Raises UserError if the rules do not accept the configuration.

    Parameters
    ----------
    cores_per_node
        What jobs of a cluster get, unless the configuration says.
    cores
        All cores, which several ranks may share; more than those of a node on a cluster.
    """
    values = copy.deepcopy(dict(config)) | {"results_dir": RESULTS, "baseline": None}
    cores = cores or cores_per_node
    if cores > cores_per_node:
        values["solver"]["cores"] = config["solver"]["cores"] or cores_per_node
    meshes: dict[str, str] = {}
    with TemporaryDirectory() as folder:
        for part in (values, *(values[section] for section in solids.studied(values))):
            for model in part["models"].values():
                # Of a material from a file is only known that it varies.
                if "material" in model and model["material"] not in MATERIALS:
                    model["material"] = "smooth"
                if not model["mesh"].startswith(settings.BUILTIN_PREFIX):
                    empty = f"{folder}/mesh-{len(meshes)}.obj"
                    meshes[empty] = settings.located(config, model["mesh"])
                    model["mesh"] = empty
        forests = f"{folder}/forests.h5"
        if values["forests"]["model"]:
            values["forests"]["model"] = forests
        for path in (forests, *meshes):
            Path(path).touch()
        file = Path(folder, "config.json")
        file.write_text(json.dumps(values))
        # Snakemake alters the process that it runs in; a fork has loaded most of it already.
        with ProcessPoolExecutor(1, mp_context=get_context("fork")) as process:
            jobs = pd.DataFrame(process.submit(_planned, file, cores).result())
    for empty, mesh in meshes.items():
        jobs["command"] = jobs["command"].str.replace(empty, shlex.quote(mesh), regex=False)
    return jobs


def requested_memory(resources: Any) -> int | None:
    """Megabytes that SLURM is asked for by a job on all of its nodes, from Snakemake's resources.

    Examples
    --------
    >>> requested_memory({"mem_mb": 900, "mem_mb_per_cpu": 100, "tasks": 3, "cpus_per_task": 4})
    1200
    >>> requested_memory({"mem_mb": 900})
    900
    """
    of_core: int | None = resources.get("mem_mb_per_cpu")
    if of_core:
        return of_core * int(resources["tasks"]) * int(resources["cpus_per_task"])
    of_node: int | None = resources.get("mem_mb")
    return of_node


def _planned(file: Path, cores: int) -> list[dict[str, Any]]:
    from snakemake.api import SnakemakeApi
    from snakemake.exceptions import WorkflowError
    from snakemake.settings import types

    quiet = types.OutputSettings(quiet={types.Quietness.ALL})
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()), SnakemakeApi(quiet) as api:
        try:
            rules = api.workflow(
                types.ResourceSettings(cores=cores),
                types.ConfigSettings(configfiles=[file]),
                snakefile=settings.FOLDER / "Snakefile",
                workdir=file.parent,
            )
            rules.dag(types.DAGSettings(targets=set(TARGETS))).printd3dag()
        except WorkflowError as error:
            raise UserError(f"the jobs cannot be planned: {one_line(str(error))}") from None
        dag = rules._workflow.dag
        main = [job for job in dag.jobs if job.rule.name == TARGETS[0]]
        needed = set(dag.bfs(dag.dependencies, *main))
        return [
            described(job) | {"target": TARGETS[job not in needed]}
            for job in sorted(dag.jobs, key=lambda job: (job.rule.name, list(job.output)))
            if job.output
        ]


def described(job: Any) -> dict[str, Any]:
    """Columns of `plan` but the target, of a job of Snakemake's."""
    return {
        "kind": f"{job.rule.name} {job.wildcards_dict.get('variant', '')}".strip(),
        "model": job.wildcards_dict.get("model", ""),
        "cores": job.threads,
        "ranks": int(job.resources.get("tasks") or 1),
        "memory_mb": requested_memory(job.resources),
        "minutes": job.resources.get("runtime"),
        "command": job.shellcmd or "",
        "outputs": list(map(str, job.output)),
        "benchmark": str(job.benchmark or ""),
    }
