"""On three nodes, with messages and files between them: the same bits as on one machine."""

import subprocess
import sys
from pathlib import Path

import pytest

from solver.files.modes_file import read_modes
from tests import slurm_cluster, workflow_runs
from tests.patience import wait_for
from tests.programs import CHECKOUT, checkout_environment, python
from workflow.commands.digest import digest

pytestmark = [pytest.mark.slurm, pytest.mark.mpi, pytest.mark.nightly]

NODES = ["n1", "n2", "n3"]
RANKS = len(NODES)
SAMPLES = 3000
SHARD = f"--samples {SAMPLES} --shards {RANKS} --seed 3".split()
FORESTS = "--trees 1 --depth 6".split()
SMALL = f"""\
models: {{bar: {{mesh: 'builtin:bar', resolution: 12, material: two-region}}}}
dataset: {{samples: {SAMPLES}, distributions: [uniform], shards: {RANKS}}}
forests: {{trees: 1, depth: 6, ranks: {RANKS}, threads: 2}}
solver: {{modes: 16, ranks: {RANKS}, cores: {RANKS}, launcher: LAUNCHER}}
resources: {{find_modes: {{memory_mb: 2000}}}}
"""
MODES = "results/models/bar/ddfem_hcms_ec.h5"
UNCORRECTED = "results/models/bar/hcms.h5"
MODEL = "results/forests/forests.h5"
DATASET = [f"results/dataset/uniform-{shard}.h5" for shard in range(RANKS)]
WHOLE_NODES = ["--ntasks=2", "--mem-per-cpu=500M"]
"""Two tasks fill a node, so that the jobs of an array share none."""
ONE_RANK_EACH = [f"--nodes={RANKS}", f"--ntasks={RANKS}", "--mem-per-cpu=900M"]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory, together):
    """A cluster of three nodes with two cores each."""
    folder = tmp_path_factory.mktemp("slurm")
    options = ("--nodes", RANKS)
    with slurm_cluster.running(folder, together, *options, CPUS="2") as found:
        yield found


def nodes_of(jobs: list[dict[str, str]]) -> list[str]:
    """Where jobs ran, each node or range of nodes once."""
    return sorted({job["NodeList"] for job in jobs})


def run_here(folder: Path, module: str, *words: object) -> None:
    """Run a program of the checkout to a good end, without SLURM."""
    done = python("-m", module, *words, cwd=folder, env=checkout_environment())
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """Folder with the shards and the forests that one process makes."""
    folder = tmp_path_factory.mktemp("here")
    shards = [f"{shard}.h5" for shard in range(RANKS)]
    for shard, file in enumerate(shards):
        run_here(folder, "dataset_gen", "generate", *SHARD, "--shard", shard, "--out", file)
    run_here(folder, "forests", "train", *shards, *FORESTS, "--out", "forests.h5")
    return folder


def test_a_node_has_a_name_processes_memory_and_files_of_its_own(cluster, tmp_path):
    files = [Path(folder, "of-one-node") for folder in ("/tmp", "/var/tmp", "/dev/shm")]
    names = [cluster.on(node, "hostname").stdout.strip() for node in NODES]
    processes = cluster.on("n1", "ps", "-e", "-o", "comm=").stdout.split()
    for file in files:
        assert cluster.on("n1", "touch", file).returncode == 0
        assert cluster.on("n2", "ls", file).returncode != 0 and not file.exists()
    assert cluster.on("n3", "touch", tmp_path / "of-all").returncode == 0
    assert (tmp_path / "of-all").exists()
    assert names == NODES and processes.count("slurmd") == 1 and "slurmctld" not in processes


@pytest.mark.system
def test_ranks_of_three_nodes_share_no_memory(cluster, tmp_path):
    program = (
        "import socket; from mpi4py import MPI; ranks = MPI.COMM_WORLD;"
        "near = ranks.Split_type(MPI.COMM_TYPE_SHARED).size;"
        "found = ranks.gather((socket.gethostname(), near));"
        "ranks.rank or print(found)"
    )
    (tmp_path / "ranks.py").write_text(program)
    slurm_cluster.batch(
        tmp_path,
        f"--wrap=srun --mpi=pmix {sys.executable} -m mpi4py ranks.py",
        options=ONE_RANK_EACH,
    )
    assert str([(node, 1) for node in NODES]) in slurm_cluster.logs(tmp_path)


@pytest.mark.system
def test_mpiexec_starts_ranks_that_find_each_other_on_two_nodes(cluster, tmp_path):
    command = f"mpiexec -n 2 {sys.executable} -m mpi4py -m carillon modes builtin:bar"
    slurm_cluster.batch(
        tmp_path,
        f"--wrap={command} --resolution 10 --modes 16 --out modes.h5",
        options=["--nodes=2", "--ntasks=2", "--mem-per-cpu=900M"],
    )
    assert read_modes(str(tmp_path / "modes.h5")).attributes["ranks"] == 2


def test_modes_are_proved_on_three_nodes_as_on_one_machine(cluster, tmp_path, mpiexec):
    """The count below the last mode, the modes and all evidence, on one thread a rank."""
    solid = "builtin:bar --resolution 24 --material two-region".split()
    words = [*solid, "--modes", "30", "--check-inertia", "--no-estimate", "--out"]
    mpiexec(RANKS, "carillon", "modes", *words, tmp_path / "here.h5", check=True)
    program = f"{sys.executable} -m mpi4py -m carillon modes {' '.join(words)} nodes.h5"
    command = f"OMP_NUM_THREADS=1 srun --mpi=pmix {program}"
    before = len(cluster.ended())
    slurm_cluster.batch(tmp_path, f"--wrap={command}", options=ONE_RANK_EACH)
    assert nodes_of(cluster.ended()[before:]) == ["n[1-3]"]
    proved = read_modes(tmp_path / "nodes.h5").attributes
    assert proved["ranks"] == RANKS and proved["threads"] == 1
    assert proved["inertia_count"] == proved["inertia_expected"] >= 30
    assert digest(tmp_path / "nodes.h5") == digest(tmp_path / "here.h5")


def test_delayed_links_take_their_time(cluster, tmp_path):
    (tmp_path / "there.py").write_text(
        "import time; from mpi4py import MPI; ranks = MPI.COMM_WORLD;"
        "ranks.barrier(); begin = time.perf_counter();"
        "ranks.recv(source=0) if ranks.rank else [ranks.send(0, each) for each in (1, 2)];"
        "ranks.barrier(); ranks.rank or print(time.perf_counter() - begin)"
    )
    links = [sys.executable, CHECKOUT / "slurm" / "delayed_links.py", cluster.folder, "50"]
    process = subprocess.Popen([str(word) for word in links])
    try:
        there = ("ip", "link", "show", "late", "up")
        wait_for(lambda: "late" in cluster.on("n3", *there).stdout, "no link", process)
        program = f"srun --mpi=pmix {sys.executable} -m mpi4py there.py"
        command = f"OMPI_MCA_btl_tcp_if_include=late {program}"
        slurm_cluster.batch(tmp_path, f"--wrap={command}", options=ONE_RANK_EACH)
    finally:
        process.kill()
        process.wait()
    # A message, and the barrier's answer.
    assert float(slurm_cluster.logs(tmp_path).split()[-1]) > 0.1


def test_shards_of_an_array_are_those_of_one_process(cluster, here, tmp_path):
    before = len(cluster.ended())
    slurm_cluster.batch(
        tmp_path,
        *(CHECKOUT / "slurm" / "shards.sbatch", "%a.h5", *SHARD),
        options=[f"--array=0-{RANKS - 1}", *WHOLE_NODES],
    )
    assert nodes_of(cluster.ended()[before:]) == NODES
    for shard in range(RANKS):
        assert digest(tmp_path / f"{shard}.h5") == digest(here / f"{shard}.h5")


def test_trees_of_an_array_and_leaves_of_ranks_are_the_forests_of_one_process(
    cluster, here, tmp_path
):
    shards = [here / f"{shard}.h5" for shard in range(RANKS)]
    script, trees = CHECKOUT / "slurm" / "forests.sbatch", range(2)
    before = len(cluster.ended())
    slurm_cluster.batch(
        tmp_path,
        *(script, "grow", "tree-%a.h5", *shards, *FORESTS),
        options=["--array=0-1", *WHOLE_NODES],
    )
    slurm_cluster.batch(
        tmp_path,
        *(script, "train", "forests.h5", *shards, *FORESTS),
        *("--structure", *(f"tree-{tree}.h5" for tree in trees)),
        options=ONE_RANK_EACH,
    )
    assert nodes_of(cluster.ended()[before:]) == ["n1", "n2", "n[1-3]"]
    assert digest(tmp_path / "forests.h5") == digest(here / "forests.h5")


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """Folder of a run without SLURM, with as many ranks."""
    folder = tmp_path_factory.mktemp("local")
    (folder / "config.yaml").write_text(SMALL.replace("LAUNCHER", "mpiexec --oversubscribe"))
    wanted = (MODES, UNCORRECTED, "--cores", 2, "--configfile", "config.yaml")
    done = workflow_runs.snakemake(folder, *wanted)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def remote(cluster, tmp_path_factory):
    """Folder of a run by jobs of SLURM, and the jobs."""
    folder = tmp_path_factory.mktemp("remote")
    (folder / "config.yaml").write_text(SMALL.replace("LAUNCHER", "null"))
    before = len(cluster.ended())
    wanted = (MODES, UNCORRECTED, "--configfile", "config.yaml")
    # One thread a rank, as on two cores, since sums of more are others.
    wanted += ("--set-resources", f"find_modes:nodes={RANKS}")
    slurm_cluster.finish(slurm_cluster.snakemake(folder, *wanted), folder)
    return folder, cluster.ended()[before:]


def test_a_run_on_three_nodes_finds_the_same_bits_as_a_local_run(local, remote):
    folder, jobs = remote
    # Two cores of each rank fill a node: two trees and their leaves; and two runs of the solver.
    assert [job["NodeList"] for job in jobs].count("n[1-3]") == 5
    for file in (*DATASET, MODEL, UNCORRECTED, MODES):
        assert digest(folder / file) == digest(local / file), file
    for each in (folder, local):
        assert read_modes(str(each / MODES)).attributes["ranks"] == RANKS
