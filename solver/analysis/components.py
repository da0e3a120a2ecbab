"""Modes of a mesh by component mode synthesis, for any material on it."""

from typing import Any

import numpy as np
from mpi4py import MPI

from carillon.arrays import Array
from carillon.errors import UserError, on_all_ranks
from carillon.fem.model import RIGID_MODES
from solver.analysis.bounds import default_keep, uncorrected_keep
from solver.analysis.options import SolverOptions
from solver.assembly.system import System
from solver.distribution.local_mesh import LocalMesh
from solver.hcms.kept_groups import KeptGroups
from solver.hcms.synthesis import Synthesis, make_subdomains, synthesize
from solver.reference.truth import SPARE_MODES

ORTHOGONAL_TO_RIGID = 1e-10
"""Largest overlap of HCMS modes with the rigid motions that is not removed."""


class ComponentModes:
    """Hierarchical component mode synthesis on one mesh.

    Fewer modes are needed if a block Lanczos iteration corrects them `together`. Raises UserError
    if `--retained-modes` is too few for the modes that are asked for.
    """

    def __init__(
        self, local_mesh: LocalMesh, options: SolverOptions, together: bool, comm: MPI.Comm
    ) -> None:
        self._options = options
        self._comm = comm
        self._keep = _modes_to_keep(local_mesh, options, together)
        self._subdomains = make_subdomains(local_mesh, options.interface, comm)
        self._kept: KeptGroups | None = None

    def synthesis(self, local_mesh: LocalMesh, threads: int, evidence: dict[str, Any]) -> Synthesis:
        """Approximate modes of the material on `local_mesh`; `evidence` gets messages and work.

        From the third call on, groups of subdomains whose material is that of the call before are
        not made again: the second shows that materials follow each other.
        """
        cutoff = self._options.cutoff
        kept = self._kept
        if kept is None:
            self._kept = KeptGroups()
        synthesis = synthesize(
            local_mesh,
            self._keep,
            self._options.interface,
            self._comm,
            self._subdomains,
            threads,
            None if cutoff is None else (2.0 * np.pi * cutoff) ** 2,
            kept,
        )
        evidence["hcms"] = synthesis.counts.summary(self._comm)
        return synthesis


@on_all_ranks()
def _modes_to_keep(local_mesh: LocalMesh, options: SolverOptions, together: bool) -> int:
    keep = options.retained_modes
    if keep is None:
        parts = local_mesh.decomposition.tree.parts
        keep = (
            default_keep(options.modes, parts, together)
            if options.corrections
            else uncorrected_keep(options.modes, parts)
        )
    least = options.modes + (SPARE_MODES if options.corrections else 0)
    if keep < min(least, local_mesh.n_dofs):
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
    elastic = np.ascontiguousarray(synthesis.vectors[:, RIGID_MODES:])
    overlap = system.inner(system.times_mass(system.rigid), elastic)
    if overlap.size and np.abs(overlap).max() > ORTHOGONAL_TO_RIGID:
        return None, synthesis.vectors
    return synthesis.values[RIGID_MODES:], elastic
