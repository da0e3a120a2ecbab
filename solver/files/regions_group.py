"""Materials and supports of solids in files, beside their mesh."""

import h5py
import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.elasticity import Elasticity, require_elasticity
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.kinks import Borders
from carillon.fem.finite_cells.shared_cells import SharedCells
from carillon.fem.regions import Damping, RegionOf, Regions
from carillon.fem.supports import Supports
from carillon.files.datasets import INTEGER, number, put, read, refused
from carillon.limits import DENSITIES, MODULI, POISSON
from solver.files.cells_group import OlderCells

REGIONS, SHARED, SUPPORTS = "regions", "shared", "supports"
"""Names of the groups of several materials, of what finite cells share, and of supports."""
_BORDERS = {
    "cell": "cell of each border of two regions",
    "region": "regions on its two sides",
    "place": "a point of its plane, in the cell",
    "normal": "its unit normal",
    "share": "share of the cell's inside on its two sides",
}
UNKNOWN = -1.0
"""Rayleigh coefficients of a material whose damping is not known."""


def put_regions(group: h5py.Group, regions: Regions, region: RegionOf | None) -> None:
    """Write the materials, and the region of each cell.

    A single isotropic one is written as it was before there were others.
    """
    if len(regions) == 1 and regions.poisson is not None:
        group.attrs["poisson"] = regions.poisson
        group.attrs["density"] = float(regions.density[0])
        if regions.damping[0] is not None:
            group.attrs["damping"] = regions.damping[0]
        return
    inner = group.create_group(REGIONS)
    inner.attrs["names"] = list(regions.names)
    put(
        inner, "elasticity", regions.elasticity, "1", "elasticity by the modulus, shears xy, yz, zx"
    )
    isotropic = np.array([law.poisson is not None for law in regions.laws], dtype=np.uint8)
    put(inner, "isotropic", isotropic, "1", "whether the material is isotropic")
    put(inner, "poisson", np.nan_to_num(regions.poissons), "1", "Poisson's ratio of isotropic ones")
    put(inner, "density", regions.density, "kg/m^3", "mass density")
    put(inner, "young", regions.young, "Pa", "modulus of the material as it is in tables")
    damping = np.array([each or (UNKNOWN, UNKNOWN) for each in regions.damping], dtype=float)
    put(inner, "damping", damping, "1/s, s", "Rayleigh's coefficients, -1 where not known")
    if region is not None:
        put(group, "region", region, "1", "region of each cell, or of its octants")


def get_regions(group: h5py.Group, shape: tuple[int, ...]) -> tuple[Regions, RegionOf | None]:
    """The materials, and the region of each cell in an array of this shape, if there are several.

    Raises UserError if they are incomplete or make no sense.
    """
    if REGIONS not in group:
        constants = number(group, "poisson", *POISSON), number(group, "density", *DENSITIES)
        return Regions.one(*constants, damping=_damping(group)), None
    inner = group[REGIONS]
    density = read(inner, "density", (None,))
    count = len(density)
    young, poisson = (read(inner, name, (count,)) for name in ("young", "poisson"))
    isotropic = read(inner, "isotropic", (count,), INTEGER).astype(bool)
    matrices, damping = read(inner, "elasticity", (count, 6, 6)), read(inner, "damping", (count, 2))
    names = [str(name) for name in np.atleast_1d(inner.attrs.get("names", []))]
    if not count or len(names) != count:
        raise refused(inner, f"has {len(names)} names of {count} materials")
    for values, limits, name in ((density, DENSITIES, "density"), (young, MODULI, "young")):
        if values.min() < limits[0] or values.max() > limits[1]:
            raise refused(inner, f"dataset {name!r} is out of range")
    if ((poisson <= POISSON[0]) | (poisson >= POISSON[1])).any():
        raise refused(inner, "dataset 'poisson' is out of range")
    laws = tuple(
        Elasticity.isotropic(float(ratio)) if alike else _law(inner, matrix)
        for alike, ratio, matrix in zip(isotropic, poisson, matrices, strict=True)
    )
    pairs = tuple(None if pair[0] == UNKNOWN else _pair(pair) for pair in damping)
    regions = Regions(laws, density, young, tuple(names), pairs)
    if count == 1:
        return regions, None
    region = read(group, "region", shape, INTEGER)
    if _beyond(region, count):
        raise refused(group, "dataset 'region' names materials that are not there")
    return regions, region.astype(np.uint16)


def put_shared(group: h5py.Group, shared: SharedCells | None) -> None:
    """Write what finite cells have of several regions."""
    if shared is None:
        return
    inner = group.create_group(SHARED)
    put(inner, "portion", shared.portion, "1", "row of the cells' parts of voxels")
    put(inner, "region", shared.region, "1", "region of each part")
    put(inner, "weights", shared.weights, "1", "integrals of the points' Lagrange polynomials")
    for name, meaning in _BORDERS.items():
        put(inner, f"border_{name}", getattr(shared.borders, name), "1", meaning)


def get_shared(
    group: h5py.Group, cells: FiniteCells, solid: h5py.Group, older: OlderCells | None
) -> SharedCells | None:
    """The parts that several regions share; raises UserError if they make no sense.

    `older` tells the places of octants in files of older versions.
    """
    if SHARED not in group:
        return None
    if REGIONS not in solid:
        raise refused(group, "has shared cells of one material")
    inner, count = group[SHARED], len(solid[REGIONS]["density"])
    region = read(inner, "region", (None,), INTEGER)
    if older is None:
        portion = read(inner, "portion", (len(region),), INTEGER)
    else:
        cell, octant = (read(inner, name, (len(region),), INTEGER) for name in ("cell", "octant"))
        if _beyond(cell, len(cells)) or _beyond(octant, 8):
            raise refused(inner, "names cells or octants that are not there")
        portion = older.portion[cell, octant]
    weights = read(inner, "weights", (len(region), cells.basis.n_points))
    if _beyond(portion, len(cells.cell)) or _beyond(region, count):
        raise refused(inner, "names cells, voxels or materials that are not there")
    return SharedCells(
        portion.astype(np.int64),
        region.astype(np.uint16),
        weights,
        _get_borders(inner, len(cells), count),
    )


def _beyond(numbers: Array, count: int) -> bool:
    """Whether any of the numbers does not lie in 0 to `count` - 1."""
    return bool(((numbers < 0) | (numbers >= count)).any())


def _get_borders(group: h5py.Group, cells: int, count: int) -> Borders:
    cell = read(group, "border_cell", (None,), INTEGER)
    region = read(group, "border_region", (len(cell), 2), INTEGER)
    place, normal = (read(group, f"border_{name}", (len(cell), 3)) for name in ("place", "normal"))
    share = read(group, "border_share", (len(cell), 2))
    if _beyond(cell, cells) or _beyond(region, count):
        raise refused(group, "names borders of cells or materials that are not there")
    if (share <= 0.0).any() or (np.abs(np.linalg.norm(normal, axis=1) - 1.0) > 1e-6).any():
        raise refused(group, "has borders with normals or shares that are none")
    return Borders(cell.astype(np.int64), region.astype(np.uint16), place, normal, share)


def put_supports(group: h5py.Group, supports: Supports | None) -> None:
    """Write what holds a solid."""
    if supports is None:
        return
    inner = group.create_group(SUPPORTS)
    put(inner, "positions", supports.positions, "m", "where springs and masses are")
    put(inner, "stiffness", supports.stiffness, "N/m", "force by displacement at each")
    put(inner, "mass", supports.mass, "kg", "point mass at each")


def get_supports(group: h5py.Group) -> Supports | None:
    """The supports of a solid; raises UserError if they make no sense."""
    if SUPPORTS not in group:
        return None
    inner = group[SUPPORTS]
    positions = read(inner, "positions", (None, 3))
    count = len(positions)
    stiffness, mass = read(inner, "stiffness", (count, 3, 3)), read(inner, "mass", (count,))
    if (mass < 0.0).any() or np.abs(stiffness - stiffness.transpose(0, 2, 1)).any():
        raise refused(inner, "holds negative masses, or springs that are not symmetric")
    return Supports(positions, stiffness, mass)


def _law(group: h5py.Group, matrix: Array) -> Elasticity:
    try:
        return Elasticity.of_matrix(require_elasticity(matrix), 1.0)
    except UserError as error:
        raise refused(group, f"has a material whose {error}") from None


def _damping(group: h5py.Group) -> Damping | None:
    if "damping" not in group.attrs:
        return None
    pair = np.asarray(group.attrs["damping"])
    if pair.shape != (2,) or pair.dtype.kind != "f" or not ((pair >= 0.0) & (pair < np.inf)).all():
        raise refused(group, f"'damping' is {pair.tolist()}, expected two numbers of at least 0")
    return _pair(pair)


def _pair(pair: Array) -> Damping:
    return float(pair[0]), float(pair[1])
