"""What a search tells while it goes on, and what is left of a round that is broken off."""

import os
import signal
import struct
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sound.design.optimise import optimise
from sound.design.pool import InterruptedRoundError, Pool
from sound.design.preparation import prepare
from sound.design.tasks import Task
from tests import small_project
from tests.patience import HANG_SECONDS, wait_for
from tests.small_project import with_options


def write_half_a_result(path):
    """In a process of a pool: begin with a result as if to be killed in the midst of it."""
    frame = sys._getframe()
    while "result_queue" not in frame.f_locals:
        frame = frame.f_back
    os.write(frame.f_locals["result_queue"]._writer.fileno(), struct.pack("!i", 1000) + b"begin")
    Path(path).touch()
    time.sleep(HANG_SECONDS)


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    """The targets are sounds of the fine bar, the search works with a coarse one."""
    made = small_project.project(tmp_path_factory.mktemp("project"), evaluations=60)
    targets = small_project.targets(made)
    return prepare(replace(made, coarsen="average"), targets)


@pytest.mark.parametrize("workers", [1, 2])
def test_every_step_is_told_with_what_the_fine_solid_then_sounds_at(problem, workers):
    followed = []
    chosen = with_options(problem, workers=workers)
    design = optimise(chosen, follow=lambda step, hertz: followed.append((step, hertz)))
    assert len(followed) > 5
    costs = [step.cost.total for step, _ in followed]
    assert np.isfinite(costs).all() and min(costs) < max(costs)
    near = min(followed, key=lambda each: np.linalg.norm(each[0].z - design.coordinates))
    assert np.allclose(near[0].z, design.coordinates, atol=1e-12)
    told, found = np.sort(near[1]), design.frequencies
    assert np.allclose(told / told[0], found / found[0], rtol=5e-3)


def test_a_search_begins_at_given_coordinates(problem):
    z = np.random.default_rng(0).normal(scale=0.1, size=problem.setting.material.dimensions)
    design = optimise(with_options(problem, evaluations=1), coordinates=z)
    assert np.array_equal(design.coordinates, z)


def test_a_round_that_is_broken_off_leaves_the_best_of_its_steps(problem):
    """It is not waited for: two descents of the round alone would take all that follows."""
    followed = []

    def follow(step, hertz):
        followed.append(step)
        if len(followed) == 3:
            os.kill(os.getpid(), signal.SIGTERM)

    endless = with_options(problem, evaluations=None, seconds=None, workers=2, fine_check=False)
    design = optimise(endless, follow=follow)
    best = min(followed, key=lambda step: step.cost.total)
    # Analyses of a search are less accurate than the last one.
    assert design.evidence["cost"] <= best.cost.total * (1.0 + 1e-3)


def test_a_round_is_broken_off_while_tasks_are_sent(problem):
    """They may be larger than what waits between processes, and nobody reads them any more."""
    setting = problem.setting
    start = np.zeros((300_000, 8))
    z = np.zeros(setting.material.dimensions)
    for _ in range(3):
        processes = Pool(setting, 2)
        with pytest.raises(InterruptedRoundError):
            processes.run([Task(z, start)] * 6, lambda: True)


def test_processes_are_ended_in_the_midst_of_what_they_tell(problem, tmp_path):
    processes = Pool(problem.setting, 2)
    written = tmp_path / "written"
    processes._pool.submit(write_half_a_result, str(written))
    wait_for(written.exists, "half a result")
    manager = processes._pool._executor._executor_manager_thread
    # By now it waits for the rest.
    time.sleep(0.2)
    processes.close()
    assert not manager.is_alive()
