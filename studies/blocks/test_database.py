"""The database of metamaterials: what it stores, what it finds, what stands for what."""

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.block import symmetries
from dataset_gen.objectives import fit
from dataset_gen.sampling import moduli
from studies.blocks.cases import CASES
from studies.blocks.combinations import cells_of, combination_keys, combinations
from studies.blocks.database import base_materials, build, load_databases, look_up, save_databases
from studies.blocks.farthest_points import farthest_points
from studies.blocks.methods import database_methods, databases_of

BASE = np.array([0.5, 2.0, 9.0])
WITH_VOID = np.array([0.0, 1.0, 6.0])


@pytest.fixture(scope="module", params=[BASE, WITH_VOID], ids=["solid", "void"])
def database(request):
    return build(request.param, representatives=None)


@pytest.fixture(scope="module")
def compressed():
    return build(WITH_VOID, representatives=40)


def images(young):
    """A block under all 48 symmetries: cell j goes to cell [g, j]."""
    return young[np.argsort(symmetries(), axis=1)]


@pytest.mark.parametrize(("materials", "count"), [(2, 22), (3, 267), (4, 1996)])
def test_combinations_are_counted_and_listed_up_to_symmetry(materials, count):
    keys = combination_keys(materials)
    assert combinations(materials) == len(keys) == count
    assert (np.diff(keys.astype(np.int64)) > 0).all()
    cells = cells_of(keys, np.arange(materials))
    powers = materials ** np.arange(8)
    np.testing.assert_array_equal(cells @ powers, keys)
    for block, key in zip(cells[::17], keys[::17], strict=True):
        assert (images(block) @ powers).min() == key


def test_blocks_of_base_materials_have_the_fit_that_is_stored(database):
    young = cells_of(database.keys, database.materials)
    found = look_up(database, young)
    alone = np.array([len(np.unique(images(block), axis=0)) == 48 for block in young])
    assert alone.any() and not alone.all()
    np.testing.assert_array_equal(found[alone], database.moduli[alone])
    np.testing.assert_allclose(found, fit("chen2015", young).moduli, rtol=1e-9)


@pytest.mark.parametrize("kind", ["whole", "compressed"])
def test_lookup_turns_with_the_block(kind, compressed):
    database = compressed if kind == "compressed" else build(WITH_VOID, representatives=None)
    generator = np.random.default_rng(0)
    young = np.exp(generator.uniform(-1.0, 3.0, (30, 8))) * (generator.random((30, 8)) < 0.7)
    symmetric = cells_of(database.keys, database.materials)[::9]
    for block in (*young[young.any(axis=1)], *symmetric):
        (found,) = look_up(database, block[None])
        np.testing.assert_allclose(look_up(database, images(block)), images(found), rtol=1e-13)


def test_nearest_is_meant_in_logarithm_and_ends_are_clamped():
    database = build(BASE, representatives=None)
    exact = look_up(database, BASE[[0, 1, 2, 0, 1, 1, 2, 0]][None])
    near = np.array([[0.99, 1.01, 4.3, 0.001, 4.2, 1.9, 1e6, 0.6]])  # bounds: 1 and 4.243
    np.testing.assert_array_equal(look_up(database, near), exact)


def test_filled_cells_stay_filled():
    database = build(WITH_VOID, representatives=None)
    faint = np.array([[1e-30, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0]])
    np.testing.assert_array_equal(look_up(database, faint), look_up(database, (faint > 0) * 1.0))


def test_representatives_are_stored_fits_within_the_radius(compressed):
    whole = build(WITH_VOID, representatives=None)
    assert len(compressed.moduli) == 40 and compressed.nbytes < whole.nbytes / 3
    stored = {tuple(row) for row in whole.moduli}
    assert all(tuple(row) in stored for row in compressed.moduli)
    away = np.log(compressed.moduli[compressed.entries] / whole.moduli)
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(compressed.radius, rel=1e-12)


def test_farthest_points_are_distinct_and_cover_ever_closer():
    points = np.random.default_rng(1).standard_normal((3000, 5))
    cover = farthest_points(points, 700)
    assert len(np.unique(cover.chosen)) == 700
    assert (np.diff(cover.radius) <= 0.0).all()
    gaps = np.linalg.norm(points[:, None] - points[cover.chosen][None], axis=2)
    np.testing.assert_allclose(
        np.take_along_axis(gaps, cover.nearest[:, None], 1), gaps.min(1)[:, None]
    )
    assert gaps.min(axis=1).max() == pytest.approx(cover.radius[-1])


def test_farthest_points_are_those_of_the_plain_algorithm():
    points = np.random.default_rng(2).standard_normal((900, 3))
    cover = farthest_points(points, 60)
    square = np.full(len(points), np.inf)
    new = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    for found in cover.chosen:
        assert found == new
        square = np.minimum(square, ((points - points[new]) ** 2).sum(axis=1))
        new = int(np.argmax(square))


def test_equal_points_need_one_representative():
    points = np.repeat(np.arange(4.0)[:, None], 200, axis=0)
    cover = farthest_points(points, 50)
    assert len(cover.chosen) == 4 and cover.radius[-1] == 0.0
    np.testing.assert_array_equal(points[cover.chosen][cover.nearest], points)
    with pytest.raises(UserError, match="at least 1"):
        farthest_points(points, 0)


@pytest.mark.parametrize("case", CASES[:4], ids=lambda case: case.name)
def test_base_materials_ascend_within_the_range(case):
    materials = base_materials(case.moduli, 6, case.void)
    assert len(materials) == 6 and (np.diff(materials) > 0.0).all()
    assert (materials[0] == 0.0) == case.void
    low, high = case.range_gpa
    assert low < materials[int(case.void)] and materials[-1] < high


@pytest.mark.parametrize(
    "materials",
    [[1.0], [2.0, 1.0], [1.0, 1.0], [-1.0, 1.0], [1.0, np.inf], np.arange(1.0, 14.0), [[1.0, 2.0]]],
)
def test_impossible_materials_are_refused(materials):
    with pytest.raises(UserError, match="base materials"):
        build(materials)


@pytest.mark.parametrize(
    ("young", "match"),
    [
        (np.ones(8), "shape"),
        (-np.ones((1, 8)), "negative"),
        (np.full((1, 8), np.nan), "finite"),
        (np.array([[1.0] * 8, [0.0] + [1.0] * 7]), "block 1 is not in the database"),
    ],
)
def test_impossible_blocks_are_refused(young, match):
    with pytest.raises(UserError, match=match):
        look_up(build(BASE, representatives=None), young)


def test_void_blocks_are_refused(compressed):
    with pytest.raises(UserError, match="block 0"):
        look_up(compressed, np.zeros((1, 8)))


def test_file_gives_the_databases_back(tmp_path, compressed):
    other = build(base_materials(moduli("log-uniform"), 3), representatives=None)
    save_databases(tmp_path / "two.h5", [compressed, other])
    young = np.random.default_rng(3).uniform(0.1, 20.0, (50, 8))
    for stored, database in zip(
        load_databases(tmp_path / "two.h5"), (compressed, other), strict=True
    ):
        assert stored.seconds == database.seconds and stored.nbytes == database.nbytes
        np.testing.assert_array_equal(look_up(stored, young), look_up(database, young))


def test_damaged_file_is_refused(tmp_path, compressed):
    path = tmp_path / "one.h5"
    save_databases(path, [compressed])
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(UserError, match="damaged"):
        load_databases(path)


def test_databases_of_a_table_are_built_once(tmp_path):
    path = tmp_path / "all.h5"
    first = databases_of(CASES, 0.25, path, materials=3)
    again = databases_of(CASES, 0.25, path, materials=3)
    assert set(first) == set(again) == {case for case in CASES if case.scaled_by == 1.0}
    for case, database in first.items():
        assert again[case].seconds == database.seconds
    with pytest.raises(UserError, match="4 materials"):
        databases_of(CASES, 0.25, path, materials=4)
    with pytest.raises(UserError, match=r"0\.3"):
        databases_of(CASES, 0.3, path, materials=3)


def test_every_case_meets_the_database_of_its_range_and_lower_ones():
    databases = databases_of(CASES, 0.25, materials=2)
    names = [[method.name for method in database_methods(case, databases)] for case in CASES]
    low, high = "database 0..10 GPa", "database 100..10000 GPa"
    chen = "Chen et al. 2015, "
    assert names[0] == [chen + low]
    assert names[1] == [f"{chen}{low}, clamped", chen + high]
    assert names[3] == [chen + low]
    assert names[4] == [f"{chen}{low}, clamped"]
