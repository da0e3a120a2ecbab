"""Loss factors of a material's regions, fitted to the dampings of the clips.

The loss factor of a material is the share of its strain energy that a radian of vibration loses.  A
mode loses the energy that its regions lose, each by its share s_r of the mode's strain energy
(modal strain energy method; Johnson and Kienholz, AIAA Journal 20, 1982):

    d = alpha / 2 + omega / 2 sum_r eta_r s_r .
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from carillon.arrays import Array
from carillon.fem.geometry import HexMesh
from solver.distribution.partition import partition_cells
from sound.design.simulation import Evaluation, Simulation
from sound.project.material_damping import MaterialDamping

ALIKE = 1e-4
"""Weight of the differences between loss factors.  It is small, and makes equal those that dampings
do not distinguish, such as of the two ends of a bar."""


def material_damping(
    simulation: Simulation,
    evaluation: Evaluation,
    mesh: HexMesh,
    regions: int,
    hertz: Array,
    order: NDArray[np.integer],
    targets: Array,
) -> MaterialDamping:
    """Loss factors that bring the dampings of a material's modes near to the targets.

    Parameters
    ----------
    simulation, evaluation
        Simulation and modes of the material.
    mesh
        Voxels.
    regions : int
        Number of regions with a loss factor each; the regions depend on the solid alone.
    hertz : (N,) [Hz]
        Frequencies of the modes.
    order : (N,)
        Number of each mode in the evaluation.
    targets : (N,) [1/s]
        Dampings of the clips.
    """
    labels = partition_cells(mesh, min(regions, mesh.n_cells))
    shares = simulation.energy_shares(evaluation, labels)[order]
    factors, mass = fitted_loss_factors(shares, hertz, targets)
    dampings = 0.5 * mass + np.pi * hertz * (shares @ factors)
    return MaterialDamping(factors[labels], mass, np.maximum(dampings, 0.0))


def fitted_loss_factors(shares: Array, hertz: Array, targets: Array) -> tuple[Array, float]:
    """Loss factors (R,) and alpha [1/s], none negative, for dampings nearest to the targets.

    Least squares of relative differences, so that large dampings do not outweigh small ones.

    Parameters
    ----------
    shares : (N, R)
        Shares of the regions in the modes' strain energies.
    hertz : (N,) [Hz]
        Frequencies.
    targets : (N,) [1/s]
        Dampings above 0.

    Examples
    --------
    >>> shares, hertz = np.array([[0.9, 0.1], [0.2, 0.8], [0.5, 0.5]]), np.array([1e2, 2e2, 3e2])
    >>> targets = np.pi * hertz * (shares @ np.array([0.01, 0.03]))
    >>> factors, mass = fitted_loss_factors(shares, hertz, targets)
    >>> factors.round(6).tolist(), round(mass, 6)
    ([0.01, 0.03], 0.0)
    """
    lost = np.pi * hertz[:, None] * shares / targets[:, None]
    regions = shares.shape[1]
    differences = ALIKE * np.linalg.norm(lost) * (np.eye(regions) - 1.0 / regions)
    columns = np.column_stack(
        [np.concatenate([lost, differences]), np.append(0.5 / targets, np.zeros(regions))]
    )
    solution = nnls(columns, np.append(np.ones(len(targets)), np.zeros(regions)))[0]
    return solution[:-1], float(solution[-1])
