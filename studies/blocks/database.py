"""Database of coarse metamaterials (Chen et al. 2015), the method that the forests replace.

Cells are made of a few base materials. Every combination of eight of them, up to the symmetries of
the cube, is fitted beforehand with the objective `chen2015`; farthest-point sampling picks some of
the resulting metamaterials to stand for all. What is stored is the sorted index of combinations,
the representative of each, and the moduli of the representatives. At run time every modulus is
replaced by the nearest base material, and the combination is found by binary search, after a turn
to the least of its images; the moduli found are turned back. Combinations that are their own image
get the mean over all turns that do it, so that the lookup is equivariant whatever stands for them.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import h5py
import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from carillon.arrays import Array, Index
from carillon.command_line.progress import track
from carillon.errors import UserError
from carillon.fem.block import symmetries
from carillon.fem.element import DEFAULT_POISSON
from carillon.files.datasets import INTEGER, number, read, refused
from carillon.files.hdf5 import create_h5, open_h5
from carillon.records import provenance
from dataset_gen.objectives import fit, require_poisson
from dataset_gen.sampling import Moduli
from forests.evaluate import require_blocks
from studies.blocks.combinations import cells_of, combination_keys, places
from studies.blocks.farthest_points import farthest_points

OBJECTIVE = "chen2015"

MATERIALS = 8
"""Base materials of a database, void included."""

REPRESENTATIVES = 65_536
"""Metamaterials that stand for all."""

MOST_MATERIALS = 12
"""More would make more combinations than keys of 32 bits and a machine's memory can bear."""

FITS_AT_ONCE = 16_384

KIND = "metamaterial databases"
SCHEMA = 1


@dataclass(frozen=True)
class Database:
    """Coarse metamaterials of base materials."""

    materials: Array
    """(m,) young's moduli in ascending order, any unit; the first may be 0, void."""
    keys: NDArray[np.uint32]
    """(k,) of combinations, see `studies.blocks.combinations`; ascending."""
    entries: NDArray[np.unsignedinteger]
    """(k,) representative of each combination."""
    moduli: Array
    """(r, 8) coarse moduli of the representatives, in the unit of the materials."""
    poisson: float
    """Poisson's ratio of all materials."""
    radius: float
    """Largest distance of a metamaterial from its representative, |log E - log E'|."""
    seconds: float
    """Time that building it took on one core."""

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays."""
        stored = (self.materials, self.keys, self.entries, self.moduli)
        return sum(array.nbytes for array in stored)


def base_materials(moduli: Moduli, count: int, void: bool = False) -> Array:
    """Young's moduli (count,) to represent a range, in its unit; void is one of them if `void`.

    Each stands in the middle of an equal part of the range, on the scale of logarithms for
    log-uniform moduli. For uniform ones the scale is that of square roots: soft cells decide how
    a block deforms, and spacing them so brought the lookup closest to the fit of the block itself
    (against even spacing, and logarithmic spacing over one to three decades).
    """
    solid = count - 1 if void else count
    middle = (np.arange(solid) + 0.5) / solid
    if moduli.logarithmic:
        materials = moduli.low * (moduli.high / moduli.low) ** middle
    else:
        materials = moduli.low + (moduli.high - moduli.low) * middle**2
    return np.concatenate([np.zeros(int(void)), materials])


def _require_materials(materials: Array) -> None:
    if materials.ndim != 1 or not 2 <= len(materials) <= MOST_MATERIALS:
        raise UserError(
            f"base materials have shape {materials.shape}, expected 2 to {MOST_MATERIALS} of them"
        )
    if not np.isfinite(materials).all() or materials[0] < 0.0 or (np.diff(materials) <= 0.0).any():
        raise UserError("base materials must be finite, not negative, and ascend")


def build(
    materials: ArrayLike,
    poisson: float = DEFAULT_POISSON,
    representatives: int | None = REPRESENTATIVES,
    label: str = "database",
    progress: bool = False,
) -> Database:
    """Fit every combination of base materials and choose representatives.

    Raises UserError for materials that do not ascend, are too few or too many, or a bad Poisson's
    ratio.

    Parameters
    ----------
    materials : (m,)
        Ascending, 0 for void.
    representatives
        How many metamaterials to keep; None keeps all of them. Distances between metamaterials are
        those of their logarithmic moduli.
    """
    start = time.perf_counter()
    base = np.array(materials, dtype=float)
    _require_materials(base)
    require_poisson(OBJECTIVE, poisson)
    keys = combination_keys(len(base))
    if base[0] == 0.0:
        keys = keys[1:]  # void in all cells
    moduli = np.empty((len(keys), 8))
    starts = range(0, len(keys), FITS_AT_ONCE)
    count = min(FITS_AT_ONCE, len(keys))
    for first in track(starts, f"{label}: fits", len(keys), "fit", progress, lambda _: count):
        rows = slice(first, first + FITS_AT_ONCE)
        moduli[rows] = fit(OBJECTIVE, cells_of(keys[rows], base), poisson).moduli
    entries, radius = np.arange(len(keys)), 0.0
    if representatives is not None and representatives < len(keys):
        logs = np.log(moduli)
        cover = farthest_points(logs, representatives, f"{label}: representatives", progress)
        entries, moduli = cover.nearest, moduli[cover.chosen]
        radius = float(cover.radius[-1])
    small = np.min_scalar_type(len(moduli) - 1)
    seconds = time.perf_counter() - start
    return Database(base, keys, entries.astype(small), moduli, float(poisson), radius, seconds)


@numba.njit(cache=True, nogil=True)
def _look_up(
    young: Array,
    bounds: Array,
    void: int,
    weights: Index,
    images: Index,
    keys: NDArray[np.uint32],
    entries: NDArray[np.unsignedinteger],
    moduli: Array,
    out: Array,
) -> int:
    """Coarse moduli of blocks (n, 8); the first block that is not there, or -1.

    `bounds` are between neighbouring materials, void aside; `void` is 1 if there is void, else 0.
    """
    turns = weights.shape[1]
    turned = np.empty(turns, dtype=np.int64)
    for block in range(len(young)):
        turned[:] = 0
        for j in range(8):
            digit = 0
            if young[block, j] > 0.0:
                digit = void
                for bound in bounds:
                    digit += young[block, j] > bound
            elif void == 0:
                return block
            for g in range(turns):
                turned[g] += digit * weights[j, g]
        key = turned.min()
        low, high = 0, len(keys)
        while low < high:
            middle = (low + high) // 2
            if keys[middle] < key:
                low = middle + 1
            else:
                high = middle
        if low == len(keys) or keys[low] != key:
            return block
        entry = moduli[entries[low]]
        out[block] = 0.0
        count = 0
        for g in range(turns):
            if turned[g] == key:
                count += 1
                for j in range(8):
                    out[block, j] += entry[images[g, j]]
        out[block] /= count
    return -1


def look_up(database: Database, young: ArrayLike) -> Array:
    """Coarse moduli (n, 8) of blocks (n, 8), both in the unit of the base materials.

    Every modulus becomes the base material that is nearest in logarithm, the softest or stiffest
    one where it leaves their range; a void cell stays void, a filled one stays filled. (Nearest
    in value brought larger errors: it rounds soft cells, which matter most, too coarsely.)

    Raises UserError, see `forests.evaluate.require_blocks`, and for void cells in a database
    without void.
    """
    blocks = require_blocks(young)
    void = int(database.materials[0] == 0.0)
    solid = database.materials[void:]
    out = np.empty_like(blocks)
    missing = _look_up(
        blocks,
        np.sqrt(solid[1:] * solid[:-1]),
        void,
        places(len(database.materials)),
        symmetries(),
        database.keys,
        database.entries,
        database.moduli,
        out,
    )
    if missing >= 0:
        raise UserError(
            f"block {missing} is not in the database: it has void cells; build one with void among "
            "its materials"
        )
    return out


def save_databases(path: str | Path, databases: Sequence[Database]) -> None:
    """Write databases to one file, atomically, with checksums and provenance."""
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        for number, database in enumerate(databases):
            group = file.create_group(str(number))
            for field in fields(Database):
                value = getattr(database, field.name)
                if isinstance(value, np.ndarray):
                    group.create_dataset(field.name, data=value)
                else:
                    group.attrs[field.name] = value
        provenance.write(file, {"objective": OBJECTIVE, "databases": len(databases)})


def load_databases(path: str | Path) -> list[Database]:
    """Read what `save_databases` wrote.

    Raises UserError if the file is missing, damaged, of another kind or schema.
    """
    with open_h5(path, KIND, SCHEMA, sealed=True) as file:
        numbers = sorted(int(name) for name in file if name.isdigit())
        return [_read(file[str(number)]) for number in numbers]


def _read(group: h5py.Group) -> Database:
    moduli = read(group, "moduli", (None, 8))
    keys = read(group, "keys", (None,), INTEGER)
    entries = read(group, "entries", (len(keys),), INTEGER)
    if not len(keys) or entries.min() < 0 or entries.max() >= len(moduli):
        raise refused(group, "combinations name metamaterials that are not there")
    return Database(
        materials=read(group, "materials", (None,)),
        keys=keys,
        entries=entries,
        moduli=moduli,
        poisson=number(group, "poisson"),
        radius=number(group, "radius"),
        seconds=number(group, "seconds"),
    )
