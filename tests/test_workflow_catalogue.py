"""The workflow as Snakemake's catalogue of workflows lists it, and as its users deploy it."""

import shutil

import pytest
import yaml

from tests.programs import CHECKOUT
from tests.workflow_runs import LAPTOP, planned

SNAKEFILE = CHECKOUT / "workflow" / "Snakefile"
CONFIGURATION = CHECKOUT / "config" / "config.yaml"

DEPLOYED = """
configfile: "config/config.yaml"


module carillon:
    snakefile:
        "{snakefile}"
    config:
        config


use rule * from carillon
"""
"""A Snakefile such as `snakedeploy deploy-workflow` writes."""


@pytest.fixture
def deployment(tmp_path):
    """A folder with a configuration of its own that takes the rules from elsewhere."""
    (tmp_path / "workflow").mkdir()
    (tmp_path / "workflow" / "Snakefile").write_text(DEPLOYED.format(snakefile=SNAKEFILE))
    (tmp_path / "config").mkdir()
    shutil.copy(CONFIGURATION, tmp_path / "config")
    return tmp_path


def test_the_catalogue_finds_what_it_asks_for():
    usage = yaml.safe_load((CHECKOUT / ".snakemake-workflow-catalog.yml").read_text())["usage"]
    assert usage["software-stack-deployment"] == {"conda": False, "apptainer": False}
    assert (CHECKOUT / "config" / "README.md").read_text().startswith("# Configuration")
    assert {"snakemake", "workflow"} <= set((CHECKOUT / "README.md").read_text().lower().split())


def test_no_rule_deploys_software_as_the_catalogue_is_told():
    rules = [SNAKEFILE, *CHECKOUT.glob("workflow/rules/*.smk"), *CHECKOUT.glob("studies/*/*.smk")]
    lines = {line.strip() for file in rules for line in file.read_text().splitlines()}
    assert not {"conda:", "container:", "envmodules:"} & lines


def test_the_snakefile_is_no_link_as_git_hands_out_the_text_of_links():
    assert not SNAKEFILE.is_symlink()
    assert (CHECKOUT / "Snakefile").samefile(SNAKEFILE)


def test_the_configuration_of_a_deployment_is_that_of_the_default_run():
    assert CONFIGURATION.read_bytes() == LAPTOP.read_bytes()


def test_a_deployed_workflow_plans_the_jobs_of_the_default_run(deployment, run_cli, plan):
    assert planned(run_cli("snakemake", "--dry-run", "--cores", 2, cwd=deployment)) == plan()


def test_a_deployed_workflow_goes_by_its_own_configuration(deployment, run_cli):
    solid = "  a-bar: {mesh: builtin:bar, resolution: 16, material: smooth}"
    (deployment / "config" / "config.yaml").write_text(f"results_dir: mine\nmodels:\n{solid}\n")
    done = run_cli("snakemake", "--dry-run", "--cores", 2, cwd=deployment)
    assert "mine/figures/a-bar-overview.png" in done.stdout
    assert "frying-pan" not in done.stdout


def test_a_mistake_in_the_configuration_of_a_deployment_is_told_with_its_line(deployment, run_cli):
    (deployment / "config" / "config.yaml").write_text("title: x\nmodles: {}\n")
    done = run_cli("snakemake", "--dry-run", "--cores", 2, cwd=deployment)
    assert done.returncode != 0
    assert "config/config.yaml, line 2: " in done.stdout + done.stderr
