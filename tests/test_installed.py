"""A wheel of the checkout, installed elsewhere, is whole: commands, rules and data files."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import HANG_SECONDS

pytestmark = pytest.mark.nightly

CHECKOUT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with the wheel unpacked, as an installation has it."""
    folder = tmp_path_factory.mktemp("installed")
    pip = [sys.executable, "-m", "pip", "--quiet", "--no-input"]
    # From a copy: setuptools leaves its traces in the folder that it builds.
    copy = folder / "copy"
    files = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=CHECKOUT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    for name in filter(None, files.split("\0")):
        if (CHECKOUT / name).exists() and not name.startswith("tests/"):
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).write_bytes((CHECKOUT / name).read_bytes())
    for words in (
        ["wheel", "--no-deps", "--wheel-dir", folder, copy],
        ["install", "--no-deps", "--no-index", "--target", folder / "site"],
    ):
        wheels = [] if words[0] == "wheel" else list(folder.glob("*.whl"))
        subprocess.run([*pip, *map(str, [*words, *wheels])], check=True, timeout=HANG_SECONDS)
    return folder / "site"


@pytest.fixture
def installed(site, tmp_path):
    """Function that runs a program of the installation in an empty folder."""

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            [sys.executable, *map(str, words)],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(site)},
            capture_output=True,
            text=True,
            timeout=HANG_SECONDS,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done

    return run


def test_the_console_script_is_the_program(site, installed):
    assert "modes of a solid" in installed(site / "bin" / "carillon", "--help").stdout


def test_modules_and_data_come_from_the_installation(site, installed, tmp_path):
    where = installed("-c", "import carillon, forests.default as d; print(d.DEFAULT_FILE)").stdout
    assert Path(where.strip()) == site / "forests" / "default.h5"
    installed("-m", "carillon", "inspect-forests")
    # Ground truth needs the fewest kernels, which have to be compiled for the other folder.
    solid = ("builtin:bar", "--resolution", 6, "--method", "slepc", "--modes", 8)
    installed("-m", "carillon", "modes", *solid, "--out", "modes.h5")
    assert (tmp_path / "modes.h5").exists()


def test_rules_are_found_and_planned(site, installed):
    rules = Path(installed("-m", "carillon", "rules").stdout.strip())
    assert rules.is_relative_to(site)
    graph = installed("-m", "snakemake", "-s", rules, "--cores", 1, "--rulegraph").stdout
    assert "train_forests" in graph


def test_a_configuration_is_estimated(installed):
    found = installed("-m", "carillon", "estimate", "--preset", "tiny", "--json").stdout
    assert json.loads(found)


def test_the_page_of_the_studio_is_whole(site):
    """With the licences of its libraries, and without what only its makers need."""
    made = {
        str(path.relative_to(CHECKOUT))
        for path in (CHECKOUT / "studio" / "page").rglob("*")
        if path.suffix in (".js", ".css", ".svg", ".html")
        or path.name in ("LICENSE", "vendor.json")
    }
    page = site / "studio" / "page"
    found = {str(path.relative_to(site)) for path in page.rglob("*") if path.is_file()}
    assert len(made) > 40 and made == found
