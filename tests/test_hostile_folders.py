"""A folder of a stranger's: nothing in it is run, or read as settings of a library."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil
import pytest
import yaml

from carillon.errors import UserError
from carillon.processes import present_folder
from tests.listening import has_loaded, listening
from tests.patience import wait_for
from tests.programs import CHECKOUT, checkout_environment, python, run
from tests.rank_counts import SEVERAL
from tests.small_project import PROJECT, write_clips
from workflow.disk_space import MODULES, require_own

PROGRAM = Path(sys.executable).with_name("carillon")
"""As it is installed; `python -m` takes modules from the present folder before anything can be said
against it."""
PACKAGES = ("numpy", "scipy", "numba", "h5py", "yaml", "joblib", "sklearn", "mpi4py", "petsc4py")
BAR = ("builtin:bar", "--resolution", "12", "--modes", "12", "--out", "modes.h5")


@pytest.fixture
def planted(tmp_path) -> Path:
    """A folder with a module for every one of Python's, and settings of PETSc and numba."""
    folder, mark = tmp_path / "folder", tmp_path / "mark"
    folder.mkdir()
    for name in sorted({*sys.stdlib_module_names, *PACKAGES, "carillon", "solver", "sound"}):
        (folder / f"{name}.py").write_text(f"open({str(mark)!r}, 'a').write('{name} ')\n")
    for name in (".petscrc", "petscrc"):
        (folder / name).write_text(f"-log_view :{mark}\n")
    (folder / ".numba_config.yaml").write_text("cache_dir: kernels\n")
    (folder / "petsc.cfg").write_text("PETSC_ARCH = /proc/self/cwd/evil\n")
    (folder / "evil").mkdir()
    (folder / "evil" / "PETSc.py").write_text(f"open({str(mark)!r}, 'a').write('PETSc ')\n")
    return folder


def carillon(folder: Path, *words: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    return run(PROGRAM, *words, cwd=folder, check=check)


def project(folder: Path, workers: int) -> None:
    """A design problem in a folder, which takes that many processes."""
    search = {"seconds": None, "evaluations": 4, "workers": workers}
    (folder / "p.yaml").write_text(yaml.safe_dump({**PROJECT, "optimiser": search}))
    write_clips(folder, np.array([700.0, 1200.0, 1900.0, 2500.0, 3300.0, 4100.0]))


@pytest.mark.parametrize(
    "words",
    [
        ("modes", *BAR),
        ("modes", *BAR, "--method", "slepc"),
        pytest.param(("design", "p.yaml", "--workers", "2", "--out", "d.h5"), id="design"),
    ],
)
def test_nothing_in_the_folder_runs(planted, tmp_path, words):
    project(planted, workers=2)
    before = set(planted.iterdir())
    carillon(planted, *words)
    assert not (tmp_path / "mark").exists(), (tmp_path / "mark").read_text()
    made = {path.name for path in planted.iterdir() if path not in before}
    assert made == {words[words.index("--out") + 1]}


CHAIN = (
    *(("modes", *BAR, "--method", method) for method in ("hcms", "lobpcg", "arpack")),
    ("modes", *BAR, "--coarsen", "ddfem"),
    ("compare", "modes.h5", "modes.h5"),
    ("audit", "modes.h5"),
    ("respond", "modes.h5", "--out", "motion.h5"),
    ("extract", "end.wav", "--out", "end.json"),
    ("init", "new.yaml", "--mesh", "builtin:bar", "--clips", "end.wav"),
    ("design", "p.yaml", "--workers", "2", "--out", "d.h5"),
    ("check", "d.h5"),
    ("render", "d.h5", "--target", "end", "--out", "heard.wav"),
    *(("export", "d.h5", "--out", f"d.{ending}") for ending in ("glb", "dsp", "npy")),
    ("generate", "--samples", "600", "--workers", "2", "--out", "shard.h5"),
    ("inspect-shard", "shard.h5"),
    ("train", "shard.h5", "--trees", "2", "--out", "forests.h5"),
    ("inspect-forests", "forests.h5"),
)
"""Commands, one after another: later ones take what earlier ones have made."""


@pytest.mark.nightly
def test_nothing_in_the_folder_runs_whatever_the_command(planted, tmp_path):
    project(planted, workers=2)
    for words in CHAIN:
        done = carillon(planted, *words, check=False)
        assert done.returncode == 0, (words, done.stderr)
        assert not (tmp_path / "mark").exists(), (words, (tmp_path / "mark").read_text())
    assert not (planted / "kernels").exists()


@pytest.mark.nightly
def test_an_archive_brings_nothing_to_life(planted, tmp_path):
    """Modules, settings and links survive in an archive; so does the project, the control."""
    project(planted, workers=1)
    diary = tmp_path / "diary"
    diary.write_text("dear diary")
    for name in ("MUJOCO_LOG.TXT", ".d.h5.partial", "d.h5.lock"):
        (planted / name).symlink_to(diary)
    archive, opened = tmp_path / "gift.tar", tmp_path / "opened"
    subprocess.run(["tar", "-cf", archive, "-C", planted, "."], check=True)
    opened.mkdir()
    subprocess.run(["tar", "-xf", archive, "-C", opened], check=True)
    carillon(opened, "design", "p.yaml", "--workers", "2", "--out", "d.h5")
    assert (opened / "d.h5").is_file()
    assert diary.read_text() == "dear diary"
    assert not (tmp_path / "mark").exists()


def test_planted_files_are_what_would_run(planted, tmp_path):
    """The control: without protection each of them does."""
    for program in ("import signal", "from petsc4py import PETSc", "import numba.core.config as c"):
        told = f"{program}; print(getattr(globals().get('c'), 'CACHE_DIR', ''))"
        plain = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
        done = python(*(() if "signal" in program else ("-P",)), "-c", told, cwd=planted, env=plain)
        marked = (tmp_path / "mark").exists() or "kernels" in done.stdout
        assert marked, (program, done.stderr)
        (tmp_path / "mark").unlink(missing_ok=True)


def test_a_plot_looks_the_same_beside_settings_of_matplotlib(tmp_path):
    (tmp_path / "matplotlibrc").write_text("backend: module://planted\nfigure.facecolor: red\n")
    program = (
        "import carillon, os, matplotlib as m\n"
        "print(m.rcParams['figure.facecolor'], os.getcwd(), m.__loader__.__class__.__name__)"
    )
    done = python("-c", program, cwd=tmp_path, check=True)
    assert done.stdout.split() == ["white", str(tmp_path), "SourceFileLoader"]


@pytest.mark.nightly
def test_a_profile_of_snakemake_in_the_folder_is_not_taken(tmp_path):
    profile = tmp_path / "profiles" / "default"
    profile.mkdir(parents=True)
    mark = tmp_path / "mark"
    (profile / "config.yaml").write_text(
        f"default-resources:\n  - \"mem_mb=open({str(mark)!r}, 'a').write('x')\"\n"
        "no-such-option: 1\n"
    )
    words = ("validate", "builtin:bar", "--resolution", "8", "--modes", "12", "--out", "found")
    done = carillon(tmp_path, *words, check=False)
    assert not mark.exists()
    assert "no-such-option" not in done.stderr
    assert (tmp_path / "found" / "validation" / "bar.html").is_file(), done.stderr
    assert carillon(tmp_path, *words, check=False).returncode == done.returncode, "it goes on"


def test_settings_that_a_user_names_hold(tmp_path):
    (tmp_path / "mine").write_text("figure.facecolor: green\n")
    program = "import carillon, matplotlib as m; print(m.rcParams['figure.facecolor'])"
    done = python(
        "-c", program, cwd=tmp_path, env={**os.environ, "MATPLOTLIBRC": "mine"}, check=True
    )
    assert done.stdout == "green\n"


def test_a_folder_that_nobody_may_enter_is_no_error(monkeypatch):
    def forbidden(*_):
        raise PermissionError

    here = os.getcwd()
    with monkeypatch.context() as patch:
        patch.setattr(os, "open", forbidden)
        with present_folder.elsewhere():
            assert os.getcwd() == here


def test_snakemake_adds_no_modules_of_the_present_folder(tmp_path):
    modules = tmp_path / MODULES
    modules.mkdir(parents=True)
    (modules / "planted.py").write_text("print('run')\n")
    program = "import carillon, snakemake\ntry: import planted\nexcept ImportError: print('not')"
    done = python("-c", program, cwd=tmp_path, check=True)
    assert done.stdout == "not\n"


@pytest.mark.parametrize("name", ["validate.log", "models", ".snakemake", "logs/deep.log"])
def test_a_folder_of_results_leads_nowhere_else(tmp_path, name):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    require_own(tmp_path)
    (tmp_path / name).symlink_to("elsewhere")
    with pytest.raises(UserError, match=f"{name}: is a link, expected files and folders of a run"):
        require_own(tmp_path)


def test_a_folder_of_results_brings_no_modules(tmp_path):
    (tmp_path / "found" / MODULES).mkdir(parents=True)
    words = ("validate", "builtin:bar", "--resolution", "8", "--modes", "12", "--out", "found")
    done = carillon(tmp_path, *words, check=False)
    assert done.returncode == 2 and "holds modules that would be run" in done.stderr


def test_sounds_of_a_search_follow_no_link(tmp_path):
    project(tmp_path, workers=1)
    (tmp_path / "d-end.wav").symlink_to(tmp_path / "diary")
    done = carillon(tmp_path, "design", "p.yaml", "--watch", "--out", "d.h5", check=False)
    assert done.returncode == 2 and "d-end.wav: is a link, expected a sound" in done.stderr
    assert not (tmp_path / "diary").exists()


def test_the_studio_follows_no_link_that_nobody_has_named(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "carillon-studio").symlink_to("data")
    done = carillon(tmp_path, "studio", "--no-browser", check=False)
    assert done.returncode == 2 and "carillon-studio: is a link" in done.stderr
    assert list((tmp_path / "data").iterdir()) == []


def test_a_checkout_is_found_by_what_is_started_in_it():
    root = str(CHECKOUT)
    environment = {"PYTHONPATH": "/more"}
    present_folder.ignore_modules(environment, [root])
    assert environment == {"PYTHONSAFEPATH": "1", "PYTHONPATH": f"{root}{os.pathsep}/more"}
    again = dict(environment)
    present_folder.ignore_modules(again, [root])
    assert again == environment


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", SEVERAL)
def test_ranks_of_one_machine_listen_nowhere(ranks, mpiexec):
    told = json.loads(mpiexec(ranks, "tests.listening", check=True).stdout)
    assert told == {"sum": ranks * (ranks - 1) // 2, "listening": [[]] * ranks}


def test_a_lone_process_listens_nowhere():
    command = [sys.executable, "-m", "tests.listening"]
    environment = checkout_environment()
    done = run(*command, env=environment, check=True)
    assert json.loads(done.stdout) == {"sum": 0, "listening": [[]]}


def listening_of(process: psutil.Process, run: subprocess.Popen[str]) -> list[str]:
    """Where a process and those that it has started listen, once one of those has MPI."""

    def solvers() -> list[psutil.Process]:
        return [each for each in process.children(recursive=True) if has_loaded(each, "libmpi")]

    wait_for(solvers, "a process that has MPI", run)
    return listening([process, *process.children(recursive=True)])


def test_processes_of_a_studio_listen_at_its_address_alone(tmp_path):
    project(tmp_path, workers=1)
    words = ("studio", "p.yaml", "--no-browser")
    with subprocess.Popen(
        [PROGRAM, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as studio:
        try:
            assert studio.stdout is not None
            address = studio.stdout.readline().split("?")[0]
            found = listening_of(psutil.Process(studio.pid), studio)
        finally:
            studio.terminate()
    assert [f"http://{each}/" for each in found] == [address]


def test_processes_of_a_search_listen_nowhere(tmp_path):
    project(tmp_path, workers=2)
    words = ("design", "p.yaml", "--evaluations", "100000", "--out", "d.h5")
    with subprocess.Popen(
        [PROGRAM, *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    ) as run:
        try:
            assert listening_of(psutil.Process(run.pid), run) == []
        finally:
            run.kill()
