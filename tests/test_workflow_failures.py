"""Full, damaged and slow file systems, and jobs that are killed while they write a result."""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import psutil
import pytest

from carillon.errors import UserError
from dataset_gen.journal import journal_of
from solver.files.modes_file import read_modes
from tests.disks import KIB, disk_on
from tests.patience import HANG_SECONDS, wait_for, words_of
from tests.workflow_runs import CHECKOUT, PROFILE, snakemake
from workflow.commands.digest import digest

pytestmark = pytest.mark.nightly

CONFIG = """\
models: {bar: {mesh: 'builtin:bar', resolution: 20, material: two-region}}
dataset: {samples: 600, distributions: [uniform], shards: 2}
forests: {trees: 1, depth: 6}
solver: {modes: 12, cores: 1}
"""
SHARDS = ["results/dataset/uniform-0.h5", "results/dataset/uniform-1.h5"]
FORESTS = "results/forests/forests.h5"
SHARD_LOG = "results/logs/dataset/uniform-1.log"
TRUTH = "results/models/bar/truth.h5"
HCMS = "results/models/bar/hcms.h5"


def run(folder: Path, *targets: str) -> subprocess.CompletedProcess[str]:
    return snakemake(folder, *options(*targets, cores=2))


def options(*targets: str, cores: int) -> list[object]:
    """The profile's options stand before those that take several values."""
    start = ["--profile", PROFILE, "--cores", cores, "--keep-going"]
    return [*start, "--configfile", "config.yaml", "--", *targets]


def output_of(done: subprocess.CompletedProcess[str]) -> str:
    return done.stdout + done.stderr


def finished(done: subprocess.CompletedProcess[str]) -> dict[str, int]:
    """Jobs of a run that has ended well, by rule."""
    output = output_of(done)
    assert done.returncode == 0, output[-6000:]
    jobs = [line.split("Rule: ")[1].rstrip(")") for line in output.splitlines() if "Rule: " in line]
    return {rule: jobs.count(rule) for rule in jobs}


def unfinished(folder: Path) -> list[Path]:
    return [path for path in folder.rglob(".*") if path.suffix in (".h5", ".journal")]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> Path:
    """Folder of a run that nothing has disturbed."""
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "config.yaml").write_text(CONFIG)
    assert finished(run(folder, FORESTS, TRUTH, HCMS))["find_modes"] == 2
    assert unfinished(folder) == []
    return folder


@pytest.fixture
def folder(undisturbed, tmp_path) -> Path:
    """A copy of it, with its times."""
    return Path(shutil.copytree(undisturbed, tmp_path / "copy"))


@pytest.fixture
def assert_as_undisturbed(undisturbed) -> Callable[..., None]:
    def check(folder: Path, *files: str) -> None:
        for file in files:
            assert digest(folder / file) == digest(undisturbed / file), file

    return check


# Full --------------------------------------------------------------------------------------------


@pytest.fixture
def small_disk(folder) -> Iterator[Callable[[int], None]]:
    """Puts the results on a file system with so many bytes to spare; again to change that."""
    results, aside = folder / "results", folder / "aside"
    results.rename(aside)
    results.mkdir()
    with disk_on(results, 64 * KIB * KIB) as give:
        shutil.copytree(aside, results, dirs_exist_ok=True)
        yield give


def test_a_run_on_a_full_disk_goes_on_when_there_is_room(folder, small_disk, assert_as_undisturbed):
    shard, truth = folder / SHARDS[1], folder / TRUTH
    for path in (shard, truth):
        path.unlink()
    small_disk(80 * KIB)
    targets = (*SHARDS, TRUTH)
    done = run(folder, *targets)
    assert done.returncode != 0
    for file in (SHARDS[1], TRUTH):
        sentence = f"{file}: could not be written (No space left on device; make room and run"
        assert sentence in output_of(done)
    # The run says it too: with no room at all the log of a job stays empty.
    assert "results: cannot be written (No space left on device; make room" in output_of(done)
    assert not shard.exists() and not truth.exists()
    assert unfinished(folder) == [journal_of(shard)]
    small_disk(KIB * KIB)
    assert finished(run(folder, *targets)) == {"generate_shard": 1, "find_modes": 1}
    assert "going on after 300 of 300" in (folder / SHARD_LOG).read_text()
    assert_as_undisturbed(folder, *targets)
    assert unfinished(folder) == []


# Damaged -----------------------------------------------------------------------------------------


def damage(path: Path, change: Callable[[bytearray], object]) -> None:
    """Change a file as a bad copy does, which keeps its time."""
    status = path.stat()
    content = bytearray(path.read_bytes())
    change(content)
    path.write_bytes(content)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def cut(content: bytearray) -> None:
    del content[len(content) // 2 :]


def flip(content: bytearray) -> None:
    content[len(content) // 2] ^= 1


def test_damaged_files_are_named_and_nothing_comes_of_them(folder, assert_as_undisturbed):
    """The shard is asked for last, since its missing description keeps back whatever needs it."""
    damaged = {
        FORESTS: (flip, "results/forests/forests.json"),
        TRUTH: (cut, "results/models/bar/convergence.json"),
        SHARDS[1]: (cut, "results/dataset/uniform-1.json"),
    }
    needing = [file for _, file in damaged.values()]
    for file, (change, _) in damaged.items():
        damage(folder / file, change)
    output = output_of(refused := run(folder, *needing[:2]))
    assert refused.returncode != 0
    (folder / needing[2]).unlink()
    output += output_of(refused := run(folder, needing[2]))
    assert refused.returncode != 0
    for file in damaged:
        sentences = [line for line in output.splitlines() if f"{file}: is " in line]
        assert len(sentences) == 1, output[-6000:]
        assert "damaged" in sentences[0] and "remove it and generate" in sentences[0]
    assert not any((folder / file).exists() for file in needing)
    for file in damaged:
        (folder / file).unlink()
    assert finished(run(folder, *needing)) == {
        "generate_shard": 1,
        "describe_shard": 1,
        "grow_tree": 2,
        "train_forests": 1,
        "describe_forests": 1,
        "find_modes": 1,
        "follow_convergence": 1,
    }
    assert_as_undisturbed(folder, *SHARDS, FORESTS, TRUTH, HCMS)


def test_zeros_where_a_copy_failed_are_no_modes(undisturbed, tmp_path):
    """HDF5's own checksum of a chunk of zeros is zero."""
    path = Path(shutil.copy(undisturbed / TRUTH, tmp_path))
    with h5py.File(path) as file:
        chunk = file["eigenvalues"].id.get_chunk_info(0)
    with path.open("rb+") as stream:
        stream.seek(chunk.byte_offset)
        stream.write(bytes(chunk.size))
    with pytest.raises(UserError, match=r"truth\.h5: is damaged .* remove it and generate"):
        read_modes(path)


# Killed, slow ------------------------------------------------------------------------------------

SLOW_DISK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdarg.h>
#include <string.h>
#include <unistd.h>

static void wait_at(const char *path)
{
    if (strstr(path, "results/")) usleep(30000);
}

#define OPEN(name)                                                                        \
    int name(const char *path, int flags, ...)                                            \
    {                                                                                     \
        va_list rest;                                                                     \
        va_start(rest, flags);                                                            \
        mode_t mode = va_arg(rest, mode_t);                                               \
        va_end(rest);                                                                     \
        wait_at(path);                                                                    \
        return ((int (*)(const char *, int, ...))dlsym(RTLD_NEXT, #name))(path, flags, mode); \
    }
OPEN(open)
OPEN(open64)

int rename(const char *from, const char *to)
{
    wait_at(to);
    return ((int (*)(const char *, const char *))dlsym(RTLD_NEXT, "rename"))(from, to);
}

int fsync(int file)
{
    usleep(300000);
    return ((int (*)(int))dlsym(RTLD_NEXT, "fsync"))(file);
}
"""
"""Delays what goes to disk by 0.3 s, and every name below results by 0.03 s."""


@pytest.fixture(scope="module")
def slow_disk(tmp_path_factory) -> dict[str, str]:
    """Environment of processes for which the disk is slow."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler to make a disk slow with")
    library = tmp_path_factory.mktemp("slow") / "slow.so"
    source = library.with_suffix(".c")
    source.write_text(SLOW_DISK)
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    return {**os.environ, "PYTHONPATH": str(CHECKOUT), "LD_PRELOAD": str(library)}


def start(folder: Path, environment: dict[str, str], *arguments: object) -> subprocess.Popen[str]:
    """Start a module in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", *map(str, arguments)],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def written(folder: Path, run: subprocess.Popen[str], left: int = 0) -> list[Path]:
    """Half-written results: one that a job of a run is about to name, and those left before."""
    wait_for(lambda: len(unfinished(folder)) != left, "a half-written result", run)
    return unfinished(folder)


def job_of(run: subprocess.Popen[str], name: str) -> list[psutil.Process]:
    """Processes of the job that makes a file."""
    processes = psutil.Process(run.pid).children(recursive=True)
    return [process for process in processes if any(name in word for word in words_of(process))]


@pytest.mark.system
def test_killed_while_a_result_is_written(folder, slow_disk, assert_as_undisturbed):
    """First one job alone, then all; the same command finishes, on a disk that is as slow."""
    results = {(folder / file).name: folder / file for file in (FORESTS, TRUTH)}
    for path in results.values():
        path.unlink()
    command = ["snakemake", "-s", CHECKOUT / "Snakefile", *options(FORESTS, TRUTH, cores=1)]
    run = start(folder, slow_disk, *command)
    try:
        (first,) = written(folder, run)
        for process in job_of(run, next(name for name in results if name in first.name)):
            process.kill()
        assert len(written(folder, run, left=1)) == 2
    finally:
        os.killpg(run.pid, signal.SIGKILL)
        output, _ = run.communicate()
    assert "Error in rule" in output
    assert not any(path.exists() for path in results.values())
    again = start(folder, slow_disk, *command)
    output, _ = again.communicate(timeout=HANG_SECONDS)
    assert again.returncode == 0, output[-6000:]
    assert "removed the lock of a run that was killed" in output
    assert_as_undisturbed(folder, *SHARDS, FORESTS, TRUTH)
    assert unfinished(folder) == []


@pytest.mark.system
def test_two_processes_make_a_shard_once_on_a_slow_disk(undisturbed, slow_disk, tmp_path):
    (tmp_path / "results").mkdir()
    arguments = "--samples 600 --shard 0 --shards 2 --out results/shard.h5"
    both = [
        start(tmp_path, slow_disk, "dataset_gen", "generate", *arguments.split()) for _ in range(2)
    ]
    outputs = {process.communicate(timeout=HANG_SECONDS)[0]: process.returncode for process in both}
    assert sorted(outputs.values()) == [0, 2]
    refused = next(output for output, status in outputs.items() if status == 2)
    # The journal is there before it says whose it is.
    holder = r"(another process|process \d+ on \S+) is generating this shard"
    assert re.search(holder, refused), refused
    shard = tmp_path / "results" / "shard.h5"
    assert digest(shard) == digest(undisturbed / SHARDS[0])
    assert list(shard.parent.iterdir()) == [shard]
