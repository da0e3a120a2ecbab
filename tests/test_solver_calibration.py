"""Calibration by spectra: random solids, derivatives of frequencies, and the search."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.block import ALL_FILLED, least_patterns
from carillon.fem.model import ElasticModel
from dataset_gen.objectives import fit, orientations
from dataset_gen.objectives.calibrated import combine
from dataset_gen.objectives.calibration import (
    Calibration,
    default_calibration,
    octant_orbits,
    parse,
)
from solver.studies.calibration.cases import read_case
from solver.studies.calibration.constants import LUMPED, CalibrationConstants, filled_places
from solver.studies.calibration.exact import make_cases
from solver.studies.calibration.gauss_newton import bounds, calibrate, calibrate_in_turn
from solver.studies.calibration.solids import CELLS, random_solid
from tests import solids


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    return make_cases(tmp_path_factory.mktemp("cases"), seed=3, count=3, objects=False)


def test_octants_of_one_orbit_are_exchanged_by_symmetries():
    """79 free factors, counted by hand from the 21 classes' symmetry groups."""
    numbers, count = octant_orbits()
    assert count == 79
    assert len(least_patterns()) == 21
    filled = numbers[least_patterns()]
    assert np.array_equal(np.unique(filled), np.arange(count))
    assert len(np.unique(numbers[ALL_FILLED])) == 1
    assert len(np.unique(numbers[0b1111])) == 2


def test_neutral_constants_leave_factored():
    neutral = Calibration(np.ones((256, 8)), 0.0, 0.0, 0.0, {})
    rng = np.random.default_rng(0)
    for mask in least_patterns():
        filled = (mask >> np.arange(8) & 1).astype(float)
        young = filled * rng.uniform(0.1, 10.0, (3, 8))
        held = fit("oversampled", young).moduli
        np.testing.assert_allclose(
            combine(neutral, young, held, mask, 0.25), fit("factored", young).moduli, rtol=1e-9
        )


def test_blocks_of_one_material_get_the_factors():
    calibration = default_calibration()
    images, _ = orientations()
    one = (np.array(least_patterns())[:, None] >> np.arange(8) & 1).astype(float)
    ratio = fit("calibrated", 3.0 * one).moduli / fit("factored", 3.0 * one).moduli
    np.testing.assert_allclose(ratio, calibration.factors[least_patterns()], rtol=1e-9)
    assert set(images[1:]) == set(least_patterns())


def test_a_vector_of_constants_survives_its_file():
    constants = CalibrationConstants.of(default_calibration())
    again = CalibrationConstants.of(parse(json.loads(json.dumps(constants.as_json()))))
    np.testing.assert_allclose(again.vector, constants.vector, atol=1e-3)


@pytest.mark.parametrize(
    "content", [{}, {"factors": {"1": "soft"}}, {"factors": {}, "galerkin_share": {}}]
)
def test_a_broken_calibration_is_refused(content):
    with pytest.raises(UserError, match="solver calibrate"):
        parse(content)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_lumping_a_share_moves_no_mass(share):
    mesh = solids.box_mesh(3, 2, 2)
    fill = np.full(mesh.n_cells, ALL_FILLED, dtype=np.uint8)
    fill[0] = 0b1111
    model = ElasticModel(mesh, np.ones((mesh.n_cells, 8)), fill)
    mixed = replace(model, lumped_share=share).nodal_mass()
    consistent, lumped = model.nodal_mass(), replace(model, lumped=True).nodal_mass()
    np.testing.assert_allclose(mixed.sum(axis=2), consistent.sum(axis=2), rtol=1e-12)
    np.testing.assert_array_equal(mixed[0], consistent[0])
    between = (1.0 - share) * consistent[1:] + share * lumped[1:]
    np.testing.assert_allclose(mixed[1:], between, rtol=1e-12, atol=1e-16)


def test_random_solids_are_the_same_again_and_of_the_asked_size():
    for number in range(8):
        mesh, young, name = random_solid(5, number)
        again, same, _ = random_solid(5, number)
        assert np.array_equal(mesh.grid, again.grid) and np.array_equal(young, same)
        assert CELLS[0] <= mesh.n_cells < CELLS[1] and len(young) == mesh.n_cells
        assert (young > 0.0).all() and name


def test_cases_are_kept_and_read_back(paths):
    stamps = [path.stat().st_mtime_ns for path in paths]
    assert make_cases(paths[0].parent, 3, 3, objects=False) == paths
    assert [path.stat().st_mtime_ns for path in paths] == stamps
    case = read_case(paths[0])
    assert len(case.exact) == 54 and (np.diff(case.exact) >= 0.0).all()


def test_derivatives_of_frequencies_agree_with_differences(paths):
    """Every constant in a random direction; multiple frequencies would not be differentiable."""
    case = read_case(paths[1])
    constants = CalibrationConstants.neutral()
    errors, columns = case.linearised(constants)
    direction = np.random.default_rng(1).standard_normal(len(constants.vector))
    step = 1e-5
    ahead, behind = (
        case.errors(CalibrationConstants(constants.vector + sign * step * direction))
        for sign in (1, -1)
    )
    difference = (ahead - behind) / (2.0 * step)
    np.testing.assert_allclose(
        columns @ direction, difference, atol=2e-4 * np.abs(difference).max()
    )
    np.testing.assert_allclose(errors, case.errors(constants), atol=1e-9)


def test_the_search_lowers_the_errors_within_bounds_for_any_number_of_workers(paths):
    start = CalibrationConstants.neutral()
    one = calibrate(paths, start, 0.25, workers=1, steps=2)
    two = calibrate(paths, start, 0.25, workers=2, steps=2)
    assert np.array_equal(one.constants.vector, two.constants.vector)
    before = np.sqrt(np.mean([np.mean(read_case(path).errors(start) ** 2) for path in paths]))
    assert one.rms < before
    low, high = bounds(0.25)
    assert ((one.constants.vector >= low) & (one.constants.vector <= high)).all()
    assert 0.0 <= one.constants.vector[LUMPED] <= 1.0


def test_filled_blocks_are_left_to_solids_without_voids(paths):
    start = CalibrationConstants.neutral()
    hollow = [path for path in paths if not read_case(path).filled.all()]
    found = calibrate_in_turn(hollow, start, 0.25, steps=1).constants.vector
    kept = filled_places()
    assert np.array_equal(found[kept], start.vector[kept])
    assert not np.array_equal(found, start.vector)


def test_calibrate_writes_a_file_that_parses(tmp_path, run_cli):
    out = tmp_path / "calibration.json"
    arguments = (
        "--solids",
        2,
        "--seed",
        3,
        "--steps",
        1,
        "--random-only",
        "--cases",
        tmp_path / "cases",
    )
    found = run_cli("solver", "calibrate", *arguments, "--out", out)
    assert found.returncode == 0, found.stderr
    content = json.loads(out.read_text())
    assert 0.0 <= parse(content).lumped_share <= 1.0
    assert content["provenance"]["rms_after"]
    refused = run_cli("solver", "calibrate", *arguments, "--out", tmp_path / "missing" / "c.json")
    assert refused.returncode == 2 and "does not exist" in refused.stderr
