"""Which modes a solid can have: what is had, what is not, and why."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml

from sound.__main__ import main
from sound.design import reach as reaching
from sound.design.material import REACH
from sound.design.objective import Objective
from sound.design.optimise import optimise
from sound.design.preparation import prepare
from sound.design.reach import HAD, HAD_CENTS, NOT_ALONE, NOT_SOUGHT, NOT_TOGETHER, SomeModes, reach
from sound.project.design_file import write_design
from tests import small_project


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    """The targets are sounds of the bar with a material among those that are sought."""
    made = small_project.project(tmp_path_factory.mktemp("project"), evaluations=1)
    return prepare(made, small_project.targets(made))


@pytest.fixture(scope="module")
def uniform(problem):
    return optimise(problem)


@pytest.fixture(scope="module")
def found(problem, uniform):
    return reach(problem, uniform, None, 2)


def with_frequencies(problem, frequencies):
    targets = replace(problem.setting.objective.targets, frequencies=frequencies)
    objective = Objective(targets, problem.project.weights)
    return replace(problem, setting=replace(problem.setting, objective=objective))


def test_modes_that_a_material_has_together_can_be_had(found, uniform):
    assert found.together == len(found.modes) + 1 == 6
    assert all(mode.alone_cents == 0.0 for mode in found.modes)
    assert max(mode.beside_cents for mode in found.modes) <= HAD_CENTS
    assert all((abs(mode.cents) <= HAD_CENTS) == (mode.verdict == HAD) for mode in found.modes)
    assert any(mode.verdict != HAD for mode in found.modes)


def test_a_mode_beyond_the_bounds_of_the_law_cannot_be_had(problem, uniform):
    """Eigenvalues grow with the moduli, so none leaves its own times the bounds of the moduli."""
    frequencies = problem.setting.objective.targets.frequencies.copy()
    widest = np.exp(REACH) * uniform.frequencies[-1] / uniform.frequencies[0]
    frequencies[-1] = 2.0 * widest * frequencies[0]
    found = reach(with_frequencies(problem, frequencies), uniform, None, 1)
    last = found.modes[-1]
    assert last.verdict == NOT_ALONE
    assert 1200.0 <= last.alone_cents <= last.beside_cents
    assert found.together < 6


def test_nothing_is_sought_where_a_design_has_all(problem, uniform, monkeypatch):
    monkeypatch.setattr(reaching, "Pool", None)
    found = reach(with_frequencies(problem, 3.0 * uniform.frequencies), uniform, None, 1)
    assert found.together == 6 and {mode.verdict for mode in found.modes} == {HAD}
    assert max(abs(mode.cents) for mode in found.modes) < 1e-9


def test_what_is_found_does_not_depend_on_the_number_of_workers(problem, uniform, found):
    optimiser = replace(problem.project.optimiser, workers=2)
    two = reach(
        replace(problem, project=replace(problem.project, optimiser=optimiser)), uniform, None, 2
    )
    assert (two.modes, two.together) == (found.modes, found.together)


def test_no_descent_begins_when_the_time_is_over(problem, uniform, monkeypatch):
    monkeypatch.setattr("sound.design.pool.descend_by_model", None)
    found = reach(problem, uniform, 1e-9, 3)
    assert found.together < 6
    verdicts = {mode.verdict for mode in found.modes}
    assert {NOT_SOUGHT} <= verdicts <= {HAD, NOT_SOUGHT, NOT_TOGETHER}


def test_some_modes_cost_what_they_add_to_the_cost_of_all(problem):
    targets = problem.setting.objective.targets
    evaluation = problem.setting.simulation().evaluate(np.zeros(10), derivatives=True)
    values, sensitivity = evaluation.eigenvalues, evaluation.sensitivity
    whole, some = SomeModes(targets, range(1, 6)), SomeModes(targets, (2, 4))
    rest = SomeModes(targets, (1, 3, 5))
    costs = [each.cost(values, evaluation.pushed, 0.0).total for each in (whole, some, rest)]
    assert costs[0] == pytest.approx(costs[1] + costs[2])
    np.testing.assert_array_equal(
        some.frequency_jacobian(values, sensitivity),
        problem.setting.objective.frequency_jacobian(values, sensitivity)[[1, 3]],
    )


def test_the_command_tells_what_was_found(uniform, tmp_path, capsys):
    write_design(tmp_path / "design.h5", uniform)
    small_project.write_clips(tmp_path, 2.0 * uniform.frequencies)
    (tmp_path / "project.yaml").write_text(yaml.safe_dump(small_project.PROJECT))
    words = ["reach", str(tmp_path / "project.yaml"), str(tmp_path / "design.h5")]
    assert main([*words, "--descents", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [mode["mode"] for mode in told["modes"]] == [2, 3, 4, 5, 6]
    assert main([*words, "--descents", "1"]) == 0
    assert f"the first {told['together']} of 6 modes" in capsys.readouterr().out
    assert main([*words, "--unless-fall", "0"]) == 0
    assert "nothing is asked" in capsys.readouterr().out


def test_a_design_for_other_targets_is_refused(uniform, tmp_path, capsys):
    write_design(tmp_path / "design.h5", uniform)
    described = {**small_project.PROJECT, "targets": small_project.PROJECT["targets"][:1]}
    small_project.write_clips(tmp_path, 2.0 * uniform.frequencies)
    (tmp_path / "project.yaml").write_text(yaml.safe_dump(described))
    assert main(["reach", str(tmp_path / "project.yaml"), str(tmp_path / "design.h5")]) != 0
    assert "is a design for end, side, expected one for" in capsys.readouterr().err
