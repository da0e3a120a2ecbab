"""Errors of coarse models mode by mode: matching, verdicts, and the elements to blame."""

import json

import numpy as np
import pytest
from mpi4py import MPI

from carillon.errors import UserError
from carillon.fem.geometry import blocks_from_mesh
from carillon.fem.materials import young_modulus
from carillon.fem.model import ElasticModel, fine_model
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from solver.coarsening.choice import make_coarsening
from solver.coarsening.model import build_model
from solver.verification.matching import match_modes
from studies.coarsening.picture_file import ModePicture, read_pictures, write_pictures
from studies.coarsening.rating import ERROR, LOCAL, SWAP, CoarseRating, SolvedModel, verdict
from tests import solids

LAST, FOUND = 24, 30
NONE_EXPECTED = np.zeros(LAST)
ORIGIN = {"commit": "none"}


def solved(model: ElasticModel) -> SolvedModel:
    modes = modal_analysis(model, SolverOptions(method="slepc", modes=FOUND), MPI.COMM_SELF)
    vectors = modes.system.gather(modes.vectors)
    modes.destroy()
    return SolvedModel(model, modes.values, np.ascontiguousarray(vectors))


@pytest.fixture(scope="module")
def bar():
    """Fine solid without two equal modes, its exact modes, and the whole of it as fine blocks."""
    fine = solids.box_mesh(12, 5, 4)
    young = young_modulus("noise", fine, seed=1)
    everything = np.ones(blocks_from_mesh(fine).coarse.n_cells, dtype=bool)
    blocks = blocks_from_mesh(fine, everything)
    coarse = build_model(fine, young, make_coarsening("galerkin"), everything)
    return solved(fine_model(fine, young)), blocks, solved(coarse)


@pytest.fixture(scope="module")
def coarse_bar(bar):
    """The same, with a coarse model that is far off."""
    truth, _, _ = bar
    fine = truth.model.mesh
    model = build_model(fine, truth.model.young[:, 0], make_coarsening("average"))
    return CoarseRating(truth, blocks_from_mesh(fine), solved(model), NONE_EXPECTED, LAST)


def test_identical_models_have_no_errors_and_the_same_modes(bar):
    truth, blocks, same = bar
    rating = CoarseRating(truth, blocks, same, NONE_EXPECTED, LAST)
    found = rating.as_dict()
    assert found["by_index"]["rms"] < 1e-9 and found["by_projection"]["rms"] < 1e-9
    assert [mode["partner"] for mode in found["modes"]] == list(range(7, LAST + 1))
    assert rating.matching.overlaps == pytest.approx(1.0, abs=1e-6)
    assert found["recognised"]["modes"] == LAST - 6
    assert found["far_off"] == [] and rating.pictures(4) == []


def test_modes_behind_one_that_is_lost_are_swaps_and_that_one_is_local(bar):
    truth, blocks, same = bar
    # No mode from the lost one on keeps its number; those it is far from are far off.
    lost = 9
    kept = np.delete(np.arange(FOUND), lost - 1)
    rest = SolvedModel(same.model, same.values[kept], same.vectors[:, kept])
    found = CoarseRating(truth, blocks, rest, NONE_EXPECTED, LAST).as_dict()
    far = {mode["mode"]: mode for mode in found["far_off"]}
    assert found["by_index"]["rms"] > 0.02 and min(far) >= lost
    assert far.pop(lost)["verdict"] == LOCAL
    assert far and {mode["verdict"] for mode in far.values()} == {SWAP}
    for number, mode in far.items():
        assert mode["partner"] == number - 1 and mode["overlap"] > 0.999
        assert abs(mode["matched_error"]) < 1e-6 < abs(mode["error"])
    assert found["recognised"]["modes"] == LAST - 6 - 1
    assert found["recognised"]["rms"] < 1e-6


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ((0.05, 0.9, 0.9), SWAP),
        ((-0.05, 0.5, 0.5), SWAP),
        ((0.20, 0.9, 0.9), ERROR),
        ((0.05, 0.3, 0.8), ERROR),
        ((0.05, 0.3, 0.5), LOCAL),
        ((0.90, 0.0, 0.1), LOCAL),
    ],
)
def test_verdicts(case, expected):
    assert verdict(*case) == expected


def test_no_two_modes_have_the_same_partner():
    overlaps = np.random.default_rng(0).random((20, 30))
    matching = match_modes(overlaps)
    assert len(set(matching.partners)) == 20
    assert (matching.largest >= matching.overlaps).all()
    greedy = overlaps[np.arange(20), np.arange(20)]
    assert matching.overlaps.sum() > greedy.sum()


def test_shares_of_energy_and_blame_are_whole(coarse_bar):
    found = coarse_bar.as_dict()
    worst = max(found["far_off"], key=lambda mode: abs(mode["error"]))
    assert abs(worst["error"]) == pytest.approx(abs(found["by_index"]["worst"]))
    assert 0.0 < worst["half_of_energy"] < 0.5
    assert len(worst["elements"]) == 10
    blame = [element["blame"] for element in worst["elements"]]
    assert blame == sorted(blame, reverse=True) and 0.0 < sum(blame) <= 1.0
    for element in worst["elements"]:
        assert 0.0 < element["energy"] < 1.0 and element["cells"] in (4, 8)
        assert bin(element["pattern"]).count("1") == element["cells"]
    first = coarse_bar.pictures(2)[0]
    assert first.energy.sum() == pytest.approx(1.0, rel=1e-9)
    assert first.blame.sum() == pytest.approx(1.0, rel=1e-9)


def test_pictures_are_of_the_modes_farthest_off_and_read_as_written(coarse_bar, bar, tmp_path):
    mesh, pictures = bar[0].model.mesh, coarse_bar.pictures(3)
    errors = {mode["mode"]: abs(mode["error"]) for mode in coarse_bar.as_dict()["far_off"]}
    of_picture = [errors[picture.mode] for picture in pictures]
    assert of_picture == sorted(errors.values(), reverse=True)[:3]
    write_pictures(tmp_path / "modes.h5", mesh, pictures, ORIGIN)
    again, read = read_pictures(tmp_path / "modes.h5")
    assert np.array_equal(again.cells, mesh.cells) and np.allclose(again.nodes, mesh.nodes)
    for left, right in zip(read, pictures, strict=True):
        assert left.mode == right.mode
        for field in ("displacement", "energy", "blame"):
            assert np.array_equal(getattr(left, field), getattr(right, field))


def test_a_file_of_pictures_may_hold_none_and_another_is_refused(bar, tmp_path):
    mesh = bar[0].model.mesh
    write_pictures(tmp_path / "none.h5", mesh, [], ORIGIN)
    assert read_pictures(tmp_path / "none.h5")[1] == []
    short = ModePicture(7, np.zeros((3, 3)), np.zeros(2), np.zeros(2))
    write_pictures(tmp_path / "short.h5", mesh, [short], ORIGIN)
    with pytest.raises(UserError, match=r"short\.h5: is not what it should be"):
        read_pictures(tmp_path / "short.h5")


@pytest.fixture(scope="module")
def dumbbell(tmp_path_factory, run_cli):
    """What the command writes of the dumbbell with noise, and prints."""
    folder = tmp_path_factory.mktemp("dumbbell")
    command = ["coarsening", "builtin:dumbbell", "--resolution", 24, "--material", "noise"]
    command += ["--refine-to", 0.05, "--modes", 60]
    outputs = ["--out", folder / "case.json", "--pictures", folder / "case.h5"]
    done = run_cli("solver", *command, *outputs, check=True)
    return folder, json.loads((folder / "case.json").read_text()), done.stdout


def test_what_is_taken_for_the_dumbbell_is_within_what_is_allowed(dumbbell):
    _, case, printed = dumbbell
    refined = case["refined"]
    for errors in ("by_index", "expected"):
        assert refined[errors]["rms"] <= 0.05 and abs(refined[errors]["worst"]) <= 0.15
    assert case["plain"]["by_index"]["rms"] > 0.1 and case["plain"]["rank_correlation"] > 0.9
    assert case["plain"]["fine_blocks"] == 0 < refined["fine_blocks"]
    assert case["plain"]["n_dofs"] < refined["n_dofs"] <= case["n_dofs"]
    for model in (case["plain"], refined):
        assert model["by_index"]["last"] == 60 and len(model["modes"]) == 54
    costs = case["costs"]
    assert costs["auto"]["taken"] == "fine" and "few unknowns" in costs["auto"]["reason"]
    assert f"since {costs['auto']['reason']}" in printed
    for each in costs.values():
        assert min(each["fine"].values()) > 0.0 and min(each["coarse"].values()) > 0.0
    assert (costs["slepc"]["taken"] == "fine") == (refined["n_dofs"] == case["n_dofs"])
    assert case["truth"]["inertia_count"] == case["truth"]["inertia_expected"]
    assert case["provenance"]["commit"]


def test_modes_of_the_neck_and_of_specks_are_told_apart(dumbbell):
    folder, case, printed = dumbbell
    far = {mode["mode"]: mode for mode in case["plain"]["far_off"]}
    lost = [mode for mode in far.values() if mode["verdict"] == LOCAL]
    assert lost and all(mode["half_of_energy"] < 0.05 for mode in lost)
    # The bending of the neck, which is between both spheres.
    assert far[8]["verdict"] == ERROR and abs(far[8]["elements"][0]["place"][0]) < 0.02
    for number, mode in far.items():
        assert f"mode {number} {mode['error']:+.1%}, {mode['verdict']}" in printed
    _, pictures = read_pictures(folder / "case.h5")
    assert len(pictures) == 4 and {picture.mode for picture in pictures} <= set(far)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--modes", "61"], "found 61, expected at most"),
        (["--modes", "6"], "found 6, expected at least 7"),
        (["--coarsen", "none"], "invalid choice: 'none'"),
        (["--refine-to", "0"], "expected above 0"),
        (["--refine-to", "nan"], "expected a finite number"),
        (["--out", "absent/case.json"], "the folder absent does not exist"),
        (["--pictures", "absent/case.h5"], "the folder absent does not exist"),
        (["--out", "one", "--pictures", "./one"], "name two files"),
    ],
)
def test_bad_arguments_are_answered_in_one_sentence(arguments, sentence, run_cli):
    done = run_cli("solver", "coarsening", "builtin:box", "--resolution", "8", *arguments)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
