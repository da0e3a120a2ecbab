"""Kernels are compiled and, where a folder can be written, kept, whoever runs the program."""

import os
from pathlib import Path

import pytest
from numba.core import caching

from carillon.processes import kernel_cache
from tests.programs import python

KERNEL = """
import numba

@numba.njit(cache=True)
def twice(x):
    return 2 * x
"""
SCRIPT = """
import logging, sys
import carillon
from carillon.processes import kernel_cache
from carillon.command_line import logs
logs.show()
kernel_cache.PLACES = ()
from numba.core import caching
places = {"beside": [caching.InTreeCacheLocator], "home": [caching.UserWideCacheLocator]}
caching.CacheImpl._locator_classes = places.get(sys.argv[1], [])
import kernel
assert kernel.twice(2) == 4 and kernel.twice(2.5) == 5.0
print(sum(kernel.twice.stats.cache_hits.values()))
"""
"""Numba's own places but one are taken away; root can write everywhere."""


@pytest.fixture
def kernel(tmp_path):
    """Calls a kernel in a process, by itself without a home; returns hits and what was said."""
    source = tmp_path / "source"
    source.mkdir()
    (source / "kernel.py").write_text(KERNEL)

    def call(place: str, temporary: Path, **more: str) -> tuple[int, str]:
        removed = (kernel_cache._CLASSES, kernel_cache._DIRECTORY)
        kept = {name: value for name, value in os.environ.items() if name not in removed}
        path = os.pathsep.join([str(source), *filter(None, [os.environ.get("PYTHONPATH")])])
        variables = {"XDG_CACHE_HOME": "/dev/null", "TMPDIR": str(temporary), "PYTHONPATH": path}
        done = python("-c", SCRIPT, place, env={**kept, **variables, **more})
        assert done.returncode == 0, done.stderr
        return int(done.stdout), done.stderr

    return call


def test_kernels_are_kept_in_a_private_folder_where_no_other_can_be_written(kernel, tmp_path):
    hits, said = kernel("nowhere", tmp_path)
    folder = tmp_path / f"{kernel_cache.FOLDER}-{os.geteuid()}"
    assert hits == 0 and f"kept in {folder}/kernels" in said and len(said.splitlines()) == 1
    assert folder.stat().st_mode & 0o777 == 0o700
    assert kernel("nowhere", tmp_path)[0] == 2


def test_kernels_that_were_compiled_beside_the_source_are_taken_over(kernel, tmp_path):
    assert kernel("beside", tmp_path) == (0, "")
    assert kernel("nowhere", tmp_path)[0] == 2


def test_a_user_who_cannot_write_beside_the_source_begins_with_the_kernels_there(kernel, tmp_path):
    home = {"XDG_CACHE_HOME": str(tmp_path / "home")}
    assert kernel("beside", tmp_path) == (0, "")
    assert kernel("home", tmp_path, **home) == (2, "")
    assert list((tmp_path / "home" / "numba").rglob("*.nbc"))


def test_kernels_of_two_kinds_of_processors_are_kept_side_by_side(kernel, tmp_path):
    processors = [{"NUMBA_CPU_NAME": name} for name in ("generic", "nehalem")]
    assert [kernel("beside", tmp_path, **each)[0] for each in processors] == [0, 0]
    assert [kernel("beside", tmp_path, **each)[0] for each in processors] == [2, 2]


INNER = """
import numba

FACTOR = 1.0

@numba.njit(cache=True)
def inner(x):
    return 3 * x
"""
OUTER = """
import carillon
import numba
from inner import FACTOR, inner

@numba.njit(cache=True)
def outer(x):
    return inner(x) * FACTOR

print(outer(1.0), outer.stats.cache_hits.total())
"""


@pytest.mark.parametrize(
    ("before", "after", "result"),
    [("3 * x", "5 * x", "5.0"), ("FACTOR = 1.0", "FACTOR = 2.0", "6.0")],
)
def test_a_kernel_is_compiled_anew_when_what_it_uses_in_another_file_changes(
    tmp_path, before, after, result
):
    (tmp_path / "outer.py").write_text(OUTER)
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])

    def printed() -> list[str]:
        done = python("-c", "import outer", env={**os.environ, "PYTHONPATH": path})
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    (tmp_path / "inner.py").write_text(INNER)
    assert [printed(), printed()] == [["3.0", "0"], ["3.0", "1"]]
    (tmp_path / "inner.py").write_text(INNER.replace(before, after))
    assert printed() == [result, "0"]


def test_two_that_compile_at_once_never_get_the_code_of_the_other(tmp_path):
    """The second one writes between the index of the first and its code."""
    first, second, later = (caching.IndexDataCacheFile(tmp_path, "kernel", 1) for _ in range(3))
    write = first._save_data

    def write_late(*words):
        second._load_index = dict  # it looked before the first one wrote
        second.save("znver3", "code with AVX2")
        write(*words)

    first._save_data = write_late
    first.save("znver4", "code with AVX-512")
    assert later.load("znver3") == "code with AVX2"
    assert later.load("znver4") in (None, "code with AVX-512")


def test_kernels_are_compiled_every_time_where_nothing_can_be_written(kernel, tmp_path):
    for _ in range(2):
        hits, said = kernel("nowhere", tmp_path / "absent")
        assert hits == 0 and "kept nowhere" in said and "NUMBA_CACHE_DIR" in said


@pytest.mark.parametrize("fault", ["open to others", "link", "file"])
def test_a_folder_that_others_may_have_made_is_not_used(tmp_path, monkeypatch, fault):
    """What lies in it would be run."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(kernel_cache, "PLACES", ())
    folder = kernel_cache.private_folder()
    assert folder is not None and folder.parent == tmp_path
    folder.rmdir()
    if fault == "link":
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        folder.symlink_to(tmp_path / "elsewhere")
    elif fault == "file":
        folder.touch()
    else:
        folder.mkdir()
        folder.chmod(0o777)
    assert kernel_cache.private_folder() is None


def test_programs_that_are_started_get_a_cache(tmp_path, monkeypatch):
    """Snakemake ends without one."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    environment = {"XDG_CACHE_HOME": "/dev/null"}
    kernel_cache.configure(environment)
    assert Path(environment["XDG_CACHE_HOME"]).parent == tmp_path


def test_a_user_with_a_cache_keeps_numbas_own_rules(tmp_path):
    environment = {"XDG_CACHE_HOME": str(tmp_path)}
    kernel_cache.configure(environment)
    assert list(environment) == ["XDG_CACHE_HOME"]


def test_the_first_compilation_of_a_process_is_told(tmp_path):
    (tmp_path / "kernel.py").write_text(KERNEL)
    script = (
        "from carillon.processes import kernel_cache\n"
        "kernel_cache.tell_compilation(lambda: print('compiling'))\n"
        "import kernel\n"
        "print(kernel.twice(2), kernel.twice(2.5))\n"
    )
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    for said in ("compiling\n4 5.0\n", "4 5.0\n"):
        done = python("-c", script, env={**os.environ, "PYTHONPATH": path})
        assert (done.returncode, done.stdout) == (0, said), done.stderr
