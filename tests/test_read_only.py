"""A checkout that cannot be written, as in an image or another user's, serves users of any home."""

import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from tests.programs import CHECKOUT, run

pytestmark = [pytest.mark.nightly, pytest.mark.system]

NOBODY = 65534
"""Number of a user, and of a group, without rights."""
MOUNTED = """
set -eu
mount --rbind "$0" "$0"
mount -o remount,bind,ro "$0"
! touch "$0/written" 2>/dev/null
exec setpriv --reuid $NOBODY --regid $NOBODY --clear-groups "$@"
"""
"""Runs a command as nobody where the checkout is mounted without the right to write."""

TARGET = "results-tiny/forests/forests.h5"

Call = Callable[..., CompletedProcess[str]]


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder of nobody's; those of pytest are in one that only its user may enter."""
    made = Path(tempfile.mkdtemp(prefix="carillon-", dir="/var/tmp"))
    os.chown(made, NOBODY, NOBODY)
    yield made
    shutil.rmtree(made)


@pytest.fixture(params=["home", "no home"])
def call(request, folder) -> Call:
    """Calls a program of the environment as nobody, in the folder; fails if the program does."""
    if os.geteuid() or run("unshare", "--mount", "true").returncode:
        pytest.skip("only root can mount a checkout read-only, and not everywhere")
    home = folder / "home"
    if request.param == "home":
        home.mkdir()
        os.chown(home, NOBODY, NOBODY)
    else:
        home = Path("/nonexistent")
    kept = {"PATH": os.environ["PATH"], "PYTHONPATH": str(CHECKOUT), "OMP_NUM_THREADS": "1"}
    environment = {**kept, "HOME": str(home), "TMPDIR": str(folder), "NOBODY": str(NOBODY)}

    def called(*words: object, **more: str) -> CompletedProcess[str]:
        command = ("unshare", "--mount", "bash", "-c", MOUNTED, CHECKOUT, sys.executable)
        done = run(*command, *words, cwd=folder, env={**environment, **more})
        assert done.returncode == 0, done.stderr
        return done

    return called


def test_a_solve_and_a_training_need_no_folder_but_the_present_one(call, folder):
    assert "Open MPI" in call("-m", "carillon", "environment").stdout
    solve = ("solver", "modes", "builtin:bar", "--resolution", 12, "--modes", 20)
    call("-m", *solve, "--method", "hcms", "--out", "modes.h5")
    call("-m", "dataset_gen", "generate", "--samples", 200, "--out", "shard.h5")
    call("-m", "forests", "train", "shard.h5", "--out", "forests.h5")
    assert "trees" in call("-m", "forests", "inspect", "forests.h5").stdout


def test_the_workflow_writes_below_its_directory_and_the_cache_alone(call, folder):
    """Snakemake ends where it cannot write a cache, before it reads the rules."""
    rules = ("--snakefile", CHECKOUT / "Snakefile", "--directory", folder / "run")
    profile = ("--profile", CHECKOUT / "workflow/profiles/default", "--cores", 2)
    config = ("--configfile", CHECKOUT / "workflow/config/tiny.yaml")
    call("-m", "snakemake", *rules, *profile, TARGET, *config, XDG_CACHE_HOME=str(folder / "cache"))
    assert (folder / "run" / TARGET).is_file()
    assert {path.name for path in folder.iterdir()} - {"home"} == {"run", "cache"}
