"""Validate one cell; whatever comes of it is a result, its failure too."""

import os
import shlex
import subprocess
import sys
import time
from math import isfinite
from pathlib import Path
from typing import Any

from carillon.records import provenance
from workflow.validation.criteria import judge, verdict
from workflow.validation.evidence import Evidence

JUDGED = (0, 1)
"""Exit statuses of `validate` after which there is a verdict."""
SAID = 2000
"""Last characters of what a validation said, in which its error is looked for."""


def validated(arguments: list[str], folder: Path, cores: int, log: Path) -> dict[str, Any]:
    """Run `carillon validate`, and what it found as plain values for JSON.

    Returns
    -------
    dict[str, Any]
        `passed`; the `reason` if the run failed, else None; `wrong` spectra, the `advice` and all
        `criteria` if it did not; the `command` that repeats it, and its `seconds`.
    """
    words = ["validate", *arguments, "--out", str(folder)]
    program = [sys.executable, "-m", "workflow", *words, "--cores", str(cores)]
    begun = time.perf_counter()
    # Without what MPI, loaded here, has set beside Python: mpiexec would take it for its own.
    environment = dict(os.environ)
    with log.open("w") as stream:
        done = subprocess.run(program, env=environment, stdout=stream, stderr=stream)
    status = done.returncode
    result: dict[str, Any] = {
        "command": shlex.join(["carillon", *words]),
        "seconds": time.perf_counter() - begun,
        "provenance": provenance.record({"arguments": arguments}),
    }
    if status not in JUDGED:
        reason = reason_of(status, log.read_text())
        return {**result, "passed": False, "reason": reason, "criteria": [], "wrong": []}
    (page,) = (folder / "validation").glob("*.html")
    evidence = Evidence(folder, page.stem)
    outcome = verdict(evidence)
    return {
        **result,
        **{key: outcome[key] for key in ("passed", "wrong", "advice")},
        "reason": None,
        "criteria": [_finite(criterion.row) for criterion in judge(evidence)],
        "page": str(page.relative_to(folder)),
    }


def _finite(row: dict[str, Any]) -> dict[str, Any]:
    """The same without values that JSON has no number for."""
    odd = {key for key, value in row.items() if isinstance(value, float) and not isfinite(value)}
    return {key: None if key in odd else value for key, value in row.items()}


def reason_of(status: int, said: str) -> str:
    """Why a validation ended without a verdict, from its exit status and what it said.

    Examples
    --------
    >>> reason_of(2, "running\\nworkflow validate: error: the run failed\\n")
    'workflow validate: error: the run failed'
    >>> reason_of(-9, "")
    'it was ended by signal 9'
    """
    if status < 0:
        return f"it was ended by signal {-status}"
    lines = [line.strip() for line in said[-SAID:].splitlines() if line.strip()]
    return lines[-1] if lines else f"it ended with exit status {status} and said nothing"
