"""Designs of solids with regions and supports from project to sound."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
import yaml

from carillon.errors import UserError
from solver.files.modes_file import frequencies
from sound.__main__ import main
from sound.design.fine_check import fine_frequencies
from sound.design.optimise import optimise
from sound.design.outcome import FINAL_TOLERANCE
from sound.design.preparation import coordinates_of, prepare
from sound.project.design_file import read_design, write_design
from sound.project.project import load_project, project_of
from tests import small_project

REGIONS = [
    {"name": "body", "material": "iron"},
    {"name": "end", "material": "brass", "where": "x > 0.031"},
]
WOOD = [REGIONS[0], {"name": "end", "material": "beech", "grain": [1, 0, 0], "where": "x > 0.031"}]
HELD = [{"where": "x < -0.11"}]
CASES = {
    "voxels": {"regions": REGIONS},
    "held": {
        "regions": REGIONS,
        "supports": HELD,
        "material": {"dimensions": 10, "young_bounds": [1e7, 1e10]},
    },
    "coarse": {"regions": REGIONS, "supports": HELD, "coarsen": "ddfem"},
    "cells": {"regions": WOOD, "supports": HELD, "discretisation": "finite-cell", "resolution": 10},
    "loaded": {
        "regions": REGIONS,
        "supports": [{"at": [0.1, 0.0, 0.03], "mass": 0.2}, {"where": "z < 0.001", "spring": 1e9}],
    },
    "free": {
        "regions": REGIONS,
        "supports": HELD,
        "coarsen": "average",
        "material": {
            "dimensions": 6,
            "poisson_bounds": [0.1, 0.45],
            "density_bounds": [2000.0, 20000.0],
            "density_regions": ["end"],
        },
    },
}


def project(folder, case, **optimiser):
    """A project of a case, whose clips say nothing."""
    for target in small_project.PROJECT["targets"]:
        (folder / target["clip"]).touch()
    changes = {"evaluations": 25, **optimiser}
    described = {**small_project.PROJECT, **CASES[case]}
    described["optimiser"] = {**described["optimiser"], **changes}
    return project_of(described, folder)


def designed(folder, case, **optimiser):
    made = project(folder, case, **optimiser)
    targets = small_project.targets(made)
    return made, targets, optimise(prepare(made, targets))


@pytest.mark.parametrize("case", CASES)
def test_a_design_is_the_solid_that_it_describes(case, tmp_path):
    """Its file holds a solid whose modes, found anew, are the design's."""
    from solver import solve

    made, targets, design = designed(tmp_path, case)
    assert design.evidence["cost"] <= design.evidence["cost_start"]
    write_design(tmp_path / "design.h5", design)
    read = read_design(tmp_path / "design.h5")
    rigid = read.model.rigid_modes
    assert rigid == (6 if case == "voxels" else 0 if case != "loaded" else rigid)
    count = len(design.eigenvalues)
    again = solve(read.model, modes=max(count, 8), tolerance=1e-9)
    np.testing.assert_allclose(again.eigenvalues[rigid:count], read.eigenvalues[rigid:], rtol=1e-6)
    amplitudes = again.modes[:, rigid:count].T @ read.modes[:, rigid:]
    assert np.isfinite(amplitudes).all()
    assert len(read.frequencies) == made.modes == len(targets.frequencies)
    np.testing.assert_array_equal(read.fine_region, design.fine_region)
    if case != "cells":
        fine = fine_frequencies(read)
        np.testing.assert_allclose(fine.hertz, read.frequencies, rtol=1e-4)


@pytest.mark.parametrize("case", ["held", "free", "loaded"])
def test_a_search_goes_on_from_a_design(case, tmp_path):
    made, targets, design = designed(tmp_path, case)
    problem = prepare(made, targets)
    np.testing.assert_array_equal(coordinates_of(problem, design), design.coordinates)
    other = replace(made, material=replace(made.material, dimensions=8))
    z = coordinates_of(prepare(other, targets), design)
    material = problem.setting.material
    assert len(z) == material.dimensions - made.material.dimensions + 8
    constants = len(material.free)
    if constants:
        np.testing.assert_allclose(z[-constants:], design.coordinates[-constants:], atol=1e-9)


def test_a_design_finds_the_material_that_its_targets_are_of(tmp_path):
    """Frequencies as they are, since springs and masses have a scale of their own."""
    made = project(tmp_path, "loaded", evaluations=120)
    targets = small_project.targets(made)
    setting = prepare(made, targets).setting
    z = 0.4 * np.random.default_rng(0).standard_normal(setting.material.dimensions)
    wanted = setting.simulation().evaluate(z)
    targets = replace(
        targets, frequencies=frequencies(wanted.eigenvalues), amplitudes=np.abs(wanted.pushed)
    )
    design = optimise(prepare(made, targets))
    assert design.evidence["cost"] < 0.05 * design.evidence["cost_start"]
    assert np.abs(np.log(design.frequencies / targets.frequencies)).max() < 0.01


def test_dampings_of_known_materials_are_theirs(tmp_path):
    made, targets, _ = designed(tmp_path, "voxels", evaluations=1)
    same = [dict(each, loss_factor=0.01, material="iron") for each in REGIONS]
    described = {**small_project.PROJECT, "regions": same, "damping": {"source": "material"}}
    described["optimiser"] = {"evaluations": 1, "seconds": None, "workers": 1}
    design = optimise(prepare(project_of(described, tmp_path), targets))
    omega = 2.0 * np.pi * design.frequencies
    alpha, beta = design.model.regions.damping[0]
    np.testing.assert_allclose(design.dampings, 0.5 * (alpha + beta * omega**2), rtol=1e-6)
    assert design.damping.loss_factors is None
    assert FINAL_TOLERANCE < 1e-9 and made.modes == 6


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        (
            {"regions": WOOD, "coarsen": "ddfem"},
            "'end' is not the same.* none.*finite-cell",
        ),
        ({"material": {"poisson_bounds": [0.3, 0.4]}, "regions": REGIONS}, "'body'.*it is 0.2"),
        (
            {"material": {"poisson_bounds": [0.1, 0.4], "poisson_regions": ["lid"]}},
            "there is no region 'lid'",
        ),
        (
            {
                "material": {"poisson_bounds": [0.1, 0.4], "poisson_regions": ["end"]},
                "regions": WOOD,
            },
            "'end' has elasticity of its own",
        ),
        ({"material": {"density_bounds": [100.0, 2000.0]}}, "changes no ratio of frequencies"),
        (
            {"material": {"density_bounds": [100.0, 2000.0]}, "regions": REGIONS},
            "density.*region 'body'.*it is 8000",
        ),
        ({"supports": [{"where": "x > 9"}]}, "meets nothing of solid"),
    ],
)
def test_projects_that_no_search_can_follow(keys, says, tmp_path):
    for target in small_project.PROJECT["targets"]:
        (tmp_path / target["clip"]).touch()
    made = project_of({**small_project.PROJECT, "modes": 6, **keys}, tmp_path)
    plain = project_of(small_project.PROJECT, tmp_path)
    with pytest.raises(UserError, match=says) as caught:
        prepare(made, small_project.targets(plain))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("case", ["coarse", "cells", "loaded"])
def test_commands_work_on_designs_of_regions(case, tmp_path, capsys):
    made = project(tmp_path, case)
    targets = small_project.targets(made)
    small_project.write_clips(tmp_path, targets.frequencies)
    described = {**small_project.PROJECT, **CASES[case], "modes": 4}
    described["optimiser"] = {"evaluations": 12, "seconds": None, "workers": 1}
    file, out = tmp_path / "bar.yaml", tmp_path / "bar.h5"
    file.write_text(yaml.safe_dump(described))
    assert load_project(file).composition.supports
    assert main(["design", str(file), "--out", str(out), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert [each["name"] for each in summary["regions"]] == ["body", "end"]
    assert main(["design", str(file), "--out", str(out)]) == 0
    assert "end: Young's modulus" in capsys.readouterr().out
    assert main(["check", str(out), "--json"]) == 0
    checked = json.loads(capsys.readouterr().out)
    assert np.isfinite(checked["fine_cents"]).all()
    assert main(["reach", str(file), str(out), "--seconds", "2", "--workers", "1"]) == 0
    wav = str(tmp_path / "hit.wav")
    for source in ("clips", "material"):
        words = ["--target", "end", "--out", wav, "--damping-from", source]
        assert main(["render", str(out), *words]) == 0
    for ending in ("h5", "gltf", "glb", "dsp", "npy"):
        assert main(["export", str(out), "--out", str(tmp_path / f"bar_.{ending}")]) == 0
    document = json.loads((tmp_path / "bar_.gltf").read_text())
    extension = document["extensions"]["KHR_audio_rigid_bodies"]
    (material,) = extension["acousticMaterials"]
    regions = material["extras"]["regions"]
    assert [each["name"] for each in regions] == ["body", "end"]
    assert all(each["density"] > 0.0 for each in regions)
    assert ("elasticity" in regions[1]) == (case == "cells")
    with h5py.File(tmp_path / "bar_.h5") as exported:
        assert "region" in exported["fine"]


def test_modes_files_of_regions_are_heard_with_their_dampings(tmp_path, capsys, run_cli):
    regions = tmp_path / "regions.yaml"
    regions.write_text(yaml.safe_dump({"regions": WOOD}))
    out = tmp_path / "modes.h5"
    command = ("solver", "modes", "builtin:bar", "--resolution", 16, "--modes", 14)
    run_cli(*command, "--regions", regions, "--out", out, check=True)
    words = ["render", str(out), "--at", "0.12", "0", "0.03", "--out", str(tmp_path / "hit.wav")]
    assert main([*words, "--json"]) == 0
    mixed = np.array(json.loads(capsys.readouterr().out)["dampings_per_second"])

    def by(name):
        from carillon.composition.materials import named_material

        pair = (str(getattr(named_material(name), key)) for key in ("alpha", "beta"))
        assert main([*words, "--json", "--damping", *pair]) == 0
        return np.array(json.loads(capsys.readouterr().out)["dampings_per_second"])

    iron, beech = by("iron"), by("beech")
    assert (iron < mixed).all() and (mixed < beech).all()


def test_regions_of_a_call_are_those_of_a_project(tmp_path, monkeypatch):
    import carillon as ca

    monkeypatch.chdir(tmp_path)
    made = project(tmp_path, "held")
    small_project.write_clips(tmp_path, small_project.targets(made).frequencies)
    keys = {**small_project.PROJECT, "modes": 4, "optimiser": {"evaluations": 1, "workers": 1}}
    keys["optimiser"]["seconds"] = None
    regions = [ca.Region(**each) for each in REGIONS]
    supports = [ca.Support(**each) for each in HELD]
    one = ca.design(**keys, regions=regions, supports=supports)
    other = ca.design(**keys, regions=REGIONS, supports=HELD)
    assert one.found.settings == other.found.settings
    np.testing.assert_array_equal(one.frequencies, other.frequencies)
    chosen = ca.Region("end", where=lambda points: points[:, 0] > 0.0)
    with pytest.raises(UserError, match="'end': where is a function"):
        ca.design(**keys, regions=[REGIONS[0], chosen])
