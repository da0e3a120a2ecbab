"""SLURM's commands as Snakemake sees them: they wait for a controller that is busy or away.

Snakemake's executor takes a job for failed when `sbatch` gets no answer, even if the job was
accepted and runs; it waits for ever for a job that the controller has forgotten, which it does some
minutes after the end (`MinJobAge`); and it asks `sacct` when the controller is slow, also where
there is no accounting. The commands of this module stand before SLURM's own in the search path of a
run:

`sbatch` submits again when there was no answer, unless a job that bears its mark is in the queue,
and gives each task of an array its own command;
`squeue` tells of a job that was submitted and is no longer known that its state is `UNKNOWN`,
whereupon Snakemake looks for its files; `sacct` answers by `squeue` where it cannot itself;
`sacctmgr` and `sshare` know no account where they cannot answer, whereupon Snakemake takes the one
that the profile names. It would wait for ever otherwise.

It runs as a program of its own, with nothing but the standard library.
"""

import base64
import json
import os
import re
import shlex
import shutil
import stat
import subprocess
import sys
import time
import uuid
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

FOLDER = Path(".snakemake", "slurm-commands")
"""Folder of the commands and of what they remember, in the working directory of a run."""
LOG = "log"
"""File in there that tells what Snakemake does not."""
COMMANDS = ("sbatch", "squeue", "sacct", "sacctmgr", "sshare")
PATIENCE_SECONDS = 3600.0
"""Time for which jobs are submitted again while SLURM does not answer."""
PAUSE_SECONDS = 10.0
"""Time between two tries, and until a request that got no answer must have been carried out."""
ANSWER_SECONDS = 50.0
"""Time for an answer to a question; Snakemake itself waits for a minute."""
PAUSE = "CARILLON_SLURM_PAUSE_SECONDS"
"""Variable of the environment that says another `PAUSE_SECONDS`."""

NO_ANSWER = re.compile(
    "timed out|unable to contact|connection refused|connection reset|communication connection"
    "|connect failure|unexpected message|zero bytes|not connected|temporarily|not responding"
    "|authentication credential",
    re.IGNORECASE,
)
"""Words of `sbatch` when it does not know whether the job was accepted; else it was refused."""
TASK_COMMANDS = "--slurm-jobstep-array-execs"
"""Option of a task's Snakemake that holds the commands of all other tasks."""
STATES = "--format=%i|%T"
"""Options by which Snakemake asks `squeue` for number and state of each job."""
FATES = "--format=%i|%T|%N|%r"
"""The same, with the nodes and the reason of the state, for `workflow.slurm_watch`."""
FATES_ENDING = "fates"
"""Ending of the file that keeps what `squeue` has last answered."""
UNKNOWN = "UNKNOWN"
"""State on which Snakemake decides by the files of a job."""


def install(folder: Path = FOLDER) -> Path:
    """Write the commands into a folder, and return it as an absolute path."""
    folder.mkdir(parents=True, exist_ok=True)
    for command in COMMANDS:
        file = folder / command
        words = [sys.executable, "-I", "-S", __file__, str(folder.resolve()), command]
        part = file.with_name(f"{command}.{os.getpid()}")
        part.write_text(f'#!/bin/sh\nexec {shlex.join(words)} "$@"\n')
        part.chmod(part.stat().st_mode | stat.S_IXUSR)
        part.replace(file)
    return folder.resolve()


def main(folder: str, command: str, *arguments: str) -> int:
    """Run one of the commands; its exit status."""
    slurm = Slurm(Path(folder))
    match command:
        case "sbatch":
            return slurm.submit(arguments)
        case "squeue" if STATES in arguments and "--name" in arguments:
            return slurm.tell_states(arguments)
        case "sacct":
            return slurm.account(arguments)
        case "sacctmgr" | "sshare":
            return slurm.tell_accounts(command, arguments)
        case _:
            return slurm.passed_on(command, arguments)


class Slurm:
    """SLURM's own commands, and the jobs that were submitted.

    `folder`: where commands of this module are, which are not SLURM's own, and where jobs are
    noted.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        path = os.environ.get("PATH", os.defpath).split(os.pathsep)
        own = [part for part in path if Path(part).resolve() != folder.resolve()]
        self._path = os.pathsep.join(own)
        # All jobs are told, those of arrays in full, whatever a user wants to see of them.
        told = {"SLURM_BITSTR_LEN": "0", "SQUEUE_ALL": "1"}
        self._environ = {k: v for k, v in os.environ.items() if not k.startswith("SQUEUE_")} | told
        self._pause = float(os.environ.get(PAUSE, PAUSE_SECONDS))

    def passed_on(self, command: str, arguments: Sequence[str]) -> int:
        """Run a command as it is."""
        program = self._program(command)
        return 127 if program is None else subprocess.run([program, *arguments]).returncode

    def submit(self, arguments: Sequence[str]) -> int:
        """Submit a job once, however often that takes."""
        mark = f"carillon-{uuid.uuid4().hex[:12]}"
        words, script = _marked(arguments, mark), None
        if words and words[-1] == "/dev/stdin":
            script = sys.stdin.read()
        words, script = _with_own_commands(words, script)
        until = time.monotonic() + PATIENCE_SECONDS
        while True:
            done = self._run("sbatch", words, script, timeout=None)
            answer, status = done.stdout.strip(), done.returncode
            if status == 0:
                break
            if not NO_ANSWER.search(done.stderr) or time.monotonic() > until:
                sys.stderr.write(done.stderr)
                return status
            self._say(f"sbatch: {done.stderr.strip()}; looking for the job, or submitting it again")
            time.sleep(self._pause)
            answer = self._number_of(mark, until)
            if answer:
                break
        self._note(_value(words, "--job-name"), answer, _value(words, "--array"))
        print(answer)
        return 0

    def tell_states(self, arguments: Sequence[str]) -> int:
        """Tell the states of a run's jobs, also of those that SLURM has forgotten."""
        name = arguments[arguments.index("--name") + 1]
        noted = self._noted(name)
        arguments = [FATES if word == STATES else word for word in arguments]
        done = self._run("squeue", arguments)
        if done.returncode == 0 and noted - _known(done.stdout):
            # Asked again, for fear of a controller that has only just begun.
            time.sleep(min(self._pause, PAUSE_SECONDS))
            done = self._run("squeue", arguments)
        sys.stderr.write(done.stderr)
        if done.returncode == 0:
            self._keep_fates(name, done.stdout)
            for line in done.stdout.splitlines():
                print(*line.split("|")[:2], sep="|")
            for number in sorted(noted - _known(done.stdout)):
                state = self._remembered(number)
                self._say(f"squeue: job {number} is no longer known, its state is {state}")
                print(f"{number}|{state}")
        return done.returncode

    def _keep_fates(self, name: str, answer: str) -> None:
        """Keep what `squeue` has answered; on a folder that is full the run goes on without."""
        part = self._folder / f"{name}.{os.getpid()}"
        with suppress(OSError):
            part.write_text(answer)
            part.replace(self._folder / f"{name}.{FATES_ENDING}")

    def account(self, arguments: Sequence[str]) -> int:
        """Ask the accounting, or else the queue for what Snakemake wants to know."""
        done = self._run("sacct", arguments)
        if done.returncode and "--name" in arguments:
            name = arguments[arguments.index("--name") + 1]
            return self.tell_states([STATES, "--states=all", "--noheader", "--name", name])
        sys.stdout.write(done.stdout)
        sys.stderr.write(done.stderr)
        return done.returncode

    def tell_accounts(self, command: str, arguments: Sequence[str]) -> int:
        """Tell the accounts of a user; none where SLURM has no answer, or not this command."""
        done = self._run(command, arguments)
        if done.returncode == 0:
            sys.stdout.write(done.stdout)
        return 0

    def _say(self, text: str) -> None:
        with (self._folder / LOG).open("a") as file:
            file.write(f"{time.strftime('%F %T')} {text}\n")

    def _program(self, command: str) -> str | None:
        return shutil.which(command, path=self._path)

    def _run(
        self,
        command: str,
        arguments: Sequence[str],
        given: str | None = None,
        timeout: float | None = ANSWER_SECONDS,
    ) -> subprocess.CompletedProcess[str]:
        """What a command of SLURM's says; one that is missing or late has failed."""
        words = [self._program(command) or command, *arguments]
        try:
            return subprocess.run(
                words,
                input=given,
                capture_output=True,
                text=True,
                timeout=timeout,
                env=None if command == "sbatch" else self._environ,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            return subprocess.CompletedProcess(words, 1, "", f"{command}: {error}\n")

    def _number_of(self, mark: str, until: float) -> str:
        """Number of the job with a mark, empty if there is none; asked until there is an answer."""
        while time.monotonic() < until:
            done = self._run("squeue", ["--me", "--states=all", "--noheader", "--format=%F|%k"])
            if done.returncode == 0:
                rows = (line.partition("|") for line in done.stdout.splitlines())
                return next((number.strip() for number, _, told in rows if mark in told), "")
            time.sleep(self._pause)
        return ""

    def _remembered(self, number: str) -> str:
        """State of a forgotten job by the accounting, where there is one."""
        done = self._run(
            "sacct", ["-X", "--noheader", "--parsable2", "--format=State", "-j", number]
        )
        words = done.stdout.split() if done.returncode == 0 else []
        return words[0] if words else UNKNOWN

    def _note(self, name: str | None, number: str, array: str | None) -> None:
        """Remember a job; one of another cluster is left to that."""
        if name is None or not number.isdigit():
            return
        numbers = [f"{number}_{task}" for task in _tasks(array)] if array else [number]
        with (self._folder / f"{name}.jobs").open("a") as file:
            file.write("".join(f"{each}\n" for each in numbers))

    def _noted(self, name: str) -> set[str]:
        """Jobs of a run that were submitted."""
        try:
            return set((self._folder / f"{name}.jobs").read_text().split())
        except OSError:
            return set()


def _marked(arguments: Sequence[str], mark: str) -> list[str]:
    """Arguments of `sbatch` with a mark at the end of the comment."""
    words = list(arguments)
    if "--comment" not in words:
        return ["--comment", mark, *words]
    place = words.index("--comment") + 1
    words[place] = f"{words[place]} {mark}"
    return words


def _with_own_commands(words: list[str], script: str | None) -> tuple[list[str], str | None]:
    """Arguments and script of `sbatch`, those of an array as a script with a command for each task.

    Snakemake's executor gives every task the command of the first one, which starts the task's own
    and then looks for the files of the first: a task that ends long before the first one fails, and
    its finished files are removed.
    """
    whole = script if script is not None else next(filter(_is_wrapped, words), "")
    first, found, rest = whole.partition(TASK_COMMANDS)
    if not found:
        return words, script
    (payload,) = shlex.split(rest.lstrip("= "))
    packed = json.loads(base64.b64decode(payload))
    commands = {number: zlib.decompress(bytes.fromhex(text)) for number, text in packed.items()}
    first = first.removeprefix("--wrap=").removeprefix("#!/bin/sh").strip()
    cases = [f"{number}) {command.decode()} ;;" for number, command in commands.items()]
    lines = ["#!/bin/sh", "case $SLURM_ARRAY_TASK_ID in", *cases, f"*) {first} ;;", "esac", ""]
    kept = [word for word in words if not _is_wrapped(word) and word != "/dev/stdin"]
    return [*kept, "/dev/stdin"], "\n".join(lines)


def _is_wrapped(word: str) -> bool:
    return word.startswith("--wrap=")


def _value(words: Sequence[str], option: str) -> str | None:
    """Value of an option, given either way."""
    for place, word in enumerate(words):
        if word == option and place + 1 < len(words):
            return words[place + 1]
        if word.startswith(f"{option}="):
            return word.partition("=")[2]
    return None


def _tasks(ranges: str) -> set[int]:
    """Numbers in ranges of SLURM's.

    Examples
    --------
    >>> sorted(_tasks("1-3,7%2"))
    [1, 2, 3, 7]
    """
    numbers: set[int] = set()
    for part in ranges.partition("%")[0].split(","):
        first, _, last = part.partition("-")
        numbers.update(range(int(first), int(last or first) + 1))
    return numbers


def _known(told: str) -> set[str]:
    """Jobs that `squeue` tells of, those in ranges of an array one by one.

    Examples
    --------
    >>> sorted(_known("5|RUNNING\\n7_[2-3]|PENDING\\n7_1|RUNNING\\n"))
    ['5', '7_1', '7_2', '7_3']
    """
    numbers = set()
    for line in told.splitlines():
        number = line.partition("|")[0].strip()
        parent, bracket, ranges = number.partition("_[")
        if bracket:
            numbers |= {f"{parent}_{task}" for task in _tasks(ranges.rstrip("]"))}
        else:
            numbers.add(number)
    return numbers


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
