"""From the fine mesh to the mesh of its 2x2x2 blocks (section 7.1)."""

from __future__ import annotations

from typing import NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.fem.geometry import Blocks, HexMesh, blocks_from_mesh
from carillon.fem.model import Constants, ElasticModel, fine_model
from dataset_gen.objectives import DEFAULT_OBJECTIVE, Fits, fit, lumped_share
from forests import coarsen as evaluate_forest
from forests.baselines import average, galerkin
from solver.coarsening.trained import Trained, load_trained

Array = NDArray[np.float64]

METHODS = ("none", "average", "galerkin", "ddfem", "fit")


class CoarseMaterial(NamedTuple):
    """What a coarsening decides about the coarse elements.

    Attributes
    ----------
    moduli : (mc, 8) Young's modulus at the quadrature points, in the unit of the fine ones.
    lumped_share : share of lumped mass in elements without void octants, see `ElasticModel`.
    """

    moduli: Array
    lumped_share: float


def coarse_material(
    e: Array,
    method: str,
    poisson: float,
    forest: Trained | None = None,
    objective: str = DEFAULT_OBJECTIVE,
) -> CoarseMaterial:
    """Material of coarse elements from the blocks' fine moduli (mc, 8).

    `method` is one of `average`, `galerkin`, `ddfem` (the regression forests `forest`, or the
    default ones) and `fit` (the `objective` solved for every block, what the forests learn).

    Raises
    ------
    UserError
        For an unknown method, or if the default forests are absent or for another Poisson's ratio.
    """
    match method:
        case "average":
            return CoarseMaterial(average(e), 0.0)
        case "galerkin":
            return CoarseMaterial(galerkin(e), 0.0)
        case "fit":
            moduli = fit_distinct(objective, e, poisson).moduli
            return CoarseMaterial(moduli, lumped_share(objective))
        case "ddfem":
            model = (forest or load_trained(None, poisson)).model
            return CoarseMaterial(evaluate_forest(model, e), lumped_share(model.objective))
    raise UserError(f"coarsening {method!r} is unknown, expected one of {', '.join(METHODS)}")


def fit_distinct(objective: str, e: Array, poisson: float) -> Fits:
    """The same as `dataset_gen.objectives.fit`, but blocks that are equal are fitted once."""
    distinct, row = np.unique(e, axis=0, return_inverse=True)
    fits = fit(objective, distinct, poisson)
    return Fits(*(values[row.ravel()] for values in fits))


def block_moduli(blocks: Blocks, young: Array) -> Array:
    """Fine moduli (mc, 8) of every block, 0 where a cell is void; `young` is (m,) [Pa]."""
    return np.where(blocks.mask, young[blocks.fine_of_block], 0.0)


def build_model(
    mesh: HexMesh,
    young: Array,
    method: str = "none",
    forest: Trained | None = None,
    objective: str = DEFAULT_OBJECTIVE,
    **constants: Unpack[Constants],
) -> ElasticModel:
    """Model of the fine mesh (`none`) or of its blocks.

    Parameters
    ----------
    mesh
        Fine mesh.
    young
        (m,) modulus [Pa] of each fine cell.
    method, forest, objective
        See `coarse_material`.
    constants
        `poisson`, `density` [kg/m^3], `lumped`, see `ElasticModel`.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> grid = np.argwhere(np.ones((4, 2, 2)))
    >>> mesh = hexmesh_from_grid(grid, np.zeros(3), 0.5)
    >>> coarse = build_model(mesh, np.full(16, 1e9), "ddfem")
    >>> coarse.mesh.n_cells, coarse.young.shape
    (2, (2, 8))
    """
    fine = fine_model(mesh, young, **constants)
    if method == "none":
        return fine
    blocks = blocks_from_mesh(mesh)
    e = block_moduli(blocks, young)
    material = coarse_material(e, method, fine.poisson, forest, objective)
    return coarse_model(blocks, material, **constants)


def coarse_model(
    blocks: Blocks, material: CoarseMaterial, **constants: Unpack[Constants]
) -> ElasticModel:
    """Model of the blocks. The consistent part of the mass is P^T M P over the filled cells."""
    pattern = np.packbits(blocks.mask, axis=1, bitorder="little").ravel()
    return ElasticModel(
        blocks.coarse,
        material.moduli,
        pattern,
        lumped_share=material.lumped_share,
        **constants,
    )
