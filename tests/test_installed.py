"""A wheel of the checkout, installed elsewhere, is whole: commands, rules and data files."""

import json
import os
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest

from carillon import ROOMS
from tests.patience import HANG_SECONDS
from tests.programs import CHECKOUT, python, run

pytestmark = pytest.mark.nightly

PIP = (sys.executable, "-m", "pip", "--quiet", "--no-input")


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    """An sdist of the checkout, and the names of its files."""
    folder = tmp_path_factory.mktemp("sdist")
    # From a copy: setuptools leaves its traces in the folder that it builds.
    copy = folder / "copy"
    words = "git ls-files -z --cached --others --exclude-standard".split()
    listed = filter(None, run(*words, cwd=CHECKOUT, check=True).stdout.split("\0"))
    names = [name for name in listed if (CHECKOUT / name).exists()]
    for name in names:
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_bytes((CHECKOUT / name).read_bytes())
    build = f"from setuptools.build_meta import build_sdist; build_sdist({str(folder)!r})"
    tools = folder / "tools"
    needed = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["build-system"]["requires"]
    subprocess.run([*PIP, "install", "--target", tools, *needed], check=True, timeout=HANG_SECONDS)
    python("-c", build, cwd=copy, env={**os.environ, "PYTHONPATH": str(tools)}, check=True)
    return next(folder.glob("*.tar.gz")), names


def test_the_sdist_is_the_checkout(sdist):
    archive, names = sdist
    with tarfile.open(archive) as files:
        held = {name.partition("/")[2] for name in files.getnames()}
    assert set(names) <= held


@pytest.fixture(scope="module")
def site(sdist, tmp_path_factory):
    """A folder with the wheel of the sdist unpacked, as an installation has it."""
    folder = tmp_path_factory.mktemp("installed")
    for words in (
        ["wheel", "--no-deps", "--wheel-dir", folder, sdist[0]],
        ["install", "--no-deps", "--no-index", "--target", folder / "site"],
    ):
        wheels = [] if words[0] == "wheel" else list(folder.glob("*.whl"))
        subprocess.run([*PIP, *map(str, [*words, *wheels])], check=True, timeout=HANG_SECONDS)
    return folder / "site"


@pytest.fixture
def installed(site, tmp_path):
    """Function that runs a program of the installation in an empty folder."""

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        done = python(*words, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(site)})
        assert done.returncode == 0, done.stdout + done.stderr
        return done

    return run


def test_the_console_script_is_the_program(site, installed):
    assert "modes of a solid" in installed(site / "bin" / "carillon", "--help").stdout


def test_modules_and_data_come_from_the_installation(site, installed, tmp_path):
    where = installed("-c", "import carillon, forests.default as d; print(d.DEFAULT_FILE)").stdout
    assert Path(where.strip()) == site / "carillon" / "_rooms" / "forests" / "default.h5"
    installed("-m", "carillon", "inspect-forests")
    # Ground truth needs the fewest kernels, which have to be compiled for the other folder.
    solid = ("builtin:bar", "--resolution", 6, "--method", "slepc", "--modes", 8)
    installed("-m", "carillon", "modes", *solid, "--out", "modes.h5")
    assert (tmp_path / "modes.h5").exists()


def test_one_name_is_installed(site):
    """Beside what pip writes of any package."""
    names = {path.name for path in site.iterdir() if path.suffix != ".dist-info"}
    assert names - {"bin", "__pycache__"} == {"carillon"}


@pytest.mark.parametrize("room", ROOMS)
def test_every_module_is_in_the_wheel(room, site):
    """But not the tests that lie beside the modules of studies."""
    installed = site / "carillon" / "_rooms"
    of_room = installed.parent if room == "carillon" else installed / room
    made = {path.relative_to(CHECKOUT / room) for path in (CHECKOUT / room).rglob("*.py")}
    found = {path.relative_to(of_room) for path in of_room.rglob("*.py")}
    if room == "carillon":
        found = {path for path in found if path.parts[0] != "_rooms"}
    assert found == {path for path in made if not path.name.startswith(("test_", "conftest"))}


@pytest.mark.parametrize("name", ["solver", "workflow", "sound"])
def test_a_foreign_package_of_the_same_name_is_left_alone(name, site, tmp_path):
    """It is found by those who do not import Carillon, and never by Carillon's own processes."""
    foreign = tmp_path / "packages" / name
    foreign.mkdir(parents=True)
    (foreign / "__init__.py").write_text("MINE = True\n")
    environment = {**os.environ, "PYTHONPATH": f"{site}{os.pathsep}{foreign.parent}"}

    def run(*words: object) -> str:
        words = [sys.executable, *map(str, words)]
        options = {"cwd": tmp_path, "env": environment, "timeout": HANG_SECONDS}
        done = subprocess.run(words, capture_output=True, text=True, **options)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert run("-c", f"import {name}; print({name}.MINE)") == "True\n"
    own = run("-c", f"import carillon, {name}; print({name}.__file__)")
    assert Path(own.strip()).is_relative_to(site / "carillon" / "_rooms")
    assert "modes of a solid" in run("-m", "carillon", "--help")


def test_rooms_start_processes_of_their_own(installed, tmp_path):
    """A search in workers, which import the rooms anew."""
    (tmp_path / "search.py").write_text(
        "import carillon as ca, numpy as np\n"
        "if __name__ == '__main__':\n"
        "    t = np.arange(4000) / 8000\n"
        "    clip = 0.3 * np.exp(-6 * t) * (np.sin(4400 * t) + np.sin(8200 * t))\n"
        "    ca.write_wav('clip.wav', clip, 8000)\n"
        "    target = dict(name='end', vertex=0, clip='clip.wav')\n"
        "    settings = dict(evaluations=4, workers=2)\n"
        "    found = ca.design(mesh='builtin:bar', resolution=16, coarsen='none',\n"
        "                      targets=[target], optimiser=settings)\n"
        "    print(np.isfinite(found.target_frequencies).sum())\n"
    )
    assert installed("search.py").stdout == "2\n"


def test_rules_are_found_and_planned(site, installed):
    rules = Path(installed("-m", "carillon", "rules").stdout.strip())
    assert rules.is_relative_to(site)
    graph = installed("-m", "snakemake", "-s", rules, "--cores", 1, "--rulegraph").stdout
    assert "train_forests" in graph


def test_crates_of_an_installation_name_the_authors(installed):
    program = "import carillon; from workflow.crate.citation import citation; print(citation())"
    assert "The Carillon developers" in installed("-c", program).stdout


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
    rooms = site / "carillon" / "_rooms"
    page = rooms / "studio" / "page"
    found = {str(path.relative_to(rooms)) for path in page.rglob("*") if path.is_file()}
    assert len(made) > 40 and made == found
