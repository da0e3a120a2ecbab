"""Where the other rooms lie: beside `carillon` in a checkout, in `carillon/_rooms` if installed.

So an installation takes one name among the packages of an environment, whatever else is called
`solver` or `workflow` there. A process that imports `carillon` then finds Carillon's rooms first.
"""

import os
from collections.abc import MutableSequence

CARILLON = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
"""Folder of the package."""
PARENT = os.path.dirname(CARILLON)
"""The folder that `carillon` is imported from."""
INSTALLED = os.path.join(CARILLON, "_rooms")
"""The folder of the other rooms in an installation."""


def folders() -> list[str]:
    """Folders that all rooms are imported from, in the order in which they are searched."""
    return [INSTALLED, PARENT] if os.path.isdir(INSTALLED) else [PARENT]


def find(path: MutableSequence[str]) -> None:
    """Have modules be searched in the rooms of an installation, just before `carillon` is found.

    Examples
    --------
    >>> path = ["/elsewhere"]
    >>> find(path)
    >>> "/elsewhere" in path
    True
    """
    if os.path.isdir(INSTALLED) and INSTALLED not in path:
        own = [index for index, folder in enumerate(path) if os.path.abspath(folder) == PARENT]
        path.insert(own[0] if own else 0, INSTALLED)
