"""A solid whose frequencies were measured or published, as its data file describes it."""

from dataclasses import KW_ONLY
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array, Surface
from carillon.composition.entries import SupportEntry
from carillon.errors import UserError
from carillon.fem.elasticity import elasticity_matrix
from carillon.fem.model import RIGID_MODES
from carillon.parameters import REQUIRED, OneOf, option, parameters
from carillon.parameters.documents import document_of, read_parameters
from carillon.parameters.quantities import (
    PoissonRatio,
    Positive,
    Resolution,
    Triple,
    between,
)
from studies.accuracy.anisotropic_box import box_eigenvalues
from studies.accuracy.domains import Degrees
from studies.accuracy.ritz import free_eigenvalues
from studies.measured.crystals import SYMMETRIES, elasticity, grain, turned
from studies.measured.data_files import FOLDER, is_file, solid_names
from studies.measured.quantities import UNITS, MassDensity, Pressure
from studies.measured.shapes import DOMAINS, SHAPES, require_dimensions

FREE = "free"
"""Supports of a solid that has none."""


@parameters
class SolidGeometry:
    """What the solid looks like."""

    shape: Annotated[str, OneOf(*SHAPES)] = option(REQUIRED, "a function of `shapes.py`")
    unit: Annotated[str, OneOf(*UNITS["length"])] = option(REQUIRED, "of the dimensions")
    dimensions: dict[str, Positive] = option(REQUIRED, "by name, see the function")

    def __post_init__(self) -> None:
        require_dimensions(self.shape, self.dimensions)

    @property
    def metres(self) -> dict[str, float]:
        """The dimensions [m]."""
        unit = UNITS["length"][self.unit]
        return {name: unit * value for name, value in self.dimensions.items()}

    def surface(self) -> Surface:
        """Triangles in metres."""
        return SHAPES[self.shape](**self.metres)


@parameters
class Crystal:
    """Elasticity of a solid that is not isotropic."""

    symmetry: Annotated[str, OneOf(*SYMMETRIES)] = option(REQUIRED, "of the crystal")
    constants: dict[str, Pressure] = option(REQUIRED, "c11 and so on, by Voigt's numbers")
    turned: Triple[float] = option(
        (0.0, 0.0, 0.0), "rotation vector from the solid's axes to the crystal's [degrees]"
    )

    def __post_init__(self) -> None:
        elasticity(self.symmetry, self.constants)

    @property
    def elasticity(self) -> Array:
        """Elasticity (6, 6) [Pa] along the solid's axes, see `studies.measured.crystals`."""
        return turned(elasticity(self.symmetry, self.constants), self.turned)


@parameters
class SolidMaterial:
    """Constants of the solid."""

    _: KW_ONLY
    density: MassDensity = option(REQUIRED, "with its unit")
    young: Pressure | None = option(None, "with its unit; null if not isotropic")
    poisson: PoissonRatio | None = option(None)
    elastic: Crystal | None = option(None, "elastic constants of a solid that is not isotropic")
    constants: str = option(REQUIRED, "who found the constants, and from what")
    fitted: Annotated[int, between(0, 21)] = option(
        0, "constants that were fitted to these very frequencies [1]"
    )

    def __post_init__(self) -> None:
        given = self.young is not None and self.poisson is not None
        if given == (self.elastic is not None):
            raise ValueError("found neither or both of young with poisson, and elastic")

    @property
    def isotropic(self) -> tuple[float, float] | None:
        """Young's modulus [Pa] and Poisson's ratio; None of a solid that has more constants."""
        if self.young is not None and self.poisson is not None:
            return self.young, self.poisson
        assert self.elastic is not None
        if self.elastic.symmetry != "isotropic":
            return None
        longitudinal, shear = self.elastic.constants["c11"], self.elastic.constants["c44"]
        lame = longitudinal - 2.0 * shear
        poisson = 0.5 * lame / (lame + shear)
        return 2.0 * shear * (1.0 + poisson), poisson

    @property
    def elasticity(self) -> Array:
        """Elasticity (6, 6) [Pa] along the solid's axes."""
        if self.isotropic is not None:
            young, poisson = self.isotropic
            return young * elasticity_matrix(poisson)
        assert self.elastic is not None
        return self.elastic.elasticity


@parameters
class Frequencies:
    """What was measured or published."""

    _: KW_ONLY
    unit: Annotated[str, OneOf(*UNITS["frequency"])] = option(REQUIRED, "of all frequencies")
    values: tuple[Positive | None, ...] = option(
        REQUIRED, "of all elastic modes from the lowest on, null where none is known"
    )
    others: dict[str, tuple[Positive | None, ...]] = option(dict, "the same by others")
    uncertainty: Annotated[float, between(0.0, 1.0)] = option(
        REQUIRED, "relative rms error that the frequencies and constants are good for [1]"
    )
    why: str = option(REQUIRED, "where that number is from")


@parameters
class CitedSource:
    """What is cited."""

    reference: str = option(REQUIRED, "in full")
    read_in: str = option("", "where the numbers were read, if not there")


@parameters
class MeasuredSolid:
    """A data file."""

    _: KW_ONLY
    title: str = option(REQUIRED, "name for people")
    kind: Annotated[str, OneOf("measured", "published")] = option(REQUIRED, "of the frequencies")
    geometry: SolidGeometry = option(REQUIRED, "dimensions")
    material: SolidMaterial = option(REQUIRED, "constants")
    frequencies: Frequencies = option(REQUIRED, "what they are compared with")
    source: CitedSource = option(REQUIRED, "what is cited")
    conditions: str = option(REQUIRED, "how it was measured or computed")
    supports: str = option(FREE, "in words")
    held: tuple[SupportEntry, ...] = option(
        (), "the same as regions files have it, in metres of the solid's shape"
    )
    left_out: str = option("", "why no model is made of it, if so")
    resolution: Resolution = option(24)
    degrees: Triple[Annotated[int, between(4, 40)]] | None = option(
        None, "of the polynomials of the solution without a mesh, if there is one"
    )

    @cached_property
    def hertz(self) -> Array:
        """Frequencies (n,) [Hz], not a number where none is known."""
        return self._in_hertz(self.frequencies.values)

    def others_hertz(self, name: str) -> Array:
        """Frequencies (n,) [Hz] by others, likewise."""
        return self._in_hertz(self.frequencies.others[name])

    @property
    def composition(self) -> dict[str, Any]:
        """Plain values of the file that `carillon modes --regions` takes."""
        material = self.material
        region: dict[str, Any] = {"name": "solid", "density": material.density}
        if material.isotropic is not None:
            young, poisson = material.isotropic
            region |= {"young": young, "poisson": poisson}
        else:
            assert material.elastic is not None
            crystal = elasticity(material.elastic.symmetry, material.elastic.constants)
            region |= grain(crystal, material.elastic.turned)
        return {"regions": [region], "supports": [document_of(each) for each in self.held]}

    @property
    def is_run(self) -> bool:
        """Whether models are made of it."""
        return not self.left_out

    def without_a_mesh(self, fewer: int = 0) -> Array:
        """The lowest elastic frequencies (n,) [Hz] by polynomials, degrees lower by `fewer`."""
        assert self.degrees is not None
        x, y, z = (degree - fewer for degree in self.degrees)
        values = self._eigenvalues((x, y, z))[RIGID_MODES : RIGID_MODES + len(self.hertz)]
        return np.asarray(np.sqrt(values) / (2.0 * np.pi))

    def _eigenvalues(self, degrees: Degrees) -> Array:
        shape, dimensions, material = self.geometry.shape, self.geometry.metres, self.material
        if shape == "box":
            sides = (dimensions["x"], dimensions["y"], dimensions["z"])
            return box_eigenvalues(sides, degrees, material.elasticity, material.density)
        assert material.isotropic is not None
        domain = DOMAINS[shape](**dimensions)(degrees)
        return free_eigenvalues(domain, degrees, *material.isotropic, material.density)

    def _in_hertz(self, values: tuple[float | None, ...]) -> Array:
        unit = UNITS["frequency"][self.frequencies.unit]
        return np.array([np.nan if value is None else unit * value for value in values])


def read_solid(name: str) -> MeasuredSolid:
    """The solid of a name, or of a data file elsewhere.

    Raises UserError if there is none, or for anything wrong with it.
    """
    if not is_file(name) and name not in solid_names():
        raise UserError(f"there is no solid {name!r}, only {', '.join(solid_names())}")
    path = Path(name) if is_file(name) else FOLDER / f"{name}.yaml"
    return read_parameters(path, MeasuredSolid, "a measured solid")
