"""Elastic modes of a solid: frequencies, dampings, and excitation by strikes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Complex
from carillon.errors import UserError
from carillon.fem.geometry import HexMesh
from carillon.fem.model import Solid
from solver.files.modes_file import ModesFile
from solver.response.dissipation import decays
from solver.response.points import motion_at
from solver.response.response import Damping
from solver.subspace.weyl import clusters
from sound.design.place import transfer_of
from sound.project.design import Design


@dataclass(frozen=True)
class SoundingSolid:
    """Elastic modes of a solid.

    `frequencies` f (k,) [Hz] and `dampings` d (k,) [1/s] are those of Eq. 3 of the appendix.  The
    mass-normalised `modes` (n_dofs, k) [kg^-1/2] are given on the nodes of `model`.  `heard` (k,)
    [Pa m / (kg^-1/2 N s)] are their pressures where they are heard, None where they count as they
    are struck.
    """

    frequencies: Array
    dampings: Array
    model: Solid
    modes: Array
    heard: Complex | None = None

    @classmethod
    def of_design(cls, design: Design) -> SoundingSolid:
        """A design: shapes of its coarse solid, frequencies of the fine one if they are known.

        Its dampings are those of the clips (§5) or of its material.
        """
        modes = design.elastic_modes
        return cls(design.frequencies, design.dampings, design.model, modes, design.heard)

    @classmethod
    def of_modes(cls, file: ModesFile, damping: Damping | None = None) -> SoundingSolid:
        """A solid of any modes file; see `damped`."""
        assert file.modes is not None
        return cls.damped(file.model, file.eigenvalues, file.modes, damping)

    @classmethod
    def damped(
        cls, model: Solid, eigenvalues: Array, modes: Array, damping: Damping | None = None
    ) -> SoundingSolid:
        """A solid with Rayleigh damping, without rigid modes and overdamped ones.

        Without a damping each of its regions has its own, see `solver.response.dissipation`. Its
        eigenvalues (k,) [rad^2/s^2] and modes (n_dofs, k) [kg^-1/2] ascend, those of the rigid
        motions first.  Raises UserError if none is left.
        """
        rigid = model.rigid_modes
        values = eigenvalues[rigid:]
        decay = decays(model, values, modes[:, rigid:], damping)
        square = values - decay**2
        kept = np.flatnonzero(square > 0.0)
        if not len(kept):
            raise UserError(
                f"of {len(eigenvalues)} modes none is elastic and damped little enough to sound; "
                "compute more or lower the damping"
            )
        hertz = np.sqrt(square[kept]) / (2.0 * np.pi)
        return cls(hertz, decay[kept], model, modes[:, rigid + kept])

    @classmethod
    def of_truth(cls, file: ModesFile, design: Design) -> SoundingSolid:
        """A design's object by modes of a file, for instance of the fine mesh, damped as the
        design.

        Raises UserError if the file holds fewer elastic modes than the design, or those of another
        object.
        """
        assert file.modes is not None
        count, rigid = len(design.frequencies), file.model.rigid_modes
        if len(file.frequencies) < rigid + count:
            raise UserError(
                f"found {len(file.frequencies)} modes, expected {rigid} rigid and {count} "
                f"elastic ones as in the design; compute {rigid + count}"
            )
        _require_same_object(file.mesh, design.model.mesh)
        kept = slice(rigid, rigid + count)
        hertz, modes = file.frequencies[kept], file.modes[:, kept]
        heard = None
        if design.heard is not None:
            heard = transfer_of(design).heard(file.model, modes, hertz)
        return cls(hertz, design.dampings, file.model, modes, heard)

    def motion(self, positions: Array) -> Array:
        """Displacement (p, 3, k) [kg^-1/2] of points (p, 3) [m] of the surface in each mode."""
        return motion_at(self.model, self.modes, positions)

    def amplitudes(self, positions: Array, impulses: Array) -> Array:
        """Amplitudes a_k (p, k) after impulses (p, 3) [N s] at points (p, 3) [m].

        They are in kg^-1/2 N s, or in Pa m where they are `heard`, see `struck_amplitudes`.
        """
        pushed = np.einsum("pik,pi->pk", self.motion(positions), impulses)
        return struck_amplitudes(pushed, self.frequencies, self.heard)


def struck_amplitudes(pushed: Array, frequencies: Array, heard: Complex | None = None) -> Array:
    """Amplitudes a_k (p, k) of modes that impulses f push by u_k^T f (p, k) [kg^-1/2 N s].

    a_k = |u_k^T f|: every mode starts in the direction of the push, so its sign does not matter.
    Within a cluster of equal frequencies (k,) [Hz], which ascend, it is (u_k^T f)^2 over the root
    of the sum of these squares: the whole cluster then is as loud as |U^T f|, whatever the basis of
    its modes.

    Modes that are `heard` by pressures h (k,) have a_k = |u_k^T f h_k|, and a cluster, whose
    pressures add up, |sum u_i^T f h_i|, of which modes have shares as these squares.
    """
    groups = clusters(frequencies**2)
    firsts = [group.start for group in groups]
    square = pushed**2 if heard is None else np.abs(pushed * heard) ** 2
    whole = np.add.reduceat(square, firsts, axis=1)
    if heard is None:
        divisor = np.sqrt(whole)
    else:
        joint = np.abs(np.add.reduceat(pushed * heard, firsts, axis=1))
        divisor = np.divide(whole, joint, out=np.zeros_like(whole), where=joint > 0.0)
    divisor = np.repeat(divisor, [group.stop - group.start for group in groups], axis=1)
    return np.asarray(np.divide(square, divisor, out=np.zeros_like(square), where=divisor > 0.0))


def _require_same_object(mesh: HexMesh, designed: HexMesh) -> None:
    """Refuse a mesh whose bounding box differs from the design's by more than a cell."""
    boxes = [mesh.bounds, designed.bounds]
    if np.abs(boxes[0] - boxes[1]).max() > max(mesh.edge, designed.edge):
        sizes = [" x ".join(f"{side:.3g}" for side in np.ptp(box, axis=0)) for box in boxes]
        raise UserError(
            f"the modes are of another object than the design: one of {sizes[0]} m at "
            f"{boxes[0][0].round(4).tolist()}, expected one of {sizes[1]} m at "
            f"{boxes[1][0].round(4).tolist()}"
        )
