"""From the fine mesh to the mesh of its 2x2x2 blocks (section 7.1)."""

from typing import Unpack

import numpy as np

from carillon.arrays import Array, Flags
from carillon.errors import UserError
from carillon.fem.block import ALL_FILLED
from carillon.fem.elasticity import elasticity_matrix
from carillon.fem.geometry import Blocks, HexMesh, blocks_from_mesh
from carillon.fem.model import Constants, ElasticModel, fine_model
from carillon.fem.moduli import at_points, require_moduli
from carillon.fem.regions import RegionOf, Regions
from solver.coarsening.anisotropic import AnisotropicCoarsening
from solver.coarsening.coarsening import Coarsening


def block_moduli(blocks: Blocks, young: Array) -> Array:
    """Fine moduli (mc, 8) of every block, 0 where a cell is void; `young` is (m,) [Pa]."""
    return np.where(blocks.mask, young[blocks.fine_of_block], 0.0)


def element_moduli(
    blocks: Blocks,
    young: Array,
    coarsening: Coarsening,
    regions: Regions | None = None,
    region: RegionOf | None = None,
) -> Array:
    """Moduli (mc, 8) [Pa] of the elements from `young` (m,) [Pa]: coarsened, or fine cells' own.

    Blocks that hold an anisotropic material, of the `region` (m,) of a cell, are fitted one by one.
    """
    e = block_moduli(blocks, young)
    law = block_regions(blocks, region)
    whole = ~blocks.is_fine
    if whole.all():
        return _coarsened(e, law, coarsening, regions)
    # A fine cell is the only one of its element.
    moduli = at_points(e.sum(axis=1))
    if whole.any():
        few = None if law is None else law[whole]
        moduli[whole] = _coarsened(e[whole], few, coarsening, regions)
    return moduli


def _coarsened(
    e: Array, law: RegionOf | None, coarsening: Coarsening, regions: Regions | None
) -> Array:
    if regions is None or regions.is_isotropic or coarsening.general is None:
        return coarsening.moduli(e)
    law = np.zeros(e.shape, dtype=np.uint16) if law is None else law
    anisotropic = np.isnan(regions.poissons)
    chosen = (anisotropic[law] & (e > 0.0)).any(axis=1)
    moduli = np.empty_like(e)
    if not chosen.all():
        moduli[~chosen] = coarsening.moduli(e[~chosen])
    if chosen.any():
        # Fits of isotropic cells are those at one ratio, see `dataset_gen.objectives.calibrated`.
        matrices = np.where(anisotropic[:, None, None], regions.elasticity, elasticity_matrix())
        general = AnisotropicCoarsening(coarsening.general)
        moduli[chosen] = general.moduli(e[chosen], law[chosen].astype(np.int64), matrices)
    return moduli


def block_regions(blocks: Blocks, region: RegionOf | None) -> RegionOf | None:
    """Region (mc, 8) of each octant of the elements from those (m,) of the fine cells.

    A void octant has the region that most of the block is of, a fine cell's octants have its own.
    """
    if region is None:
        return None
    of_cells = np.where(blocks.mask, region[blocks.fine_of_block], 0)
    present = np.unique(region)
    counts = ((of_cells[:, :, None] == present) & blocks.mask[:, :, None]).sum(axis=1)
    most = present[counts.argmax(axis=1)]
    return np.where(blocks.mask, of_cells, most[:, None]).astype(region.dtype)


def build_model(
    mesh: HexMesh,
    young: Array,
    coarsening: Coarsening | None = None,
    refined: Flags | None = None,
    region: RegionOf | None = None,
    **constants: Unpack[Constants],
) -> ElasticModel:
    """Model of the fine mesh, or of its blocks if there is a coarsening.

    Raises UserError for what `carillon.fem.moduli.require_moduli` refuses.

    Parameters
    ----------
    young
        (m,) modulus [Pa] of each fine cell; without a coarsening also (m, 8).
    refined
        Coarse elements that shall stay fine, see `blocks_from_mesh`.
    region
        (m,) region of each fine cell, if there are several.
    constants
        `regions`, `lumped`, `supports`, see `ElasticModel`.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> from solver.coarsening.choice import make_coarsening
    >>> mesh = hexmesh_from_grid(np.argwhere(np.ones((4, 2, 2))), np.zeros(3), 0.5)
    >>> coarse = build_model(mesh, np.full(16, 1e9), make_coarsening("ddfem"))
    >>> coarse.mesh.n_cells, coarse.young.shape
    (2, (2, 8))
    """
    if coarsening is None:
        return fine_model(mesh, young, region, **constants)
    given = require_moduli(young, mesh.n_cells)
    if given.ndim > 1:
        raise UserError(f"moduli: an array of shape {given.shape}, expected ({mesh.n_cells},)")
    blocks = blocks_from_mesh(mesh, refined)
    moduli = element_moduli(blocks, given, coarsening, constants.get("regions"), region)
    return coarse_model(blocks, moduli, coarsening.lumped_fraction, region, **constants)


def coarse_model(
    blocks: Blocks,
    moduli: Array,
    lumped_fraction: float = 0.0,
    region: RegionOf | None = None,
    **constants: Unpack[Constants],
) -> ElasticModel:
    """Model of the blocks with moduli (mc, 8) [Pa] that a coarsening made, or of their fine cells.

    The consistent part of the mass is P^T M P over the filled cells; `lumped_fraction` is that of
    the coarsening, `region` (m,) that of each fine cell.
    """
    fill = np.where(blocks.is_fine, np.uint8(ALL_FILLED), blocks.pattern)
    return ElasticModel(
        blocks.coarse,
        moduli,
        fill,
        region=block_regions(blocks, region),
        lumped_share=lumped_fraction,
        **constants,
    )
