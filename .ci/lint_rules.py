"""`snakemake --lint` without its demand for a conda environment or container in every rule.

One locked environment (`make env`) serves all rules, because MPI, PETSc and SLEPc have to be those
of the machine; every other lint counts.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

from snakemake.cli import main
from snakemake.linting.rules import RuleLinter


def _accept_any_software(linter: RuleLinter, rule: object) -> Iterator[object]:
    return iter(())


RuleLinter.lint_missing_software_definition = _accept_any_software

if __name__ == "__main__":
    sys.exit(main(["--lint", *sys.argv[1:]]))
