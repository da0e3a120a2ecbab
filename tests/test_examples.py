"""Every example says what it shows, stands in the gallery, and runs."""

import ast

import gallery
import pytest

from tests.programs import checkout_environment, python

SLOW = set(
    "a_scene a_study coarsening design_from_a_clip export_a_design melody own_objective "
    "pan_of_iron_and_beech strike_and_hear train_forests".split()
)
"""Examples that take more than ten seconds, and are run each night."""
LIGHT = 60_000
"""Bytes of a picture in the checkout."""

EACH = pytest.mark.parametrize("script", gallery.scripts(), ids=lambda script: script.stem)


@EACH
def test_an_example_is_short_and_says_what_it_shows(script):
    lines = script.read_text().splitlines()
    docstring = ast.get_docstring(ast.parse(script.read_text()))
    assert 10 <= len(lines) <= 60
    assert docstring is not None and ": " in docstring.splitlines()[0]


@EACH
def test_an_example_uses_the_public_surface_alone(script):
    rooms = {"dataset_gen", "forests", "solver", "sound", "studio", "studies", "workflow"}
    for node in ast.walk(ast.parse(script.read_text())):
        if isinstance(node, ast.Import):
            names = {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names = {node.module}
        else:
            continue
        assert names.isdisjoint(rooms) and not any(n.startswith("carillon.") for n in names)


def test_pictures_are_light_and_of_examples_that_are_there():
    pictures = {path.stem: path.stat().st_size for path in gallery.PICTURES.iterdir()}
    assert set(pictures) == {script.stem for script in gallery.scripts()}
    assert max(pictures.values()) < LIGHT


@pytest.mark.parametrize(
    "script",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.nightly] * (path.stem in SLOW))
        for path in gallery.scripts()
    ],
)
def test_an_example_runs_and_draws_its_picture(script, tmp_path):
    pytest.importorskip("mujoco") if script.stem == "a_scene" else None
    environment = checkout_environment(MPLBACKEND="Agg")
    done = python("-W", "error::DeprecationWarning", script, cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / gallery.picture_of(script).name).stat().st_size > 5_000


@pytest.mark.mpi
@pytest.mark.nightly
def test_ranks_say_the_same(tmp_path, mpiexec):
    done = mpiexec(2, gallery.EXAMPLES / "on_ranks.py", cwd=tmp_path, check=True)
    said = {line.partition(": ")[2] for line in done.stdout.splitlines() if "rank " in line}
    assert len(said) == 1
