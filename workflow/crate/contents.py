"""Which files belong to the crate of a run, and what each is in it."""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import chain, count
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from carillon.files.paths import cause, require_file, require_plain
from forests.default import default_path
from workflow import settings

RULES, INPUTS, RESULTS = "workflow", "inputs", "results"
"""Folders of a crate."""
CONFIGURATION = "config.yaml"
"""The resolved configuration in a folder of results."""
TRACES = ("logs", "benchmarks")
"""Folders of results that tell how the jobs went, not what they found."""
ENDING = ".crate.zip"
"""End of the names that crates have by default."""
SNAKEFILE = f"{RULES}/Snakefile"


class Role(Enum):
    """What a file is in the run."""

    RULES = "rules"
    CONFIGURATION = "configuration"
    INPUT = "input"
    RESULT = "result"
    TRACE = "trace"


@dataclass(frozen=True)
class CrateFile:
    """A file of a crate."""

    name: str
    """Path in the crate, with slashes."""
    path: Path
    role: Role
    original: str = ""
    """Path by which the run knew it, if that is another."""

    @property
    def published_original(self) -> str:
        """`original`, but of an absolute path the last part: folders tell of their owner."""
        path = Path(self.original)
        return path.name if path.is_absolute() else self.original

    @property
    def is_result(self) -> bool:
        """Whether the run has made it, other than as a trace of itself."""
        return self.role is Role.RESULT


def results_of(results: Path, left_out: Iterable[str] = ()) -> list[CrateFile]:
    """Files below the folder of a run's results, its configuration among them.

    `left_out`: files and folders below `results` that stay out of the crate. Hidden files and
    earlier crates do, too. Raises UserError if the folder is not that of a run, or a name or link
    cannot be in a crate.
    """
    _require_run(results)
    files = list(_results(results, left_out))
    if not any(file.is_result for file in files):
        raise UserError(
            f"{results}: holds no results but {CONFIGURATION}, expected those of a run; "
            "run the workflow first"
        )
    for file in files:
        require_plain(Path(file.name))
    return files


def _require_run(results: Path) -> None:
    try:
        if not results.is_dir():
            raise UserError(f"{results}: is no folder, expected that of a run's results")
    except (OSError, ValueError) as error:
        said = cause(error) if isinstance(error, OSError) else str(error)
        raise UserError(f"{results}: cannot be read ({said})") from None
    if not (results / CONFIGURATION).is_file():
        raise UserError(
            f"{results}: holds no {CONFIGURATION}, which every run writes; name the results_dir "
            "of a run"
        )


def rules() -> list[CrateFile]:
    """The rules of the workflow; folders are those of a checkout."""
    rooms = settings.FOLDER.parent
    others = sorted([*rooms.glob("workflow/rules/*.smk"), *rooms.glob("studies/*/*.smk")])
    return [
        CrateFile(SNAKEFILE, settings.FOLDER / "Snakefile", Role.RULES),
        *(CrateFile(path.relative_to(rooms).as_posix(), path, Role.RULES) for path in others),
    ]


def inputs(config: Mapping[str, Any], named: Mapping[str, str]) -> list[CrateFile]:
    """Files that a run was made from: meshes, materials, regions, forests.

    `named`: those that the results name, each with its result, beside those of the configuration.
    The forests of the package and what the run has made itself are none. Raises UserError, which
    says who names it, if one is missing.
    """
    configured = [
        file for model in config["models"] for file in settings.model_files(config, model)
    ]
    forests = settings.forests_file(config)
    if forests is not None:
        configured.append(forests)
    files = {**named, **dict.fromkeys(configured, CONFIGURATION)}
    own, results = default_path(), Path(config["results_dir"]).resolve()
    found: list[CrateFile] = []
    for file in sorted(files):
        path = _require_input(file, files[file])
        if results in path.resolve().parents or (own.is_file() and path.samefile(own)):
            continue
        # Some systems take names that differ in case alone for one.
        taken = {each.name.casefold() for each in found}
        names = (
            f"{path.stem}{number}{path.suffix}"
            for number in chain([""], map("-{}".format, count(2)))
        )
        name = next(name for name in names if f"{INPUTS}/{name}".casefold() not in taken)
        found.append(CrateFile(f"{INPUTS}/{name}", path, Role.INPUT, original=file))
    return found


def _require_input(file: str, named_by: str) -> Path:
    try:
        path = require_file(file, "an input of the run; make the crate in the folder of the run")
        require_plain(Path(path.name))
    except UserError as error:
        raise UserError(f"{named_by} names {error}") from None
    return path


def _results(results: Path, left_out: Iterable[str]) -> Iterator[CrateFile]:
    """Files below a folder of results, in the order of their names.

    A link is refused: what it leads to may be anything, and the crate is published.
    """
    absent = {_below(results, name) for name in left_out}

    def refuse(error: OSError) -> None:
        raise UserError(f"{error.filename}: cannot be read ({cause(error)})")

    for folder, folders, files in os.walk(results, onerror=refuse):
        here = Path(folder)
        folders[:] = sorted(each for each in folders if _belongs(here / each, absent))
        for name in sorted(files):
            path = here / name
            if not _belongs(path, absent):
                continue
            require_file(path, "a result of the run")
            below = path.relative_to(results)
            yield CrateFile(f"{RESULTS}/{below.as_posix()}", path, _role(below))


def _below(results: Path, name: str) -> Path:
    path = results / name
    if ".." in Path(name).parts or results not in path.parents or not os.path.lexists(path):
        raise UserError(f"--leave-out {name}: there is no such file or folder below {results}")
    if path == results / CONFIGURATION:
        raise UserError(
            f"--leave-out {name}: is the configuration of the run, which every crate holds; leave "
            "out results only"
        )
    return path


def _belongs(path: Path, absent: set[Path]) -> bool:
    if path.name.startswith(".") or path.name.endswith(ENDING) or path in absent:
        return False
    if path.is_symlink():
        raise UserError(
            f"{path}: is a link, and a crate holds files; put what it leads to in its place, or "
            "leave it out by --leave-out"
        )
    return True


def _role(below: Path) -> Role:
    if below == Path(CONFIGURATION):
        return Role.CONFIGURATION
    return Role.TRACE if below.parts[0] in TRACES else Role.RESULT
