"""Runs and validations of solids of several regions, and of held ones."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from carillon.command_line import exit_status
from carillon.errors import UserError
from solver.response.response_file import StrikeOptions, respond, write_response
from solver.verification.audit import audit_files
from solver.verification.comparison import compare_each
from studies.base.table import read_table
from tests.pages import Page
from tests.test_workflow_validation import call, words_of
from workflow import settings
from workflow.composition import composition_of, surface_of
from workflow.report.page import support_in_words
from workflow.validation.evidence import Evidence
from workflow.validation.study import VALIDATION
from workflow.variants import SHOWN

REGIONS = """regions:
  - {name: pan, material: iron}
  - {name: handle, material: beech, grain: [1, 0, 0], where: "x > 0.02"}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A bar, and files of regions."""
    place = tmp_path_factory.mktemp("pan")
    trimesh.creation.box(extents=[0.16, 0.04, 0.02]).export(place / "pan.obj")
    (place / "regions.yaml").write_text(REGIONS)
    (place / "wrong.yaml").write_text(REGIONS.replace("beech", "aluminium"))
    return place


def config(folder, **model):
    """A configuration with one model."""
    entry = {"mesh": "pan.obj", "resolution": 16, "material": "uniform", **model}
    path = folder / "run.yaml"
    given = {"mesh_folder": str(folder), "results_dir": str(folder / "results")}
    path.write_text(yaml.safe_dump({**given, "models": {"pan": entry}}))
    return settings.complete([path]), path


def test_files_of_regions_are_files_of_a_model(folder):
    part = trimesh.creation.box(bounds=[[0.02, -1, -1], [1, 1, 1]])
    part.export(folder / "handle.obj")
    (folder / "meshes.yaml").write_text(
        "regions: [{name: pan, material: iron}, {name: handle, mesh: handle.obj}]\n"
    )
    made, path = config(folder, regions="meshes.yaml")
    files = [Path(each).name for each in settings.model_files(made, "pan")]
    assert files == ["pan.obj", "meshes.yaml", "handle.obj"]
    settings.check_files(made, [path])
    (folder / "handle.obj").rename(folder / "gone.obj")
    with pytest.raises(UserError, match=r"run.yaml, line \d+: .*handle.obj, which is no file"):
        settings.check_files(made, [path])


def test_a_missing_file_is_told_with_its_line(folder):
    made, path = config(folder, regions="none.yaml")
    with pytest.raises(
        UserError, match=r"run.yaml, line \d+: models.pan.regions: found 'none.yaml'"
    ):
        settings.check_files(made, [path])


def test_regions_that_cannot_be_read_are_told_when_a_run_is_planned(folder):
    (folder / "bad.yaml").write_text("regions: [{name: a, poisson: 0.5}]\n")
    made, path = config(folder, regions="bad.yaml")
    with pytest.raises(UserError, match="bad.yaml.*poisson"):
        settings.check_files(made, [path])


@pytest.mark.parametrize("model", [{"regions": "regions.yaml"}, {"fix": ["x < 0"]}])
def test_methods_are_timed_on_free_solids_of_one_material(folder, model):
    made, path = config(folder, **model)
    made["times"]["models"] = ["pan"]
    with pytest.raises(UserError, match="pan is of several regions, or held"):
        settings.check_files(made, [path])


def test_a_model_is_composed_of_its_file_and_of_what_is_fixed(folder):
    made, _ = config(folder, regions="regions.yaml", fix=["x > 0.07", "region:handle"])
    entry = composition_of(made, "pan")
    assert [each.name for each in entry.regions] == ["pan", "handle"]
    words = [support_in_words(each) for each in entry.supports]
    assert words == ["held where x > 0.07", "held where region:handle"]


def test_a_mesh_may_be_a_file_of_regions(folder):
    trimesh.creation.box(bounds=[[0, 0, 0], [0.1, 0.02, 0.02]]).export(folder / "a.obj")
    trimesh.creation.box(bounds=[[0.1, 0, 0], [0.15, 0.02, 0.02]]).export(folder / "b.obj")
    (folder / "parts.yaml").write_text(
        "regions: [{name: a, material: iron, mesh: a.obj}, {name: b, material: brass, mesh: b.obj}]"
    )
    made, path = config(folder, mesh="parts.yaml")
    settings.check_files(made, [path])
    files = [Path(each).name for each in settings.model_files(made, "pan")]
    assert files == ["parts.yaml", "a.obj", "b.obj"]
    assert np.ptp(surface_of(made, "pan").bounds, axis=0) == pytest.approx([0.15, 0.02, 0.02])


def test_what_does_not_fit_is_told_before_anything_runs(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    words = ["pan.obj", "--resolution", 16, "--out", tmp_path / "out"]
    for more, says in (
        (["--regions", "none.yaml"], "none.yaml"),
        (["--regions", "regions.yaml", "--fix", "x > 9"], "meets nothing of solid"),
        (["--fix", "region:lid"], "there is no region 'lid'"),
        (["--fix", "x >"], "cannot be read"),
    ):
        assert call(*words, *more) == exit_status.EXIT_BAD_INPUT
        error = capsys.readouterr().err.strip()
        assert says in error and len(error.splitlines()) == 1
        assert not (tmp_path / "out").exists()


@pytest.mark.nightly
@pytest.mark.parametrize("kind", ["voxel", "finite-cell"])
def test_a_held_solid_of_two_materials_is_validated(folder, tmp_path, kind):
    out = tmp_path / "out"
    words = (folder / "pan.obj", "--resolution", 16, "--modes", 16, "--discretisation", kind)
    held = ("--regions", folder / "regions.yaml", "--fix", "x > 0.07", "--out", out)
    loose = ("--tolerances", "frequency_rms=0.5", "frequency_worst=0.9")
    status = call(*words, *held, *loose)
    log = out / "validate.log"
    assert status == 0, log.read_text()[-6000:] if log.exists() else "nothing ran"
    text = words_of(Page(out / "validation" / "pan.html"))
    assert "pan of iron" in text and "held where x &gt; 0.07" in text
    assert "leaves it none of six rigid motions" in text and "It is held" in text
    tables = out / "validation" / "tables"
    rows = {row["region"]: row for row in read_table(tables / "pan-regions.json").rows}
    assert rows["pan"]["material"] == "iron, isotropic" and rows["pan"]["poisson"] == 0.28
    assert rows["handle"]["material"] == "beech, with a grain"
    assert rows["handle"]["poisson"] is None
    volumes = [rows[name]["volume"] for name in ("pan", "handle")]
    assert volumes == pytest.approx([0.1 * 0.04 * 0.02, 0.06 * 0.04 * 0.02], rel=0.01)
    criteria = {
        (row["group"], row["key"]): row for row in read_table(tables / "pan-criteria.json").rows
    }
    assert criteria["truth", "rigid"]["limit"] == 0
    errors = read_table(tables / "pan-errors.json").rows
    assert errors[0]["mode"] == 1 and len(errors) == 16

    # The truth of another material is no truth.
    from solver.__main__ import main

    other = ["--discretisation", kind, "--resolution", "16", "--modes", "16", "--fix", "x > 0.07"]
    other += ["--regions", str(folder / "wrong.yaml"), "--no-estimate", "--method", "slepc"]
    models = out / "models" / "pan"
    assert main(["modes", str(folder / "pan.obj"), *other, "--out", str(models / "truth.h5")]) == 0
    paths = {name: models / f"{name}.h5" for name in SHOWN if (models / f"{name}.h5").exists()}
    others = {name: path for name, path in paths.items() if name != "truth"}
    compared = compare_each(list(others.values()), paths["truth"])
    content = {"comparisons": {name: each.as_dict() for name, each in compared.items()}}
    (models / "comparisons.json").write_text(json.dumps(content | {"provenance": {}}))
    audits = {name: asdict(audit) for name, audit in audit_files(paths.values()).items()}
    (models / "audit.json").write_text(json.dumps({"spectra": audits, "provenance": {}}))
    write_response(models / "response.h5", respond(paths["truth"], others, StrikeOptions()), {})
    rows = VALIDATION.made(Evidence(out, "pan"))["criteria"].rows
    missed = {row["key"] for row in rows if row["verdict"] == "missed"}
    assert {"eigenvalue_error", "subspace_angle", "response"} <= missed
