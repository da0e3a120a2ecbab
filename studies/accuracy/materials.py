"""Solids of several materials, of wood, and held ones, against frequencies that no mesh made."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from trimesh.creation import box

from carillon.arrays import Array
from carillon.command_line.progress import say
from carillon.composition.composition import Composition, MaterialRegion
from carillon.composition.materials import named_material
from carillon.composition.places import ClosedSurface, Everywhere, Expression
from carillon.composition.supports import Support, placed_supports
from carillon.fem.elasticity import axes_along, rotated
from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import hexmesh_from_voxels, voxelize
from carillon.fem.model import Solid, fine_model
from carillon.fem.regions import Regions
from carillon.parameters import option, parameters
from carillon.parameters.quantities import between
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from studies.accuracy.anisotropic_box import BoxLayer, layered_eigenvalues
from studies.accuracy.beams import (
    BeamPart,
    Layer,
    RodPart,
    bending_frequencies,
    layered,
    rod_frequencies,
    timoshenko_cantilever,
)

WAYS = ("voxel", "finite-cell")
TOLERANCE = 1e-9
"""Relative error of the eigenvalues."""
DEGREES = (11, 11, 11)
"""Polynomial degrees of the boxes' reference."""
SLENDER = 20.0
"""Ratio of sides beyond which half as many spacings do."""
SHEAR = 5.0 / 6.0
"""Timoshenko's factor of a rectangle."""
STEEL = named_material("steel").region("steel")
SPRUCE = named_material("spruce").region("spruce")
RIGID_ACROSS = (
    Regions.one(0.0, 7800.0, 2e11, name="first"),
    Regions.one(0.0, 1200.0, 2e10, name="second"),
)
"""Without Poisson's effect, as theories of rods have none."""


@parameters
class MaterialStudyOptions:
    """Sizes of the lattices."""

    spacings: tuple[Annotated[int, between(4, 64)], ...] = option(
        (4, 8, 16), "lattice spacings along the second side of each solid"
    )


@dataclass(frozen=True)
class MaterialCase:
    """A box with regions and supports, and its frequencies by a theory."""

    name: str
    reference: str
    """What its frequencies are by."""
    sides: tuple[float, float, float]
    """[m], about the origin."""
    parts: tuple[tuple[Any, ...], ...]
    """Material, place and axes of each region."""
    supports: tuple[Support, ...]
    exact: Callable[[], Array]
    """(k,) frequencies [Hz] to look at; each is compared with the nearest one."""
    searched: int
    """Modes to compute, rigid ones included."""


def measure_materials(options: MaterialStudyOptions) -> dict[str, Any]:
    """Errors of voxels and finite cells in each case, and the orders at which they fall."""
    return {"cases": [_measured(case, options.spacings) for case in cases()]}


def _measured(case: MaterialCase, spacings: tuple[int, ...]) -> dict[str, Any]:
    exact = case.exact()
    found: dict[str, Any] = {"name": case.name, "reference": case.reference, "ways": {}}
    for way in WAYS:
        say(f"{case.name}: {way}")
        sizes = [_error(case, way, spacing, exact) for spacing in spacings]
        errors = np.array([size["rms"] for size in sizes])
        slope = np.polyfit(np.log(spacings), np.log(errors), 1)[0] if len(sizes) > 1 else None
        found["ways"][way] = {"sizes": sizes, "order": None if slope is None else -float(slope)}
    return found


def _error(case: MaterialCase, way: str, spacing: int, exact: Array) -> dict[str, Any]:
    model = discretised(case, way, spacing)
    modes = modal_analysis(model, SolverOptions(modes=case.searched, tolerance=TOLERANCE))
    hertz = np.sqrt(np.maximum(modes.values[modes.rigid :], 0.0)) / (2.0 * np.pi)
    nearest = hertz[np.abs(hertz[:, None] / exact - 1.0).argmin(axis=0)]
    modes.destroy()
    return {
        "spacings": spacing,
        "unknowns": model.n_dofs,
        "rms": float(np.sqrt(np.mean((nearest / exact - 1.0) ** 2))),
    }


def discretised(case: MaterialCase, way: str, spacing: int) -> Solid:
    """The solid with this many lattice spacings along its second side; slender ones have half."""
    surface = box(extents=case.sides)
    slenderness = max(case.sides) / case.sides[1]
    resolution = round(spacing * slenderness / (2.0 if slenderness > SLENDER else 1.0))
    regions = [MaterialRegion(*part) for part in case.parts]
    composition = Composition(regions, case.name, ClosedSurface(surface))
    solid: Solid
    if way == "voxel":
        mesh = hexmesh_from_voxels(voxelize(surface, resolution))
        placed = composition.of_voxels(mesh)
        young = placed.regions.moduli(placed.region, np.ones(mesh.n_cells))
        solid = fine_model(mesh, young, placed.region, regions=placed.regions)
    else:
        cells = finite_cells(surface, resolution)
        placed = composition.of_cells(cells)
        young = placed.regions.moduli(placed.region, np.ones(cells.mesh.n_cells))
        solid = finite_cell_model(cells, young, placed.regions, placed.region, placed.shared)
    return solid.with_supports(placed_supports(case.supports, solid, surface, case.name))


def cases() -> list[MaterialCase]:
    """All cases."""
    length, side, cut = 0.2, 0.02, 0.0137
    first, second = RIGID_ACROSS
    halves = [
        RodPart(length / 2 + sign * cut, float(each.young[0]), float(each.density[0]))
        for sign, each in zip((1, -1), RIGID_ACROSS)
    ]
    two = (first, Everywhere()), (second, Expression(f"x > {cut}"))
    slides = Support("sides", Everywhere(), axes=(False, True, True))
    end = Support("end", Expression(f"x < {-length / 2 + 1e-9}"))
    bar = (length, side, side)
    return [
        MaterialCase(
            "rod of two materials, free",
            "transcendental equation",
            bar,
            two,
            (slides,),
            lambda: rod_frequencies(halves[0], halves[1], 3),
            9,
        ),
        MaterialCase(
            "rod of two materials, held at an end",
            "transcendental equation",
            bar,
            two,
            (slides, end),
            lambda: rod_frequencies(halves[0], halves[1], 3, clamped=True),
            8,
        ),
        MaterialCase(
            "slender bar of two materials, bending",
            "Euler-Bernoulli, transfer matrices",
            (length, side / 4, side / 4),
            two,
            (),
            lambda: bending_frequencies(
                [
                    _beam(each, part.length, side / 4, side / 4)
                    for each, part in zip(RIGID_ACROSS, halves)
                ],
                1,
            ),
            12,
        ),
        MaterialCase(
            "slender cantilever",
            "Euler-Bernoulli",
            (length, side / 4, side / 4),
            ((first, Everywhere()),),
            (end,),
            lambda: bending_frequencies([_beam(first, length, side / 4, side / 4)], 2, True),
            8,
        ),
        MaterialCase(
            "thick cantilever",
            "Timoshenko",
            (length / 2, side, side),
            ((first, Everywhere()),),
            (Support("end", Expression(f"x < {-length / 4 + 1e-9}")),),
            lambda: timoshenko_cantilever(_beam(first, length / 2, side, side), 3),
            10,
        ),
        MaterialCase(
            "bar of two layers, bending",
            "Euler-Bernoulli of the layers",
            (length, side / 4, side / 4),
            ((first, Everywhere()), (second, Expression("z > 0.0006"))),
            (),
            lambda: bending_frequencies(
                [
                    layered(
                        [Layer(0.0031, 2e11, 7800.0), Layer(0.0019, 2e10, 1200.0)],
                        side / 4,
                        length,
                    )
                ],
                1,
            ),
            12,
        ),
        *_boxes(),
    ]


def _boxes() -> list[MaterialCase]:
    sides, border = (0.06, 0.05, 0.04), 0.0047
    askew = axes_along(np.array([1.0, 0.4, 0.2]), np.array([0.0, 1.0, 0.3]))
    wood = float(SPRUCE.young[0]) * rotated(SPRUCE.elasticity[0], askew)
    steel = float(STEEL.young[0]) * STEEL.elasticity[0]
    grown = 0.04 / 2 + border
    layers = [
        BoxLayer(grown, wood, float(SPRUCE.density[0])),
        BoxLayer(0.04 - grown, steel, float(STEEL.density[0])),
    ]
    held = Support("base", Expression("z < -0.0199999999"))

    def ritz(parts: list[BoxLayer], clamped: bool = False) -> Callable[[], Array]:
        def exact() -> Array:
            values = layered_eigenvalues(sides[:2], DEGREES, parts, clamped)
            return np.sqrt(values[0 if clamped else 6 :][:12]) / (2.0 * np.pi)

        return exact

    whole = [BoxLayer(0.04, wood, float(SPRUCE.density[0]))]
    spruce = (SPRUCE, Everywhere(), askew)
    both = spruce, (STEEL, Expression(f"z > {border}"))
    return [
        MaterialCase(
            "block of spruce, askew", "Rayleigh-Ritz", sides, (spruce,), (), ritz(whole), 26
        ),
        MaterialCase(
            "spruce and steel", "Rayleigh-Ritz in layers", sides, both, (), ritz(layers), 26
        ),
        MaterialCase(
            "spruce and steel, held at its base",
            "Rayleigh-Ritz in layers",
            sides,
            both,
            (held,),
            ritz(layers, clamped=True),
            20,
        ),
    ]


def _beam(material: Regions, length: float, width: float, height: float) -> BeamPart:
    young, density = float(material.young[0]), float(material.density[0])
    area, second = width * height, width * height**3 / 12.0
    return BeamPart(
        length,
        young * second,
        density * area,
        shear=SHEAR * young / 2.0 * area,
        rotary=density * second,
    )


def as_text(result: dict[str, Any]) -> str:
    """A line for each case and way: rms errors by size, and the order."""
    lines = []
    for case in result["cases"]:
        lines.append(f"{case['name']} ({case['reference']})")
        for way, found in case["ways"].items():
            errors = "  ".join(
                f"{size['rms']:8.3%} ({size['unknowns']:,})" for size in found["sizes"]
            )
            order = "" if found["order"] is None else f"  order {found['order']:.1f}"
            lines.append(f"  {way:12s}{errors}{order}")
    return "\n".join(lines)
