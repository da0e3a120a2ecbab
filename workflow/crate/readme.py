"""The page of a crate for people: what is where, and what to cite."""

import re
from collections.abc import Mapping
from typing import Any

from workflow.crate.citation import name_of

SPECIAL = re.compile(r"([\\`*_{}\[\]<>#|])")
"""Characters that mean something in Markdown."""


def readme_of(title: str, licence: str, software: Mapping[str, Any]) -> str:
    """Text of a crate's README.md; `software`: keys and values of CITATION.cff."""
    name = f"{software['title']} {software['version']}"
    paper = software["preferred-citation"]
    authors = ", ".join(map(name_of, paper["authors"]))
    place = f"{paper['conference']['name']}, {paper['year']}"
    return f"""# {SPECIAL.sub(_escaped, title)}

A run of {name}. {software["abstract"]}

| file or folder | holds |
| --- | --- |
| `results` | what the run has made: its configuration, its page `report.html`, data, logs |
| `inputs` | meshes, materials and forests that it was made from, if these were files |
| `workflow`, `studies` | rules of Snakemake that made it, which call programs of {name} |
| `ro-crate-metadata.json` | length and SHA-256 of every file, and which command made it |

This is a Workflow Run RO-Crate, <https://w3id.org/ro/wfrun/workflow/0.5>. Licence: {licence}.

Cite this crate by the identifier under which you have found it, the software as {name}, and the
paper whose method it implements: {authors}, *{paper["title"]}*, {place}.
"""


def _escaped(found: re.Match[str]) -> str:
    return f"\\{found[0]}"
