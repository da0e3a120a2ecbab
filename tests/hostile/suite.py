"""A row of the table is run, and everything that it must not do is looked for."""

import os
import re
import shlex
import shutil
import stat
from pathlib import Path

from tests.hostile.cases import ZOO, Case, Copy, Place
from tests.hostile.inside import run_inside
from tests.hostile.places import put_place
from tests.hostile.zoo import Zoo
from tests.zygote import Job, Limits, Outcome, Zygote

LONGEST_SENTENCE = 1300
PEAK_BYTES = 2 << 30
"""Memory that a program may take that is about to refuse its input, or to do a tiny job."""

CPU_SECONDS = 30
"""Processor time that it may take."""

Snapshot = dict[str, tuple[object, ...]]


class Suite:
    """Runs rows; `folder` is empty and theirs."""

    def __init__(self, zygote: Zygote, zoo: Zoo, folder: Path) -> None:
        self._zygote, self._zoo, self._folder = zygote, zoo, folder
        self._number = 0

    def check(self, case: Case) -> Outcome:
        """Run a row.

        Raises
        ------
        AssertionError
            With the command line, the exit status, what was printed, and what is wrong with it.
        """
        self._number += 1
        folder = self._folder / str(self._number)
        folder.mkdir()
        if case.plain:
            folder.chmod(0o777)
        for name, content in case.files.items():
            self._put(folder / name, content)
        before = (snapshot(folder), snapshot(self._zoo.folder))
        arguments = [word.replace(ZOO, f"{self._zoo.folder}/") for word in case.arguments]
        limits = Limits(cpu_seconds=CPU_SECONDS, file_size=case.file_size)
        job = Job(case.room, arguments, str(folder), {}, limits, case.plain)
        outcome = run_inside(job) if case.inside else self._zygote.run(job)
        after = (snapshot(folder), snapshot(self._zoo.folder))
        faults = [*_faults(case, outcome), *_changes(case, before[0], after[0])]
        faults += [f"changes {name} of its input" for name in _differing(before[1], after[1])]
        assert not faults, _report(case, arguments, outcome, faults)
        shutil.rmtree(folder)
        return outcome

    def _put(self, path: Path, content: str | bytes | Copy | Place) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, Copy):
            shutil.copyfile(self._zoo.folder / content.name, path)
            path.chmod(content.rights)
        elif isinstance(content, Place):
            put_place(path, content)
        elif isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(content.replace(ZOO, f"{self._zoo.folder}/"), encoding="utf-8")


def snapshot(folder: Path) -> Snapshot:
    """What lies in a folder, hidden files too, by path: kind, rights, size, time, place."""
    found: Snapshot = {}
    for root, folders, files in os.walk(folder):
        for name in [*folders, *files]:
            path = os.path.join(root, name)
            status = os.lstat(path)
            kind = stat.S_IFMT(status.st_mode)
            told: tuple[object, ...] = (kind, status.st_mode, status.st_ino, status.st_rdev)
            if kind != stat.S_IFDIR:
                told += (status.st_size, status.st_mtime_ns)
            found[os.path.relpath(path, folder)] = told
    return found


def _faults(case: Case, outcome: Outcome) -> list[str]:
    """What is wrong with the way a program ended."""
    faults = []
    if outcome.slept:
        faults.append("sleeps for ever")
    if outcome.left:
        faults.append(f"leaves processes: {'; '.join(outcome.left)}")
    if outcome.status != case.status:
        faults.append(f"ends with status {outcome.status}, expected {case.status}")
    if "Traceback" in outcome.stderr:
        faults.append("shows a traceback")
    if outcome.peak_bytes > PEAK_BYTES:
        faults.append(f"takes {outcome.peak_bytes / 1e9:.1f} GB")
    return faults if case.control else faults + _of_the_sentence(case, outcome)


def _of_the_sentence(case: Case, outcome: Outcome) -> list[str]:
    faults = []
    text = outcome.stderr
    if outcome.stdout:
        faults.append("prints to standard output")
    if not re.fullmatch(r"[^\n]+\n", text):
        faults.append("says no single sentence")
    if not text.startswith(case.room.rpartition(".")[2]):
        faults.append("does not begin with its name")
    if len(text) > LONGEST_SENTENCE:
        faults.append(f"says {len(text):,} characters")
    if not text.rstrip("\n").isprintable():
        faults.append("prints control characters")
    missing = [word for word in case.says if word.lower() not in text.lower()]
    if missing:
        faults.append(f"does not say {', '.join(map(repr, missing))}")
    return faults


def _changes(case: Case, before: Snapshot, after: Snapshot) -> list[str]:
    """Files that are left, changed or gone."""
    faults = [
        f"{'changes' if name in after else 'removes'} {name}" for name in _differing(before, after)
    ]
    new = {name for name in set(after) - set(before) if after[name][0] != stat.S_IFDIR}
    if case.control:
        faults += [f"leaves no {name}" for name in case.writes if name not in after]
        return [*faults, *(f"leaves {name}" for name in sorted(new - set(case.writes)))]
    return [*faults, *(f"leaves {name}" for name in sorted(set(after) - set(before)))]


def _differing(before: Snapshot, after: Snapshot) -> list[str]:
    return [name for name, told in before.items() if after.get(name) != told]


def _report(case: Case, arguments: list[str], outcome: Outcome, faults: list[str]) -> str:
    text = "\n".join(
        [
            f"{case.room.rpartition('.')[2]} {case.name}: {'; '.join(faults)}",
            f"  {shlex.join(['python', '-m', case.room, *arguments])[:400]}",
            f"  status {outcome.status}, {outcome.cpu_seconds:.1f} s, "
            f"{outcome.peak_bytes / 1e6:.0f} MB",
            f"  stdout: {_shortened(outcome.stdout)}",
            f"  stderr: {_shortened(outcome.stderr)}",
        ]
    )
    # Arguments may be bytes that are no text, which test processes cannot hand on.
    return text.encode(errors="backslashreplace").decode()


def _shortened(text: str) -> str:
    """The last lines of what was printed, and their beginnings."""
    lines = [line if len(line) <= 300 else f"{line[:300]}..." for line in text.splitlines()]
    return "\n    ".join(lines[-12:])
