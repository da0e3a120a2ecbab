"""However a program ends, it says so in one sentence, and no rank is left waiting."""

import errno
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from carillon import __version__
from carillon.__main__ import main
from carillon.command_line import exit_status
from carillon.command_line.arguments import Parser
from carillon.command_line.commands import run_program
from carillon.errors import ConvergenceError, UserError, on_all_ranks
from carillon.fem.geometry.builtin import builtin_surface
from studies.base import page_command
from tests.programs import CHECKOUT, run
from tests.rank_counts import SEVERAL


class Ranks:
    """A communicator that remembers with which status its job was aborted."""

    def __init__(self, rank, size):
        self.rank, self.size, self.aborted = rank, size, None

    def Ibarrier(self):  # noqa: N802
        return SimpleNamespace(Test=lambda: True)

    def Abort(self, status):  # noqa: N802
        self.aborted = status


def raising(error):
    def main():
        raise error

    return main


def test_negative_numbers_are_no_options():
    parser = Parser()
    parser.add_argument("--at", nargs=3, type=float)
    for words in (["-1e-3", "-2", "-.5E+2"], ["-3.", "0", "-1.5"]):
        assert parser.parse_args(["--at", *words]).at == [float(word) for word in words]
    with pytest.raises(UserError, match="unrecognized|expected 3"):
        parser.parse_args(["--at", "0", "0", "-e3"])


COMMANDS = ("modes", "compare", "validate", "environment")
OPTIONS = ("--resolution", "--material", "--mass-damping", "--out")


def refused(*words: str) -> str:
    """What a program with these commands and options says of a command line."""
    parser = Parser(prog="program")
    parts = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name in COMMANDS:
        part = parts.add_parser(name)
        for option in OPTIONS:
            part.add_argument(option, required=option == "--out")
        part.add_argument("--fill", choices=("winding", "centre"))
    with pytest.raises(UserError) as told:
        parser.parse_args(words)
    return str(told.value)


@given(word=st.sampled_from(COMMANDS), place=st.integers(0, 4))
def test_a_command_that_lacks_a_letter_is_guessed(word, place):
    typed = word[:place] + word[place + 1 :]
    assert refused(typed).startswith(f"no command {typed!r}, did you mean {word!r}?")


@given(option=st.sampled_from(OPTIONS), place=st.integers(2, 3), value=st.sampled_from(" ="))
def test_an_option_that_lacks_a_letter_is_guessed(option, place, value):
    typed = option[:place] + option[place + 1 :]
    words = f"{typed}{value}8".split(" ")
    assert refused("modes", *words).startswith(f"no option {typed}, did you mean {option}?")


def test_what_is_like_nothing_is_not_guessed():
    assert "invalid choice: 'gong' (choose from" in refused("gong")
    assert "unrecognized arguments: --gong" in refused("modes", "--out", "x", "--gong", "3")
    assert "'centr', did you mean 'centre'?" in refused("modes", "--out", "x", "--fill", "centr")


def test_names_of_solids_and_capital_letters_are_guessed():
    assert refused("MODES").startswith("no command 'MODES', did you mean 'modes'?")
    with pytest.raises(UserError, match=r"no such built-in object \(did you mean bell\?\)"):
        builtin_surface("bel")


def test_the_version_is_told(capsys):
    with pytest.raises(SystemExit) as ended:
        run_program("program", "", {}, ["--version"])
    assert ended.value.code == 0 and __version__ in capsys.readouterr().out


def test_abbreviated_options_and_values_that_look_like_options_are_taken():
    parser = Parser()
    parser.add_argument("--resolution")
    parser.add_argument("--petsc")
    parser.add_argument("words", nargs="*")
    found = parser.parse_args(["--res", "8", "--petsc", "-carillon_eps_ncv 4", "--", "--resoluton"])
    assert (found.resolution, found.words) == ("8", ["--resoluton"])


@pytest.mark.parametrize(
    ("main", "status", "said"),
    [
        (raising(UserError("no such\nmesh")), 2, "no such mesh"),
        (raising(ConvergenceError("missed")), 3, "missed"),
        (raising(MemoryError()), 2, "out of memory; ask for"),
        (lambda: np.empty(1 << 60, np.uint8), 2, "out of memory (Unable to allocate 1.00 EiB"),
        (raising(OSError(errno.ENOSPC, "?")), 2, "No space left on device; make room"),
        (raising(PermissionError(errno.EACCES, "Permission", "a.h5")), 2, "a.h5: Permission"),
        (raising(BrokenPipeError(errno.EPIPE, "Broken pipe")), 2, "Broken pipe"),
        (raising(KeyboardInterrupt()), 130, "interrupted"),
    ],
)
def test_errors_are_one_sentence_and_a_status(main, status, said, capsys):
    assert exit_status.run("program", main) == status
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"program: {said}")


def test_in_a_job_of_slurm_errors_name_the_job_and_the_node(capsys, monkeypatch):
    for name, value in {"JOB_ID": "9", "ARRAY_JOB_ID": "7", "ARRAY_TASK_ID": "2"}.items():
        monkeypatch.setenv(f"SLURM_{name}", value)
    monkeypatch.setenv("SLURMD_NODENAME", "n3")
    assert exit_status.run("program", raising(UserError("bad"))) == 2
    assert capsys.readouterr().err == "program (in job 7_2 on n3): bad\n"


def test_a_fault_of_the_program_keeps_its_traceback():
    with pytest.raises(ZeroDivisionError):
        exit_status.run("program", raising(ZeroDivisionError()))


def test_what_all_ranks_raise_is_told_by_the_first_and_aborts_nothing(capsys):
    for rank in range(3):
        ranks = Ranks(rank, 3)
        assert exit_status.run("program", on_all_ranks()(raising(UserError("bad"))), ranks) == 2
        assert ranks.aborted is None
    assert capsys.readouterr().err == "program: bad\n"


@pytest.mark.parametrize(
    ("error", "status"),
    [(UserError("bad"), 2), (MemoryError(), 2), (KeyboardInterrupt(), 130), (KeyError(), 1)],
)
def test_what_one_rank_alone_raises_ends_the_others(error, status, capsys):
    ranks = Ranks(1, 2)
    exit_status.run("program", raising(error), ranks)
    assert ranks.aborted == status
    assert capsys.readouterr().err


REFUSING = """
import sys
from mpi4py import MPI
from carillon.command_line import exit_status
from carillon.errors import UserError, on_all_ranks

comm = MPI.COMM_WORLD

def on_one():
    if comm.rank == comm.size - 1:
        raise UserError("bad on one rank")
    comm.Barrier()

@on_all_ranks()
def on_all():
    raise UserError("bad on all")

sys.exit(exit_status.run("program", {"one": on_one, "all": on_all}[sys.argv[1]], comm))
"""


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", SEVERAL)
@pytest.mark.parametrize(("who", "sentence"), [("one", "bad on one rank"), ("all", "bad on all")])
def test_an_error_on_any_rank_is_one_sentence_and_leaves_none_waiting(
    who, sentence, ranks, mpiexec, tmp_path
):
    program = tmp_path / "program.py"
    program.write_text(REFUSING)
    done = mpiexec(ranks, program, who)
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if line.startswith("program")]
    assert lines == [f"program: {sentence}"]


# Standard streams ---------------------------------------------------------------------------------

PROGRAM = """
import sys
from carillon.command_line import exit_status
from carillon.command_line.arguments import Parser

def main():
    with open(sys.argv[1], "w") as file:
        print(file.fileno(), file=file)
        print("results " * int(sys.argv[2]))

sys.exit(exit_status.run("program", main))
"""


def run_shell(redirection, tmp_path, words=1):
    out = tmp_path / "out"
    command = f'"$0" -c "$1" {out} {words} {redirection}'
    return run("bash", "-c", command, sys.executable, PROGRAM, cwd=CHECKOUT), out.read_text()


@pytest.mark.parametrize("words", [1, 100_000])
def test_output_that_nobody_takes_is_a_sentence(words, tmp_path):
    done, _ = run_shell("> /dev/full", tmp_path, words)
    assert done.returncode == 2
    assert (
        done.stderr.startswith("program: No space left on device") and done.stderr.count("\n") == 1
    )


@pytest.mark.parametrize("words", [1, 100_000])
def test_a_reader_who_has_seen_enough_is_no_error(words, tmp_path):
    out = tmp_path / "out"
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(out), str(words)],
        cwd=CHECKOUT,
        stdout=write,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(write)
    assert done.returncode == 0 and done.stderr == ""


def test_files_do_not_take_the_place_of_closed_streams(tmp_path):
    done, number = run_shell(">&- 2>&- <&-", tmp_path)
    assert done.returncode == 0 and int(number) > 2


def test_complaints_that_nobody_takes_change_no_status(tmp_path):
    command = '"$0" -c "from carillon.command_line import exit_status\n'
    command += "from carillon.errors import UserError\n"
    command += (
        'def main(): raise UserError(1)\nraise SystemExit(exit_status.run(1, main))" 2> /dev/full'
    )
    words = ["bash", "-c", command, sys.executable]
    for buffered in ({}, {"PYTHONUNBUFFERED": "1"}):
        settings = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
        done = subprocess.run(words, cwd=CHECKOUT, env=settings | buffered)
        assert done.returncode == 2


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("rules x", "carillon: unrecognized arguments: x (see carillon rules --help)"),
        ("calibrate", "carillon: no command 'calibrate', which is gone: the constants of"),
        ("claims", "carillon: no command 'claims', did you mean 'carillon study claims'?"),
        ("validat", "carillon: no command 'validat', did you mean 'validate'?"),
        ("study objectives m --objectives energi", "'energi' is unknown (did you mean energy?)"),
        (
            "validate builtin:barr --resolution 12 --out o",
            "carillon validate: mesh: builtin:barr: no such built-in object (did you mean bar?)",
        ),
        (
            "validate builtin:bar --resolution 12 --out {o",
            "carillon validate: --out: '",
        ),
    ],
)
def test_a_mistaken_command_line_points_to_what_was_meant(capsys, words, says):
    assert main(words.split()) == exit_status.EXIT_BAD_INPUT
    assert says in capsys.readouterr().err


def test_study_alone_lists_the_studies(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["study"])
    assert ended.value.code == 0 and "claims" in capsys.readouterr().out


def test_a_page_command_hands_options_on(monkeypatch):
    started = []
    monkeypatch.setattr(
        page_command.subprocess,
        "run",
        lambda command: started.append(command) or SimpleNamespace(returncode=3),
    )
    words = ["study", "claims", "-n", "--configfile", "a.yaml", "--cores", "2", "tables"]
    assert main(words) == 3
    assert started[0][-6:] == ["2", "claims", "-n", "--configfile", "a.yaml", "tables"]
