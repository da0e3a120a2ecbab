"""Loss factors of regions, by which a material damps its modes as the clips say.

The loss factor of a material is the share of its strain energy that a radian of vibration loses.
A mode loses what its regions lose, each by its share s_r of the mode's strain energy (modal strain
energy method; Johnson and Kienholz, AIAA Journal 20, 1982):

    d = alpha / 2 + omega / 2 sum_r eta_r s_r .
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from carillon.fem.geometry import HexMesh
from solver.distribution.partition import partition_cells
from sound.design.simulation import Evaluation, Simulation
from sound.project.material_damping import MaterialDamping

Array = NDArray[np.float64]

ALIKE = 1e-4
"""Weight of the differences of loss factors: little, but where dampings do not tell regions apart,
such as the two ends of a bar, it makes them alike."""


def material_damping(
    simulation: Simulation,
    evaluation: Evaluation,
    mesh: HexMesh,
    regions: int,
    hertz: Array,
    order: NDArray[np.integer],
    wanted: Array,
) -> MaterialDamping:
    """Loss factors that bring the dampings of a material's modes near to those `wanted`.

    Parameters
    ----------
    simulation, evaluation
        Of the material.
    mesh
        Its voxels.
    regions : int
        Regions that have a loss factor each; they depend on the solid alone.
    hertz : (N,) [Hz]
        What the modes sound at.
    order : (N,)
        Number of each among the modes of the evaluation.
    wanted : (N,) [1/s]
        Dampings.
    """
    labels = partition_cells(mesh, min(regions, mesh.n_cells))
    shares = simulation.energy_shares(evaluation, labels)[order]
    factors, mass = fitted_loss_factors(shares, hertz, wanted)
    dampings = 0.5 * mass + np.pi * hertz * (shares @ factors)
    return MaterialDamping(factors[labels], mass, np.maximum(dampings, 0.0))


def fitted_loss_factors(shares: Array, hertz: Array, wanted: Array) -> tuple[Array, float]:
    """Loss factors (R,) and alpha [1/s], neither negative, for dampings nearest to those `wanted`.

    Least squares of relative differences: so no damping is made far too long for the sake of a
    short one.

    Parameters
    ----------
    shares : (N, R)
        Of the modes' strain energies, that the regions hold.
    hertz : (N,) [Hz]
        Frequencies.
    wanted : (N,) [1/s]
        Dampings, above 0.

    Examples
    --------
    >>> shares, hertz = np.array([[0.9, 0.1], [0.2, 0.8], [0.5, 0.5]]), np.array([1e2, 2e2, 3e2])
    >>> wanted = np.pi * hertz * (shares @ np.array([0.01, 0.03]))
    >>> factors, mass = fitted_loss_factors(shares, hertz, wanted)
    >>> factors.round(6).tolist(), round(mass, 6)
    ([0.01, 0.03], 0.0)
    """
    lost = np.pi * hertz[:, None] * shares / wanted[:, None]
    regions = shares.shape[1]
    differences = ALIKE * np.linalg.norm(lost) * (np.eye(regions) - 1.0 / regions)
    columns = np.column_stack(
        [np.concatenate([lost, differences]), np.append(0.5 / wanted, np.zeros(regions))]
    )
    found = nnls(columns, np.append(np.ones(len(wanted)), np.zeros(regions)))[0]
    return found[:-1], float(found[-1])
