"""The benchmark of the forests: what it measures is what it says, at small sizes."""

import json

import numpy as np
import pytest

from carillon.command_line import exit_status
from forests import load_model, save_model
from forests.__main__ import main
from forests.evaluate import coarsen
from forests.model import FILLED, VOID
from forests.scaling import prepare
from studies.forests.benchmark import SIZES, ForestBenchmarkOptions, benchmark, caches
from studies.forests.synthetic import coherent_blocks, complete_forests, random_blocks
from tests.forests_reference import coarsen_reference, leaf_numbers


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmark") / "forests.h5"
    save_model(path, complete_forests(2, 6))
    return path


@pytest.mark.parametrize("blocks", [random_blocks(1000), coherent_blocks(1000)])
def test_blocks_have_a_modulus_and_void_cells(blocks):
    assert blocks.shape == (1000, 8) and blocks.flags.c_contiguous
    assert (blocks >= 0).all() and (blocks <= 10.1).all() and blocks.any(axis=1).all()
    assert 0.01 < (blocks == 0).mean() < 0.3


def test_neighbours_in_a_mesh_are_alike():
    young = coherent_blocks(20_000)
    solid = (young > 0).all(axis=1)
    pairs = solid[1:] & solid[:-1]
    step = np.abs(young[1:] / np.where(young[:-1] > 0, young[:-1], 1) - 1)[pairs]
    assert np.median(step) < 0.15


def test_complete_forests_have_all_leaves_and_spread_the_blocks(path):
    model = load_model(path)
    assert len(model.forests.leaves) == 2 * 2 * 2**6
    young = random_blocks(4000, seed=3)
    np.testing.assert_array_equal(coarsen(model, young), coarsen_reference(model, young))
    numbers, filled = leaf_numbers(model, young), prepare(young, "log").filled
    for kind in (VOID, FILLED):
        for tree in range(2):
            visits = np.bincount(numbers[filled == bool(kind), tree] % 64, minlength=64)
            tree_number = numbers[filled == bool(kind), tree] // 64
            assert (tree_number == 2 * kind + tree).all()
            # A random choice has entropy 1; ties of void cells make some leaves empty.
            share = visits[visits > 0] / visits.sum()
            assert -(share * np.log2(share)).sum() / 6 > 0.7


def test_measurements_are_complete_and_agree_with_scikit_learn(path):
    result = benchmark(ForestBenchmarkOptions(str(path), blocks=300, largest=1.0))
    assert result["leaves"] == 256 and result["load_ms"] > 0
    evaluation, rival = result["evaluation"], result["rival"]
    assert len(evaluation) == 5
    for timing in (*evaluation.values(), rival["predict"], rival["coarsen"]):
        assert 0 < timing["min"] <= timing["median"] <= timing["max"] and timing["runs"] >= 7
    assert rival["difference"] < 1e-5 and rival["leaves"] > 200
    (size,) = result["sizes"]
    assert (size["trees"], size["depth"]) == SIZES[0] and 0.5 < size["megabytes"] < 1.0
    np.testing.assert_allclose(size["random_walk_ns"], 1e3 * size["random"]["median"] / 24)


def test_sizes_reach_from_one_to_five_hundred_megabytes():
    megabytes = [2 * trees * 2**depth * 56e-6 for trees, depth in SIZES]
    assert megabytes[0] < 1.0 and megabytes[-1] > 530 and max(depth for _, depth in SIZES) <= 20


def test_caches_are_read_where_the_system_tells_them(tmp_path):
    for number, (level, kind) in enumerate([("1", "Data"), ("2", "Unified")]):
        folder = tmp_path / f"index{number}"
        folder.mkdir()
        for name, text in (("level", level), ("type", kind), ("size", "48K")):
            (folder / name).write_text(f"{text}\n")
    (tmp_path / "index9").mkdir()
    assert caches(tmp_path) == {"L1 Data": "48K", "L2": "48K"}
    assert caches(tmp_path / "missing") == {}


def test_command_prints_columns_or_json(path, capsys):
    arguments = ["benchmark", "--forest", str(path), "--blocks", "200", "--largest", "1"]
    assert exit_status.run("forests", lambda: main([*arguments, "--json"])) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["trees"] == 2 and found["evaluation"]["coarsen, 1 thread"]["median"] > 0
    assert exit_status.run("forests", lambda: main(arguments)) == 0
    assert "microseconds of a block" in capsys.readouterr().out


def test_a_missing_model_is_one_line(capsys, tmp_path):
    arguments = ["benchmark", "--forest", str(tmp_path / "no.h5")]
    assert exit_status.run("forests", lambda: main(arguments)) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
