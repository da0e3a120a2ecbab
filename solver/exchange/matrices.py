"""Stiffness and mass of a solid in files of other programs."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from carillon.errors import UserError
from carillon.fem.model import Solid
from carillon.files.atomic import atomic_path
from solver.assembly.node_rows import NodeRows, Pattern

NUMBERING = (
    "row 3 n + a, counted from 0, is the displacement of node n along axis a; "
    "nodes are ordered by z, then y, then x"
)
"""What the rows of the matrices are, for their files."""
_PETSC_MATRIX = 1211216
"""What binary matrices of PETSc begin with."""
_LARGEST = 2**31 - 1
"""Largest whole number in a binary file of PETSc with indices of 32 bits."""
_AT_ONCE = 1 << 20


def matrices(model: Solid) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Stiffness [N/m] and mass [kg] (n_dofs, n_dofs) of a solid, in the order of its mesh's nodes.

    Entries are those that all commands solve with; element matrices exist a few at a time.
    """
    count = model.n_nodes
    rows = NodeRows(Pattern.of_cells(model.connectivity.astype(np.int64), 0, count))
    rows.add_elements(model.elements)
    return rows.stiffness_csr(model.n_dofs), rows.mass_csr(model.n_dofs)


def write_matrix(path: str | Path, matrix: sp.csr_matrix, what: str) -> None:
    """Write a symmetric matrix in the format that the ending tells.

    `what` it is, with its unit, for the formats that hold comments. Raises UserError if the ending
    tells no format, or the file cannot be written.
    """
    with atomic_path(path) as temporary:
        writer_of(path)(temporary, matrix, what)


def writer_of(path: str | Path) -> Callable[[Path, sp.csr_matrix, str], None]:
    """What writes a matrix to a file of this name; raises UserError if its ending is unknown."""
    ending = Path(path).suffix.lower()
    if ending not in WRITERS:
        raise UserError(
            f"{path}: ends in {ending or 'nothing'}, expected .mtx (Matrix Market), .petsc (binary "
            "of PETSc) or .npz (scipy)"
        )
    return WRITERS[ending]


def _matrix_market(path: Path, matrix: sp.csr_matrix, what: str) -> None:
    from scipy.io import mmwrite

    with open(path, "wb") as stream:
        mmwrite(stream, matrix, comment=f"{what}; {NUMBERING}", symmetry="symmetric")


def _petsc(path: Path, matrix: sp.csr_matrix, _: str) -> None:
    """Big-endian, indices of 32 bits: what PETSc is built for unless asked (MatLoad)."""
    if max(matrix.nnz, *matrix.shape) > _LARGEST:
        raise UserError(
            f"a matrix of {matrix.nnz:,} entries, expected at most {_LARGEST:,} for PETSc's binary "
            "format with indices of 32 bits; write .mtx or .npz"
        )
    with open(path, "wb") as stream:
        head = np.array([_PETSC_MATRIX, *matrix.shape, matrix.nnz], dtype=">i4")
        stream.write(head.tobytes())
        stream.write(np.diff(matrix.indptr).astype(">i4").tobytes())
        for values, kind in ((matrix.indices, ">i4"), (matrix.data, ">f8")):
            for first in range(0, matrix.nnz, _AT_ONCE):
                stream.write(values[first : first + _AT_ONCE].astype(kind).tobytes())


def _npz(path: Path, matrix: sp.csr_matrix, _: str) -> None:
    # An archive that cannot be closed, on a full disk, would say so when it is collected.
    archive = BytesIO()
    sp.save_npz(archive, matrix)
    with open(path, "wb") as stream:
        stream.write(archive.getbuffer())


WRITERS: dict[str, Callable[[Path, sp.csr_matrix, str], None]] = {
    ".mtx": _matrix_market,
    ".petsc": _petsc,
    ".npz": _npz,
}
"""What writes a matrix, by the ending of its name."""
