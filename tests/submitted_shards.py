"""Jobs that make shards on three nodes, while a test does what it likes to them (test support)."""

import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import psutil
import pytest

from dataset_gen.journal import journal_of
from tests import slurm_cluster
from tests.patience import HANG_SECONDS, wait_for, words_of
from tests.programs import CHECKOUT, checkout_environment, python, run
from tests.slurm_cluster import Cluster
from workflow.commands.digest import digest

NODES = ["n1", "n2", "n3"]
COUNT = len(NODES)
SHARD = f"--samples 300000 --shards {COUNT} --seed 5 --objective chen2015".split()
SCRIPT = CHECKOUT / "slurm" / "shards.sbatch"
ARRAY = [f"--array=0-{COUNT - 1}", "--ntasks=1", "--cpus-per-task=2", "--mem-per-cpu=500M"]
"""A shard on each node."""
ON_RANKS = ["--array=0", f"--nodes={COUNT}", f"--ntasks={COUNT}", "--cpus-per-task=2"]
ON_RANKS += ["--mem-per-cpu=500M"]
"""A shard by a rank on each node."""


@contextmanager
def three_nodes(factory: pytest.TempPathFactory, together: Path) -> Iterator[Cluster]:
    """A cluster of three nodes with two cores each."""
    folder = factory.mktemp("slurm")
    with slurm_cluster.running(folder, together, "--nodes", COUNT, CPUS="2") as found:
        yield found


def undisturbed_digests(folder: Path) -> list[str]:
    """Digests of the shards that one process makes."""
    for shard in range(COUNT):
        out = ["--shard", shard, "--out", f"{shard}.h5"]
        words = ("-m", "dataset_gen", "generate", *SHARD, *out)
        python(*words, cwd=folder, env=checkout_environment(), check=True)
    return [digest(folder / f"{shard}.h5") for shard in range(COUNT)]


def workers(shard: str, folder: Path) -> list[psutil.Process]:
    """Processes, on whichever node, that make a shard in a folder."""
    found = []
    for process in psutil.process_iter():
        words = words_of(process)
        if "dataset_gen" in words and shard in words and "python" in words[0]:
            with suppress(psutil.Error):
                if Path(process.cwd()) == folder:
                    found.append(process)
    return found


class Submitted:
    """Jobs that make shards in a folder, while the test does what it likes to them."""

    def __init__(
        self,
        folder: Path,
        options: list[str],
        seen: Path | None = None,
        logs: Path | None = None,
        before: Sequence[object] = (),
        **variables: str,
    ) -> None:
        self.folder = folder
        """As the nodes see it."""
        self.seen = seen or folder
        """As this process sees it."""
        self.logs = logs or folder
        """Where jobs print."""
        options = [*options, f"--output={self.logs}/slurm-%A_%a.out"]
        words = (SCRIPT, "%a.h5", *SHARD)
        self.run = slurm_cluster.submit(folder, *words, options=options, before=before, **variables)

    def stop_in_the_middle(self, *shards: int) -> None:
        """Wait until shards are under way, and let their processes hang."""
        for shard in shards:
            wait_for(partial(self._begun, shard), f"shard {shard}", self.run)
            for worker in self.workers(shard):
                worker.send_signal(signal.SIGSTOP)

    def go_on(self, *shards: int) -> None:
        """Let the processes of shards work again."""
        for shard in shards:
            for worker in self.workers(shard):
                worker.send_signal(signal.SIGCONT)

    def workers(self, shard: int) -> list[psutil.Process]:
        """Processes, on whichever node, that make a shard."""
        return workers(f"{shard}.h5", self.folder)

    def finish(self) -> str:
        """What the jobs have printed, once all have ended well."""
        status = self.run.wait(HANG_SECONDS)
        assert status == 0, slurm_cluster.logs(self.logs)
        return slurm_cluster.logs(self.logs)

    def fail(self) -> str:
        """The same, once one of them has failed."""
        assert self.run.wait(HANG_SECONDS) != 0, slurm_cluster.logs(self.logs)
        return slurm_cluster.logs(self.logs)

    def _begun(self, shard: int) -> bool:
        journal = journal_of(self.seen / f"{shard}.h5")
        return journal.exists() and journal.stat().st_size > 10_000


def node_of(shard: int) -> str:
    """Where a shard of the only array in the queue is made."""
    told = run("squeue", "--noheader", "--states=RUNNING", "--format=%K %N").stdout.split("\n")
    return dict(line.split() for line in told if line)[str(shard)]


def require_equal(folder: Path, digests: list[str], *shards: int) -> None:
    """Compare shards with those that nothing has disturbed."""
    for shard in shards or range(COUNT):
        assert digest(folder / f"{shard}.h5") == digests[shard]


def wait_for_end(cluster: Cluster, state: str, before: int) -> None:
    """Wait until one more job has ended in a state."""
    wait_for(lambda: cluster.ends().count(state) > before, state)


def node_with(cluster: Cluster, process: psutil.Process) -> str:
    """Name of the node that a process runs on."""
    place = Path("/proc", str(process.pid), "ns", "net").readlink()
    files = {name: (cluster.folder / f"{name}.init").read_text().split() for name in NODES}
    return next(name for name, (_, network) in files.items() if network == str(place))
