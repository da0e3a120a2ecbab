"""Stiffness and mass of a solid in files, for eigensolvers of other programs.

The solid is described as for `modes`, or it is that of a modes file. Names of matrices end in .mtx
(Matrix Market, the lower triangle), .petsc (PETSc's binary format) or .npz (scipy). Row 3 n + a,
counted from 0, is the displacement of node n along axis a; nodes are ordered by z, then y, then x,
and their positions [m] go into the file of --nodes. With the eigenvalues lambda [rad^2/s^2] of
K u = lambda M u, frequencies are sqrt(lambda) / (2 pi) [Hz]; those of the rigid motions that
supports leave come first, six of a free solid.
"""

import argparse
from pathlib import Path

import numpy as np

from carillon.errors import UserError
from carillon.fem.model import Solid
from carillon.files.atomic import atomic_path
from carillon.files.paths import require_writable
from carillon.parameters.command_line import collect, reader
from carillon.parameters.quantities import Resolution
from solver.analysis.problem import ProblemOptions, build_problem
from solver.commands.running import add_solid, on_ranks
from solver.exchange.matrices import matrices, write_matrix, writer_of
from solver.files.modes_file import read_modes

EXAMPLES = """examples:
  matrices builtin:bell --resolution 16 --stiffness K.mtx --mass M.mtx --nodes nodes.npy
  matrices bell.h5 --stiffness K.petsc --mass M.petsc
"""
NODES_ENDING = ".npy"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser, "resolution")
    parser.add_argument(
        "--resolution",
        type=reader(Resolution),
        help="voxels, or lattice spacings, along the longest side; needed of a mesh",
    )
    parser.add_argument("--stiffness", metavar="FILE", help="file of K [N/m] to write")
    parser.add_argument("--mass", metavar="FILE", help="file of M [kg] to write")
    parser.add_argument("--nodes", metavar="FILE", help="file of the nodes' positions to write")
    parser.set_defaults(defaults={each.dest: each.default for each in parser._actions})


def run(arguments: argparse.Namespace) -> None:
    """Assemble and write."""
    _require_outputs(arguments)
    with on_ranks():
        model = _model(arguments)
        stiffness, mass = matrices(model)
    written = (
        (arguments.stiffness, stiffness, "K [N/m]"),
        (arguments.mass, mass, "M [kg]"),
    )
    for path, matrix, what in written:
        if path is not None:
            write_matrix(path, matrix, what)
            size = Path(path).stat().st_size
            print(
                f"{path}: {what}, {len(matrix.indptr) - 1:,} unknowns, {matrix.nnz:,} entries, "
                f"{size:,} bytes"
            )
    if arguments.nodes is not None:
        with atomic_path(arguments.nodes) as temporary, open(temporary, "wb") as stream:
            np.save(stream, model.positions)
        print(f"{arguments.nodes}: positions of {model.n_nodes:,} nodes [m]")


def _require_outputs(arguments: argparse.Namespace) -> None:
    named = [arguments.stiffness, arguments.mass, arguments.nodes]
    given = [path for path in named if path is not None]
    if not given:
        raise UserError("expected --stiffness, --mass or --nodes, the name of a file to write")
    if len({Path(path).absolute() for path in given}) < len(given):
        raise UserError(
            f"{', '.join(given)}: expected names that differ, each is a file of its own"
        )
    for path in given:
        if path is arguments.nodes:
            if Path(path).suffix.lower() != NODES_ENDING:
                raise UserError(
                    f"{path}: expected a name that ends in {NODES_ENDING} for positions"
                )
        else:
            writer_of(path)
        inputs = (arguments.mesh, arguments.material, arguments.forest)
        require_writable(path, [each for each in inputs if each is not None])


def _model(arguments: argparse.Namespace) -> Solid:
    if Path(arguments.mesh).suffix.lower() in (".h5", ".hdf5"):
        _require_nothing_given(arguments)
        return read_modes(arguments.mesh, with_modes=False).model
    if arguments.resolution is None:
        raise UserError("expected --resolution of a mesh, or a modes file in its place")
    return build_problem(collect(ProblemOptions, arguments)).model


def _require_nothing_given(arguments: argparse.Namespace) -> None:
    own = ("mesh", "stiffness", "mass", "nodes", "defaults", "help")
    given = [
        name
        for name, default in arguments.defaults.items()
        if name not in own and getattr(arguments, name, default) != default
    ]
    if given:
        raise UserError(
            f"{arguments.mesh}: leave out --{given[0].replace('_', '-')}, since the solid of a "
            "modes file is as it was solved"
        )
