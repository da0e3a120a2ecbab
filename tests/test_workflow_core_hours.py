"""At its end a run tells what its jobs took beside the estimate, and is no worse off for it."""

import json
from types import SimpleNamespace

import pandas as pd
import pytest

from tests.programs import python
from tests.workflow_runs import snakemake
from workflow import settings
from workflow.estimate import costs, used

SECONDS = 90.0
CORES, RANKS, EACH = 4, 3, 2
CONFIG = "models: {bar: {mesh: 'builtin:bar', resolution: 8}}\n"
SHARD = "results/dataset/uniform-0.h5"


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(CONFIG)
    return settings.complete([path])


@pytest.fixture
def finished(tmp_path):
    """Makes a job of Snakemake's that took `SECONDS`."""

    def make(rule: str, number: int = 0, benchmarked: bool = True, **resources: int):
        file = tmp_path / f"{rule}-{number}.tsv"
        if benchmarked:
            file.write_text(f"s\th:m:s\n{SECONDS}\t0:01:30\n")
        return SimpleNamespace(
            rule=SimpleNamespace(name=rule),
            wildcards_dict={},
            threads=CORES,
            resources={"runtime": 5, **resources},
            shellcmd="true",
            output=["out"],
            benchmark=str(file),
        )

    return make


def run_of(*jobs, local: bool = True, touch: bool = False) -> SimpleNamespace:
    """Snakemake's workflow at the end of a run."""
    return SimpleNamespace(touch=touch, local_exec=local, dag=SimpleNamespace(finished_jobs=jobs))


def rows(folder, run: int = -1) -> dict[str, dict]:
    """What a run has left by rule."""
    record = json.loads((folder / used.FILE).read_text())["runs"][run]
    return {row["rule"]: row for row in record["rules"]}


def test_core_hours_are_those_of_the_cores_that_jobs_had(finished, config, tmp_path, capsys):
    jobs = [finished("audit_spectra"), finished("audit_spectra", 1), finished("find_modes")]
    used.tell(run_of(*jobs), config, tmp_path)
    found = rows(tmp_path)
    each = SECONDS * CORES / 3600.0
    assert found["audit_spectra"]["jobs"] == 2
    assert found["audit_spectra"]["core_hours"] == pytest.approx(2 * each)
    assert found["total"]["core_hours"] == pytest.approx(3 * each)
    printed = capsys.readouterr().err.splitlines()
    assert [line.split()[0] for line in printed[1:]] == ["audit_spectra", "find_modes", "total"]


@pytest.mark.parametrize(("local", "cores"), [(True, CORES), (False, RANKS * EACH)])
def test_ranks_on_a_cluster_have_the_cores_that_were_asked_for(
    finished, config, tmp_path, local, cores
):
    job = finished("find_modes", tasks=RANKS, cpus_per_task=EACH)
    used.tell(run_of(job, local=local), config, tmp_path)
    assert rows(tmp_path)["total"]["core_hours"] == pytest.approx(SECONDS * cores / 3600.0)


def test_estimates_are_those_of_the_command(finished, config, tmp_path):
    medians = costs.load_medians()
    used.tell(run_of(finished("describe_shard")), config, tmp_path)
    described = pd.DataFrame([{**used.finished_jobs(run_of(finished("describe_shard")))[0]}])
    expected = costs.with_costs(costs.with_work(described, config), medians)["core_hours"].sum()
    row = rows(tmp_path)["describe_shard"]
    assert row["estimated_core_hours"] == pytest.approx(expected)
    assert row["ratio"] == pytest.approx(row["core_hours"] / expected)


def test_a_rule_that_was_never_measured_has_no_estimate(finished, config, tmp_path, capsys):
    used.tell(run_of(finished("new_rule"), finished("describe_shard")), config, tmp_path)
    found = rows(tmp_path)
    assert found["new_rule"]["estimated_core_hours"] is found["new_rule"]["ratio"] is None
    assert found["total"]["ratio"] == found["describe_shard"]["ratio"]
    assert capsys.readouterr().err.splitlines()[2].split()[3:] == ["-", "-"]


def test_runs_are_recorded_one_after_the_other(finished, config, tmp_path):
    for count in (1, 2):
        jobs = [finished("describe_shard", number) for number in range(count)]
        used.tell(run_of(*jobs), config, tmp_path)
    assert [rows(tmp_path, run)["total"]["jobs"] for run in (0, 1)] == [1, 2]


def test_nothing_is_said_where_nothing_was_run(finished, config, tmp_path, capsys):
    used.tell(run_of(), config, tmp_path)
    used.tell(run_of(finished("draw_modes", benchmarked=False)), config, tmp_path)
    used.tell(run_of(finished("find_modes"), touch=True), config, tmp_path)
    assert capsys.readouterr().err == "" and not (tmp_path / used.FILE).exists()


@pytest.mark.parametrize("harm", ["benchmark", "folder", "job"])
def test_what_fails_is_a_warning(finished, config, tmp_path, capsys, harm):
    job, folder = finished("find_modes"), tmp_path
    if harm == "benchmark":
        (tmp_path / "find_modes-0.tsv").write_bytes(b"\xff\x00")
    elif harm == "folder":
        folder = tmp_path / "absent"
    else:
        del job.shellcmd
    used.tell(run_of(job), config, folder)
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith("warning: the core-hours of this run are not told: ")


def test_a_record_that_cannot_be_read_begins_anew(finished, config, tmp_path):
    (tmp_path / used.FILE).write_text("[")
    used.tell(run_of(finished("find_modes")), config, tmp_path)
    assert rows(tmp_path)["total"]["jobs"] == 1


def test_planning_loads_nothing_for_it():
    check = (
        "import sys, workflow.estimate.used; print({'pandas', 'numpy', 'numba'} & set(sys.modules))"
    )
    assert python("-c", check).stdout.strip() == "set()"


def test_a_run_tells_it_once_at_its_end(tmp_path):
    text = "dataset: {samples: 200, distributions: [uniform], shards: 1, objective: chen2015}\n"
    (tmp_path / "config.yaml").write_text(CONFIG + text)
    wanted = (SHARD, "--cores", 1, "--configfile", "config.yaml")
    first, second = snakemake(tmp_path, *wanted), snakemake(tmp_path, *wanted)
    assert first.returncode == second.returncode == 0, first.stderr + second.stderr
    told = first.stdout + first.stderr
    assert told.count("core-hours of this run") == 1 and "warning: the core-hours" not in told
    assert "core-hours" not in second.stdout + second.stderr
    assert rows(tmp_path / "results")["generate_shard"]["jobs"] == 1
    records = json.loads((tmp_path / "results" / used.FILE).read_text())["runs"]
    assert len(records) == 1
