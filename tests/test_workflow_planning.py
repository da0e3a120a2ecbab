"""Planning a run: quick, and without MPI, whose traces in the environment would reach every job."""

import re

from tests.programs import python
from tests.workflow_runs import CHECKOUT

_IMPORT = re.compile(r"(?m)^(?:from (?:carillon|workflow)|import (?:carillon|workflow))\b.*$")


def test_rules_import_neither_mpi_nor_petsc():
    files = [CHECKOUT / "Snakefile", *(CHECKOUT / "workflow" / "rules").glob("*.smk")]
    imports = [line for file in files for line in _IMPORT.findall(file.read_text())]
    check = "import sys; print(sorted({'mpi4py.MPI', 'petsc4py', 'slepc4py'} & set(sys.modules)))"
    done = python("-c", "\n".join([*imports, check]), cwd=CHECKOUT)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr
