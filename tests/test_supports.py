"""Solids that are held, rest on springs or carry masses."""

import numpy as np
import pytest
import scipy.sparse as sp
import trimesh
from scipy.sparse.linalg import eigsh

from carillon.composition.places import Expression
from carillon.composition.supports import Support, placed_supports
from carillon.errors import ConvergenceError, UserError
from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import hexmesh_from_voxels, voxelize
from carillon.fem.model import fine_model
from carillon.fem.regions import Regions
from carillon.fem.supports import Supports
from solver.accuracy.estimate import estimate_cell_errors
from solver.assembly.sparse import assembled
from solver.coarsening.choice import make_coarsening
from solver.coarsening.model import build_model
from tests import solids

LENGTH, WIDTH, HEIGHT = 0.2, 0.02, 0.01
BAR = trimesh.creation.box(extents=[LENGTH, WIDTH, HEIGHT])
YOUNG, POISSON, DENSITY = 2e11, 0.3, 7800.0
REGIONS = Regions.one(POISSON, DENSITY, YOUNG)
END = Expression(f"x < {-LENGTH / 2 + 1e-6}")
KINDS = ("voxel", "finite-cell")


def bar(kind, *supports, resolution=40, surface=BAR):
    """A bar that is held somehow."""
    if kind == "voxel":
        mesh = hexmesh_from_voxels(voxelize(surface, resolution))
        free = fine_model(mesh, np.full(mesh.n_cells, YOUNG), regions=REGIONS)
    else:
        cells = finite_cells(surface, resolution)
        free = finite_cell_model(cells, np.full(cells.mesh.n_cells, YOUNG), REGIONS)
    return free.with_supports(placed_supports(supports, free, surface))


def held(text, axes=(True, True, True), **how):
    return Support(f"support {text!r}", Expression(text), axes=axes, **how)


def hertz(model, count=6):
    K, M = (matrix.tocsc() for matrix in assembled(model))
    values = eigsh(K, count, M, sigma=-1e3, return_eigenvectors=False)
    return np.sqrt(np.maximum(np.sort(values), 0.0)) / (2.0 * np.pi)


def euler_bernoulli(wavenumbers, height=HEIGHT):
    """Frequencies [Hz] of bending of the bar with these products of wave number and length."""
    speed = np.sqrt(YOUNG / DENSITY) * height / np.sqrt(12.0)
    return np.square(wavenumbers) * speed / (2.0 * np.pi * LENGTH**2)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("supports", "rigid"),
    [
        ((), 6),
        ((Support("end", END),), 0),
        ((held("z < -0.00499", (False, False, True)),), 3),
        ((held("z < -0.00499", (True, True, False)),), 3),
        ((held("z < 0.001", (True, True, False)),), 1),
        ((Support("point", point=(0.0, 0.0, 0.0)),), 3),
        (tuple(Support("two", point=(x, 0.0, 0.0)) for x in (-0.05, 0.05)), 1),
        ((Support("mass", point=(0.0, 0.0, 0.005), mass=0.1),), 6),
        ((held("x > 0.0999", spring=np.array(1e8)),), 0),
    ],
)
def test_supports_leave_rigid_motions(kind, supports, rigid):
    model = bar(kind, *supports, resolution=16)
    assert model.rigid_modes == rigid
    modes = solids.analysed(model, modes=12, tolerance=1e-8)
    assert modes.evidence["rigid_modes"] == rigid
    assert modes.rigid == rigid
    frequencies = np.sqrt(np.maximum(modes.values, 0.0)) / (2.0 * np.pi)
    assert (frequencies[:rigid] < 1e-3 * frequencies[rigid]).all()


def test_held_nodes_are_as_if_taken_out():
    model = bar("voxel", Support("end", END), resolution=20)
    K, M = (matrix.tocsr() for matrix in assembled(model.with_supports(None)))
    left = np.flatnonzero(np.repeat(model.mesh.nodes[:, 0] > -LENGTH / 2 + 1e-6, 3))
    inside = (sp.csc_matrix(matrix[left][:, left]) for matrix in (K, M))
    stiffness, mass = inside
    values = np.sort(eigsh(stiffness, 10, mass, sigma=0.0, return_eigenvectors=False))
    found = solids.analysed(model, modes=10, tolerance=1e-10).values
    assert np.allclose(found, values, rtol=1e-3)


def test_a_clamped_bar_bends_as_euler_and_bernoulli_say():
    expected = euler_bernoulli(np.array([1.8751, 4.6941]))
    found = hertz(bar("finite-cell", Support("end", END), resolution=60), 5)
    sideways = euler_bernoulli(np.array([1.8751]), WIDTH)
    assert found[0] == pytest.approx(expected[0], rel=5e-3)
    assert found[1] == pytest.approx(sideways[0], rel=1e-2)
    # Shear and the inertia of turning lower the second one by some per cent.
    assert 0.96 < found[2] / expected[1] < 1.0


@pytest.mark.parametrize("kind", KINDS)
def test_a_bar_held_at_both_ends(kind):
    model = bar(kind, Support("end", END), held(f"x > {LENGTH / 2 - 1e-6}"), resolution=60)
    expected = euler_bernoulli(np.array([4.7300]))[0]
    # Voxels are too stiff in bending.
    assert hertz(model, 3)[0] == pytest.approx(expected, rel=0.02 if kind == "finite-cell" else 0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_soft_springs_carry_a_rigid_body(kind):
    by_area = 1e5
    model = bar(kind, held("z < -0.00499", spring=np.array(by_area)), resolution=16)
    expected = np.sqrt(by_area * LENGTH * WIDTH / model.mass) / (2.0 * np.pi)
    found = hertz(model, 7)
    assert np.abs(found[:6] / expected - 1.0).min() < 1e-3
    assert found[5] < 10.0 * expected
    assert found[6] > 100.0 * expected


@pytest.mark.parametrize("kind", KINDS)
def test_a_heavy_mass_at_the_end_of_a_clamped_bar(kind):
    mass = 10.0
    tip = Support("tip", point=(LENGTH / 2, 0.0, 0.0), mass=mass)
    model = bar(kind, Support("end", END), tip, resolution=40)
    stiffness = 3.0 * YOUNG * WIDTH * HEIGHT**3 / 12.0 / LENGTH**3
    expected = np.sqrt(stiffness / mass) / (2.0 * np.pi)
    # Voxels are too stiff in bending, and points give way a little.
    assert hertz(model, 1)[0] == pytest.approx(expected, rel=0.1 if kind == "voxel" else 0.03)


def test_a_pad_is_stiffer_across_than_along():
    across, along = (
        bar("voxel", held("z < -0.00499", axes, pad=(4e5, 1e5)), resolution=16)
        for axes in ((False, False, True), (True, True, False))
    )
    lowest = [hertz(model, 4)[-1] for model in (across, along)]
    assert across.rigid_modes == 3
    assert along.rigid_modes == 3
    assert lowest[0] > lowest[1]


@pytest.mark.parametrize("method", ["hcms", "lanczos", "lobpcg", "slepc"])
@pytest.mark.parametrize("kind", KINDS)
def test_all_methods_find_the_modes_of_held_solids(kind, method):
    model = bar(kind, Support("end", END), resolution=24)
    if (kind, method) == ("finite-cell", "lobpcg"):
        # Multigrid hardly converges where cells are nearly empty, and says so.
        with pytest.raises(ConvergenceError, match="use --method lanczos"):
            solids.analysed(model, modes=12, method=method, tolerance=1e-8)
        return
    found = solids.analysed(model, modes=12, method=method, tolerance=1e-8).values
    assert np.allclose(np.sqrt(found) / (2.0 * np.pi), hertz(model, 12), rtol=1e-6)


def test_coarse_models_of_held_solids_are_as_good_as_of_free_ones():
    errors = []
    for supports in ((), (Support("end", END),)):
        fine = bar("voxel", *supports, resolution=60)
        coarsening = make_coarsening("ddfem", POISSON)
        coarse = build_model(fine.mesh, fine.young[:, 0], coarsening, **fine.constants)
        assert coarse.rigid_modes == fine.rigid_modes
        exact, found = (hertz(each, 14)[fine.rigid_modes :] for each in (fine, coarse))
        errors.append(np.sqrt(np.mean((found / exact - 1.0)[:8] ** 2)))
    assert errors[1] < 1.2 * errors[0]


def test_the_expected_error_of_held_cells_is_about_theirs():
    model, finer = (bar("finite-cell", Support("end", END), resolution=n) for n in (16, 48))
    modes = solids.analysed(model, modes=20, tolerance=1e-8)
    whole = modes.system.gather(modes.vectors)
    expected = estimate_cell_errors(model, modes.values, whole).errors
    assert expected.rigid == 0
    error = np.sqrt(modes.values[:10]) / (2.0 * np.pi) / hertz(finer, 10) - 1.0
    rms = np.sqrt(np.mean(error**2))
    assert 0.3 * rms < np.sqrt(np.mean(expected.errors[:10] ** 2)) < 4.0 * rms


@pytest.mark.parametrize(
    ("support", "said"),
    [
        (held("z > 1"), "meets nothing of solid 'mesh', which has -0.1 <= x <= 0.1"),
        (held("z > 1", spring=np.array(1.0)), "meets nothing"),
        (held("z > -1"), "nothing is left that vibrates"),
        (Support("far", point=(1.0, 0.0, 0.0)), "is 90 cm off solid 'mesh'"),
    ],
)
def test_supports_that_hold_nothing_or_everything(support, said):
    with pytest.raises(UserError, match=said):
        bar("voxel", support, resolution=16)


def test_a_point_near_the_surface_is_moved_to_it():
    model = bar("finite-cell", Support("near", point=(0.0, 0.0, 0.006)), resolution=16)
    assert model.supports.positions[0, 2] == pytest.approx(HEIGHT / 2)


def test_free_motions_do_not_depend_on_how_stiff_springs_are():
    positions = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    springs = np.eye(3) * np.array([1e-6, 1.0, 1e12])[:, None, None]
    assert Supports(positions, springs, np.zeros(3)).free_motions(np.zeros(3), 1.0).shape == (6, 0)
    line = Supports(positions[:2], springs[:2], np.zeros(2))
    assert line.free_motions(np.zeros(3), 1.0).shape == (6, 1)


def described(tmp_path, run_cli, text, *options):
    """Frequencies [Hz] of the built-in bar with what a file says."""
    from solver.files.modes_file import read_modes

    (tmp_path / "held.yaml").write_text(text)
    run_cli(
        *("solver", "modes", "builtin:bar", "--resolution", 16, "--modes", 10, "--no-estimate"),
        *("--regions", tmp_path / "held.yaml", "--out", tmp_path / "out.h5", *options),
        check=True,
    )
    return read_modes(tmp_path / "out.h5")


def test_a_mass_within_a_radius_is_a_mass(tmp_path, run_cli):
    text = "supports: [{at: [0, 0, 0.03], radius: 0.02, mass: 0.1}]\n"
    file = described(tmp_path, run_cli, text)
    assert file.model.rigid_modes == 6
    assert file.model.supports.mass.sum() == pytest.approx(0.1)
    assert not file.model.supports.stiffness.any()


def test_a_region_that_is_held_is_what_later_ones_leave_of_it(tmp_path, run_cli):
    regions = (
        "regions:\n  - {name: a, material: iron}\n  - {name: b, material: beech, where: 'x > 0'}\n"
    )
    by_name, by_place = (
        described(tmp_path, run_cli, f"{regions}supports: [{{where: '{where}'}}]\n").frequencies
        for where in ("region:a", "x <= 0")
    )
    assert np.allclose(by_name, by_place, rtol=1e-6)


@pytest.mark.mpi
@pytest.mark.parametrize("kind", KINDS)
def test_held_solids_of_several_materials_on_ranks(kind, mpiexec, tmp_path):
    from solver.files.modes_file import read_modes

    (tmp_path / "regions.yaml").write_text(
        "regions:\n"
        "  - {name: body, material: iron}\n"
        "  - {name: handle, material: spruce, grain: [1, 0.2, 0], where: 'x > 0.013'}\n"
        "supports: [{where: 'x < -0.11'}]\n"
    )
    spectra = []
    for ranks in (1, 2, 3):
        out = tmp_path / f"{ranks}.h5"
        mpiexec(
            *(ranks, "solver", "modes", "builtin:bar", "--resolution", 20, "--modes", 16),
            *("--discretisation", kind, "--regions", tmp_path / "regions.yaml"),
            *("--tolerance", 1e-9, "--no-estimate", "--out", out),
            check=True,
        )
        spectra.append(read_modes(out).eigenvalues)
    for other in spectra[1:]:
        assert np.allclose(other, spectra[0], rtol=2e-8)
