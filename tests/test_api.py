"""The public surface, `import carillon as ca`: whole, light, and the same as what it stands on."""

from dataclasses import replace

import h5py
import meshio
import numpy as np
import pytest

import carillon as ca
from carillon import api
from carillon.fem.geometry import HexMesh
from tests.programs import CHECKOUT, python


@pytest.fixture(scope="module")
def bar() -> ca.Solution:
    return ca.solve("builtin:bar", "two-region", resolution=12, modes=12)


def test_all_names_are_there_and_documented():
    page = (CHECKOUT / "docs" / "reference" / "api.md").read_text()
    for name in ca.__all__:
        assert getattr(ca, name).__doc__
        assert f"carillon.{name}\n" in page


def test_import_loads_no_room_and_no_numpy():
    program = "import sys, carillon as ca; ca.UserError; print(*sys.modules)"
    done = python("-c", program)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert loaded.isdisjoint({"numpy", "mpi4py", "petsc4py", "numba", "solver", "sound", "forests"})


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Bell'"):
        ca.Bell  # noqa: B018


def test_members_that_the_page_names_are_documented():
    page = (CHECKOUT / "docs" / "reference" / "api.md").read_text()
    for name in ("n_nodes", "n_cells", "n_dofs", "volume", "nodes", "hanging"):
        assert name in page
        member = getattr(HexMesh, name, None)
        assert not isinstance(member, property) or member.__doc__


def test_a_mesh_of_arrays_is_that_of_its_file():
    read = ca.load_mesh("builtin:bell", unit=2.0)
    made = ca.Mesh.of_triangles(read.vertices, read.faces)
    assert np.array_equal(made.hexahedra(12).cells, read.hexahedra(12).cells)


@pytest.mark.parametrize("faces", [[[0, 1, 9]], np.empty((0, 3)), [[0, 1, 2]]])
def test_arrays_that_are_no_solid_are_refused(faces):
    with pytest.raises(ca.UserError):
        ca.Mesh.of_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces, "flat")


@pytest.mark.parametrize(
    "young",
    [2e9, "two-region", lambda centres: 1e9 + centres[:, 0] * 1e9, np.array(3e9)],
    ids=["number", "name", "function", "array"],
)
def test_moduli_are_positive_and_one_a_voxel(young):
    mesh = ca.load_mesh("builtin:bar").hexahedra(12)
    moduli = ca.Material(young).moduli(mesh)
    assert moduli.shape == (mesh.n_cells,) and (moduli > 0.0).all()


def test_a_modulus_alone_keeps_the_constants_of_a_solid(bar):
    solid = ca.solve("builtin:bar", ca.Material.named("steel"), resolution=8, modes=8).solid
    again = ca.solve(solid, 2.0 * solid.young, modes=8).solid
    assert (again.density, again.poisson) == (7850.0, solid.poisson)


def test_a_solution_is_the_same_after_its_file(bar, tmp_path):
    bar.save(tmp_path / "bar.h5")
    read = ca.read(tmp_path / "bar.h5")
    assert np.array_equal(read.shapes, bar.shapes)
    assert np.array_equal(read.frequencies, bar.frequencies)
    assert ca.compare(read, bar).eigenvalue_relative_error["max"] == 0.0
    assert ca.audit(tmp_path / "bar.h5").faults == []
    with h5py.File(tmp_path / "bar.h5") as file:
        assert file["modes"].shape == (bar.mesh.n_dofs, 12)


def test_paraview_is_given_every_mode_and_hexahedra_that_are_right_way_out(bar, tmp_path):
    bar.to_vtu(tmp_path / "bar.vtu")
    grid = meshio.read(tmp_path / "bar.vtu")
    assert len(grid.point_data) == 12
    corners = grid.points[grid.cells_dict["hexahedron"]]
    sides = [corners[:, k] - corners[:, 0] for k in (1, 3, 4)]
    volumes = np.einsum("ci,ci->c", np.cross(sides[0], sides[1]), sides[2])
    assert volumes.sum() == pytest.approx(bar.mesh.volume)
    shape = next(values for name, values in grid.point_data.items() if name.startswith("mode 7,"))
    assert np.allclose(shape, bar.shapes[6])


def test_a_figure_says_its_mode(bar):
    assert bar.plot(7).axes[0].get_title().startswith("mode 7, ")


def test_finite_cells_are_solved_drawn_and_written(tmp_path):
    cells = ca.solve("builtin:bar", resolution=8, modes=8, discretisation="finite-cell")
    cells.plot(7)
    cells.to_vtu(tmp_path / "cells.vtu")
    assert ca.audit(cells).faults == []


def test_two_strikes_are_the_sum_of_each(bar):
    at = bar.mesh.nodes[[0, -1]]
    both = ca.render(bar, at, times=[0.0, 0.1], seconds=0.4, raw=True)
    first, second = (ca.render(bar, each, seconds=0.4, raw=True) for each in at)
    delay = round(0.1 * api.SAMPLE_RATE)
    basis = np.stack([first, np.concatenate([np.zeros(delay), second[:-delay]])])
    assert np.linalg.lstsq(basis.T, both, rcond=None)[1][0] < 1e-12 * both @ both


def test_a_solid_sounds_by_the_damping_of_its_material(tmp_path):
    brass = ca.Material.named("brass")
    solution = ca.solve("builtin:bell", brass, resolution=12, modes=9)
    at = solution.mesh.nodes[0]
    samples = ca.render(solution, at)
    assert np.array_equal(samples, ca.render(solution, at, damping=brass.damping))
    assert len(samples) > 4 * len(ca.render(solution, at, damping=api.DAMPING))
    softer = ca.solve(solution.solid, 0.9 * solution.solid.young, modes=9)
    coarse = ca.coarsen("builtin:bar", brass, resolution=8, method="average")
    cells = ca.solve("builtin:bar", brass, resolution=6, modes=7, discretisation="finite-cell")
    cells.save(tmp_path / "cells.h5")
    of_file = ca.read(tmp_path / "cells.h5")
    for solid in (softer.solid, coarse, of_file.solid):
        assert solid.damping == brass.damping
    solution.save(tmp_path / "bell.h5")
    assert np.array_equal(ca.render(tmp_path / "bell.h5", at), samples)
    assert ca.compare(tmp_path / "bell.h5", solution).frequency_rms_relative_error == 0.0
    table = solution.solid.regions
    undamped = solution.solid.with_regions(replace(table, damping=(None,)))
    replace(solution, solid=undamped).save(tmp_path / "old.h5")
    default = ca.render(solution, at, damping=api.DAMPING)
    assert np.array_equal(ca.render(tmp_path / "old.h5", at), default)


PAN = [
    ca.Region("body", material="iron"),
    ca.Region("handle", material="beech", grain=(1, 0, 0), where="x > 0.02"),
]


def test_regions_by_text_by_function_and_of_a_file_are_the_same_solid(tmp_path):
    chosen = ca.Region(
        "handle", material="beech", grain=(1, 0, 0), where=lambda points: points[:, 0] > 0.02
    )
    bodies = ("builtin:bar", ca.load_mesh("builtin:bar").hexahedra(12))
    solutions = [
        ca.solve(body, ca.Material(regions=regions), resolution=12, modes=9)
        for body in bodies
        for regions in (PAN, [PAN[0], chosen])
    ]
    for solution in solutions[1:]:
        np.testing.assert_allclose(solution.frequencies[6:], solutions[0].frequencies[6:])
    solid = solutions[0].solid
    assert solid.regions.names == ("body", "handle") and solid.density > 1000.0
    solutions[0].save(tmp_path / "pan.h5")
    assert ca.read(tmp_path / "pan.h5").solid.regions.names == ("body", "handle")
    halved = ca.solve("builtin:bar", ca.Material(regions=PAN, factor=0.25), resolution=12, modes=9)
    np.testing.assert_allclose(2.0 * halved.frequencies[6:], solutions[0].frequencies[6:])
    mesh = bodies[1]
    material = ca.Material(regions=PAN)
    assert np.array_equal(material.moduli(mesh), solid.young[:, 0])


@pytest.mark.parametrize("discretisation", ["voxel", "finite-cell"])
def test_a_held_solid_has_no_rigid_modes(discretisation):
    how = {"resolution": 12, "modes": 8, "discretisation": discretisation}
    material = ca.Material(regions=PAN)
    held = ca.solve("builtin:bar", material, fix="x < -0.11", **how)
    same = ca.solve("builtin:bar", material, supports=[ca.Support(where="x < -0.11")], **how)
    assert held.solid.rigid_modes == 0 and held.frequencies[0] > 10.0
    np.testing.assert_allclose(held.frequencies, same.frequencies)
    loaded = ca.Support(at=(0.1, 0.0, 0.03), mass=0.5)
    heavier = ca.solve("builtin:bar", material, fix="x < -0.11", supports=[loaded], **how)
    assert (heavier.frequencies < held.frequencies).all()


def test_regions_whose_damping_is_not_known_have_that_of_the_material():
    regions = [ca.Region("a", young=1e9), ca.Region("b", material="steel", where="x > 0")]
    solution = ca.solve(
        "builtin:bar", ca.Material(regions=regions, damping=(3.0, 1e-7)), resolution=8, modes=8
    )
    steel = ca.Material.named("steel").damping
    assert solution.solid.regions.damping == ((3.0, 1e-7), steel)
    coarse = ca.coarsen("builtin:bar", ca.Material(regions=regions), resolution=8, fix="x < -0.11")
    assert coarse.rigid_modes == 0 and len(coarse.regions) == 2


MISTAKES = [
    (lambda _: ca.Region("a", where="x < 1", box=((0, 0, 0), (1, 1, 1))), "expected one place"),
    (lambda _: ca.Region("a", where=5), "where: found 5, expected comparisons"),
    (lambda _: ca.Support(mass=1.0), "expected where, at or painted"),
    (lambda _: ca.Material(2e9, regions=PAN), "found young beside regions"),
    (lambda _: ca.Material(regions=PAN, density=900.0), "found density beside regions"),
    (lambda _: ca.Material(factor=2.0), "factor goes with regions"),
    (lambda _: ca.Material(regions=[PAN[0]] * 2), "two regions are called 'body'"),
    (lambda _: ca.Material(regions=["iron"]), "regions: found 'iron', expected regions"),
    (lambda bar: ca.solve(bar.solid, ca.Material(regions=PAN)), "a solid keeps what it has"),
    (lambda bar: ca.solve(bar.solid, fix="x < 0"), "a solid keeps what it has"),
    (lambda _: ca.solve("builtin:bar", fix=5), "fix: found 5"),
    (lambda _: ca.solve("builtin:bar", fix="x >", resolution=8), "cannot be read"),
    (lambda _: ca.solve("builtin:bar", supports=["x"]), "supports: found 'x'"),
    (
        lambda _: ca.solve("builtin:bar", ca.Material(regions=PAN, factor=[1.0, 2.0]), 8),
        r"factor: an array of shape \(2,\)",
    ),
    (
        lambda _: ca.load_mesh("builtin:bar", unit="ell"),
        "unit: found 'ell', expected one of m, cm, mm",
    ),
    (lambda _: ca.load_mesh(5), "found 5, expected the path of a mesh file"),
    (lambda _: ca.Mesh.of_triangles("a", "b", "it"), "it: could not convert"),
    (lambda _: ca.Material(density="heavy"), "density: found 'heavy', expected a number"),
    (lambda _: ca.Material(density="7850"), "density: found '7850', expected a number"),
    (lambda _: ca.Material(poisson="a"), "poisson: found 'a', expected a number"),
    (lambda _: ca.Material(seed=-1), "seed: found -1, expected at least 0"),
    (lambda _: ca.Material(seed=1.5), "seed: found 1.5, expected a whole number"),
    (lambda _: ca.Material(damping=5), "damping: found 5, expected a list: Rayleigh"),
    (lambda _: ca.Material(damping=(1.0, np.nan)), r"damping\[1\]: found nan, expected a finite"),
    (lambda _: ca.Material(damping=(-500, 0)), r"damping\[0\]: found -500, expected at least 0"),
    (lambda _: ca.Material({}), "young: found {}, expected a modulus"),
    (lambda _: ca.Material([1e9, [2e9]]), "young: found .* expected a modulus"),
    (lambda bar: ca.Material(-1.0).moduli(bar.mesh), "young: .* are negative"),
    (lambda bar: ca.Material(lambda _: 1e9).moduli(bar.mesh), r"young: an array of shape \(\)"),
    (lambda _: ca.solve("builtin:bar", "brass"), r"give Material.named\('brass'\)"),
    (lambda _: ca.solve("builtin:bar", resolution="8"), "resolution: found '8', expected a whole"),
    (lambda _: ca.solve("builtin:bar", discretisation="voxels"), "did you mean voxel"),
    (lambda bar: ca.solve(bar.solid, modes="8"), "modes: found '8', expected a whole number"),
    (lambda bar: ca.solve(bar.solid, modes=10**6), "ask for fewer or raise the resolution"),
    (lambda bar: ca.solve(bar.solid, seed=-1), "seed: found -1, expected at least 0"),
    (lambda bar: ca.solve(bar.solid, initial=5), "found 5, expected a solution or the path"),
    (lambda bar: ca.Material.named(None), "there is no material None, only "),
    (lambda bar: ca.solve("builtin:bar", resolution=8, initial=bar), "modes of another mesh"),
    (lambda bar: ca.solve(bar.solid, modes=40, initial=bar), "initial modes, 40 are wanted"),
    (lambda _: ca.load_mesh("builtin:bar").hexahedra("8"), "resolution '8': expected a whole"),
    (lambda bar: bar.plot(13), "mode 13: expected a whole number, 1 to 12"),
    (lambda bar: bar.plot("7"), "mode '7': expected a whole number, 1 to 12"),
    (lambda bar: ca.render(bar), "no target; name a point"),
    (lambda bar: ca.render(bar, [0, 0, 0], target="end"), "expected at, the points"),
    (lambda bar: ca.render(bar, target="end"), "target: a modes file knows neither targets"),
    (lambda bar: ca.render(bar, [0, 0, 0], seconds=-1), "seconds: found -1, expected above 0 s"),
    (lambda bar: ca.render(bar, [0, 0, 0], seconds=1e9), "expected at most 600 s"),
    (lambda bar: ca.render(bar, [0, 0, 0], seconds=600, rate=768_000), "expected 1 to 67,108,864"),
    (lambda bar: ca.render(bar, [0, 0, 0], rate=0), "rate: found 0, expected at least 1,000"),
    (lambda bar: ca.render(bar, [np.nan] * 3), "found nan, expected a finite number"),
    (lambda bar: ca.render(bar, [0, 0]), r"at\[0\]: found \[0, 0\], expected 3 of them"),
    (lambda bar: ca.render(bar, np.empty((0, 3))), "at: found .* expected at least 1 of them"),
    (lambda bar: ca.render(bar, [0, 0, 0], times=[0, 1]), "times: 2 of them, expected 1$"),
    (lambda bar: ca.render(bar, [0, 0, 0], strength="loud"), r"strength\[0\]: found 'loud'"),
    (lambda bar: ca.render(bar, [0, 0, 0], damping=(-500, 0)), r"damping\[0\]: found -500"),
    (lambda bar: ca.render(bar, [0, 0, 0], damping=5), "damping: found 5, expected a list"),
    (lambda _: ca.render(5, [0, 0, 0]), "found 5, expected a solution or the path"),
    (lambda bar: ca.compare("there is none.h5", bar), "there is none.h5: no such file"),
    (lambda bar: ca.audit(bar, tolerance="a"), "tolerance: found 'a', expected a number"),
    (lambda _: ca.write_wav("a.wav", [0.5], rate=-1), "rate: found -1, expected at least 1,000"),
    (lambda _: ca.write_wav("a.wav", [0.5], bits=8), "bits: found 8, expected 16, 24 or 32"),
    (lambda _: ca.write_wav("a.wav", []), r"samples: found \[\], expected samples \(s,\)"),
    (lambda _: ca.write_wav("a.wav", ["loud"]), "samples: found .'loud'., expected samples"),
    (lambda _: ca.extract(["loud"]), "clip: found .'loud'., expected a file or samples"),
    (lambda _: ca.extract("clip.wav", modes=0), "modes: found 0, expected at least 1"),
    (lambda _: ca.generate("shard.h5", "3"), "samples: found '3', expected a whole number"),
    (lambda _: ca.generate("shard.h5", 3, workers="all"), "workers: found 'all', expected a whole"),
]


@pytest.mark.parametrize(("call", "sentence"), MISTAKES, ids=[row[1] for row in MISTAKES])
def test_a_mistake_in_a_call_is_one_sentence(bar, call, sentence):
    with pytest.raises(ca.UserError, match=sentence):
        call(bar)


def test_a_design_sounds_as_its_clip_and_is_exported(tmp_path):
    seconds = np.arange(4000) / 8000
    partials = [np.sin(2.0 * np.pi * hertz * seconds) for hertz in (700.0, 1300.0)]
    ca.write_wav(tmp_path / "clip.wav", 0.3 * np.exp(-6.0 * seconds) * np.sum(partials, 0), 8000)
    found = ca.design(
        mesh="builtin:bar",
        resolution=8,
        coarsen="none",
        material={"dimensions": 4},
        targets=[{"name": "end", "vertex": 0, "clip": str(tmp_path / "clip.wav")}],
        optimiser={"evaluations": 4, "workers": 1},
    )
    assert len(found.frequencies) == len(found.target_frequencies)
    assert np.abs(found.render(target="end", seconds=0.1)).max() > 0.0
    found.export(tmp_path / "moduli.npy")
    assert np.array_equal(np.load(tmp_path / "moduli.npy").ravel(), found.young)
    found.save(tmp_path / "design.h5")
    assert np.array_equal(ca.read(tmp_path / "design.h5").young, found.young)


def test_forests_are_trained_and_coarsen_a_solid(tmp_path):
    ca.generate(tmp_path / "shard.h5", 400, seed=1)
    forests = ca.train([tmp_path / "shard.h5"], tmp_path / "forests.h5", trees=1, min_leaf=10)
    assert forests.scores
    solid = ca.coarsen("builtin:bar", resolution=12, forests=forests)
    assert isinstance(solid.mesh, HexMesh) and solid.n_dofs < 3 * 68


def test_forests_take_no_shard_s_place(tmp_path):
    shard = tmp_path / "shard.h5"
    ca.generate(shard, samples=10)
    before = shard.read_bytes()
    with pytest.raises(ca.UserError, match="is an input and would be replaced"):
        ca.train(shard, shard, trees=1)
    assert shard.read_bytes() == before


@pytest.mark.mpi
def test_ranks_solve_together(tmp_path, bar, mpiexec):
    script = tmp_path / "script.py"
    script.write_text(
        "import carillon as ca\n"
        "found = ca.solve('builtin:bar', 'two-region', resolution=12, modes=12)\n"
        f"found.save({str(tmp_path / 'bar.h5')!r})\n"
        "print(len(found.frequencies))\n"
    )
    assert mpiexec(2, script, check=True).stdout.split() == ["12", "12"]
    assert ca.compare(ca.read(tmp_path / "bar.h5"), bar).eigenvalue_relative_error["max"] < 1e-6
