"""Why a run of Snakemake failed, from what it printed."""

from __future__ import annotations

import re

_PROGRAM = re.compile(
    r"^\s*((?:carillon|dataset_gen|forests|solver|sound|workflow)[ \w-]*: .+)$", re.MULTILINE
)
"""What a program of ours says at last."""
_EXCEPTION = re.compile(
    r"^(?:\w+\.)*\w+(?:Error|Exception)\b[^\n:]*(?:\"[^\n]*\"[^\n:]*)?:[ \t]*([^\n]*)\n"
    r"((?:(?!\s+File )[^\n]*\S[^\n]*\n)*)",
    re.MULTILINE,
)
"""An exception of Snakemake's or of a script: its name, where it was raised, and what it says."""
_RULE = re.compile(r"^Error in rule (\w+):", re.MULTILINE)
LONGEST = 1000
"""Characters of a cause."""


def cause(output: str) -> str:
    """The cause in one line: what a program said, or else Snakemake, or else its last line.

    Examples
    --------
    >>> cause('WorkflowError in file "Snakefile", line 2:\\nmodels: names none\\n  File "x"\\n')
    'Snakemake says: models: names none'
    >>> cause("LockException:\\nError: Directory cannot be locked.\\n")
    'Snakemake says: Error: Directory cannot be locked'
    >>> cause("Error in rule find_modes:\\n    jobid: 3\\n")
    'rule find_modes ended without a word, as jobs do that are killed'
    """
    output = output.rstrip() + "\n"
    programs = _PROGRAM.findall(output)
    if programs:
        return _line(programs[-1])
    exceptions = [_line(" ".join(parts)) for parts in _EXCEPTION.findall(output)]
    said = [text for text in exceptions if text]
    if said:
        return f"Snakemake says: {said[-1]}"
    rules = _RULE.findall(output)
    if rules:
        return f"rule {rules[-1]} ended without a word, as jobs do that are killed"
    last = output.strip().splitlines()[-1:]
    return f"Snakemake says: {_line(last[0])}" if last else "Snakemake said nothing"


def _line(text: str) -> str:
    line = re.sub(r"\s+", " ", text).strip().rstrip(".")
    return line if len(line) <= LONGEST else f"{line[:LONGEST]} ..."
