"""Names of designs and points in file names, in columns of tables, and in other programs."""

import re
import unicodedata
from collections.abc import Sequence

LONGEST = 60
"""Greatest length of a name in a file name."""


def file_name(name: str, default: str) -> str:
    """A name as part of file names and columns: small letters, digits and `_`.

    Accents are left out; anything else becomes `_`.  `default` stands for a name of nothing else.

    Examples
    --------
    >>> file_name("Läute; rim-left", "point"), file_name("鐘", "point")
    ('laute_rim_left', 'point')
    """
    letters = unicodedata.normalize("NFKD", name.lower())
    bare = "".join(each for each in letters if not unicodedata.combining(each))
    return re.sub(r"[^a-z0-9]+", "_", bare).strip("_")[:LONGEST].rstrip("_") or default


def file_names(names: Sequence[str]) -> list[str]:
    """Names of points as parts of file names and columns, each a different one.

    Examples
    --------
    >>> file_names(["Rim left", "rim-left", "鐘"])
    ['rim_left', 'rim_left_2', 'point']
    """
    taken: set[str] = set()
    found = []
    for name in names:
        base = file_name(name, "point")
        own, number = base, 1
        while own in taken:
            number += 1
            own = f"{base}_{number}"
        taken.add(own)
        found.append(own)
    return found


def plain(name: str) -> str:
    """A name of letters, digits and ` .+-_` alone, which every program takes.

    Examples
    --------
    >>> plain("rim; left/upper")
    'rim_ left_upper'
    """
    return re.sub(r"[^\w .+-]", "_", name)
