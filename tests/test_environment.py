"""The environment starts with no variable set and is fast; licence and citation are in order."""

import json
import re
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
import yaml

import carillon
from tests.programs import CHECKOUT, python

pytestmark = pytest.mark.system


def test_petsc_and_slepc_start_in_an_empty_environment():
    program = "from petsc4py import PETSc; from slepc4py import SLEPc; SLEPc.EPS().create()"
    done = python("-c", program, env={}, cwd="/")
    assert done.returncode == 0, done.stderr


def test_the_packages_import_from_any_folder_without_pythonpath():
    done = python("-c", "import carillon; print(carillon.__file__)", env={}, cwd="/")
    assert Path(done.stdout.strip()).parent == CHECKOUT / "carillon", done.stderr


@pytest.fixture(scope="module")
def environment(start_cli) -> dict:
    return json.loads(start_cli("carillon", "environment", "--json", check=True).stdout)


def test_the_start_up_check_names_what_is_used(environment):
    assert environment["versions"]["carillon"] == carillon.__version__
    assert re.match(r"3\.\d+\.\d+", environment["petsc"])
    assert re.match(r"3\.\d+\.\d+", environment["slepc"])
    assert environment["mpi"]
    assert environment["cores"] >= 1


def test_petsc_does_not_run_on_the_reference_blas(environment):
    assert not environment["reference_blas"], environment["blas"]
    assert "reference" not in environment["blas"]


def test_the_blas_of_each_package_is_named(environment):
    users = environment["blas_by_user"]
    assert list(users) == ["PETSc", "numpy", "scipy"] and users["PETSc"] == environment["blas"]
    assert all(re.match(r"[a-z]+ \d", name) for name in users.values()), users


def test_the_start_up_check_is_readable(start_cli):
    done = start_cli("carillon", "environment", check=True)
    for word in ("Carillon", "PETSc", "SLEPc", "BLAS", "MUMPS"):
        assert word in done.stdout


@pytest.mark.mpi
def test_ranks_see_each_other_and_share_the_cores(mpiexec, tmp_path):
    script = tmp_path / "ranks.py"
    script.write_text(
        "import os\n"
        "from mpi4py import MPI\n"
        "from petsc4py import PETSc\n"
        "ranks = MPI.COMM_WORLD.allgather(PETSc.COMM_WORLD.getRank())\n"
        "threads = MPI.COMM_WORLD.allreduce(int(os.environ['OMP_NUM_THREADS']))\n"
        "cores = len(os.sched_getaffinity(0))\n"
        "if not MPI.COMM_WORLD.rank:\n"
        "    print(ranks, threads <= max(cores, len(ranks)))\n"
    )
    assert mpiexec(3, script, check=True).stdout.strip() == "[0, 1, 2] True"


@pytest.mark.mpi
def test_an_error_on_one_rank_ends_all_of_them(mpiexec, tmp_path):
    script = tmp_path / "error.py"
    script.write_text(
        "from mpi4py import MPI\n"
        "if MPI.COMM_WORLD.rank == 1:\n"
        "    raise ValueError('rank 1 cannot go on')\n"
        "MPI.COMM_WORLD.barrier()\n"
    )
    done = mpiexec(2, script)
    assert done.returncode != 0
    assert "rank 1 cannot go on" in done.stderr


ENVS = CHECKOUT / "workflow" / "envs"


def locked(name: str) -> dict[str, str]:
    lines = (ENVS / name).read_text().splitlines()
    pins = (line.split("==") for line in lines if line and not line.startswith("#"))
    return {package.lower().replace("_", "-"): version for package, version in pins}


@pytest.mark.parametrize("lock", ["lock.txt", "lock-numpy2.txt"])
@pytest.mark.parametrize("part", ["", "-sound", "-workflow", "-dev"])
def test_every_requirement_is_locked(lock, part):
    from packaging.requirements import Requirement

    pins = locked(lock)
    requirements = CHECKOUT / "workflow" / "envs" / f"requirements{part}.txt"
    for line in requirements.read_text().splitlines():
        if line and not line.startswith("#"):
            requirement = Requirement(line)
            assert requirement.specifier.contains(pins[requirement.name.lower()]), line


def test_the_installed_numpy_is_the_locked_one():
    assert metadata.version("numpy") in {
        locked("lock.txt")["numpy"],
        locked("lock-numpy2.txt")["numpy"],
    }


def built() -> dict[str, str]:
    """Versions of what PETSC=source builds."""
    lines = (ENVS / "petsc-source.txt").read_text().splitlines()
    return dict(line.split("==") for line in lines if line and not line.startswith("#"))


def installed_requirements() -> set[str]:
    """Requirement files that `make env` installs."""
    parts = re.search(r"for part in ([a-z ]+); do", (ENVS / "setup.sh").read_text())
    return {"requirements.txt", *(f"requirements-{part}.txt" for part in parts[1].split())}


def test_the_conda_environment_is_the_locked_one():
    described = yaml.safe_load((ENVS / "environment.yml").read_text())
    pinned, pip = {}, []
    for entry in described["dependencies"]:
        if isinstance(entry, dict):
            pip = entry["pip"]
        elif "=" in entry:
            name, version, *_ = entry.split("=")
            pinned[name] = version
    assert pinned.pop("python") == "3.12"
    known = {**locked("lock-numpy2.txt"), **built()}
    assert pinned == {name: known[name] for name in pinned}
    assert {"mpi4py", "petsc4py", "slepc4py", "numpy"} <= set(pinned)
    assert pip[0] == "-c lock-numpy2.txt"
    assert {entry.removeprefix("-r ") for entry in pip[1:]} == installed_requirements()


def test_the_spack_environment_is_the_locked_one():
    text = (ENVS / "spack.yaml").read_text()
    specs = yaml.safe_load(text)["spack"]["specs"]
    versions = dict(spec.split()[0].split("@") for spec in specs if "@" in spec)
    assert versions.pop("python") == "3.12"
    known = {**locked("lock-numpy2.txt"), **built()}
    pinned = {name.removeprefix("py-"): version for name, version in versions.items()}
    assert pinned == {name: known[name] for name in pinned}
    needed = installed_requirements() - {"requirements-dev.txt"}
    assert set(re.findall(r"-r (\S+)", text)) == needed


def test_images_are_made_by_one_script_and_have_one_environment():
    container = (ENVS / "Containerfile").read_text()
    apptainer = (CHECKOUT / "slurm" / "carillon.def").read_text()
    bare = (CHECKOUT / ".ci" / "bare-root").read_text()
    assert all("workflow/envs/image.sh" in text for text in (container, apptainer, bare))
    assert "debian:12" in container and "From: debian:12" in apptainer
    for setting in (
        "PATH=/opt/carillon/.venv/bin:$PATH",
        "OMPI_MCA_btl_vader_single_copy_mechanism",
    ):
        assert setting in container and setting in apptainer


def test_the_licence_is_bsd_3_clause():
    text = (CHECKOUT / "LICENSE").read_text()
    assert text.startswith("BSD 3-Clause License")
    assert "Copyright (c) 2026, The Carillon developers" in text
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    assert project["license"] == "BSD-3-Clause"


def test_the_citation_names_software_version_and_paper():
    citation = yaml.safe_load((CHECKOUT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0"
    assert citation["title"] == "Carillon"
    assert citation["version"] == carillon.__version__
    paper = citation["preferred-citation"]
    assert [author["family-names"] for author in paper["authors"]] == ["Yamamoto", "Igarashi"]
    assert paper["year"] == 2016


def test_the_changelog_has_an_entry_for_this_version():
    assert f"## [{carillon.__version__}]" in (CHECKOUT / "CHANGELOG.md").read_text()
