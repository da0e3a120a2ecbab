"""Voxels that close a gap of a solid, and so hold together what is apart, are told."""

import numpy as np
import pytest
import trimesh

from carillon.fem.geometry import BUILTINS, builtin_surface, voxelize
from carillon.fem.geometry.bridges import bridge
from solver.__main__ import main
from tests.mesh_files import block, concatenated

TURN = trimesh.transformations.rotation_matrix(0.7, (1.0, 2.0, 3.0))
TURNS = {"straight": np.eye(4), "turned": TURN}
SIDE = 0.3


def slit(gap: float) -> trimesh.Trimesh:
    """Square ring of bars a third as thick as it is wide, cut through by a gap."""
    return concatenated(
        block((0.0, 0.0, 0.0), (SIDE, 0.1, 0.1)),
        block((0.0, 0.05, 0.0), (0.1, SIDE, 0.1)),
        block((0.2, 0.05, 0.0), (SIDE, SIDE, 0.1)),
        block((0.05, 0.2, 0.0), (0.13, SIDE, 0.1)),
        block((0.13 + gap, 0.2, 0.0), (0.25, SIDE, 0.1)),
    )


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("share", [0.8, 0.9, 1.0])
def test_a_slit_of_up_to_a_voxel_is_told_where_it_is_closed(share, turn):
    solid = slit(share * SIDE / 16).apply_transform(TURNS[turn])
    found = bridge(solid, voxelize(solid, 16))
    assert found is not None
    x, y, z = trimesh.transform_points([found], np.linalg.inv(TURNS[turn]))[0]
    assert 0.11 < x < 0.17 and 0.18 < y < 0.32 and -0.02 < z < 0.12


@pytest.mark.parametrize("turn", TURNS)
def test_wide_slits_stay_open(turn):
    solid = slit(0.07).apply_transform(TURNS[turn])
    assert bridge(solid, voxelize(solid, 16)) is None


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("resolution", [12, 20, 32])
@pytest.mark.parametrize("name", BUILTINS)
def test_nothing_is_told_of_solids_without_gaps(name, resolution, turn):
    solid = builtin_surface(name).apply_transform(TURNS[turn])
    assert bridge(solid, voxelize(solid, resolution)) is None


@pytest.mark.parametrize("name", ["slit-ring", "spiral", "eared-head", "cup", "comb"])
def test_gaps_of_a_voxel_are_told_of_the_solids_made_to_have_them(name):
    """At most at resolution 24, of which a voxel is as wide as the gaps."""
    solids = [builtin_surface(name), builtin_surface(name).apply_transform(TURN)]
    assert any(bridge(each, voxelize(each, 20)) is not None for each in solids)
    assert bridge(solids[0], voxelize(solids[0], 48)) is None


@pytest.mark.parametrize("discretisation", ["voxel", "finite-cell"])
def test_modes_of_voxels_say_once_that_a_gap_is_closed(discretisation, tmp_path, capfd):
    slit(0.015).export(tmp_path / "ring.obj")
    words = ["modes", str(tmp_path / "ring.obj"), "--resolution", "16", "--modes", "8"]
    words += ["--discretisation", discretisation, "--no-estimate"]
    assert main([*words, "--out", str(tmp_path / "x.h5")]) == 0
    said = capfd.readouterr().err.count("voxels close a gap near (")
    assert said == (1 if discretisation == "voxel" else 0)
