"""The solver's commands: what they write, and one sentence for everything that can be wrong."""

import json
import shutil

import h5py
import numpy as np
import pytest

from carillon.fem.geometry import hexmesh_from_voxels, load_surface, voxelize
from solver.files.modes_file import read_modes
from tests.edited_files import edited
from workflow.commands.digest import digest

BAR = ("builtin:bar", "--resolution", "16")


@pytest.fixture(scope="module")
def modes_file(tmp_path_factory, run_cli):
    path = tmp_path_factory.mktemp("modes") / "modes.h5"
    words = ("--material", "two-region", "--modes", "30", "--out", path)
    run_cli("solver", "modes", *BAR, *words, check=True)
    return path


@pytest.fixture(scope="module")
def n_voxels() -> int:
    return hexmesh_from_voxels(voxelize(load_surface("builtin:bar"), 16)).n_cells


def test_modes_file_is_complete(modes_file):
    file = read_modes(modes_file)
    k, n = 30, file.mesh.n_dofs
    assert file.eigenvalues.shape == file.frequencies.shape == file.residuals.shape == (k,)
    assert file.modes.shape == (n, k)
    assert np.allclose(file.frequencies, np.sqrt(file.eigenvalues) / (2 * np.pi))
    assert file.attributes["method"] == "lanczos"
    assert file.attributes["density"] == 1000.0
    timed = {"mesh", "material", "assembly", "lanczos", "correction"}
    assert set(file.attributes["timings"]) >= timed
    assert 0.0 < file.attributes["solid_frequency_error_rms"] < 1.0
    assert "estimate" in file.attributes["timings"]
    assert set(file.provenance) >= {"commit", "config_hash", "command", "versions", "blas"}
    with h5py.File(modes_file) as raw:
        assert raw["nodes"].attrs["units"] == "m"
        assert raw["eigenvalues"].attrs["units"] == "rad^2/s^2"
        assert all(
            dataset.fletcher32 for dataset in raw.values() if isinstance(dataset, h5py.Dataset)
        )


def test_phases_are_told_and_leave_no_trace_in_the_file(modes_file, run_cli, tmp_path):
    out = tmp_path / "modes.h5"
    words = ("--material", "two-region", "--modes", "30", "--out", out, "--phases")
    lines = run_cli("solver", "modes", *BAR, *words, check=True).stdout.splitlines()
    expected = (
        "phase start solid partition analysis assembly lanczos correction verification estimate "
        "writing other"
    )
    assert [line.split()[0] for line in lines[-12:]] == expected.split()
    assert digest(out) == digest(modes_file)


@pytest.mark.parametrize("discretisation", ["voxel", "finite-cell"])
@pytest.mark.parametrize("resolution", [7, 10])
def test_the_summary_tells_mesh_from_voxels_and_names_the_norm(
    discretisation, resolution, run_cli, tmp_path
):
    out = tmp_path / "modes.h5"
    command = ["modes", "builtin:plate", "--resolution", resolution, "--modes", 12, "--out", out]
    command += ["--no-estimate", "--discretisation", discretisation]
    told = run_cli("solver", *command, check=True).stdout
    assert "; mesh 24 x " in told and "largest 2-norm residual" in told
    assert (" cm, voxels " in told) == (discretisation == "voxel")
    found = json.loads(run_cli("solver", *command, "--json", check=True).stdout)
    mesh, voxels = found["extents_m"], found["voxel_extents_m"]
    if discretisation == "finite-cell":
        assert voxels is None
    else:
        edge = max(mesh) / resolution
        assert (np.subtract(voxels, mesh) <= edge * (1.0 + 1e-9)).all()
        counts = np.array(voxels) / read_modes(out).mesh.edge
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    audited = run_cli("solver", "audit", out, check=True).stdout
    assert "largest 2-norm residual" in audited and ", energy residual" in audited


def test_compare_of_a_file_with_itself(modes_file, run_cli):
    done = run_cli("solver", "compare", modes_file, modes_file, "--json", check=True)
    (result,) = json.loads(done.stdout)["comparisons"].values()
    assert set(result["eigenvalue_relative_error"]) == {"median", "p90", "max"}
    assert result["eigenvalue_relative_error"]["max"] == 0.0
    assert result["frequency_rms_relative_error"] == 0.0
    assert result["subspace_angle_max"] < 1e-6
    stored = read_modes(modes_file).residuals.max()
    assert result["residual_max"] == pytest.approx(stored, rel=1e-3, abs=1e-12)


def test_compare_tells_another_material(modes_file, run_cli, tmp_path):
    other = tmp_path / "other.h5"
    options = ("--modes", "30", "--poisson", "0.3", "--out", other)
    run_cli("solver", "modes", *BAR, *options, check=True)
    done = run_cli("solver", "compare", other, modes_file, "--json", check=True)
    (result,) = json.loads(done.stdout)["comparisons"].values()
    found = result["material"]
    assert 0 < found["young"]["cells"] <= found["young"]["all"]
    assert found["poisson"][0] == 0.3 and "density_kg_per_m3" not in found
    told = run_cli("solver", "compare", other, modes_file, check=True).stdout
    assert "material                  another one: Young's modulus of " in told
    assert "Poisson's ratio 0.3, the truth's" in told


def test_compare_tells_that_a_mode_is_missing(modes_file, run_cli, tmp_path):
    keep = np.arange(30) != 11
    lacking = tmp_path / "lacking.h5"
    shutil.copy(modes_file, lacking)
    with edited(lacking) as file:
        for name in ("eigenvalues", "frequencies", "residuals", "modes"):
            values, attributes = file[name][()], dict(file[name].attrs)
            del file[name]
            file[name] = values[..., keep]
            file[name].attrs.update(attributes)
    told = run_cli("solver", "compare", lacking, modes_file, check=True).stdout
    assert "modes of other shapes " in told and "the first is 12: modes crossed, one is" in told
    assert "another one" not in told
    assert "other shapes" not in run_cli("solver", "compare", modes_file, modes_file).stdout


def test_several_are_compared_with_one_truth(modes_file, run_cli, tmp_path):
    other = tmp_path / "other.h5"
    shutil.copy(modes_file, other)
    out = tmp_path / "found.json"
    done = run_cli("solver", "compare", modes_file, other, modes_file, "--out", out, check=True)
    assert [line for line in done.stdout.splitlines() if line.endswith(":")] == ["modes:", "other:"]
    found = json.loads(out.read_text())
    alone = run_cli("solver", "compare", other, modes_file, "--json", check=True)
    assert found["comparisons"]["other"] == json.loads(alone.stdout)["comparisons"]["other"]
    assert json.loads(found["provenance"]["parameters"])["truth"] == str(modes_file)


def test_summary_as_json(tmp_path, run_cli):
    out = tmp_path / "modes.h5"
    done = run_cli("solver", "modes", *BAR, "--modes", "12", "--out", out, "--json", check=True)
    summary = json.loads(done.stdout)
    assert summary["rigid_modes"] == 6
    assert len(summary["frequencies_hz"]) == 12


@pytest.mark.parametrize(
    ("array_of", "sentence"),
    [
        (lambda n: np.ones(n - 1), "values for"),
        (lambda n: np.r_[np.ones(n - 1), -1.0], "1 values are negative"),
        (lambda n: np.r_[np.nan, np.ones(n - 1)], "1 values are not finite"),
        (np.zeros, "values are zero"),
        (lambda n: np.r_[0.0, np.ones(n - 1)], "1 voxels have modulus zero"),
        (lambda n: np.array(["a"] * n), "is not readable as an array of numbers"),
    ],
)
def test_bad_material_array(array_of, sentence, tmp_path, run_cli, n_voxels):
    material = tmp_path / "young.npy"
    np.save(material, array_of(n_voxels))
    expect_sentence(run_cli, tmp_path, [*BAR, "--material", material], sentence)


def test_material_array_of_the_right_length_is_used(tmp_path, run_cli, n_voxels):
    material = tmp_path / "young.npy"
    np.save(material, np.full(n_voxels, 2e9))
    out = tmp_path / "modes.h5"
    words = ("--material", material, "--modes", "10", "--out", out)
    run_cli("solver", "modes", *BAR, *words, check=True)
    assert (read_modes(out).model.young == 2e9).all()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nothing.obj", "--resolution", "16"], "nothing.obj"),
        (["builtin:bar", "--resolution", "1"], "--resolution: found 1, expected at least 2"),
        ([*BAR, "--material", "steel"], "material 'steel'"),
        ([*BAR, "--modes", "100000"], "100,000 modes asked for"),
        ([*BAR, "--modes", "6"], "--modes: found 6, expected at least 7, since"),
        (
            [*BAR, *"--modes 30 --retained-modes 30".split()],
            "--retained-modes 30 is too few for 30",
        ),
        ([*BAR, "--coarsen", "ddfem", "--forest", "absent.h5"], "absent.h5"),
        ([*BAR, "--poisson", "0.5"], "--poisson: found 0.5, expected below 0.5"),
        ([*BAR, "--density", "-1"], "--density: found -1.0, expected at least 0.001 kg/m^3"),
        ([*BAR, "--subdomains", "100000"], "100000 subdomains"),
        ([*BAR, "--petsc=-carillon_eps_ncv 90"], "prefix -carillon_inner_"),
    ],
)
def test_bad_arguments(arguments, sentence, tmp_path, run_cli):
    expect_sentence(run_cli, tmp_path, arguments, sentence)


def test_unwritable_output_is_found_before_the_work(tmp_path, run_cli):
    for out in (tmp_path / "absent" / "modes.h5", tmp_path):
        done = run_cli("solver", "modes", *BAR, "--modes", "10", "--out", out)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_damaged_and_foreign_files(modes_file, tmp_path, run_cli):
    names = ("cut", "older", "flipped", "gutted")
    cut, older, flipped, gutted = (shutil.copy(modes_file, tmp_path / f"{n}.h5") for n in names)
    cut.write_bytes(modes_file.read_bytes()[:2000])
    with edited(older) as file:
        file.attrs["schema_version"] = 0
    with h5py.File(flipped) as file:
        offset = file["modes"].id.get_chunk_info(0).byte_offset
    with open(flipped, "rb+") as raw:
        raw.seek(offset)
        raw.write(b"\xff" * 64)
    with edited(gutted) as file:
        del file["modes"]
    for path, sentence in (
        (cut, "damaged"),
        (older, "schema 0"),
        (flipped, "damaged"),
        (gutted, "incomplete"),
        (tmp_path / "absent.h5", "no such file"),
    ):
        done = run_cli("solver", "compare", path, modes_file)
        assert done.returncode == 2, done.stderr
        assert sentence in done.stderr
        assert done.stderr.count("\n") == 1


def expect_sentence(run_cli, folder, arguments, sentence) -> None:
    out = folder / "modes.h5"
    before = set(folder.iterdir())
    done = run_cli("solver", "modes", *arguments, "--out", out)
    assert done.returncode == 2, done.stderr
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert set(folder.iterdir()) == before
