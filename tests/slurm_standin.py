"""A SLURM that runs jobs at once on this machine, and fails to answer as told (test support).

As a program it is any of SLURM's commands, by the name that it is called by.
"""

import itertools
import os
import subprocess
import sys
from pathlib import Path

COMMANDS = ("sbatch", "squeue", "sacct", "scontrol", "sinfo", "srun", "scancel")
TIMED_OUT = "sbatch: error: Batch job submission failed: Socket timed out on send/recv operation"
FAULTS = {
    "lost": "the answer to the first submission, whose job runs",
    "refused": "every submission, for good",
    "unheard": "the first submission, of which SLURM knows nothing",
    "forgotten": "jobs that have ended",
    "slow": "the configuration, and accounting that there is not",
    "away": "the first three questions about jobs",
    "idle": "jobs, which end without having done anything",
}
"""What SLURM fails to do, by name."""


def install(folder: Path, *faults: str) -> dict[str, str]:
    """Write the commands into a folder, and return the environment that finds them first."""
    for command in COMMANDS:
        file = folder / command
        file.write_text(f'#!/bin/sh\nexec {sys.executable} -S {__file__} {command} "$@"\n')
        file.chmod(0o755)
    assert set(faults) <= set(FAULTS)
    path = os.pathsep.join([str(folder), os.environ["PATH"]])
    return {**os.environ, "PATH": path, "STANDIN": f"{folder} {' '.join(faults)}"}


def submitted(folder: Path) -> list[list[str]]:
    """Arguments of every job that was accepted, in order."""
    files = sorted(folder.glob("*.arguments"), key=lambda file: int(file.stem))
    return [file.read_text().split("\n") for file in files]


def calls(folder: Path, command: str) -> int:
    """How often a command was called."""
    file = folder / f"{command}.calls"
    return len(file.read_text()) if file.exists() else 0


class Standin:
    """The commands; the state is in files."""

    def __init__(self) -> None:
        folder, *self.faults = os.environ["STANDIN"].split()
        self.folder = Path(folder)

    def call(self, command: str, arguments: list[str]) -> int:
        with (self.folder / f"{command}.calls").open("a") as file:
            file.write(".")
        return int(getattr(self, command)(arguments) or 0)

    def sbatch(self, arguments: list[str]) -> int:
        first = calls(self.folder, "sbatch") == 1
        if "refused" in self.faults:
            print("sbatch: error: invalid partition specified: none", file=sys.stderr)
            return 1
        if "unheard" in self.faults and first:
            print(TIMED_OUT, file=sys.stderr)
            return 1
        for number in itertools.count(1):
            try:
                (self.folder / f"{number}.job").touch(exist_ok=False)
                break
            except FileExistsError:
                pass
        comment = arguments[arguments.index("--comment") + 1]
        (self.folder / f"{number}.comment").write_text(comment)
        (self.folder / f"{number}.arguments").write_text("\n".join(arguments))
        (wrapped,) = [word for word in arguments if word.startswith("--wrap=")]
        state = self.folder / f"{number}.state"
        state.write_text("RUNNING")
        script = (
            f"{'false' if 'idle' in self.faults else wrapped.removeprefix('--wrap=')}\n"
            f"[ $? = 0 ] && echo COMPLETED >'{state}' || echo FAILED >'{state}'\n"
        )
        log = self.folder / f"{number}.log"
        subprocess.Popen(
            ["sh", "-c", script],
            env={**os.environ, "SLURM_JOB_ID": str(number)},
            stdin=subprocess.DEVNULL,
            stdout=log.open("w"),
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        if "lost" in self.faults and first:
            print(TIMED_OUT, file=sys.stderr)
            return 1
        print(number)
        return 0

    def squeue(self, arguments: list[str]) -> int:
        if "away" in self.faults and calls(self.folder, "squeue") <= 3:
            print("slurm_load_jobs error: Unable to contact slurm controller", file=sys.stderr)
            return 1
        by_comment = "--format=%F|%k" in arguments
        for file in sorted(self.folder.glob("*.state")):
            state = file.read_text().strip()
            if "forgotten" in self.faults and state != "RUNNING" and not by_comment:
                continue
            comment = file.with_suffix(".comment").read_text()
            print(f"{file.stem}|{comment if by_comment else state}")
        return 0

    def sacct(self, arguments: list[str]) -> int:
        print("Slurm accounting storage is disabled", file=sys.stderr)
        return 1

    def scontrol(self, arguments: list[str]) -> int:
        if "slow" in self.faults:
            return 1
        print("MinJobAge               = 300 sec")
        return 0

    def sinfo(self, arguments: list[str]) -> None:
        print("compute*")

    def srun(self, arguments: list[str]) -> None:
        words = list(itertools.dropwhile(lambda word: word.startswith("-"), arguments))
        os.execvp(words[0], words)

    def scancel(self, arguments: list[str]) -> None:
        pass


if __name__ == "__main__":
    sys.exit(Standin().call(sys.argv[1], sys.argv[2:]))
