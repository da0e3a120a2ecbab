"""Which tests are run: what every change needs, all, or that and a part of the rest (test support).

`python -m tests.tiers` tells what of the rest is due with this change,
`python -m tests.tiers --measured LOG` writes anew how long it takes.
"""

import ast
import functools
import json
import re
import subprocess
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.programs import CHECKOUT, run

TIERS = ("change", "part", "all")
"""What every change needs; that and a part of the rest; everything."""
TURNS = 3
"""The rest is run in so many parts, one with each change."""
BUDGET_SECONDS = 12 * 60 * 4 / 1.4
"""Of a part: four processes for twelve minutes, on slower cores than those measured on."""
CHANGE_SECONDS = BUDGET_SECONDS / 4
"""Of which at least are for what is near to a change, even if its turn takes the whole budget."""
MEASURED = Path(__file__).with_name("nightly_seconds.json")
"""Seconds of each file's tests marked `nightly`, run beside three others on two cores."""
UNKNOWN_SECONDS = 60.0
"""What is taken for a file that was not yet measured."""
CLEAN_ROOT = ".ci/bare-root"
"""Is due in turns like a file of tests."""

NEAR = 2
"""Imports on the way from a test to a module that it is taken to test."""
ROOMS = {
    "dataset_gen": ("test_dataset_", "test_hostile_dataset_gen"),
    "forests": ("test_forests_", "test_hostile_forests"),
    "solver": ("test_solver_", "test_hostile_solver", "test_determinism"),
    "sound": ("test_sound_", "test_scene_", "test_hostile_sound", "test_docs_sound"),
    "studio": ("test_studio_", "test_hostile_studio"),
    "workflow": ("test_workflow_", "test_hostile_workflow", "test_kills"),
    "workflow/envs": ("test_installed", "test_environment", "test_read_only", CLEAN_ROOT),
    "slurm": ("test_slurm", "test_image", CLEAN_ROOT),
    ".ci": (CLEAN_ROOT,),
    "docs": ("test_docs_",),
    "README.md": ("test_docs_",),
    "pyproject.toml": ("test_installed",),
}
"""Names with which tests of a folder or a file begin: tests do not import programs and rules."""
TESTS = "tests"


@dataclass(frozen=True)
class Part:
    """Files whose nightly tests are due: `related` to what has changed, and those of a turn."""

    turn: int
    related: tuple[str, ...]
    in_turn: tuple[str, ...]

    @property
    def files(self) -> frozenset[str]:
        """All of them, see `name_of`."""
        return frozenset((*self.related, *self.in_turn))

    def __str__(self) -> str:
        names = ", ".join([*(f"{name} (changed)" for name in self.related), *self.in_turn])
        return f"turn {self.turn + 1} of {TURNS} of the nightly tests: {names}"


def measured() -> dict[str, float]:
    """Seconds of nightly tests by file, those too that are in no table yet."""
    marked = [name_of(path) for path in files_of_tests() if _is_nightly(path)]
    found: dict[str, float] = json.loads(MEASURED.read_text())
    return {**dict.fromkeys(marked, UNKNOWN_SECONDS), **found}


def files_of_tests() -> list[Path]:
    """Those in `tests/` and those of the studies."""
    return sorted([*CHECKOUT.glob(f"{TESTS}/test_*.py"), *CHECKOUT.glob("studies/*/test_*.py")])


def name_of(path: Path) -> str:
    """Name of a file of tests: in `tests/` its own, elsewhere its path."""
    return path.name if path.parent.name == TESTS else path.relative_to(CHECKOUT).as_posix()


def _path_of(name: str) -> str:
    return name if "/" in name else f"{TESTS}/{name}"


def _is_nightly(path: Path) -> bool:
    return "mark.nightly" in path.read_text()


def choose(seconds: Mapping[str, float], nearest: Iterable[str], turn: int) -> Part:
    """What is due: one turn whole, and what is nearest to the change as far as the budget lasts.

    Parameters
    ----------
    seconds
        By file with nightly tests; those that alone take longer than the budget are left to
        `make test-all`.
    nearest
        Files of tests, those nearest to the change first.
    turn
        Any whole number; `TURNS` in a row cover everything.
    """
    turn %= TURNS
    seconds = {name: each for name, each in seconds.items() if each <= BUDGET_SECONDS}
    in_turn = turns(seconds)[turn]
    left = max(BUDGET_SECONDS - sum(seconds[name] for name in in_turn), CHANGE_SECONDS)
    related = []
    for name in nearest:
        if name in seconds and name not in in_turn and seconds[name] <= left:
            left -= seconds[name]
            related.append(name)
    return Part(turn, tuple(related), tuple(in_turn))


def turns(seconds: Mapping[str, float]) -> list[list[str]]:
    """All files in `TURNS` parts that take about as long."""
    parts: list[list[str]] = [[] for _ in range(TURNS)]
    for name in sorted(seconds, key=lambda name: (-seconds[name], name)):
        min(parts, key=lambda part: sum(seconds[each] for each in part)).append(name)
    return [sorted(part) for part in parts]


def is_spared(
    name: str, files: Collection[str], unless: Collection[str], changed: Collection[str]
) -> bool:
    """Whether a test marked `nightly` is left out.

    Parameters
    ----------
    name
        Of its file.
    files
        Those that are due.
    unless
        The only folders that it depends on: it is run if something in them, or its own file,
        is among those that have `changed`.
    """
    if name in files:
        return False
    return not unless or not touched([*unless, _path_of(name)], changed)


# What has changed ---------------------------------------------------------------------------------


def due(seconds: Mapping[str, float]) -> Part:
    """What is due with the state of this checkout."""
    return choose(seconds, nearest(changed_files()), turn_of_history())


def turn_of_history() -> int:
    """Number of commits on the main line; 0 without a history."""
    count = _git("rev-list", "--count", "--first-parent", "HEAD")
    return int(count[0]) if count else 0


def changed_files() -> list[str]:
    """Files that differ from the main branch, or else from the last commit on it."""
    head = _git("rev-parse", "HEAD")
    for main in ("origin/main", "main", "HEAD^"):
        base = _git("merge-base", "HEAD", main)
        if base and base != head:
            break
    else:
        base = head
    new = _git("ls-files", "--others", "--exclude-standard")
    return sorted({*_git("diff", "--name-only", *base), *new}) if base else []


def _git(*arguments: str) -> list[str]:
    """Lines that git prints; none if it fails or is not there."""
    try:
        command = ["git", "-C", str(CHECKOUT), *arguments]
        done = run(*command, check=True)
    except (OSError, subprocess.CalledProcessError):
        return []
    return done.stdout.splitlines()


def nearest(changed: Iterable[str]) -> list[str]:
    """Files of tests that try what has changed: themselves, then by imports, then by rooms."""
    changed = set(changed)
    found: dict[str, int] = {}
    for name in map(name_of, files_of_tests()):
        for distance, modules in enumerate(_imported(_path_of(name))):
            if changed & modules:
                found[name] = distance
                break
        else:
            if _of_rooms(name, changed):
                found[name] = NEAR + 1
    if _of_rooms(CLEAN_ROOT, changed):
        found[CLEAN_ROOT] = NEAR + 1
    return sorted(found, key=lambda name: (found[name], name))


def touched(places: Iterable[str], changed: Iterable[str]) -> bool:
    """Whether something has changed in one of these folders and files.

    Examples
    --------
    >>> touched(["studio"], ["studio/page/main.js"]), touched(["studio"], ["studios.md"])
    (True, False)
    """
    return any(
        path == place or path.startswith(f"{place}/") for place in places for path in changed
    )


def _of_rooms(name: str, changed: Iterable[str]) -> bool:
    """Whether tests of this name are those of a folder in which something has changed."""
    changed = list(changed)
    if name.startswith("studies/"):
        return touched([name.rpartition("/")[0]], changed)
    return any(
        name.startswith(begin)
        for room, begins in ROOMS.items()
        for begin in begins
        if touched([room], changed)
    )


def _imported(name: str) -> Iterator[set[str]]:
    """The file itself, what it imports, what that imports, up to `NEAR`."""
    seen: set[str] = set()
    ring = {name}
    for _ in range(NEAR + 1):
        yield ring
        seen |= ring
        ring = {each for path in ring for each in _imports(path)} - seen


@functools.cache
def _imports(path: str) -> frozenset[str]:
    """Files of the checkout that a module imports by name."""
    if not path.endswith(".py"):
        return frozenset()
    found = set()
    for node in ast.walk(ast.parse((CHECKOUT / path).read_bytes())):
        if isinstance(node, ast.Import):
            found |= {file for alias in node.names for file in _files(alias.name)}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                found |= set(_files(f"{node.module}.{alias.name}")) or set(_files(node.module))
    return frozenset(found)


@functools.cache
def _files(module: str) -> tuple[str, ...]:
    """The file of a module or a package, if it is one of the checkout."""
    base = module.replace(".", "/")
    return tuple(
        path for path in (f"{base}.py", f"{base}/__init__.py") if (CHECKOUT / path).is_file()
    )[:1]


# What was measured --------------------------------------------------------------------------------


def seconds_by_file(durations: Iterable[str]) -> dict[str, float]:
    """Sum of the lines that `pytest --durations=0 -vv` prints, by file."""
    found: dict[str, float] = {}
    for line in durations:
        match = re.match(r"([\d.]+)s (?:setup|call|teardown) +([\w/]*test_\w+\.py)::", line)
        if match:
            name = match[2].removeprefix(f"{TESTS}/")
            found[name] = found.get(name, 0.0) + float(match[1])
    return found


def main(words: list[str]) -> int:
    """Print what is due; status 1 if none of the files that are named is."""
    if words[:1] == ["--measured"]:
        found = seconds_by_file(Path(words[1]).read_text().splitlines())
        kept = {name: seconds for name, seconds in measured().items() if name not in found}
        told = {name: round(seconds) for name, seconds in sorted({**kept, **found}.items())}
        MEASURED.write_text(json.dumps(told, indent=2) + "\n")
        return 0
    part = due(measured())
    print(part)
    return 0 if not words or part.files & set(words) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
