"""A SLURM that does not answer, answers late or forgets: its jobs are neither lost nor doubled."""

import base64
import json
import os
import subprocess
import zlib
from pathlib import Path

import pytest

from tests import slurm_cluster, slurm_standin
from tests.programs import python, run
from tests.workflow_runs import CHECKOUT
from workflow import patient_slurm, slurm_cleanup

RUN = "1b4e28ba-2fa1-11d2-883f-0016d3cca427"
SUBMIT = ["sbatch", "--parsable", "--job-name", RUN, "--comment", "rule_a", "--wrap=true"]
STATES = ["squeue", patient_slurm.STATES, "--states=all", "--noheader", "--name", RUN]


@pytest.fixture
def slurm(tmp_path):
    """Makes a stand-in with faults; returns its folder, and what runs a patient command on it."""
    folder = tmp_path / "slurm"
    folder.mkdir()

    def make(*faults: str):
        environment = slurm_standin.install(folder, *faults)
        own = patient_slurm.install(tmp_path / "own")
        environment["PATH"] = f"{own}{os.pathsep}{environment['PATH']}"
        environment[patient_slurm.PAUSE] = "0.05"

        def started(words: list[str]) -> subprocess.CompletedProcess[str]:
            return run(*words, env=environment)

        return folder, started

    return make


def jobs(folder: Path) -> int:
    return len(list(folder.glob("*.job")))


@pytest.mark.parametrize(("fault", "submissions"), [("lost", 1), ("unheard", 2)])
def test_a_submission_without_an_answer_makes_one_job(slurm, fault, submissions):
    folder, run = slurm(fault)
    done = run(SUBMIT)
    assert (done.returncode, done.stdout, done.stderr) == (0, "1\n", "")
    assert (jobs(folder), slurm_standin.calls(folder, "sbatch")) == (1, submissions)


def test_the_queue_is_asked_until_it_answers_before_a_job_is_submitted_again(slurm):
    folder, run = slurm("lost", "away")
    assert run(SUBMIT).stdout == "1\n"
    assert jobs(folder) == 1 and slurm_standin.calls(folder, "squeue") == 4


def test_a_job_that_is_refused_is_refused_at_once(slurm):
    folder, run = slurm("refused")
    done = run(SUBMIT)
    assert done.returncode == 1 and "invalid partition" in done.stderr
    assert slurm_standin.calls(folder, "sbatch") == 1


def test_a_job_that_slurm_has_forgotten_is_told_with_an_unknown_state(slurm):
    _, run = slurm("forgotten")
    run(SUBMIT)
    while "RUNNING" in (told := run(STATES).stdout):
        pass
    assert told == f"1|{patient_slurm.UNKNOWN}\n"


def test_what_slurm_does_not_answer_is_no_answer(slurm):
    _, run = slurm("away", "forgotten")
    run(SUBMIT)
    done = run(STATES)
    assert done.returncode != 0 and done.stdout == "" and "Unable to contact" in done.stderr


def test_without_accounting_the_queue_answers(slurm):
    _, run = slurm("slow")
    run(SUBMIT)
    question = ["sacct", "-X", "--parsable2", "--noheader", "--format=JobIdRaw,State"]
    done = run([*question, "--name", RUN])
    assert done.returncode == 0 and done.stdout.startswith("1|")
    assert run([*question]).returncode == 1


@pytest.mark.parametrize("command", ["sacctmgr", "sshare"])
def test_what_cannot_tell_accounts_knows_none(slurm, command):
    _, run = slurm()
    done = run([command, "--nonsense"])
    assert (done.returncode, done.stdout) == (0, "")


def test_jobs_keep_the_comment_that_tells_a_killed_runs_jobs(slurm):
    folder, run = slurm()
    run(SUBMIT)
    comment = (folder / "1.comment").read_text()
    assert comment.startswith("rule_a ") and slurm_cleanup._RUN.fullmatch(RUN)


@pytest.mark.parametrize("by_script", [False, True])
def test_each_task_of_an_array_has_a_command_of_its_own(by_script):
    """Snakemake's executor gives each the first one's, which waits for the first one's files."""
    packed = {number: zlib.compress(f"echo {number}".encode()).hex() for number in "34"}
    payload = base64.b64encode(json.dumps(packed).encode()).decode()
    command = f"echo 2 {patient_slurm.TASK_COMMANDS}"
    if by_script:
        words, script = ["--array=2-4", "/dev/stdin"], f"#!/bin/sh\n{command}\n{payload}"
    else:
        words, script = ["--array=2-4", f"--wrap={command}={payload}"], None
    words, script = patient_slurm._with_own_commands(words, script)
    assert words == ["--array=2-4", "/dev/stdin"]
    for task in "234":
        done = run("sh", "-c", script, env={"SLURM_ARRAY_TASK_ID": task})
        assert done.stdout == f"{task}\n"


@pytest.mark.nightly
@pytest.mark.slow
def test_a_run_ends_well_on_a_slurm_that_does_not(slurm, tmp_path):
    """Its first submission gets no answer, the controller none in time, and ended jobs are gone."""
    folder, _ = slurm()
    environment = slurm_standin.install(folder, "lost", "slow", "away", "forgotten")
    (tmp_path / "config.yaml").write_text(
        "models: {bar: {mesh: 'builtin:bar', resolution: 12}}\n"
        "dataset: {samples: 200, distributions: [uniform], shards: 1, objective: chen2015}\n"
    )
    shard = "results/dataset/uniform-0.h5"
    options = ["--profile", slurm_cluster.PROFILE, *slurm_cluster.QUICK, "--retries", "0"]
    options += [shard, "--configfile", "config.yaml"]
    variables = {**environment, "PYTHONPATH": str(CHECKOUT), patient_slurm.PAUSE: "0.2"}
    snakefile = CHECKOUT / "Snakefile"
    done = python("-m", "snakemake", "-s", snakefile, *options, cwd=tmp_path, env=variables)
    logs = "".join(log.read_text() for log in folder.glob("*.log"))
    assert done.returncode == 0, done.stdout + done.stderr + logs
    assert (tmp_path / shard).is_file() and jobs(folder) == 1
    told = (tmp_path / patient_slurm.FOLDER / patient_slurm.LOG).read_text()
    assert "Socket timed out" in told and "no longer known" in told
    # The run tells it, its jobs do not.
    assert (done.stdout + done.stderr).count("core-hours of this run") == 1
    assert "core-hours" not in logs
