"""Frequencies that no finite cell made, with their doubt: computed, kept in a file, and read.

The file `references.yaml` beside this module has those of the solids of the study, and those of
mesh files by name; `carillon study thin-wall-references` makes it again.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.model import RIGID_MODES
from carillon.files.atomic import atomic_path
from studies.accuracy.domains import Degrees, box
from studies.accuracy.ritz import free_eigenvalues
from studies.accuracy.solids import DENSITY, POISSON, YOUNG
from studies.accuracy.spectra import Spectrum
from studies.thin_walls.catalogue import REFERENCES
from studies.thin_walls.harmonics import harmonic_frequencies
from studies.thin_walls.solids import WalledSolid
from studies.thin_walls.tetrahedra import quadratic_tetrahedra, spectrum_on
from studies.thin_walls.wild import wild_mesh

COUNT = 30
"""Elastic frequencies that are kept."""
HARMONICS, POLYNOMIALS, TETRAHEDRA = "harmonics", "polynomials", "tetrahedra"
"""Methods: Fourier harmonics over triangles of the profile, Rayleigh and Ritz, tetrahedra."""

DEGREES: dict[str, tuple[Degrees, Degrees]] = {
    "plate-200": ((44, 44, 10), (36, 36, 10)),
    "plate-500": ((44, 44, 10), (36, 36, 10)),
    "box": ((18, 18, 16), (16, 16, 14)),
}
"""Of the polynomials for solids that are boxes, and those by which they are judged."""

TRIANGLES = 4.0
MORE_TRIANGLES = {"dumbbell": 8.0}
"""Edges of triangles to a wall, by default and of single solids."""
EDGES: dict[str, tuple[float, float]] = {
    "skillet": (0.0045, 20.0),
    "frying-pan": (0.0075, 8.0),
    "snare-drum": (0.016, 2.5),
    "bar": (0.0042, 1.0),
    "bell": (0.0052, 3.0),
    "fork": (0.005, 12.0),
    "slit-ring": (0.007, 1.0),
}
"""Edges of tetrahedra [m], and how much shorter they are at joints; see `tetrahedra.mesh`."""
EDGE_OF_FILES = 0.045
"""Edges of tetrahedra of mesh files, relative to the longest side."""
COARSER = {HARMONICS: 2.0, TETRAHEDRA: 1.3}
"""Edges of the mesh that a reference is judged by, relative to its own."""


@dataclass(frozen=True)
class StoredReference:
    """Frequencies of a solid."""

    hertz: Array
    """(k,) elastic frequencies [Hz], ascending; bounds from above."""
    doubt: float
    """Largest relative change that one of them takes from a coarser mesh, or lower degrees."""
    method: str
    """How they were found."""
    how: str
    """Sizes or degrees, in words."""

    def as_entry(self) -> dict[str, Any]:
        """Plain values for the file."""
        hertz = [float(f"{value:.8g}") for value in self.hertz]
        entry = {"method": self.method, "how": self.how, "doubt": float(f"{self.doubt:.2g}")}
        return {**entry, "hertz": hertz}


def read_references(path: Path = REFERENCES) -> dict[str, StoredReference]:
    """References by name of their solid; none if there is no such file."""
    if not path.is_file():
        return {}
    entries = yaml.safe_load(path.read_text()) or {}
    return {
        name: StoredReference(np.array(e["hertz"]), e["doubt"], e["method"], e["how"])
        for name, e in entries.items()
    }


def write_references(references: dict[str, StoredReference], path: Path = REFERENCES) -> None:
    """Write references by name, in the order of the alphabet."""
    entries = {name: references[name].as_entry() for name in sorted(references)}
    with atomic_path(path) as temporary:
        temporary.write_text(yaml.safe_dump(entries, sort_keys=False, width=96))


def compute_reference(name: str, solid: WalledSolid, coarser: float = 1.0) -> StoredReference:
    """Frequencies of a solid of the study, with their doubt.

    Edges of meshes are larger than those of the file by the factor `coarser`. Raises UserError if
    no method suits the solid.
    """
    if name in DEGREES:
        return _by_polynomials(name, solid)
    if (profile := solid.profile) is not None:
        size = coarser * solid.wall / MORE_TRIANGLES.get(name, TRIANGLES)
        sizes = (size, COARSER[HARMONICS] * size)
        found = [harmonic_frequencies(profile, each, COUNT) for each in sizes]
        return _judged(found, HARMONICS, f"triangles of {1e3 * size:.2g} mm")
    if solid.kind == "file":
        return _of_file(solid, coarser)
    if name not in EDGES:
        raise UserError(
            f"no method finds references of {name!r}; known are solids of revolution and "
            f"{', '.join((*DEGREES, *EDGES))}"
        )
    size, finer = EDGES[name]
    spectra = [
        quadratic_tetrahedra(solid.parts(), coarser * factor * size, COUNT, finer)
        for factor in (1.0, COARSER[TETRAHEDRA])
    ]
    joints = f", {1e3 * coarser * size / finer:.2g} mm at joints" if finer > 1.0 else ""
    return _by_tetrahedra(spectra, joints)


def _of_file(solid: WalledSolid, coarser: float) -> StoredReference:
    surface = solid.surface()
    size = coarser * EDGE_OF_FILES * float(surface.extents.max())
    sizes = (size, COARSER[TETRAHEDRA] * size)
    spectra = [spectrum_on(partial(wild_mesh, surface, each), each, COUNT) for each in sizes]
    return _by_tetrahedra(spectra, " by fTetWild")


def _by_tetrahedra(spectra: list[Spectrum], more: str) -> StoredReference:
    fine = spectra[0]
    how = f"tetrahedra of {2e3 * fine.spacing:.2g} mm{more}, {fine.unknowns:,} unknowns"
    return _judged([_hertz(each.values) for each in spectra], TETRAHEDRA, how)


def _by_polynomials(name: str, solid: WalledSolid) -> StoredReference:
    x, y, z = (float(side) for side in solid.surface().extents)
    degrees, lower = DEGREES[name]
    values = [
        free_eigenvalues(box((x, y, z), each), each, YOUNG, POISSON, DENSITY)
        for each in (degrees, lower)
    ]
    found = [_hertz(each) for each in values]
    return _judged(found, POLYNOMIALS, f"degrees {', '.join(map(str, degrees))}")


def _judged(found: list[Array], method: str, how: str) -> StoredReference:
    fine, coarse = found
    return StoredReference(fine, float(np.abs(coarse / fine - 1.0).max()), method, how)


def _hertz(values: Array) -> Array:
    elastic = values[RIGID_MODES : RIGID_MODES + COUNT]
    return np.asarray(np.sqrt(np.maximum(elastic, 0.0)) / (2.0 * np.pi))
