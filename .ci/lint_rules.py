"""`snakemake --lint` with one demand less and one more.

No conda environment or container in every rule: one locked environment (`make env`) serves all of
them, because MPI, PETSc and SLEPc have to be those of the machine.

But quotes for all that goes to a shell: names of files and values of the configuration may hold
whatever file systems allow, so `{params.mesh}` is a fault and `{params.mesh:q}` is not.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from string import Formatter

from snakemake.cli import main
from snakemake.linting import Lint
from snakemake.linting.rules import RuleLinter

UNQUOTED = frozenset({"threads", "resources.mpi"})
"""A number of Snakemake's own, and a command line whose words are quoted where it is made."""


def unquoted(command: str) -> list[str]:
    """Placeholders of a shell command that lack the `q` which quotes what stands for them."""
    return [
        name
        for _, name, how, _ in Formatter().parse(command)
        if name is not None and name not in UNQUOTED and not (how or "").endswith("q")
    ]


def _demand_quotes(linter: RuleLinter, rule: object) -> Iterator[Lint]:
    for name in unquoted(getattr(rule, "shellcmd", None) or ""):
        yield Lint(
            title=f"Placeholder {{{name}}} without quotes",
            body=f"What it stands for may mean something to a shell; write {{{name}:q}}.",
        )


def _accept_any_software(linter: RuleLinter, rule: object) -> Iterator[object]:
    return iter(())


RuleLinter.lint_missing_software_definition = _accept_any_software
RuleLinter.lint_unquoted_placeholder = _demand_quotes

if __name__ == "__main__":
    sys.exit(main(["--lint", *sys.argv[1:]]))
