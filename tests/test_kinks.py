"""Finite cells across the border of two materials."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from trimesh.transformations import euler_matrix

from carillon.composition.materials import named_material
from carillon.composition.places import Everywhere, Expression
from carillon.fem.finite_cells.build import covering
from carillon.fem.finite_cells.kinks import Borders
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import builtin_surface
from carillon.fem.model import mass_properties
from carillon.fem.regions import Regions
from studies.accuracy.solids import ANGLES
from tests.cut_solids import divided
from tests.test_regions import OBLIQUE, composed, solid, spectrum

STIFF, SOFT = Regions.one(0.0, 7800.0, 2e11), Regions.one(0.0, 1200.0, 2e10)
LENGTH, SIDE, CUT = 0.2, 0.02, 0.0137
TWIST = 15.823
"""Lowest frequency of a free square plate without Poisson's effect, times the root of mass over
stiffness and the squared side (Kirchhoff, by Rayleigh-Ritz)."""
ROD = trimesh.creation.box(extents=[LENGTH, SIDE, SIDE])


def without_kinks(model):
    return replace(model, shared=replace(model.shared, borders=Borders.nothing()))


def longitudinal(model):
    """Lowest frequencies squared [rad^2/s^2] of motions along a rod alone."""
    import scipy.linalg as la

    from solver.assembly.sparse import assembled

    K, M = (matrix.toarray() for matrix in assembled(model))
    # One displacement for all nodes of a section: without Poisson's effect sections stay plane.
    places, section = np.unique(model.positions[:, 0].round(9), return_inverse=True)
    along = np.zeros((len(K), len(places)))
    along[3 * np.arange(len(section)), section] = 1.0
    return la.eigh(along.T @ K @ along, along.T @ M @ along, eigvals_only=True)[1:3]


def exact():
    """The same by the transcendental equation of a rod of two materials."""
    from studies.accuracy.beams import RodPart, rod_frequencies

    parts = [
        RodPart(LENGTH / 2 + sign * CUT, each.young[0], each.density[0])
        for sign, each in ((1.0, STIFF), (-1.0, SOFT))
    ]
    return (2.0 * np.pi * rod_frequencies(*parts, 2)) ** 2


def test_a_rod_of_two_materials_is_as_its_equation_says():
    parts = [(STIFF, Everywhere()), (SOFT, Expression(f"x > {CUT}"))]
    errors = []
    for resolution in (20, 40):
        model = solid(parts, "finite-cell", ROD, resolution)
        values = [longitudinal(each) for each in (model, without_kinks(model))]
        errors.append([np.abs(value / exact() - 1.0).max() for value in values])
    assert errors[1][0] < 2e-3
    assert errors[1][0] < errors[0][0] / 3.0
    assert errors[1][0] < errors[1][1] / 10.0


def test_all_cells_may_be_of_two_materials():
    """As those of a solid of small parts on a coarse lattice."""
    inner = 0.45
    parts = [(STIFF, Everywhere()), (SOFT, Expression(f"abs(z) > {inner * SIDE / 2}"))]
    model = solid(parts, "finite-cell", ROD, 4)
    assert set(model.shared.portion) == set(range(len(model.cells.cell)))
    density = inner * STIFF.density[0] + (1.0 - inner) * SOFT.density[0]
    assert mass_properties(model).mass == pytest.approx(density * LENGTH * SIDE**2, rel=1e-6)


def test_there_is_no_kink_without_a_jump():
    steel = named_material("steel").region("steel")
    model = solid([(steel, Everywhere()), (steel, OBLIQUE)], "finite-cell")
    assert len(model.shared.borders)
    assert np.abs(model.elements.kinks.follow).max() < 1e-8


def test_stiffness_stays_linear_in_factors():
    steel, spruce = (named_material(name).region(name) for name in ("steel", "spruce"))
    model = solid([(steel, Everywhere()), (spruce, OBLIQUE)], "finite-cell")
    own = model.regions.young[model.region]
    one, other = np.random.default_rng(0).uniform(0.1, 10.0, (2, len(own)))
    sums = [model.with_young(own * each).stiffness() for each in (one, other, one + 2.0 * other)]
    assert np.allclose(sums[0] + 2.0 * sums[1], sums[2], rtol=1e-9, atol=1e-9 * sums[2].max())


@pytest.mark.parametrize("shares", [(), (0.3, 0.3)], ids=["whole", "divided"])
@pytest.mark.parametrize("degree", [2, 4])
@pytest.mark.parametrize(
    ("names", "least"), [(("steel", "spruce"), 1e-12), (("rubber", "iron"), 3e-11)]
)
def test_no_strain_sets_energy_free(names, least, degree, shares):
    materials = [named_material(name).region(name) for name in names]
    surface = builtin_surface("bell")
    cells = divided(covering(surface, 12, degree=degree), shares)
    placed = composed(zip(materials, (Everywhere(), OBLIQUE), strict=True), surface).of_cells(cells)
    # Whatever the moduli of a cell's voxels are.
    factor = 10.0 ** np.random.default_rng(0).uniform(-2.0, 2.0, cells.mesh.n_cells)
    for each in (np.ones(len(factor)), factor):
        young = placed.regions.moduli(placed.region, each)
        model = finite_cell_model(cells, young, placed.regions, placed.region, placed.shared)
        values = np.linalg.eigvalsh(model.stiffness())
        assert (values[:, 0] > -least * values[:, -1]).all()


@pytest.mark.parametrize("border", [-0.0003, 0.0001, 0.0004])
@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), ANGLES], ids=["straight", "turned"])
def test_plies_thinner_than_a_voxel_bend_as_a_laminate(angles, border):
    """Walls of a thirtieth of the spacing, which lie between the places where regions are asked."""
    from solver.analysis.modal_solver import modal_analysis
    from solver.analysis.options import SolverOptions

    side, wall = 0.5, 0.001
    turn = euler_matrix(*np.radians(angles))
    sheet = trimesh.creation.box((side, side, wall)).apply_transform(turn)
    x, y, z = turn[:3, 2]
    above = Expression(f"{x} * x + {y} * y + {z} * z > {border}")
    soft, stiff = Regions.one(0.0, 1000.0, 1e9), Regions.one(0.0, 3000.0, 1e10)
    model = solid([(soft, Everywhere()), (stiff, above)], "finite-cell", sheet, 16)
    places, moduli = np.array([-wall / 2, border, wall / 2]), np.array([1e9, 1e10])
    # Bending about the neutral plane; a square plate without Poisson's effect twists first.
    stretch, first, second = (
        (moduli * np.diff(places**power)).sum() / power for power in (1, 2, 3)
    )
    stiffness = second - first**2 / stretch
    per_area = (np.array([1000.0, 3000.0]) * np.diff(places)).sum()
    assert model.mass == pytest.approx(per_area * side**2, rel=2e-3)
    modes = modal_analysis(model, SolverOptions(modes=9))
    twist = np.sqrt(modes.values[6]) * side**2 * np.sqrt(per_area / stiffness)
    modes.destroy()
    assert twist == pytest.approx(TWIST, rel=0.01)


def test_kinks_only_make_a_solid_softer():
    steel, spruce = (named_material(name).region(name) for name in ("steel", "spruce"))
    model = solid([(steel, Everywhere()), (spruce, OBLIQUE)], "finite-cell")
    assert (spectrum(model)[6:] <= spectrum(without_kinks(model))[6:] * (1.0 + 1e-9)).all()
