"""Arguments of commands as lists of words, which rules quote one by one (`{params.NAME:q}`)."""

import os
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def options(values: Mapping[str, Any]) -> list[str]:
    """Options of a command from their values, in order.

    A list stands for several words, True for the option alone; an option without a value (None,
    False, an empty text or list) is left out. A text that begins like an option is one word with
    it.

    Examples
    --------
    >>> options({"max_leaves": 30, "at": [0.1, -2.0], "tune": True, "weak": False, "only": None})
    ['--max-leaves', '30', '--at', '0.1', '-2.0', '--tune']
    >>> options({"up": "-y"})
    ['--up=-y']
    """
    words = []
    for name, value in values.items():
        if value is None or value is False or value in ("", [], ()):
            continue
        option = f"--{name.replace('_', '-')}"
        if isinstance(value, str) and value.startswith("-"):
            words.append(f"{option}={value}")
            continue
        words.append(option)
        if value is not True:
            words += map(str, value) if isinstance(value, (list, tuple)) else [str(value)]
    return words


def path_word(path: str | Path) -> str:
    """A path in its shortest form, as a word that no command takes for an option.

    Examples
    --------
    >>> path_word("meshes//box.obj"), path_word("-box.obj"), path_word("./-box.obj")
    ('meshes/box.obj', './-box.obj', './-box.obj')
    """
    word = str(Path(path))
    return os.path.join(os.curdir, word) if word.startswith("-") else word


def quoted(command: str) -> str:
    """A command line whose words mean nothing to a shell but themselves.

    Raises ValueError if a quotation in it does not end.

    Examples
    --------
    >>> quoted("srun --mpi=pmix --comment 'two words' $(id); ls")
    "srun --mpi=pmix --comment 'two words' '$(id);' ls"
    """
    return shlex.join(shlex.split(command))
