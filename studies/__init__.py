"""Every experiment, each whole in a folder of its own; `carillon study` lists them.

A folder is a study: its commands (`COMMANDS` in `__init__.py`, and `PAGES`, what is on those that
its rules make), what it measures, its tables, plots and page (`study.py` says where they are), its
rules (`rules.smk`) and tests. Whoever adds or removes the folder adds or removes the study.
`config.py` holds its part of the configuration: `SECTIONS`, dataclasses of parameters by key, and
`LIMITS`, memory and time of its rules. `base` is what all of them stand on.
"""

from importlib import import_module
from pathlib import Path
from types import ModuleType

from carillon.command_line.commands import Command
from carillon.errors import UserError

FOLDER = Path(__file__).resolve().parent
PAGE_COMMAND = "studies.base.page_command"


def names() -> list[str]:
    """Names of all studies' folders."""
    folders = sorted(path.parent.name for path in FOLDER.glob("*/__init__.py"))
    return [name for name in folders if name != "base"]


def names_with(file: str) -> list[str]:
    """Names of those folders that hold a file."""
    return [name for name in names() if (FOLDER / name / file).is_file()]


def rules() -> list[Path]:
    """Files of rules; those of a study after those of the studies in its `NEEDS`.

    Raises UserError if a study, or the report of a run, needs one that is not there.
    """
    present = names()
    ordered: list[str] = []

    def add(name: str, needed_by: str) -> None:
        if name not in present:
            raise UserError(
                f"there is no folder studies/{name}, which {needed_by} needs; put it back"
            )
        for other in getattr(import_module(f"studies.{name}"), "NEEDS", ()):
            add(other, f"studies/{name}")
        if name not in ordered:
            ordered.append(name)

    for name in import_module("workflow.report").NEEDS:
        add(name, "workflow/report")
    for name in present:
        add(name, name)
    with_rules = names_with("rules.smk")
    return [FOLDER / name / "rules.smk" for name in ordered if name in with_rules]


def commands() -> dict[str, Command]:
    """Commands of all studies by name."""
    commands: dict[str, Command] = {}
    for name in names():
        study = import_module(f"studies.{name}")
        pages = getattr(study, "PAGES", {}).items()
        commands |= getattr(study, "COMMANDS", {})
        commands |= {page: Command(PAGE_COMMAND, f"page: {about}") for page, about in pages}
    return commands


def configurations() -> list[ModuleType]:
    """Modules of all studies' parts of the configuration."""
    return [import_module(f"studies.{name}.config") for name in names_with("config.py")]
