"""Modes of a mesh by component mode synthesis, for any material on it."""

from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError, on_all_ranks
from carillon.fem.model import Solid
from carillon.processes.mpi import MPI
from solver.analysis.bounds import default_keep, uncorrected_keep
from solver.analysis.options import SolverOptions
from solver.assembly.system import System
from solver.distribution.local_mesh import LocalMesh, distribute
from solver.distribution.redistribution import Redistribution
from solver.hcms.kept_groups import KeptGroups
from solver.hcms.synthesis import Synthesis, make_subdomains, synthesize
from solver.linear import ITERATIVE
from solver.reference.truth import SPARE_MODES

ORTHOGONAL_TO_RIGID = 1e-10
"""Largest overlap of HCMS modes with the rigid motions that is not removed."""


def distribute_by_parts(
    model: Solid | None, options: SolverOptions, comm: MPI.Comm
) -> tuple[LocalMesh, LocalMesh]:
    """The solid by subdomains, and by the rows of its matrices; collective.

    They are the same but where ranks factorise together to correct what HCMS finds. Its subdomains
    do not depend on the ranks, but are ragged: there are fewer nodes between ranks that are cut by
    planes.
    """
    by_parts = distribute(model, options.subdomains, options.seed, comm)
    corrected = options.method == "hcms" and options.corrections > 0
    if comm.size == 1 or not corrected or options.linear_solver in ITERATIVE:
        return by_parts, by_parts
    return by_parts, distribute(model, comm=comm, by_planes=True)


class ComponentModes:
    """Hierarchical component mode synthesis on one mesh, `by_parts`: in subdomains.

    Rows of the modes are those of `local_mesh`, where the subdomains may be others. Fewer modes are
    needed if a block Lanczos iteration corrects them `together`. Raises UserError if
    `--retained-modes` is too few for the modes that are asked for.
    """

    def __init__(
        self,
        by_parts: LocalMesh,
        local_mesh: LocalMesh,
        options: SolverOptions,
        together: bool,
        comm: MPI.Comm,
    ) -> None:
        self._options = options
        self._comm = comm
        self._keep = _modes_to_keep(by_parts, options, together)
        self._subdomains = make_subdomains(by_parts, options.interface, comm)
        self._redistribution = Redistribution(by_parts, local_mesh, comm)
        self._kept: KeptGroups | None = None

    def synthesis(self, by_parts: LocalMesh, threads: int, evidence: dict[str, Any]) -> Synthesis:
        """Approximate modes of the material on `by_parts`; `evidence` gets messages and work.

        From the third call on, groups of subdomains whose material is that of the call before are
        not made again: the second shows that materials follow each other.
        """
        cutoff = self._options.cutoff
        kept = self._kept
        if kept is None:
            self._kept = KeptGroups()
        synthesis = synthesize(
            by_parts,
            self._keep,
            self._options.interface,
            self._comm,
            self._subdomains,
            threads,
            None if cutoff is None else (2.0 * np.pi * cutoff) ** 2,
            kept,
        )
        evidence["hcms"] = synthesis.counts.summary(self._comm)
        synthesis.vectors = self._redistribution.rows(synthesis.vectors)
        return synthesis


@on_all_ranks()
def _modes_to_keep(by_parts: LocalMesh, options: SolverOptions, together: bool) -> int:
    keep = options.retained_modes
    if keep is None:
        parts = by_parts.decomposition.tree.parts
        keep = (
            default_keep(options.modes, parts, together)
            if options.corrections
            else uncorrected_keep(options.modes, parts)
        )
    least = options.modes + (SPARE_MODES if options.corrections else 0)
    if keep < min(least, by_parts.n_dofs):
        raise UserError(
            f"--retained-modes {keep} is too few for {options.modes} modes; "
            f"expected at least {least}, and half more for fast convergence"
        )
    return keep


@on_all_ranks()
def lowest_pairs(synthesis: Synthesis, count: int) -> tuple[Array, Array]:
    """The `count` lowest values and vectors, uncorrected.

    Raises UserError if the synthesis kept fewer.
    """
    if len(synthesis.values) < count:
        raise UserError(
            f"HCMS kept {len(synthesis.values)} modes, {count} are asked for; raise "
            "--retained-modes or lower --subdomains"
        )
    return synthesis.values[:count], np.ascontiguousarray(synthesis.vectors[:, :count])


def elastic_part(system: System, synthesis: Synthesis) -> tuple[Array | None, Array]:
    """Ritz values and vectors without the rigid motions; no values if the two are not apart."""
    elastic = np.ascontiguousarray(synthesis.vectors[:, system.n_rigid :])
    overlap = system.inner(system.times_mass(system.rigid), elastic)
    if overlap.size and np.abs(overlap).max() > ORTHOGONAL_TO_RIGID:
        return None, synthesis.vectors
    return synthesis.values[system.n_rigid :], elastic
