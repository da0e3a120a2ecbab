"""Damping of modes by what each region of a solid loses."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.sparse.linalg import eigsh

from carillon.composition.domains import Everywhere, Expression
from carillon.composition.materials import named_material
from carillon.fem.supports import Supports
from solver.assembly.sparse import assembled
from solver.response.region_damping import damping_of_regions
from solver.response.response import Damping
from tests.test_regions import BRASS, KINDS, STEEL, solid

SPRUCE = named_material("spruce").region("spruce")
BAR = trimesh.creation.box(extents=[0.1, 0.04, 0.03])
COEFFICIENTS = ((3.0, 1e-9), (40.0, 5e-8))


def modes_of(model, count=12):
    """Elastic modes of a model."""
    K, M = (matrix.tocsc() for matrix in assembled(model))
    values, vectors = eigsh(K, count, M, sigma=-1e6)
    rigid = model.rigid_modes
    return values[rigid:], vectors[:, rigid:]


def of(model, coefficients):
    """Their damping."""
    values, vectors = modes_of(model)
    return damping_of_regions(model, values, vectors, coefficients).decay_per_second(values)


def held(model):
    """The same on springs, with a mass."""
    points = model.mesh.nodes[[0, 5, 20]]
    springs = np.repeat(1e7 * np.eye(3)[None], 3, axis=0)
    springs[2] = 0.0
    return model.with_supports(Supports(points, springs, np.array([0.0, 0.0, 0.05])))


@pytest.mark.parametrize("kind", KINDS)
def test_a_solid_of_one_damping_decays_as_rayleigh_says(kind):
    model = solid([(STEEL, Everywhere()), (BRASS, Expression("x > 0.02"))], kind, BAR, 10)
    values, _ = modes_of(model)
    assert of(model, COEFFICIENTS[:1] * 2) == pytest.approx(
        Damping(*COEFFICIENTS[0]).decay_per_second(values), rel=1e-9
    )
    # Alike but for rounding, where regions are summed.
    other = [COEFFICIENTS[0], tuple(np.multiply(COEFFICIENTS[0], 1.0 + 1e-12))]
    assert of(model, other) == pytest.approx(of(model, COEFFICIENTS[:1] * 2), rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("is_held", [False, True])
def test_decays_are_those_of_the_damping_matrix(kind, is_held):
    # Kinks at borders inside cells follow the materials, so doubling one changes more than itself.
    border = Expression("x + 0.5 * z > 0.013" if kind == "voxel" else "x > 0.01")
    model = solid([(STEEL, Everywhere()), (SPRUCE, border)], kind, BAR, 10)
    model = held(model) if is_held else model
    free = model.with_supports(None)
    (mass_1, stiff_1), (mass_2, stiff_2) = COEFFICIENTS
    K, M = (matrix.toarray() for matrix in assembled(free))
    # Matrices of the first region, from a solid whose second one is another.
    regions = free.regions
    twice = replace(regions, density=regions.density * [2.0, 1.0])
    M_1 = assembled(free.with_regions(twice))[1].toarray() - M
    laws = (replace(regions.laws[0], entries=tuple(2.0 * np.array(regions.laws[0].entries))),)
    stiffer = replace(regions, laws=(*laws, *regions.laws[1:]))
    K_1 = assembled(free.with_regions(stiffer))[0].toarray() - K
    C = mass_1 * M_1 + mass_2 * (M - M_1) + stiff_1 * K_1 + stiff_2 * (K - K_1)
    values, vectors = modes_of(model)
    wanted = 0.5 * np.einsum("ik,ij,jk->k", vectors, C, vectors)
    assert of(model, COEFFICIENTS) == pytest.approx(wanted, rel=1e-6)


def test_dampings_of_regions_add_up_where_they_meet_inside_cells():
    parts = [(STEEL, Everywhere()), (SPRUCE, Expression("x + 0.5 * z > 0.013"))]
    model = solid(parts, "finite-cell", BAR, 10)
    values, vectors = modes_of(model)

    def decays(*coefficients):
        found = damping_of_regions(model, values, vectors, coefficients)
        return found.decay_per_second(values)

    one, other, none = (3.0, 1e-7), (40.0, 5e-8), (0.0, 0.0)
    apart = decays(one, none) + decays(none, other)
    assert decays(one, other) == pytest.approx(apart, rel=1e-9)
    assert decays(one, none) + decays(none, one) == pytest.approx(
        Damping(*one).decay_per_second(values), rel=1e-6
    )


def test_a_region_that_loses_nothing_makes_modes_last():
    model = solid(
        [(STEEL, Everywhere()), (BRASS, Expression("x > 0.02"))], surface=BAR, resolution=10
    )
    decays = of(model, ((0.0, 0.0), (40.0, 0.0)))
    assert (decays > 0.0).all() and (decays < 20.0).all()
