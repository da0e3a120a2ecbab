"""Nodes and the controller fail: no work is lost, and results are the same."""

import re
from pathlib import Path

import pytest

from tests import slurm_cluster
from tests.patience import wait_for
from tests.programs import run
from tests.submitted_shards import (
    ARRAY,
    COUNT,
    NODES,
    ON_RANKS,
    SCRIPT,
    Submitted,
    node_of,
    require_equal,
    three_nodes,
    undisturbed_digests,
    wait_for_end,
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


def test_a_shard_goes_on_on_another_node_when_its_node_dies(cluster, undisturbed, tmp_path):
    failures = cluster.ends().count("NODE_FAIL")
    jobs = Submitted(tmp_path, ARRAY)
    jobs.stop_in_the_middle(1)
    node = node_of(1)
    cluster.fail(node)
    wait_for_end(cluster, "NODE_FAIL", failures)
    cluster.start_waiting_jobs()
    printed = jobs.finish()
    assert re.search(r"job \d+_1 on n\d: started again \(time 1\), as its node failed", printed)
    assert "going on after" in printed and node not in re.findall(r"_1 on (n\d):", printed)
    require_equal(tmp_path, undisturbed)
    cluster.repair(node)
    assert run("srun", f"--nodelist={node}", "hostname").stdout.split() == [node]


def test_ranks_end_with_the_node_of_one_of_them_and_go_on_when_it_is_back(
    cluster, undisturbed, tmp_path
):
    failures = cluster.ends().count("NODE_FAIL")
    jobs = Submitted(tmp_path, ON_RANKS)
    jobs.stop_in_the_middle(0)
    cluster.fail("n3")
    wait_for_end(cluster, "NODE_FAIL", failures)
    wait_for(lambda: not jobs.workers(0), "the end of the other ranks", jobs.run)
    cluster.repair("n3")
    printed = jobs.finish()
    assert re.search(r"job \d+_0 on n\[1-3\]: started again \(time \d\), as its node", printed)
    assert "going on after" in printed
    require_equal(tmp_path, undisturbed, 0)


def test_jobs_do_not_mind_a_controller_that_starts_again(cluster, undisturbed, tmp_path):
    jobs = Submitted(tmp_path, ARRAY)
    jobs.stop_in_the_middle(*range(COUNT))
    cluster.restart_controller(pause=3)
    jobs.go_on(*range(COUNT))
    assert "started again" not in jobs.finish()
    require_equal(tmp_path, undisturbed)


def test_a_job_that_is_preempted_goes_on_when_the_urgent_one_has_ended(
    cluster, undisturbed, tmp_path
):
    preempted = cluster.ends().count("PREEMPTED")
    jobs = Submitted(tmp_path, ARRAY)
    jobs.stop_in_the_middle(1)
    urgent = ["--partition=urgent", f"--nodelist={node_of(1)}", "--exclusive"]
    assert run("srun", *urgent, "hostname", check=True).stdout
    wait_for_end(cluster, "PREEMPTED", preempted)
    cluster.start_waiting_jobs()
    printed = jobs.finish()
    assert re.search(r"job \d+_1 on n\d: started again \(time 1\), .* it was preempted", printed)
    require_equal(tmp_path, undisturbed)


def test_a_job_waits_for_itself_on_a_node_that_was_cut_off(cluster, undisturbed, tmp_path):
    """That node works on: its shard is made once, and the job ends well."""
    failures = cluster.ends().count("NODE_FAIL")
    jobs = Submitted(tmp_path, ARRAY)
    jobs.stop_in_the_middle(1)
    node = node_of(1)
    cluster.unplug(node)
    wait_for_end(cluster, "NODE_FAIL", failures)
    cluster.start_waiting_jobs()
    wait_for(lambda: "is held by another process" in slurm_cluster.logs(tmp_path), "the second")
    jobs.go_on(1)
    printed = jobs.finish()
    cluster.plug(node)
    assert "1.h5: holds samples 100000..199999, chen2015 already, nothing to do" in printed
    require_equal(tmp_path, undisturbed)
    idle = ["sinfo", "--noheader", f"--nodes={node}", "--partition=compute", "--format=%t"]
    wait_for(lambda: run(*idle).stdout.strip() == "idle", "its return")


def test_clocks_that_differ_by_a_minute_do_not_matter(cluster, undisturbed, tmp_path):
    """One node is a minute ahead of the others, and one behind; a shard begins on the first."""
    library = next(Path("/usr/lib").glob("*/faketime/libfaketime.so.1"), None)
    if library is None:
        pytest.skip("no libfaketime here")
    # Each node reads its own file; times of files are those of the server.
    clock = "/dev/shm/clock"
    variables = {"LD_PRELOAD": str(library), "FAKETIME_TIMESTAMP_FILE": clock, "NO_FAKE_STAT": "1"}
    exports = [f"{name}={value}" for name, value in variables.items()]
    for node, offset in (("n1", "+60"), ("n3", "-60")):
        cluster.on(node, "sh", "-c", f"echo {offset} > {clock}", check=True)
    first, _, last = (
        float(cluster.on(node, "env", *exports, "date", "+%s").stdout) for node in NODES
    )
    assert 100 < first - last < 140
    clocks = f"--export={','.join(['ALL', *exports])}"
    jobs = Submitted(tmp_path, ["--nodelist=n1", *ARRAY, clocks])
    jobs.stop_in_the_middle(0)
    run("scancel", f"--name={SCRIPT.stem}")
    jobs.fail()
    for node in NODES[1:]:
        Submitted(tmp_path, [f"--nodelist={node}", *ARRAY, clocks]).finish()
    assert "going on after" in slurm_cluster.logs(tmp_path)
    require_equal(tmp_path, undisturbed)
