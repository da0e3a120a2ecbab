"""Who wrote the software, under which licence, and what to cite: CITATION.cff."""

from collections.abc import Mapping
from typing import Any

from carillon.errors import UserError
from carillon.files.yaml_input import read_yaml
from workflow import settings

NAME = "CITATION.cff"
PLACES = (settings.FOLDER.parent / NAME, settings.FOLDER / NAME)
"""Where the file is in a checkout, and where in an installed package."""


def citation() -> dict[str, Any]:
    """Keys and values of CITATION.cff (Citation File Format 1.2.0).

    Raises UserError if it is missing.
    """
    for place in PLACES:
        if place.is_file():
            return read_yaml(place, "a citation file")
    raise UserError(f"{PLACES[0]}: no such file; it comes with Carillon, install it anew")


def name_of(author: Mapping[str, str]) -> str:
    """Name of an author, a person or an organisation, as people write it.

    Examples
    --------
    >>> name_of({"family-names": "Lovelace", "given-names": "Ada"})
    'Ada Lovelace'
    >>> name_of({"name": "The Carillon developers"})
    'The Carillon developers'
    """
    if "name" in author:
        return author["name"]
    return " ".join(author[key] for key in ("given-names", "family-names") if key in author)


def is_person(author: Mapping[str, str]) -> bool:
    """Whether an author is a person, not an organisation."""
    return "name" not in author
