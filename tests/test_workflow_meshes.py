"""Meshes that kept tables rest on are known by their hash."""

import hashlib

import pytest

from tests.workflow_runs import LAPTOP
from workflow import pinned_meshes, settings


@pytest.fixture
def config(tmp_path):
    """The default configuration, with a folder of meshes that is empty."""
    return {**settings.complete([LAPTOP]), "mesh_folder": str(tmp_path)}


def test_another_file_of_a_pinned_name_is_told_in_one_sentence(config, tmp_path):
    assert pinned_meshes.of_run(config) == []
    content = b"v 0 0 0\n"
    (tmp_path / "teapot.obj").write_bytes(content)
    (sentence,) = pinned_meshes.of_run(config)
    assert str(tmp_path / "teapot.obj") in sentence
    assert hashlib.sha256(content).hexdigest()[:12] in sentence
    assert pinned_meshes.PINNED["teapot.obj"]["sha256"][:12] in sentence
    assert pinned_meshes.of_study(config, "figures") == [sentence]


def test_other_names_are_nobodys_business(config, tmp_path):
    config["models"]["bell"]["mesh"] = "gong.obj"
    (tmp_path / "gong.obj").write_bytes(b"v 0 0 0\n")
    assert pinned_meshes.of_run(config) == []


def test_the_meshes_at_hand_are_the_pinned_ones(config, meshes):
    assert pinned_meshes.of_run({**config, "mesh_folder": str(meshes)}) == []
