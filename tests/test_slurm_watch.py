"""The terminal of a run on SLURM tells what befalls its jobs, each thing once."""

import pytest

from workflow import patient_slurm
from workflow.slurm_watch import Watch


@pytest.fixture
def answer(tmp_path):
    """Function that lets `squeue` answer something about the jobs of a run."""
    file = tmp_path / f"run.{patient_slurm.FATES_ENDING}"
    return lambda *lines: file.write_text("".join(f"{line}\n" for line in lines))


def test_a_job_that_lost_its_node_is_told_once(tmp_path, answer, capsys):
    watch = Watch(tmp_path)
    answer("5_1|RUNNING|n1|None", "5_2|RUNNING|n2|None")
    watch.tell()
    assert capsys.readouterr().err == ""
    answer("5_1|PENDING||BeginTime", "5_2|RUNNING|n2|None")
    watch.tell()
    watch.tell()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("SLURM: job 5_1 on n1 was stopped by SLURM and is back in the queue")


def test_a_job_that_failed_between_two_answers_is_told(tmp_path, answer, capsys):
    watch = Watch(tmp_path)
    answer("7|OUT_OF_MEMORY|n2|OutOfMemory", "8|COMPLETED|n2|None")
    watch.tell()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("SLURM: job 7 on n2 has failed: OUT_OF_MEMORY (OutOfMemory)")


def test_a_job_that_no_node_can_run_is_told_with_what_to_do(tmp_path, answer, capsys):
    watch = Watch(tmp_path)
    answer("38|FAILED||BadConstraints")
    watch.tell()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("SLURM: job 38 has failed") and "ask for less by `resources`" in line


def test_a_job_that_was_put_back_before_the_first_answer_is_told_once(tmp_path, answer, capsys):
    watch = Watch(tmp_path)
    for _ in range(2):
        answer("131|PENDING||BeginTime")
        watch.tell()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("SLURM: job 131 was stopped by SLURM and is back in the queue, unless")


def test_what_commands_waited_for_is_told_from_now_on(tmp_path, capsys):
    log = tmp_path / patient_slurm.LOG
    log.write_text("earlier\n")
    watch = Watch(tmp_path)
    with log.open("a") as file:
        file.write("sbatch: timed out; looking for the job\nhalf a line")
    watch.tell()
    assert capsys.readouterr().err == "SLURM: sbatch: timed out; looking for the job\n"
