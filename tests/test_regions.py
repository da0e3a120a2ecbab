"""Solids of several materials."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.sparse.linalg import eigsh

from carillon.composition.composition import Composition, MaterialRegion, axes_about
from carillon.composition.materials import named_material
from carillon.composition.places import Box, Chosen, ClosedSurface, Everywhere, Expression
from carillon.errors import UserError
from carillon.fem import elements
from carillon.fem.elasticity import axes_along
from carillon.fem.finite_cells.build import covering, finite_cells
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize
from carillon.fem.model import fine_model, mass_properties
from carillon.fem.regions import Regions
from solver.assembly.sparse import assembled
from solver.coarsening.choice import make_coarsening
from solver.coarsening.model import build_model
from tests import solids
from tests.cut_solids import divided

STEEL, BRASS = (named_material(name).region(name) for name in ("steel", "brass"))
KINDS = ("voxel", "finite-cell")


def composed(parts, surface):
    """Regions in their order, from pairs of a material and a place."""
    regions = [
        MaterialRegion(replace(material, names=(str(number),)), place, *axes)
        for number, (material, place, *axes) in enumerate(parts)
    ]
    return Composition(regions, "solid", ClosedSurface(surface))


def solid(parts, kind="voxel", surface=None, resolution=12, factor=1.0):
    """A solid of regions."""
    surface = builtin_surface("bell") if surface is None else surface
    composition = composed(parts, surface)
    if kind == "voxel":
        mesh = hexmesh_from_voxels(voxelize(surface, resolution))
        placed = composition.of_voxels(mesh)
        young = placed.regions.moduli(placed.region, np.full(mesh.n_cells, factor))
        return fine_model(mesh, young, placed.region, regions=placed.regions)
    cells = finite_cells(surface, resolution)
    placed = composition.of_cells(cells)
    young = placed.regions.moduli(placed.region, np.full(cells.mesh.n_cells, factor))
    return finite_cell_model(cells, young, placed.regions, placed.region, placed.shared)


def spectrum(model, count=12):
    K, M = (matrix.tocsc() for matrix in assembled(model))
    start = np.random.default_rng(0).standard_normal(K.shape[0])
    return np.sort(eigsh(K, count, M, sigma=-1e6, v0=start, return_eigenvectors=False))


OBLIQUE = Expression("x + 0.7 * y - 0.3 * z < 0.01")
"""A border that follows no lattice."""


@pytest.mark.parametrize("kind", KINDS)
def test_regions_of_one_material_are_one_solid(kind):
    whole = solid([(STEEL, Everywhere())], kind)
    parts = [(STEEL, Everywhere()), (STEEL, OBLIQUE), (STEEL, Box(np.zeros(3), np.ones(3)))]
    several = solid(parts, kind)
    assert several.region is not None
    for one, other in zip(assembled(whole), assembled(several), strict=True):
        assert abs(one - other).max() < 1e-12 * abs(one).max()


@pytest.mark.parametrize("kind", KINDS)
def test_mass_is_that_of_the_regions(kind):
    model = solid([(STEEL, Everywhere()), (BRASS, OBLIQUE)], kind)
    K, M = assembled(model)
    assert M.sum() / 3.0 == pytest.approx(model.mass, rel=1e-6)
    low, high = sorted((STEEL.density[0], BRASS.density[0]))
    assert low < model.density < high


def test_a_sharp_border_divides_the_mass_exactly():
    surface = trimesh.creation.box(extents=[0.1, 0.04, 0.02])
    border = 0.0123
    parts = [(STEEL, Everywhere()), (BRASS, Expression(f"x > {border}"))]
    model = solid(parts, "finite-cell", surface, 10)
    volumes = 0.04 * 0.02 * np.array([0.05 + border, 0.05 - border])
    expected = volumes @ [STEEL.density[0], BRASS.density[0]]
    assert model.mass == pytest.approx(expected, rel=1e-7)
    centres = np.array([(border - 0.05) / 2.0, (border + 0.05) / 2.0])
    centre = (volumes * [STEEL.density[0], BRASS.density[0]]) @ centres / expected
    assert mass_properties(model).centre[0] == pytest.approx(centre, rel=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_frequencies_follow_density_and_modulus(kind):
    light = replace(STEEL, density=STEEL.density / 2.0)
    soft = replace(STEEL, young=STEEL.young / 4.0)
    reference, lighter, softer = (
        spectrum(solid([(each, Everywhere()), (each, OBLIQUE)], kind))
        for each in (STEEL, light, soft)
    )
    assert np.allclose(lighter[6:], 2.0 * reference[6:], rtol=1e-6)
    assert np.allclose(softer[6:], reference[6:] / 4.0, rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_a_factor_is_common_to_all_regions(kind):
    parts = [(STEEL, Everywhere()), (BRASS, OBLIQUE)]
    one, other = (spectrum(solid(parts, kind, factor=factor)) for factor in (1.0, 3.0))
    assert np.allclose(other[6:], 3.0 * one[6:], rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_wood_of_a_cube_sounds_the_same_whichever_way_it_lies(kind):
    spruce = named_material("spruce").region("spruce")
    surface = trimesh.creation.box(extents=[0.1, 0.1, 0.1])
    along = [
        spectrum(solid([(spruce, Everywhere(), axes_along(axis))], kind, surface, 4))
        for axis in np.eye(3)
    ]
    for other in along[1:]:
        assert np.allclose(other[6:], along[0][6:], rtol=1e-6)


def test_a_bar_of_spruce_is_soft_across_its_grain():
    spruce = named_material("spruce").region("spruce")
    surface = trimesh.creation.box(extents=[0.3, 0.02, 0.02])
    along, across = (
        spectrum(solid([(spruce, Everywhere(), axes_along(axis))], "finite-cell", surface, 30))
        for axis in np.eye(3)[:2]
    )
    moduli = np.array(named_material("spruce").grain_young)
    # Slender bars: the modulus along the bar, less some per cent of shear.
    ratio = np.sqrt(along[6] / across[6])
    assert ratio == pytest.approx(np.sqrt(moduli[0] / moduli[1]), rel=0.1)


def test_many_laws_are_summed_as_few_are(monkeypatch):
    spruce = named_material("spruce").region("spruce")
    about = axes_about(np.array([0.0, 0.0, 1.0]), np.zeros(3))
    model = solid([(spruce, Everywhere(), about)], surface=builtin_surface("bell"))
    assert len(model.regions) > elements.MOST_LAWS
    by_entries = model.stiffness()
    monkeypatch.setattr(elements, "MOST_LAWS", len(model.regions))
    assert np.allclose(model.stiffness(), by_entries, rtol=1e-10, atol=1e-6 * by_entries.max())


def test_rings_about_a_pith_keep_a_symmetric_solid_symmetric():
    spruce = named_material("spruce").region("spruce")
    about = axes_about(np.array([0.0, 0.0, 1.0]), np.zeros(3))
    surface = trimesh.creation.box(extents=[0.1, 0.1, 0.05])
    values = spectrum(solid([(spruce, Everywhere(), about)], surface=surface, resolution=8))
    pairs = np.diff(values[6:]) / values[7:]
    assert (pairs < 1e-9).any()


def test_coarse_elements_hold_what_their_blocks_do():
    fine = solid([(STEEL, Everywhere()), (replace(STEEL, density=BRASS.density), OBLIQUE)])
    coarse = build_model(
        fine.mesh,
        fine.young[:, 0],
        make_coarsening("galerkin", STEEL.poisson),
        region=fine.cell_regions,
        **fine.constants,
    )
    assert coarse.mass == pytest.approx(fine.mass, rel=1e-12)
    rigid = [mass_properties(each) for each in (fine, coarse)]
    assert np.allclose(rigid[0].centre, rigid[1].centre, atol=1e-12)
    assert np.allclose(rigid[0].moments, rigid[1].moments, rtol=1e-12)


def test_surfaces_are_regions():
    surface = builtin_surface("box")
    low, high = surface.bounds
    part = trimesh.creation.box(bounds=[low, [0.5 * (low[0] + high[0]), *high[1:]]])
    model = solid([(STEEL, Everywhere()), (BRASS, ClosedSurface(part))], surface=surface)
    assert (model.region[:, 0] == 1).mean() == pytest.approx(0.5, abs=0.05)


def test_functions_are_regions():
    model = solid([(STEEL, Everywhere()), (BRASS, Chosen(lambda points: points[:, 2] > 0.1))])
    middles = model.mesh.origin + model.mesh.edge * (model.mesh.grid + 0.5)
    assert ((model.region[:, 0] == 1) == (middles[:, 2] > 0.1)).all()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ([(STEEL, Everywhere()), (BRASS, Expression("x > 10"))], "region '1' has no voxel"),
        ([(STEEL, OBLIQUE), (BRASS, Everywhere())], "region '0' has no voxel"),
        ([(STEEL, Expression("z < 0.02"))], "are of no region"),
    ],
)
def test_regions_that_leave_holes_or_nothing(parts, said, kind):
    if kind == "finite-cell" and len(parts) == 1:
        parts = [*parts, (BRASS, Expression("z < 0.01"))]
    with pytest.raises(UserError, match=said):
        solid(parts, kind)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("z", "compares nothing"),
        ("z <", "cannot be read"),
        ("w < 1", "where a number belongs"),
        ("x == 1", "something else than <"),
        ("__import__('os') < 1", "where a number belongs"),
        ("sqrt(x, y, z) < 1", "gives sqrt 3 numbers"),
        ("x < 1 and z", "where a comparison belongs"),
        ("(" * 400 + "x<1" + ")" * 400, "expected comparisons"),
    ],
)
def test_expressions_that_say_nothing(text, said):
    with pytest.raises(UserError, match=said):
        Expression(text)


def test_functions_take_all_of_their_numbers():
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 3))
    before = points.copy()
    ball = Expression("hypot(x, y, z) < 0.7").contains(points)
    assert np.array_equal(points, before)
    assert np.array_equal(ball, np.linalg.norm(points, axis=1) < 0.7)
    highest = Expression("maximum(x, y, z) < 0.5").contains(points)
    assert np.array_equal(highest, points.max(axis=1) < 0.5)
    with pytest.raises(UserError, match="gives sqrt 2 numbers"):
        Expression("sqrt(x, y) < 1")


def test_a_material_with_rings_leaves_other_borders_as_they_are():
    spruce = named_material("spruce").region("spruce")
    about = axes_about(np.array([0.0, 0.0, 1.0]), np.zeros(3))
    corner = Expression("x > 0.05")
    parts = [(STEEL, Everywhere()), (BRASS, OBLIQUE)]
    plain = solid([*parts, (STEEL, corner)], "finite-cell")
    ringed = solid([*parts, (spruce, corner, about)], "finite-cell")
    assert 0 < len(ringed.shared.borders) < len(plain.shared.borders) + 1
    laws = [ringed.regions.laws[number] for number in ringed.shared.borders.region.ravel()]
    assert all(law.poisson is not None for law in laws)


REGIONS = """regions:
  - {name: body, material: iron}
  - {name: handle, material: beech, grain: [1, 0, 0], where: "x > 0.02"}
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (REGIONS.replace("iron", "irn"), "there is no material 'irn'"),
        (REGIONS.replace("material: iron", "poisson: 0.5"), "poisson"),
        (REGIONS.replace("handle", "body"), "two regions are called 'body'"),
        (REGIONS.replace("x > 0.02", "x > 0.02 or"), "cannot be read"),
        (REGIONS.replace("[1, 0, 0]", "[0, 0, 0]"), "expected a direction"),
        (REGIONS + "supports: [{where: 'x > 9'}]\n", "meets nothing of solid"),
        (REGIONS + "supports: [{where: 'region:lid'}]\n", "there is no region 'lid'"),
        (REGIONS + "supports: [{where: 'x > -9'}]\n", "nothing is left that vibrates"),
        (REGIONS + "supports: [{at: [9, 9, 9]}]\n", "the nearest is"),
        (REGIONS + "supports: [{mass: 1}]\n", "expected where, at or painted"),
        ("regions: [{name: a, young: 1.0e9, mesh: missing.stl}]\n", "missing.stl"),
        ("regions: [{name: a}]\n", "found neither material nor young"),
        ("regions: [{name: a, material: spruce, poisson: 0.3}]\n", "several Poisson's ratios"),
    ],
)
def test_files_that_describe_no_solid(text, said, tmp_path, run_cli):
    path = tmp_path / "regions.yaml"
    path.write_text(text)
    out = tmp_path / "modes.h5"
    command = ("solver", "modes", "builtin:bar", "--resolution", 12, "--modes", 10)
    done = run_cli(*command, "--regions", path, "--out", out)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert len([line for line in done.stderr.splitlines() if line.strip()]) == 1
    assert not out.exists()


@pytest.mark.parametrize("kind", KINDS)
def test_modes_files_keep_regions_and_supports(kind, tmp_path, run_cli):
    from solver.files.modes_file import read_modes

    path = tmp_path / "regions.yaml"
    path.write_text(REGIONS + "supports: [{where: 'x < -0.09'}, {at: [0, 0, 0.03], mass: 0.01}]\n")
    out = tmp_path / "modes.h5"
    run_cli(
        *("solver", "modes", "builtin:bar", "--resolution", 20, "--modes", 12),
        *("--discretisation", kind, "--regions", path, "--out", out, "--tolerance", 1e-8),
        check=True,
    )
    file = read_modes(out)
    assert file.model.regions.names == ("body", "handle")
    assert file.model.rigid_modes == 0
    K, M = (matrix.tocsc() for matrix in assembled(file.model))
    values = eigsh(K, 12, M, sigma=-1.0, return_eigenvectors=False)
    assert np.allclose(np.sort(values), file.eigenvalues, rtol=1e-6)
    assert run_cli("solver", "audit", out).returncode == 0


@pytest.mark.parametrize("name", ["border_cell", "border_region", "portion", "region"])
@pytest.mark.parametrize("number", [-1, 1_000_000])
def test_shared_cells_that_name_what_is_not_there_are_refused(name, number, tmp_path):
    import h5py

    from solver.files.regions_group import get_shared, put_regions, put_shared

    model = solid([(STEEL, Everywhere()), (BRASS, OBLIQUE)], "finite-cell")
    with h5py.File(tmp_path / "solid.h5", "w") as file:
        put_regions(file, model.regions, model.region)
        put_shared(file, model.shared)
        assert len(get_shared(file, model.cells, file, None).portion)
        values = file["shared"][name][:].astype(np.int64)
        values[0] = number
        del file["shared"][name]
        file["shared"][name] = values
        with pytest.raises(UserError, match="that are not there"):
            get_shared(file, model.cells, file, None)


def test_uniform_solids_are_written_as_ever(tmp_path, run_cli):
    import h5py

    out = tmp_path / "modes.h5"
    run_cli(
        *("solver", "modes", "builtin:bar", "--resolution", 12, "--modes", 10),
        *("--poisson", 0.3, "--density", 500.0, "--out", out),
        check=True,
    )
    with h5py.File(out) as file:
        assert file.attrs["poisson"] == 0.3
        assert file.attrs["density"] == 500.0
        assert not {"regions", "supports", "region"} & set(file)


def test_regions_of_one_material_give_the_spectrum_of_solids_without():
    surface = builtin_surface("bell")
    mesh = hexmesh_from_voxels(voxelize(surface, 12))
    plain = fine_model(mesh, np.full(mesh.n_cells, 2e11), regions=Regions.one(0.29, 7850.0, 2e11))
    other = solid([(STEEL, Everywhere()), (STEEL, OBLIQUE)])
    one, two = (solids.analysed(each, modes=20, tolerance=1e-8).values for each in (plain, other))
    assert np.allclose(one[6:], two[6:], rtol=1e-7)


@pytest.mark.parametrize("shares", [(), (0.5,)], ids=["whole", "divided"])
@pytest.mark.parametrize("resolution", [12, 20, 21])
def test_regions_have_their_volumes_where_the_surface_cuts_cells(resolution, shares):
    """A bar with an arch, half of it by a plane that follows no lattice."""
    surface = builtin_surface("bar")
    points = np.random.default_rng(0).uniform(*surface.bounds, (200_000, 3))
    points = points[surface.contains(points)]
    share = (points @ [1.0, 0.3, 0.0] > 0.02).mean()
    cells = divided(covering(surface, resolution), shares)
    regions = [(STEEL, Everywhere()), (BRASS, Expression("x + 0.3 * y > 0.02"))]
    placed = composed(regions, surface).of_cells(cells)
    young = placed.regions.moduli(placed.region)
    model = finite_cell_model(cells, young, placed.regions, placed.region, placed.shared)
    found = (model.density - STEEL.density[0]) / (BRASS.density[0] - STEEL.density[0])
    assert found == pytest.approx(share, abs=2e-3)
    assert (np.linalg.eigvalsh(model.nodal_mass())[:, 0] > 0.0).all()
