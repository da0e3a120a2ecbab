"""Designs that are right on the fine solid, though the search works with a coarse one."""

import json
import os
import signal
from dataclasses import replace

import numpy as np
import pytest

from carillon.errors import ConvergenceError
from carillon.fem.model import fine_model
from solver import solve
from sound.__main__ import main
from sound.design.descent import Descent
from sound.design.fine_check import ShapeMatch, fine_frequencies
from sound.design.optimise import optimise
from sound.design.outcome import Outcome
from sound.design.pitch import cents, common_factor, rms_cents
from sound.design.preparation import prepare
from sound.design.reduced_model import ReducedModel, descend_by_model
from sound.design.space_mapping import MET_CENTS
from sound.project.design import FineFrequencies
from sound.project.design_file import read_design, write_design
from studies.sounds.pictures import fine_mesh
from tests import small_project
from tests.edited_files import edited
from tests.small_design import small_design
from tests.small_project import with_options
from tests.solids import box_mesh

EVALUATIONS = 200


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    """The targets are sounds of the fine bar, the search works with a coarse one."""
    made = small_project.project(tmp_path_factory.mktemp("project"), evaluations=EVALUATIONS)
    targets = small_project.targets(made)
    return prepare(replace(made, coarsen="average"), targets)


@pytest.fixture(scope="module")
def checked(problem):
    return optimise(problem)


def fine_cents(design):
    return rms_cents(fine_frequencies(design).hertz, design.targets.frequencies)


def test_checks_make_the_fine_error_a_fraction(problem, checked):
    unchecked = optimise(with_options(problem, fine_check=False))
    assert unchecked.fine is None and unchecked.evidence["checks"] == []
    assert fine_cents(checked) < 0.5 * fine_cents(unchecked)


def test_a_search_foretells_the_fine_frequencies(checked):
    """By far better than the coarse ones are."""
    first, *checks = checked.evidence["checks"]
    off = rms_cents(checked.coarse_frequencies[checked.fine.order], checked.fine.hertz)
    assert first["foretold_rms_cents"] < 1e-9
    assert min(check["foretold_rms_cents"] for check in checks) < 0.1 * off


def test_the_best_by_the_fine_cost_is_written_and_never_worse_than_the_start(checked):
    costs = [check["cost"] for check in checked.evidence["checks"]]
    assert checked.evidence["cost_start"] == costs[0]
    assert checked.evidence["cost"] == min(costs) < costs[0]


def test_frequencies_written_are_those_of_the_written_material_on_all_voxels(checked):
    model = fine_model(fine_mesh(checked), checked.young)
    truth = solve(model, modes=6 + len(checked.frequencies), method="slepc")
    np.testing.assert_allclose(truth.frequencies[6:], checked.frequencies, rtol=1e-5)
    np.testing.assert_allclose(fine_frequencies(checked).hertz, checked.frequencies, rtol=1e-5)
    assert common_factor(checked.frequencies, checked.targets.frequencies) == pytest.approx(1.0)


def test_result_does_not_depend_on_the_number_of_workers(problem, checked):
    again = optimise(with_options(problem, workers=2))
    np.testing.assert_array_equal(again.coordinates, checked.coordinates)
    np.testing.assert_array_equal(again.frequencies, checked.frequencies)


def test_descents_by_a_reduced_model_lower_the_cost(problem):
    descent = Descent(problem.setting.fine().simulation(), problem.setting.objective)
    z = np.zeros(problem.setting.material.dimensions)
    costs = [point.cost.total for point in descend_by_model(descent, z, None, 6, 0.3).costs]
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < 0.05 * costs[0]


def test_a_reduced_model_is_right_at_its_centre_and_to_first_order(problem):
    simulation = problem.setting.fine().simulation(1e-10)
    size = simulation.material.dimensions
    move = 1e-3 * np.random.default_rng(1).standard_normal(size)
    here = simulation.differentiate(simulation.evaluate(np.zeros(size)), whole=True)
    model = ReducedModel(here)
    there = simulation.evaluate(move, here.modes)
    moved = model.at(move)
    np.testing.assert_allclose(model.at(0.0 * move).eigenvalues, here.eigenvalues)
    change = np.abs(there.eigenvalues - here.eigenvalues)
    assert (np.abs(moved.eigenvalues - there.eigenvalues) < 0.05 * change.max()).all()
    own = np.abs(np.abs(there.pushed) - np.abs(here.pushed)).max()
    assert np.abs(np.abs(moved.pushed) - np.abs(there.pushed)).max() < 0.05 * own


def test_somebody_who_interrupts_gets_the_best_checked_so_far(problem):
    asked = []

    def interrupt(search):
        if len(search.checks) == 3 and not asked:
            asked.append(search.own_evaluations)
            os.kill(os.getpid(), signal.SIGTERM)

    design = optimise(with_options(problem, evaluations=400), watch=interrupt)
    assert asked == [design.evidence["evaluations"]] and len(design.evidence["checks"]) == 4
    assert design.evidence["cost"] < design.evidence["cost_start"]


def test_a_search_is_checked_within_its_time(problem):
    # Time of the processor, of which whatever else runs on the machine takes none.
    design = optimise(with_options(problem, evaluations=None, seconds=2.0, workers=1))
    assert design.evidence["seconds"] < 4.0
    assert len(design.evidence["checks"]) > 1


def test_a_material_without_fine_modes_is_passed_over(problem, monkeypatch):
    known = []
    checked = Outcome.checked

    def first_alone(outcome, trial):
        if known:
            raise ConvergenceError("no modes")
        known.append(checked(outcome, trial))
        return known[0]

    monkeypatch.setattr(Outcome, "checked", first_alone)
    design = optimise(with_options(problem, evaluations=40))
    assert design.evidence["cost"] == design.evidence["cost_start"]


def test_modes_are_paired_by_their_shapes_where_these_are_clear():
    model = fine_model(box_mesh(6, 4, 2, 0.04), np.ones(48))
    match = ShapeMatch(model, model)
    modes = solve(model, modes=14, method="slepc").modes[:, 6:]
    swapped = modes[:, [1, 0, 2, 3, 5, 6, 4, 7]]
    assert match.order(swapped, modes).tolist() == [1, 0, 2, 3, 6, 4, 5, 7]
    random = np.random.default_rng(0).standard_normal(modes.shape)
    assert match.order(random, modes).tolist() == list(range(8))


def test_fine_frequencies_come_back_from_a_file_and_old_files_have_none(checked, tmp_path):
    write_design(tmp_path / "new.h5", checked)
    read = read_design(tmp_path / "new.h5")
    np.testing.assert_array_equal(read.frequencies, checked.fine.hertz)
    np.testing.assert_array_equal(read.elastic_modes, checked.elastic_modes)
    with edited(tmp_path / "new.h5") as file:
        del file["fine/frequencies"], file["fine/order"]
    old = read_design(tmp_path / "new.h5")
    assert old.fine is None
    np.testing.assert_array_equal(old.frequencies, checked.coarse_frequencies)


def test_modes_are_rendered_at_the_fine_frequencies_of_their_shapes():
    from sound.rendering.solid import SoundingSolid

    design = small_design()
    order = np.array([1, 0, *range(2, len(design.frequencies))])
    other = replace(design, fine=FineFrequencies(1.1 * design.frequencies, order))
    solid, before = SoundingSolid.of_design(other), SoundingSolid.of_design(design)
    np.testing.assert_allclose(solid.frequencies, 1.1 * before.frequencies)
    np.testing.assert_array_equal(solid.modes, before.modes[:, order])


def test_the_command_says_what_the_file_says(checked, tmp_path, capsys):
    write_design(tmp_path / "design.h5", checked)
    assert main(["check", str(tmp_path / "design.h5"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(found["fine_hz"], checked.frequencies, rtol=1e-5)
    np.testing.assert_allclose(
        found["fine_cents"], cents(checked.frequencies, checked.targets.frequencies), atol=0.05
    )
    best = min(checked.evidence["checks"], key=lambda check: check["cost"])
    assert found["fine_rms_cents"] == pytest.approx(best["fine_rms_cents"], abs=0.05)
    assert main(["check", str(tmp_path / "design.h5")]) == 0
    assert f"{found['fine_rms_cents']:.1f} on the fine one" in capsys.readouterr().out


@pytest.mark.nightly
def test_a_search_ends_where_frequencies_are_met_and_nothing_gets_better(problem):
    design = optimise(with_options(problem, evaluations=4000))
    assert fine_cents(design) < MET_CENTS
    assert design.evidence["evaluations"] < 3900
