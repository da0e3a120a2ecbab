"""Designs of solids of several regions, which may be held."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import trimesh
from scipy.sparse.linalg import eigsh

from carillon.composition.composition import Composition, MaterialRegion
from carillon.composition.materials import named_material
from carillon.composition.places import ClosedSurface, Everywhere, Expression
from carillon.composition.supports import Support, placed_supports
from carillon.fem.block import degrees_of_freedom
from carillon.fem.energies import energy_shares
from carillon.fem.finite_cells.build import covering
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import hexmesh_from_voxels, voxelize
from carillon.fem.model import fine_model
from solver.analysis.problem import ProblemOptions
from solver.assembly.sparse import assembled
from solver.response.dissipation import dissipation
from sound.design.constants import NOTHING, Bounded, FreeConstants, FreeRegion
from sound.design.material import ReducedMaterial
from sound.design.objective import Objective
from sound.design.simulation import Simulation
from sound.strikes import Strike
from tests.cut_solids import divided
from tests.test_sound_gradient import random_objective

SIZE, MODES = 5, 8
SIDES = np.array([0.08, 0.06, 0.04])
BORDER = "x + 0.2 * y < 0.043"
"""Follows no lattice."""
KINDS = ("voxel", "average", "ddfem", "finite-cell")


def surface_of_block():
    surface = trimesh.creation.box(extents=SIDES)
    surface.apply_translation(SIDES / 2.0)
    return surface


def parts_of(material):
    return [
        MaterialRegion(named_material("iron").region("body"), Everywhere()),
        MaterialRegion(named_material(material).region("handle"), Expression(BORDER)),
    ]


def simulation(
    kind,
    material="brass",
    supports=(),
    free=NOTHING,
    level=False,
    tolerance=1e-13,
    more=(),
    divisions=(),
):
    """A block of two regions whose border is oblique, or of more."""
    surface = surface_of_block()
    parts = [*parts_of(material), *more]
    composition = Composition(parts, "block", ClosedSurface(surface))
    cells = None
    if kind == "finite-cell":
        cells = divided(covering(surface, 6), divisions)
        mesh, placed = cells.mesh, composition.of_cells(cells)
    else:
        mesh = hexmesh_from_voxels(voxelize(surface, 8))
        placed = composition.of_voxels(mesh)
    young = placed.regions.moduli(placed.region)
    reduced = ReducedMaterial.of_mesh(mesh, SIZE, young, "exponential", free, level)
    solid = fine_model(mesh, young) if cells is None else finite_cell_model(cells, young)
    held = placed_supports(supports, solid, surface)
    options = ProblemOptions(
        "block",
        8,
        coarsen=kind if kind in ("average", "ddfem") else "none",
        discretisation="finite-cell" if cells is not None else "voxel",
    )
    struck = [
        Strike("a", 0, np.array([0.2, 0.3, 1.0]) * SIDES, np.array([0.0, 0.0, -1.0])),
        Strike("b", 1, np.array([1.0, 0.6, 0.4]) * SIDES, np.array([-1.0, 0.0, 0.0])),
    ]
    return Simulation(mesh, options, reduced, struck, MODES, tolerance, cells, placed, held)


def solid_at(solid, z):
    model = solid.elements.with_young(solid.material.moduli(z))
    return model.with_regions(solid.regions(z))


def exact(solid, z):
    """Eigenvalues and pushed modes to rounding, by ARPACK."""
    model = solid_at(solid, z)
    K, M = assembled(model)
    # About the first elastic eigenvalue, which is below 1e10 here.
    start = np.random.default_rng(0).standard_normal(K.shape[0])
    rigid = model.rigid_modes
    values, vectors = eigsh(K.tocsc(), rigid + MODES, M=M.tocsc(), sigma=-1e8, v0=start)
    return values[rigid:], solid.mesh_rows(solid._pushes).T @ vectors[:, rigid:]


def relative(actual, expected):
    return np.linalg.norm(actual - expected) / np.linalg.norm(expected)


def assert_derivatives(solid, z, kind, absolute=False):
    """Those of residuals by formula and by differences agree, coordinate by coordinate.

    Leaves of the forests are told apart by numbers of single precision, which differences see.
    Rounding of the eigenvectors of finite cells needs longer steps.
    """
    step, bound = 1e-4 if kind == "finite-cell" else 1e-5, 1e-3 if kind == "ddfem" else 1e-4
    base = random_objective()
    objective = Objective(base.targets, base.weights, absolute=absolute)
    evaluation = solid.evaluate(z, derivatives=True)
    values, pushed, slopes = evaluation.eigenvalues, evaluation.pushed, evaluation.sensitivity
    np.testing.assert_allclose(values, exact(solid, z)[0], rtol=1e-8)
    frequency = objective.frequency_jacobian(values, slopes)
    amplitude = objective.amplitude_jacobian(values, pushed, slopes)
    for coordinate, direction in enumerate(np.eye(len(z))):
        ends = [exact(solid, z + sign * step * direction) for sign in (1.0, -1.0)]
        by_frequency, by_amplitude = (
            (function(*ends[0]) - function(*ends[1])) / (2.0 * step)
            for function in (
                lambda values, _: objective.frequency_residual(values),
                objective.amplitude_residual,
            )
        )
        assert relative(frequency[:, coordinate], by_frequency) < bound
        assert relative(amplitude[:, :, coordinate], by_amplitude) < bound


def free(density=True, poisson=True):
    ratios = tuple(
        FreeRegion(name, (row,), Bounded(0.05, 0.45, named_material(material).poisson))
        for row, (name, material) in enumerate((("body", "iron"), ("handle", "brass")))
    )
    densities = (
        FreeRegion("handle", (1,), Bounded(2000.0, 20000.0, named_material("brass").density)),
    )
    return FreeConstants(ratios if poisson else (), densities if density else ())


CLAMP = Support("clamp", Expression("x < 0.001"))
HINGE = (Support("one", None, (0.0, 0.0, 0.0)), Support("other", None, (0.0, 0.06, 0.0)))
MASS = Support("mass", None, (0.07, 0.03, 0.04), mass=0.2)
SPRING = Support("spring", None, (0.01, 0.03, 0.0), spring=np.array(3e7))


@pytest.mark.parametrize("supports", [(), (CLAMP,), HINGE])
@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_two_regions(kind, supports):
    solid = simulation(kind, supports=supports, free=free())
    assert solid.model.rigid_modes == {(): 6, (CLAMP,): 0, HINGE: 1}[supports]
    z = 0.3 * np.random.default_rng(1).standard_normal(solid.material.dimensions)
    assert_derivatives(solid, z, kind)


def test_derivatives_of_two_regions_of_divided_cells():
    """Some of the cells at the border hang from larger ones."""
    solid = simulation("finite-cell", free=free(), divisions=(0.3, 0.1))
    elements = solid.model.elements
    assert elements.kinds[elements.kinks.borders.cell].any()
    z = 0.3 * np.random.default_rng(1).standard_normal(solid.material.dimensions)
    assert_derivatives(solid, z, "finite-cell")


@pytest.mark.parametrize("kind", KINDS)
def test_shares_of_three_regions_that_meet_add_up(kind):
    """Some finite cells hold all three."""
    glass = named_material("glass").region("third")
    solid = simulation(kind, more=[MaterialRegion(glass, Expression("z > 0.0217"))])
    evaluation = solid.evaluate(0.3 * np.random.default_rng(7).standard_normal(SIZE))
    whole = np.zeros(len(solid.material.basis), dtype=int)
    np.testing.assert_allclose(solid.energy_shares(evaluation, whole), 1.0, atol=1e-6)


@pytest.mark.parametrize("kind", ["voxel", "finite-cell"])
def test_derivatives_of_wood(kind):
    solid = simulation(kind, "beech")
    assert_derivatives(solid, 0.3 * np.random.default_rng(2).standard_normal(SIZE), kind)


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_a_solid_with_springs_and_masses(kind):
    """Its frequencies are compared as they are, and the level of all moduli is a coordinate."""
    solid = simulation(kind, supports=(MASS, SPRING), free=free(poisson=False), level=True)
    z = 0.3 * np.random.default_rng(3).standard_normal(solid.material.dimensions)
    assert_derivatives(solid, z, kind, absolute=True)


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_all_pairs_are_the_same_ones(kind):
    """Those of the reduced model, whose modes may mix."""
    solid = simulation(kind, supports=HINGE, free=free(), tolerance=1e-11)
    z = 0.3 * np.random.default_rng(4).standard_normal(solid.material.dimensions)
    evaluation = solid.evaluate(z)
    few, all_ = (solid.differentiate(evaluation, whole) for whole in (False, True))
    objective = random_objective()
    for evaluated in (few, all_):
        pushed = evaluated.sensitivity
        jacobian = objective.amplitude_jacobian(evaluated.eigenvalues, evaluated.pushed, pushed)
        if evaluated is few:
            expected = jacobian
    np.testing.assert_allclose(jacobian, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("kind", KINDS)
def test_one_material_in_two_regions_has_the_derivatives_of_one(kind):
    two = simulation(kind, "iron")
    regions = two.model.regions
    one = simulation(kind, "iron", free=NOTHING)
    z = 0.3 * np.random.default_rng(5).standard_normal(SIZE)
    same = [each.evaluate(z, derivatives=True) for each in (one, two)]
    np.testing.assert_allclose(same[0].eigenvalues, same[1].eigenvalues, rtol=1e-9)
    # Energies of the parts add up to those of the whole.
    shares = two.energy_shares(same[1], np.zeros(len(two.material.moduli(z)), dtype=int))
    np.testing.assert_allclose(shares, 1.0, atol=1e-6)
    assert len(regions) == 2


@pytest.mark.parametrize("kind", ["voxel", "finite-cell"])
def test_decays_are_those_of_the_quadratic_eigenproblem(kind):
    """(K + s C + s^2 M) u = 0 with the damping of two regions, to first order."""
    solid = simulation(kind, supports=(CLAMP,))
    z = np.zeros(SIZE)
    pairs = ((12.0, 3e-8), (70.0, 4e-7))
    model = solid_at(solid, z)
    regions = replace(model.regions, damping=pairs)
    model = model.with_regions(regions)
    evaluation = solid.evaluate(z)
    elastic = solid.mesh_rows(evaluation.modes.elastic)
    lost = dissipation(model, evaluation.eigenvalues, elastic)
    found = lost.decay_per_second(evaluation.eigenvalues)

    K, M = (matrix.toarray() for matrix in assembled(model))
    alpha, beta = np.zeros_like(K), np.zeros_like(K)
    for row, (by_mass, by_stiffness) in enumerate(pairs):
        doubled = regions.density * np.where(np.arange(2) == row, 2.0, 1.0)
        heavier = assembled(model.with_regions(replace(regions, density=doubled)))[1]
        alpha += by_mass * (heavier.toarray() - M)
        elements = model.with_supports(None).elements
        own = elements.with_young(elements.moduli_of(np.arange(2) == row)).stiffness()
        dofs = degrees_of_freedom(model.connectivity.astype(np.int64))
        for places, matrix in zip(dofs, own, strict=True):
            beta[np.ix_(places, places)] += by_stiffness * matrix
    # In the space of many modes, where the stiff springs are no matter.
    values, modes = la.eigh(K, M, subset_by_index=(0, 120))
    C = modes.T @ (alpha + beta) @ modes
    size = len(values)
    companion = np.block([[np.zeros((size, size)), np.eye(size)], [-np.diag(values), -C]])
    roots = la.eigvals(companion)
    roots = roots[roots.imag > 0.0]
    roots = roots[np.argsort(np.abs(roots))][:MODES]
    np.testing.assert_allclose(found, -roots.real, rtol=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_shares_of_a_free_solid_add_up(kind):
    solid = simulation(kind)
    z = 0.3 * np.random.default_rng(6).standard_normal(SIZE)
    evaluation = solid.evaluate(z)
    elastic = solid.mesh_rows(evaluation.modes.elastic)
    mass, stiffness = energy_shares(
        solid_at(solid, z), evaluation.eigenvalues, elastic, np.arange(2)
    )
    np.testing.assert_allclose(mass.sum(axis=1), 1.0, rtol=1e-9)
    np.testing.assert_allclose(stiffness.sum(axis=1), 1.0, rtol=1e-6)
    assert (mass > 0.0).all() and (stiffness > -1e-12).all()
