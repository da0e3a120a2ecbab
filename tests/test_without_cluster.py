"""Without mpi4py, PETSc and SLEPc everything of one machine runs, and gives the same digits.

The main paths do without what macOS and Windows lack of Linux, too.
"""

import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from carillon.__main__ import main
from carillon.command_line import commands
from carillon.processes import extras, one_rank
from solver.files.modes_file import read_modes
from solver.verification.audit import audit_files
from studies.scaling import launch
from tests.core_paths import CLUSTER, SOLID
from tests.programs import CHECKOUT, checkout_environment, python
from tests.rank_counts import TO_THREE

HIDE = """
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in PACKAGES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Hidden())
"""
"""Python runs this at its start where its folder is searched, in all processes of a program."""
LACKED_MODULES = ("fcntl",)
HIDE_SYSTEM = """
import builtins, io, os, select, signal, time

# What macOS or Windows lack: no such machine is at hand to try this on.
LACKED = (
    (os, "O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK O_PATH fchdir geteuid nice"),
    (os, "pread pwrite sched_getaffinity"),
    (select, "poll"),
    (signal, "SIGHUP pthread_sigmask"),
    (time, "CLOCK_BOOTTIME"),
)
for module, names in LACKED:
    for name in names.split():
        delattr(module, name)
for functions in (os.supports_dir_fd, os.supports_fd, os.supports_effective_ids):
    functions.clear()

def without_proc(opened):
    def open(file, *arguments, **options):
        # threadpoolctl reads the maps on Linux.
        if str(file).startswith(("/proc/", "/sys/")) and str(file) != "/proc/self/maps":
            raise FileNotFoundError(2, "No such file or directory", str(file))
        return opened(file, *arguments, **options)
    return open

builtins.open = io.open = without_proc(io.open)
isdir = os.path.isdir
os.path.isdir = lambda path: isdir(path) and not str(path).startswith("/proc/")
"""
"""Likewise."""


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    """Function that runs a program in a folder, where the packages are hidden from it."""
    hidden = tmp_path_factory.mktemp("hidden")
    program = f"PACKAGES = {(*CLUSTER, *LACKED_MODULES)}\n{HIDE}{HIDE_SYSTEM}"
    (hidden / "sitecustomize.py").write_text(program)
    path = f"{hidden}:{CHECKOUT}"

    def run(
        *words: object, cwd: Path = hidden, **variables: str
    ) -> subprocess.CompletedProcess[str]:
        return python(*words, cwd=cwd, env=checkout_environment(**variables, PYTHONPATH=path))

    return run


@pytest.fixture(scope="module")
def paths(core, tmp_path_factory):
    """Folder in which the main paths were run without the packages."""
    folder = tmp_path_factory.mktemp("paths")
    done = core(CHECKOUT / "tests" / "core_paths.py", cwd=folder)
    assert done.returncode == 0 and done.stdout.endswith("done\n"), done.stdout + done.stderr
    return folder


def test_modes_have_the_digits_of_slepc(paths, run_cli, tmp_path):
    out = tmp_path / "slepc.h5"
    run_cli("carillon", "modes", *SOLID, "--method", "slepc", "--out", out, check=True)
    expected = read_modes(str(out)).eigenvalues
    for name in ("auto", "hcms", "truth"):
        file = read_modes(str(paths / f"{name}.h5"))
        assert np.abs(file.eigenvalues[6:] / expected[6:] - 1.0).max() < 1e-9, name


def test_ground_truth_is_counted_by_the_own_factorisation(paths):
    for name in ("auto", "truth"):
        found = read_modes(str(paths / f"{name}.h5")).attributes
        assert found["inertia_count"] == found["inertia_expected"] >= 12


def test_audits_agree(paths, monkeypatch):
    file = str(paths / "truth.h5")
    (of_petsc,) = audit_files([file], 1e-6).values()
    monkeypatch.setattr(extras, "_is_found", lambda package: False)
    (own,) = audit_files([file], 1e-6).values()
    assert not own.faults and own.counted == of_petsc.counted == own.expected
    # Residuals are rounding here, and so are those in energy.
    assert max(own.energy_residuals) < 1e-6 and max(of_petsc.energy_residuals) < 1e-6


@pytest.mark.parametrize(
    "options, what",
    [
        (("--method", "slepc"), "--method slepc needs mpi4py and petsc4py and slepc4py"),
        (("--method", "lobpcg"), "--method lobpcg needs mpi4py and petsc4py"),
        (("--linear-solver", "amg-cg"), "--linear-solver amg-cg needs"),
        (("--linear-solver", "mumps"), "--linear-solver mumps needs"),
        (("--method", "hcms", "--linear-solver", "icc-pcg"), "--linear-solver icc-pcg needs"),
        (("--petsc", "-carillon_inner_pc_type lu"), "--petsc needs"),
    ],
)
def test_what_needs_them_says_what_to_install(options, what, refuses, monkeypatch, tmp_path):
    monkeypatch.setattr(extras, "_is_found", lambda package: False)
    out = tmp_path / "modes.h5"
    sentence = refuses(main, "modes", *SOLID, *options, "--out", out)
    assert what in sentence and extras.install() in sentence
    assert not out.exists()


@pytest.mark.parametrize(
    "command, package, extra",
    [("study benchmark builtin:bar", "petsc4py", "cluster"), ("rules", "snakemake", "workflow")],
)
def test_commands_of_an_extra_say_what_to_install(
    command, package, extra, refuses, monkeypatch, capsys
):
    def missing(arguments):
        raise ModuleNotFoundError(f"No module named '{package}'", name=f"{package}.part")

    monkeypatch.setattr(commands, "_module", lambda command: missing(command))
    sentence = refuses(main, *command.split())
    assert f"this needs {package}, which is not installed" in sentence
    assert extras.install(extra) in sentence


@pytest.mark.parametrize(
    ("study", "packages"),
    [
        ("scaling", "mpi4py, which is"),
        ("coarsening", "mpi4py and petsc4py and slepc4py, which are"),
        ("objectives", "mpi4py and petsc4py and slepc4py, which are"),
    ],
)
def test_studies_that_need_them_say_so_before_they_start(study, packages, refuses, monkeypatch):
    monkeypatch.setattr(extras, "_is_found", lambda package: False)
    monkeypatch.setattr(launch, "run_child", None)
    sentence = refuses(main, "study", study, "builtin:bar", "--resolution", "8")
    assert f"the study of {study} needs {packages} not installed" in sentence
    assert sentence.endswith(extras.install())


def test_convergence_is_followed_to_the_eigenvalues_of_arpack(core, tmp_path, run_cli):
    words = ("convergence", *SOLID, "--steps", "1", "--out")
    done = core("-m", "carillon", "study", *words, tmp_path / "arpack.json")
    assert done.returncode == 0, done.stderr
    run_cli("carillon", "study", *words, tmp_path / "slepc.json", check=True)
    exact, expected = (
        json.loads((tmp_path / f"{name}.json").read_text())["exact"] for name in ("arpack", "slepc")
    )
    assert exact == pytest.approx(expected, rel=1e-9)


def test_ratios_are_rated_by_arpack(core):
    words = ("ratios", "builtin:bar", "--resolution", "8", "--ratios", "0.3")
    done = core("-m", "carillon", "study", *words)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("variable", ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"])
def test_one_of_several_ranks_is_told_that_mpi4py_is_missing(variable, core):
    for words in (("-m", "carillon", "environment"), ("-c", "import solver.assembly.system")):
        done = core(*words, **{variable: "2"})
        assert done.returncode != 0
        sentence = done.stderr.splitlines()[-1]
        assert "a run on 2 ranks needs mpi4py, which is not installed" in sentence


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", TO_THREE)
def test_mpi4py_alone_is_enough_for_several_ranks(ranks, paths, tmp_path, mpiexec):
    (tmp_path / "sitecustomize.py").write_text(f"PACKAGES = {CLUSTER[1:]}\n{HIDE}")
    variables = {"PYTHONPATH": f"{tmp_path}:{CHECKOUT}"}
    options = ("--tolerance", "1e-10", "--check-inertia", "--out", "modes.h5")
    words = ("carillon", "modes", *SOLID, *options)
    mpiexec(ranks, *words, cwd=tmp_path, env=variables, check=True)
    values, expected = (
        read_modes(str(folder / name)).eigenvalues[6:]
        for folder, name in ((tmp_path, "modes.h5"), (paths, "auto.h5"))
    )
    assert np.abs(values / expected - 1.0).max() < 1e-9


def test_mpi4py_that_cannot_be_loaded_is_told(tmp_path):
    """As where pip has installed it, and no MPI."""
    package = tmp_path / "mpi4py"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "MPI.py").write_text("raise RuntimeError('cannot load MPI library')\n")
    path = f"{tmp_path}:{CHECKOUT}"
    program = "from carillon.processes.mpi import MPI"
    done = python("-c", program, cwd=tmp_path, env=checkout_environment(PYTHONPATH=path))
    assert "mpi4py is installed and cannot be loaded (cannot load MPI library)" in done.stderr


CALLS = {
    "barrier": lambda comm: comm.barrier(),
    "Barrier": lambda comm: comm.Barrier(),
    "bcast": lambda comm: comm.bcast({"a": 1}, root=0),
    "allreduce": lambda comm: comm.allreduce(3),
    "allreduce of arrays": lambda comm: comm.allreduce(np.arange(3.0)).tolist(),
    "gather": lambda comm: comm.gather("a"),
    "allgather": lambda comm: comm.allgather({1, 2}),
    "alltoall": lambda comm: comm.alltoall([(1, 2)]),
    "size of a machine": lambda comm: (comm.size, comm.rank),
}


@pytest.mark.parametrize("call", CALLS)
def test_one_rank_does_what_mpi_does(call):
    assert CALLS[call](one_rank.COMM_SELF) == CALLS[call](MPI.COMM_SELF)


@pytest.mark.parametrize("space", [one_rank, MPI], ids=["one rank", "MPI"])
def test_arrays_of_one_rank_are_what_mpi_makes_of_them(space):
    comm, part = space.COMM_SELF, np.arange(6.0).reshape(3, 2)
    total, largest, everyone, whole = part.copy(), part.copy(), np.zeros((1, 6)), np.zeros((3, 2))
    comm.Allreduce(space.IN_PLACE, total)
    comm.Allreduce(part, largest, op=space.MAX)
    comm.Allgather(part, everyone)
    comm.Gatherv(part, (whole, [6]))
    assert all(
        np.array_equal(each.reshape(3, 2), part) for each in (total, largest, everyone, whole)
    )
    for operation in ("SUM", "MAX", "MIN", "LAND", "LOR"):
        assert comm.allreduce(1, getattr(space, operation)) == 1
    machine = comm.Split_type(space.COMM_TYPE_SHARED)
    assert machine.size == 1
    space.Request.Waitall([])


def test_the_extra_allows_what_is_built_from_source():
    from packaging.requirements import Requirement

    envs = CHECKOUT / "workflow" / "envs"
    built = dict(re.findall(r"^(\w+)==(.+)$", (envs / "petsc-source.txt").read_text(), re.M))
    lines = (envs / "requirements-cluster.txt").read_text().splitlines()
    extra = [Requirement(line) for line in lines if not line.startswith("#")]
    assert {each.name for each in extra} == set(CLUSTER)
    assert all(each.specifier.contains(built[each.name]) for each in extra)
