"""An image for containers is made by the script that makes a clean root, and by nothing else."""

import os
import re
import shutil

import pytest

from tests.programs import CHECKOUT, run

RECIPE = "workflow/envs/image.sh"
DEFINITION = CHECKOUT / "slurm" / "carillon.def"


def section(name: str) -> list[str]:
    """Commands of a section of the definition file."""
    found = re.search(rf"^%{name}\n(.*?)(?=^%|\Z)", DEFINITION.read_text(), re.M | re.S)
    assert found, f"no section {name}"
    lines = map(str.strip, found[1].splitlines())
    return [line for line in lines if line and not line.startswith("#")]


def test_the_definition_file_and_the_clean_root_do_what_the_recipe_does():
    assert section("post") == [f"bash /opt/carillon/{RECIPE}"]
    assert f"bash {RECIPE} && " in (CHECKOUT / ".ci" / "bare-root").read_text()


def test_the_recipe_is_the_environment_and_its_kernels():
    commands = (CHECKOUT / RECIPE).read_text().splitlines()
    done = [line for line in commands if not line.startswith(("#", "set ", "cd "))]
    assert done == ["bash workflow/envs/setup.sh", ".venv/bin/carillon compile"]


def test_the_image_holds_what_is_committed(tmp_path):
    """Here with a folder in the place of the image's root."""
    if not shutil.which("git") or run("git", "-C", CHECKOUT, "rev-parse", "HEAD").returncode:
        pytest.skip("this checkout is no repository of git")
    root = {**os.environ, "APPTAINER_ROOTFS": str(tmp_path)}
    commands = "\n".join(["set -e", *section("setup")])
    run("sh", "-c", commands, cwd=CHECKOUT, env=root, check=True)
    inside = tmp_path / "opt" / "carillon"
    committed = run("git", "-C", CHECKOUT, "ls-tree", "-r", "--name-only", "HEAD", check=True)
    assert {str(path.relative_to(inside)) for path in inside.rglob("*") if path.is_file()} == set(
        committed.stdout.splitlines()
    )


def test_programs_of_the_image_are_found_by_name():
    assert section("environment")[0] == "export PATH=/opt/carillon/.venv/bin:$PATH"
    assert section("runscript") == ['exec carillon "$@"']
    assert section("test") == ["carillon environment"]
