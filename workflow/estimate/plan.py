"""The jobs of a configuration, from Snakemake's dry run where nothing is done yet."""

from __future__ import annotations

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
    """Jobs of a complete configuration in an order in which they can run; meshes may be absent.

    Columns are `rule`, `variant` (of a model's modes, or empty), `model` (or empty) and `target`;
    `cores`; `memory_mb` and `minutes`, the limits if there are any; `command` (of a shell, or
    empty); `outputs` and `benchmark`, its files below the folder `results`.

    Parameters
    ----------
    cores_per_node
        What jobs of a cluster get, unless the configuration says.
    cores
        All cores, which several ranks may share; more than those of a node on a cluster.

    Raises
    ------
    UserError
        If the rules do not accept the configuration.
    """
    with TemporaryDirectory() as folder:
        values, meshes = _placeless(config, Path(folder))
        if cores is not None and cores > cores_per_node:
            values["solver"]["cores"] = config["solver"]["cores"] or cores_per_node
        file = Path(folder, "config.json")
        file.write_text(json.dumps(values))
        # Snakemake alters the process that it runs in; a fork has loaded most of it already.
        with ProcessPoolExecutor(1, mp_context=get_context("fork")) as process:
            jobs = pd.DataFrame(process.submit(_planned, file, cores or cores_per_node).result())
    for place, mesh in meshes.items():
        jobs["command"] = jobs["command"].str.replace(place, shlex.quote(mesh), regex=False)
    return jobs


def _placeless(config: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """The same configuration on files that are there, with the meshes by what stands for them."""
    values = copy.deepcopy(dict(config)) | {"results_dir": RESULTS, "baseline": None}
    meshes: dict[str, str] = {}
    for part in (values, *(values[section] for section in solids.studied(values))):
        for model in part["models"].values():
            # Of a material from a file is only known that it varies.
            if "material" in model and model["material"] not in MATERIALS:
                model["material"] = "smooth"
            if not model["mesh"].startswith(settings.BUILTIN_PREFIX):
                place = str(folder / f"mesh-{len(meshes)}.obj")
                meshes[place] = settings.located(config, model["mesh"])
                model["mesh"] = place
    forests = str(folder / "forests.h5")
    if values["forests"]["model"]:
        values["forests"]["model"] = forests
    for file in (forests, *meshes):
        Path(file).touch()
    return values, meshes


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
            {
                "rule": job.rule.name,
                "variant": job.wildcards_dict.get("variant", ""),
                "model": job.wildcards_dict.get("model", ""),
                "target": TARGETS[job not in needed],
                "cores": job.threads,
                "memory_mb": job.resources.get("mem_mb"),
                "minutes": job.resources.get("runtime"),
                "command": job.shellcmd or "",
                "outputs": list(map(str, job.output)),
                "benchmark": str(job.benchmark or ""),
            }
            for level in dag.toposorted()
            for job in sorted(level, key=lambda job: (job.rule.name, list(job.output)))
            if job.output
        ]
