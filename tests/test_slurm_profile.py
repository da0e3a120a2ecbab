"""Jobs go where the profile for SLURM says, by a site's names, and start ranks by what is there."""

import re
import sys
from pathlib import Path

import pytest
import yaml

from tests import slurm_cluster, slurm_standin
from tests.programs import checkout_environment, python
from tests.workflow_runs import CHECKOUT
from workflow import patient_slurm

PROFILE = (CHECKOUT / "slurm" / "config.yaml").read_text()
CONFIG = """\
models: {bar: {mesh: 'builtin:bar', resolution: 16}}
forests: {model: default}
"""
SITE = {"-p": "compute", "-A": "project", "-C": "zen4"}
"""Options of `sbatch` by which the names in the comments of the profile reach it."""


def test_the_profile_holds_no_names_until_they_are_written():
    assert set(yaml.safe_load(PROFILE)["default-resources"]) == {"mem_mb", "runtime"}


@pytest.mark.nightly(unless=("slurm", "workflow"))
def test_a_job_goes_where_the_profile_says(tmp_path):
    profile, slurm = tmp_path / "profile", tmp_path / "slurm"
    for folder in (profile, slurm):
        folder.mkdir()
    (profile / "config.yaml").write_text(re.sub("^( *)##", r"\1", PROFILE, flags=re.M))
    (tmp_path / "config.yaml").write_text(CONFIG)
    options = ["--profile", profile, *slurm_cluster.QUICK, "--retries", "0"]
    options += ["results/forests/table.json", "--configfile", "config.yaml"]
    done = python(
        *("-m", "snakemake", "-s", CHECKOUT / "Snakefile", *options),
        cwd=tmp_path,
        env={
            **slurm_standin.install(slurm, "idle"),
            "PYTHONPATH": str(CHECKOUT),
            patient_slurm.PAUSE: "0.2",
        },
    )
    (job,) = slurm_standin.submitted(slurm)
    found = {option: job[job.index(option) + 1] for option in SITE if option in job}
    assert found == SITE, done.stdout + done.stderr


@pytest.mark.nightly(unless=("slurm", "workflow"))
@pytest.mark.parametrize("launcher", ["srun --mpi=pmix", "mpiexec"])
def test_a_job_starts_ranks_by_srun_where_it_has_one(launcher, tmp_path):
    """An image for containers has none."""
    programs = tmp_path / "programs"
    programs.mkdir()
    for each in Path("/usr/bin").iterdir():
        if each.name != "srun":
            (programs / each.name).symlink_to(each)
    if launcher != "mpiexec":
        (programs / "srun").symlink_to("/usr/bin/true")
    (tmp_path / "config.yaml").write_text(CONFIG + "solver: {ranks: 2, cores: 2}\n")
    words = ("-n", "-p", "--cores", "2", "results/models/bar/hcms.h5", "--configfile")
    variables = {"PATH": f"{Path(sys.executable).parent}:{programs}", "SLURM_JOB_ID": "1"}
    done = python(
        *("-m", "snakemake", "-s", CHECKOUT / "Snakefile", *words, "config.yaml"),
        cwd=tmp_path,
        env=checkout_environment(**variables),
    )
    assert f" {launcher} -n 2 python -m mpi4py -m solver" in done.stdout, done.stderr
