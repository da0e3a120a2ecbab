"""Where the data files of the study lie."""

from pathlib import Path

FOLDER = Path(__file__).with_name("data")
"""Data files, one a solid; a file that is added is a solid that is measured."""


def solid_names() -> list[str]:
    """Names of all data files, in the order of the alphabet."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def is_file(name: str) -> bool:
    """Whether the name of a solid is the path of a data file elsewhere.

    Examples
    --------
    >>> is_file("tuning-fork"), is_file("mine.yaml")
    (False, True)
    """
    return name.endswith(".yaml")
