"""Designs of real materials: what a project may ask for, the search for them, and what it costs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from carillon.composition.materials import named_material
from carillon.errors import UserError
from carillon.fem.regions import Regions
from solver.files.modes_file import frequencies
from sound.__main__ import main
from sound.building.cost_of_build import with_cost_of_build
from sound.building.flips import FlipLimits, improved
from sound.building.grouping import cubes, width_of
from sound.building.restriction import built, known_width
from sound.building.rounding import roundings
from sound.building.voxel_solid import VoxelSolid
from sound.design.optimise import optimise
from sound.design.preparation import prepare
from sound.project.build import BuildSettings
from sound.project.design_file import read_design, write_design
from sound.project.project import project_of
from tests import small_project

TWO = {"materials": ["steel", "aluminium"], "evaluations": 20}
INFILL = {"infill": "pla", "infill_levels": 4, "evaluations": 16}
REGIONS = [
    {"name": "body", "material": "iron"},
    {"name": "end", "material": "brass", "where": "x > 0.031"},
    {"name": "start", "material": "tin", "where": "x < -0.031"},
]


def project(folder, build, **keys):
    """A project of a small bar, whose clips say nothing."""
    for target in small_project.PROJECT["targets"]:
        (folder / target["clip"]).touch()
    described = {**small_project.PROJECT, "build": build, **keys}
    described["optimiser"] = {**described["optimiser"], "evaluations": 20}
    return project_of(described, folder)


def designed(folder, build, **keys):
    """A problem and its design, a continuous field."""
    made = project(folder, build, **keys)
    problem = prepare(made, small_project.targets(made))
    return problem, optimise(problem)


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    return designed(tmp_path_factory.mktemp("build"), TWO)


def described(folder, build):
    """Arguments that design a bar by clips of four partials, in a file."""
    small_project.write_clips(folder, np.array([400.0, 930.0, 1700.0, 2600.0]))
    keys = {**small_project.PROJECT, "build": build, "modes": 4}
    keys["optimiser"] = {"seconds": None, "evaluations": 12, "workers": 1}
    (folder / "bar.yaml").write_text(yaml.safe_dump(keys))
    return ["design", str(folder / "bar.yaml"), "--out", str(folder / "bar.h5")]


def asking(problem, **build):
    """The problem with another build."""
    return replace(problem, project=replace(problem.project, build=BuildSettings(**build)))


@pytest.mark.parametrize("build", [TWO, INFILL, {**TWO, "at_least": 0.02, "size": "mesh"}])
def test_every_voxel_has_one_of_the_materials(build, field):
    problem, design = asking(field[0], **build), field[1]
    table = BuildSettings(**build).choices().table
    made = built(problem, design)
    number = made.fine_region
    assert len(number) == problem.setting.mesh.n_cells and number.max() < len(table)
    assert np.array_equal(made.young, table.young[number])
    model = made.model
    assert np.array_equal(model.young, np.repeat(table.young[number][:, None], 8, axis=1))
    assert np.array_equal(model.regions.density, table.density)
    assert model.regions.laws == table.laws and model.regions.damping == table.damping
    told = made.evidence["build"]
    assert told["evaluations"] <= build["evaluations"]
    # Costs of the search are of modes to its tolerance.
    assert told["cost"] <= told["cost_rounded"] * (1.0 + 1e-3)
    volumes = [each["volume_m3"] for each in told["materials"]]
    assert sum(volumes) == pytest.approx(len(number) * made.fine_edge**3)


@pytest.mark.parametrize("materials", [["steel", "aluminium"], ["spruce", "brass"]])
@pytest.mark.parametrize("held", [False, True])
def test_a_built_design_is_the_solid_that_it_describes(materials, held, field, tmp_path):
    """Its file holds a solid of its size whose modes, found anew, are the design's."""
    from solver import solve

    build = {**TWO, "materials": materials, "evaluations": 4}
    problem, found = asking(field[0], **build), field[1]
    if held:
        problem, found = designed(tmp_path, build, supports=[{"where": "x < -0.11"}])
    made = built(problem, found)
    write_design(tmp_path / "design.h5", made)
    read = read_design(tmp_path / "design.h5")
    rigid = read.model.rigid_modes
    assert rigid == (0 if held else 6)
    result = solve(read.model, modes=len(read.eigenvalues) + 1, method="slepc")
    # Eigenvalues of springs that hold are had to fewer digits.
    assert frequencies(result.eigenvalues[rigid:-1]) == pytest.approx(read.frequencies, rel=1e-5)
    told = read.evidence["build"]
    ratio = np.log(read.frequencies / read.targets.frequencies)[read.targets.sounding]
    assert ratio.mean() == pytest.approx(0.0, abs=1e-6)  # which the size is chosen for
    assert told["size"] == pytest.approx(read.fine_edge / problem.setting.mesh.edge)
    assert read.unit == pytest.approx(told["size"])
    assert np.ptp(read.surface_vertices, axis=0) == pytest.approx(
        told["size"] * np.ptp(found.surface_vertices, axis=0)
    )


@pytest.mark.parametrize("key", ["materials", "at_least_m", "name", "colour", "fraction"])
def test_a_file_that_tells_no_sense_of_its_build_is_refused(key, field, tmp_path):
    problem = asking(field[0], **{**TWO, "evaluations": 1})
    made = built(problem, field[1])
    told = json.loads(json.dumps(made.evidence["build"]))
    (told if key in told else told["materials"][0])[key] = "x" if key != "name" else 3
    wrong = replace(made, evidence={**made.evidence, "build": told})
    with pytest.raises(ValueError, match="evidence build"):
        write_design(tmp_path / "design.h5", wrong)


def test_a_solid_that_stays_as_large_as_its_mesh_has_its_own_pitch(field):
    made = built(asking(field[0], **TWO, size="mesh"), field[1])
    assert made.evidence["build"]["size"] == 1.0 and made.fine_edge == field[1].fine_edge


def test_results_do_not_depend_on_threads_and_repeat(field, monkeypatch):
    first = built(*field)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    second = built(*field)
    assert np.array_equal(first.fine_region, second.fine_region)
    assert np.array_equal(first.eigenvalues, second.eigenvalues)


def test_regions_are_of_one_material_each(tmp_path):
    build = {"materials": ["steel", "aluminium", "softwood"], "per": "region", "evaluations": 30}
    problem, design = designed(tmp_path, build, regions=REGIONS)
    made = built(problem, design)
    region = problem.setting.placed.region
    found = [np.unique(made.fine_region[region == each]) for each in range(3)]
    assert all(len(each) == 1 for each in found)
    assert made.evidence["build"]["at_least_m"] is None


def test_cubes_are_as_wide_as_asked_for(field):
    problem, design = field
    made = built(asking(problem, **TWO, at_least=0.02, size="mesh"), design)
    told = made.evidence["build"]
    assert told["voxels"] >= 2 and told["at_least_m"] >= 0.02
    groups = cubes(made.fine_grid, told["voxels"])
    for group in range(groups.max() + 1):
        assert len(np.unique(made.fine_region[groups == group])) == 1


def test_no_group_is_a_sliver():
    grid = np.argwhere(np.ones((7, 5, 3), dtype=bool))
    sizes = np.bincount(cubes(grid, 3))
    assert sizes.sum() == len(grid) and sizes.min() >= 0.5 * 27 and sizes.max() < 4 * 27


def test_changes_are_derivatives(field):
    """A little of a change changes the residuals by as little of what is foretold."""
    problem = field[0]
    objective, mesh = problem.setting.objective, problem.setting.mesh
    table = BuildSettings(materials=("softwood", "brass")).choices().table
    numbers = np.random.default_rng(1).integers(0, 2, mesh.n_cells).astype(np.uint16)
    groups, little = cubes(mesh.grid, 2), 1e-4
    at = VoxelSolid(problem.setting, table, objective).evaluate(numbers, None, 1e-12)
    changes = VoxelSolid(problem.setting, table, objective).changes(at, groups, 0.0)
    group = int(groups[mesh.n_cells // 3])
    for new in range(2):
        own = (groups == group) & (numbers != new)
        mixed, rows = numbers.copy(), [table]
        for old in np.unique(numbers[own]):
            share = np.array([1.0 - little, little])
            pair = table.young[[old, new]]
            law = (share * pair) @ table.elasticity[[old, new]].reshape(2, -1)
            density = float(share @ table.density[[old, new]])
            mixed[own & (numbers == old)] = 2 + len(rows) - 1
            rows.append(Regions.anisotropic(law.reshape(6, 6), density))
        tried = VoxelSolid(problem.setting, Regions.together(rows), objective)
        near = tried.evaluate(mixed, None, 1e-12)
        column = group * 2 + new
        by_frequency = objective.frequency_jacobian(at.values, changes)[:, column]
        moved = objective.frequency_residual(near.values) - objective.frequency_residual(at.values)
        scale = np.abs(by_frequency).max()
        # Second order in the change, and the tolerance of the modes.
        assert moved / little == pytest.approx(by_frequency, abs=1e-2 * scale)
        by_amplitude = objective.amplitude_jacobian(at.values, at.pushed, changes)[:, :, column]
        moved = objective.amplitude_residual(near.values, near.pushed)
        moved = (moved - objective.amplitude_residual(at.values, at.pushed)) / little
        scale = np.abs(by_amplitude).max()
        assert moved == pytest.approx(by_amplitude, abs=2e-2 * scale)


def test_the_search_lowers_the_cost_of_what_it_starts_from(field):
    problem = field[0]
    table = BuildSettings(materials=("steel", "aluminium")).choices().table
    solid = VoxelSolid(problem.setting, table, problem.setting.objective)
    groups = np.arange(problem.setting.mesh.n_cells)
    start = solid.evaluate(np.random.default_rng(0).integers(0, 2, len(groups)).astype(np.uint16))
    costs = [start.cost.total]
    found = improved(solid, start, groups, FlipLimits(10, lambda at: costs.append(at.cost.total)))
    assert found.cost.total < start.cost.total
    assert costs == sorted(costs, reverse=True)


def test_roundings_are_nearest_by_ratio():
    young = np.array([1.0, 4.0, 16.0])
    field = np.array([1.0, 4.0, 16.0, 4.0])
    found = roundings(1e7 * field, np.arange(4), young)
    assert any(np.array_equal(each, [0, 1, 2, 1]) for each in found)


def test_infill_couples_modulus_and_density():
    choices = BuildSettings(infill="pla", least_infill=0.2, infill_levels=5).choices()
    pla = named_material("pla")
    assert choices.fractions == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    assert choices.table.density == pytest.approx(pla.density * choices.fractions)
    assert choices.table.young == pytest.approx(pla.young * choices.fractions**2)
    assert set(choices.table.damping) == {(pla.alpha, pla.beta)}
    stretched = BuildSettings(infill="pla", infill_exponent=1.0).choices()
    assert stretched.table.young / stretched.table.density == pytest.approx(pla.young / pla.density)


def test_own_materials_are_named_as_others():
    own = [
        {"name": "bell metal", "young": 9.8e10, "poisson": 0.36, "density": 8600.0},
        {"name": "across", "material": "beech", "grain": [0.0, 1.0, 0.0]},
    ]
    made = project_of_build({"materials": ["across", "bell metal"], "own_materials": own})
    table = made.choices().table
    assert table.names == ("across", "bell metal")
    along = table.young[0] * table.elasticity[0]
    assert along[1, 1] > 3.0 * along[0, 0]  # the grain is along y


def project_of_build(build):
    return project_of({**small_project.PROJECT, "build": build}, Path()).build


@pytest.mark.parametrize(
    ("build", "keys", "said"),
    [
        ({"materials": ["steel"]}, {}, "'steel' alone, expected two or more"),
        ({"materials": ["steel", "steel"]}, {}, "'steel' is named twice"),
        ({"materials": ["steel", "aluminum"]}, {}, "did you mean aluminium"),
        (
            {
                "materials": ["steel", "mine"],
                "own_materials": [{"name": "mine", "material": "steel", "loss_factor": 0.1}],
            },
            {},
            "have the same constants",
        ),
        ({"materials": ["steel", "tin"], "infill": "pla"}, {}, "materials or infill, found both"),
        ({"infill": "pla", "least_infill": 0.0}, {}, "least_infill"),
        ({"infill": "pla", "least_infill": 1.5}, {}, "least_infill"),
        ({"infill": "plaster"}, {}, "there is no material 'plaster'"),
        ({**TWO, "per": "region"}, {}, "fewer than two regions"),
        ({**TWO, "per": "region", "at_least": 0.01}, {"regions": REGIONS}, "goes with per: voxel"),
        ({**TWO, "at_least": "thick"}, {}, "expected a number of metres"),
        (TWO, {"discretisation": "finite-cell"}, "expected voxel"),
    ],
)
def test_what_cannot_be_built_is_refused_in_one_sentence(build, keys, said, tmp_path):
    with pytest.raises(UserError, match=said) as refused:
        project(tmp_path, build, **keys)
    assert "\n" not in str(refused.value)


def test_parts_that_are_thicker_than_the_solid_are_refused(field):
    problem, design = field
    with pytest.raises(UserError, match="at_least: found 50 cm, expected no more than"):
        built(asking(problem, **TWO, at_least=0.5), design)
    assert width_of(0.0011, 0.001, problem.setting.mesh.grid) == 2


@pytest.mark.parametrize(
    ("build", "voxels"),
    [({"size": "mesh"}, 1), ({"size": "mesh", "at_least": "20 mm"}, 2), ({}, None)],
)
def test_the_width_of_parts_is_known_before_the_search_where_the_size_is(build, voxels, tmp_path):
    made = project(tmp_path, {**TWO, **build})
    problem = prepare(made, small_project.targets(made))
    width = known_width(problem)
    assert width == (None if voxels is None else voxels * problem.setting.mesh.edge)
    if voxels is not None:
        assert built(problem, optimise(problem)).evidence["build"]["at_least_m"] == width


@pytest.mark.parametrize("size", ["mesh", "free"])
def test_parts_that_cannot_be_printed_are_told_with_the_design(size, tmp_path, capsys, monkeypatch):
    """Before the search, too, if the solid stays as large as its mesh."""
    monkeypatch.setattr("sound.project.build.THINNEST", 0.1)
    arguments = described(tmp_path, {**TWO, "size": size})
    assert main(arguments) == 0
    told, line = capsys.readouterr(), "warning: parts are as thin as"
    assert (line in told.err) == (size == "mesh")
    assert f"{line} " in told.out and "expected 10 cm or more" in told.out
    monkeypatch.undo()
    assert main([*arguments, "--evaluations", "1"]) == 0
    told = capsys.readouterr()
    assert line not in told.out + told.err


def test_a_field_that_no_search_has_changed_is_refused(field):
    problem, design = field
    uniform = replace(design, coordinates=np.zeros_like(design.coordinates))
    with pytest.raises(UserError, match="search longer"):
        built(problem, uniform)


def test_the_cost_of_the_build_is_told(field):
    made = with_cost_of_build(field[1], built(*field))
    told = made.evidence["build"]
    for part in ("before", "rounded", "after"):
        assert 0.0 <= told[part]["median_cents"] <= told[part]["worst_cents"]


def test_the_command_builds_and_tells_what_it_costs(tmp_path, capsys):
    arguments = described(tmp_path, {**TWO, "at_least": "12 mm"})
    assert main([*arguments, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["build"]
    assert {"median_cents", "worst_cents", "distance_db", "verdict"} <= set(told["before"])
    assert {"median_cents", "worst_cents", "distance_db", "verdict"} <= set(told["after"])
    assert told["at_least_m"] >= 0.012
    out = tmp_path / "bar.h5"
    coordinates = read_design(out).coordinates
    # The field is there still, and is built again by one evaluation more.
    assert main([*arguments, "--evaluations", "1"]) == 0
    printed = capsys.readouterr().out
    assert "built of aluminium" in printed and "what that costs: partials off by" in printed
    assert np.array_equal(read_design(out).coordinates, coordinates)
