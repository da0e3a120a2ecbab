"""The shared folder of nodes fails, or is shared with others: no finished work is lost."""

import fcntl
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import pytest

from tests import slurm_cluster
from tests.programs import run
from tests.slurm_cluster import Cluster
from tests.submitted_shards import (
    ARRAY,
    COUNT,
    NODES,
    Submitted,
    require_equal,
    three_nodes,
    undisturbed_digests,
)

pytestmark = [pytest.mark.slurm, pytest.mark.mpi, pytest.mark.nightly]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory, together):
    """A cluster of three nodes."""
    with three_nodes(tmp_path_factory, together) as found:
        yield found


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> list[str]:
    """Digests of the shards that one process makes."""
    return undisturbed_digests(tmp_path_factory.mktemp("undisturbed"))


class Disk:
    """A file system that all nodes have mounted, and nobody else; jobs print elsewhere.

    Attributes
    ----------
    folder : where it is.
    seen : the same, as this process sees it.
    """

    def __init__(self, cluster: Cluster, image: Path) -> None:
        self.cluster = cluster
        self.image = image
        self.folder = Path("/mnt")
        self.seen = cluster.files_of("n1") / "mnt"
        with image.open("wb") as file:
            file.truncate(DISK_BYTES)
        run("mkfs.ext4", "-q", "-F", image, check=True)
        self.mount()

    def mount(self) -> None:
        """Mount it, on all nodes the same one."""
        self.on("n1", "mount", "-o", "loop", self.image, self.folder)
        device = self.on("n1", "findmnt", "--noheadings", "--output=SOURCE", self.folder)
        for node in NODES[1:]:
            self.on(node, "mount", device.strip(), self.folder)

    def unmount(self) -> None:
        """Take it away from all nodes."""
        for node in NODES:
            self.on(node, "umount", "--lazy", self.folder)

    def on(self, node: str, *words: object) -> str:
        """What a program prints on a node."""
        return self.cluster.on(node, *words, check=True).stdout

    def freeze(self) -> None:
        """Let it answer nobody, like a server that is away."""
        self.on("n1", "fsfreeze", "--freeze", self.folder)

    def thaw(self) -> None:
        """Let it answer again."""
        self.on("n1", "fsfreeze", "--unfreeze", self.folder)

    def break_down(self) -> None:
        """Let it answer everybody with an error, until it is mounted again."""
        folder = os.open(self.seen, os.O_RDONLY)
        fcntl.ioctl(folder, EXT4_SHUTDOWN, struct.pack("I", 1))
        os.close(folder)

    def submit(self, *before: object, cores: int = 2, **variables: str) -> Submitted:
        """Make shards in its folder by jobs that are submitted on the first node."""
        options = [*ARRAY, f"--cpus-per-task={cores}"]
        words = ["bash", slurm_cluster.SCRIPT, "on", self.cluster.folder, "n1", *before]
        logs = Path(tempfile.mkdtemp(dir=self.image.parent))
        logs.chmod(0o777)
        return Submitted(self.folder, options, self.seen, logs, words, **variables)


DISK_BYTES = 100_000_000
EXT4_SHUTDOWN = 0x8004587D
"""Number of the request, see linux/ext4.h."""


@pytest.fixture
def disk(cluster, tmp_path):
    """A file system of the nodes."""
    if not shutil.which("mkfs.ext4", path=slurm_cluster.DAEMONS):
        pytest.skip("no mkfs.ext4 here")
    try:
        made = Disk(cluster, tmp_path / "disk.image")
    except subprocess.CalledProcessError as error:
        pytest.skip(f"no file system can be mounted from a file here: {error.stderr}")
    yield made
    made.unmount()


def test_jobs_wait_for_a_shared_folder_that_does_not_answer(cluster, undisturbed, disk):
    jobs = disk.submit()
    jobs.stop_in_the_middle(*range(COUNT))
    disk.freeze()
    jobs.go_on(*range(COUNT))
    time.sleep(10)
    disk.thaw()
    jobs.finish()
    require_equal(disk.seen, undisturbed)


def test_jobs_get_on_with_a_shared_folder_that_is_slow(cluster, undisturbed, disk):
    """Most of the time it does not answer."""
    jobs = disk.submit()
    while jobs.run.poll() is None:
        disk.freeze()
        time.sleep(0.5)
        disk.thaw()
        time.sleep(0.05)
    jobs.finish()
    require_equal(disk.seen, undisturbed)


def test_a_full_shared_folder_costs_no_finished_work(cluster, undisturbed, disk):
    jobs = disk.submit()
    jobs.stop_in_the_middle(*range(COUNT))
    filler = disk.seen / "filler"
    with suppress(OSError), filler.open("wb", buffering=0) as file:
        while file.write(bytes(4096)):
            pass
    jobs.go_on(*range(COUNT))
    printed = jobs.fail()
    sentence = r"\(in job \d+_1 on n\d\): .*1.h5.* \(No space left on device; .* of 100,000 samples"
    assert re.search(sentence, printed), printed
    filler.unlink()
    printed = disk.submit().finish()
    assert "going on after" in printed
    require_equal(disk.seen, undisturbed)


def test_a_shared_folder_that_breaks_down_costs_no_finished_work(cluster, undisturbed, disk):
    jobs = disk.submit()
    jobs.stop_in_the_middle(*range(COUNT))
    # Samples are on the disk a second after they are in the journal; here at once.
    disk.on("n1", "sync", "--file-system", disk.folder)
    disk.break_down()
    jobs.go_on(*range(COUNT))
    sentence = r"\(in job \d+_1 on n\d\): .*1.h5.*: could not be written \(Input/output error\)"
    assert re.search(sentence, jobs.fail())
    disk.unmount()
    disk.mount()
    printed = disk.submit().finish()
    assert "going on after" in printed, printed
    require_equal(disk.seen, undisturbed)


def test_of_two_users_who_submit_the_same_jobs_one_is_told_of_the_other(
    cluster, undisturbed, disk, together
):
    """Their files are for all to write: the second one's jobs leave the first one's alone."""
    for folder in (disk.image.parent, cluster.folder, *cluster.folder.parents):
        if folder.is_relative_to(together):
            folder.chmod(0o711)
    disk.seen.chmod(0o777)
    everybody = ("sh", "-c", 'umask 0; exec "$@"', "sh")
    other = (*everybody, "setpriv", "--reuid=games", "--regid=games", "--clear-groups")
    own_cache = {"CARILLON_CACHE": "/tmp/cache", "HOME": "/tmp"}
    tried = cluster.on("n1", *other, sys.executable, "-c", "import dataset_gen")
    if tried.returncode:
        pytest.skip(f"another user cannot run the programs here: {tried.stderr[-200:]}")
    first = disk.submit(*everybody, cores=1)
    first.stop_in_the_middle(*range(COUNT))
    second = disk.submit(*other, cores=1, **own_cache)
    printed = second.fail()
    sentence = r"\(in job \d+_1 on n\d\): .*1.h5.*: process \d+ on n\d is generating this shard"
    assert re.search(sentence, printed), printed
    first.go_on(*range(COUNT))
    first.finish()
    require_equal(disk.seen, undisturbed)
    assert (
        disk.submit(*other, cores=1, **own_cache).finish().count("already, nothing to do") == COUNT
    )
