"""Shards are complete or absent, the same for any split, and validated when read."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from carillon.errors import UserError
from carillon.files import hdf5
from dataset_gen import shards as shards_module
from dataset_gen.generate import generate
from dataset_gen.objectives import DEFAULT_OBJECTIVE
from dataset_gen.settings import ShardOptions, settings_of
from dataset_gen.shards import iterate_shard, read_runs, read_settings
from tests.edited_files import edited, put
from tests.shard_files import read_shard, read_shards, write_shard

COLUMNS = ("fine", "coarse", "residual", "converged")


@pytest.fixture(scope="module")
def shard():
    return generate(ShardOptions(300, seed=2), progress=False)


@pytest.fixture
def path(tmp_path, shard):
    file = tmp_path / "shard.h5"
    write_shard(file, shard)
    return file


def with_settings(shard, **change):
    return replace(shard, settings=replace(shard.settings, **change))


def test_round_trip_keeps_every_bit(path, shard):
    found = read_shard(path)
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(found, name), getattr(shard, name))
    assert found.settings == read_settings(path) == settings_of(ShardOptions(300, seed=2))
    assert (found.objective, found.seed, found.start, found.stop) == (DEFAULT_OBJECTIVE, 2, 0, 300)
    assert found.provenance["commit"]


def test_settings_and_provenance_are_attributes(path):
    with h5py.File(path) as file:
        assert file.attrs["distribution"] == "uniform"
        assert (file.attrs["low"], file.attrs["high"]) == (0.0, 10.0)
        command = file["provenance"].attrs["command"]
        assert "cores" not in file["provenance"].attrs
    assert command.endswith("--distribution uniform --low 0.0 --high 10.0")
    assert "--samples 300 --shard 0 --shards 1" in command


def test_columns_carry_units_and_checksums(path):
    with h5py.File(path) as file:
        for name in ("fine", "coarse"):
            assert file[name].attrs["units"] == "GPa"
        for name in COLUMNS:
            assert file[name].fletcher32 and file[name].attrs["long_name"]


@pytest.mark.parametrize("rows", [1, 7, 100, 299, 300, 1000])
def test_pieces_are_the_shard(path, shard, rows):
    pieces = list(iterate_shard(path, rows))
    assert [piece.start for piece in pieces] == list(range(0, 300, rows))
    assert pieces[-1].stop == 300
    for name in COLUMNS:
        joined = np.concatenate([getattr(piece, name) for piece in pieces])
        np.testing.assert_array_equal(joined, getattr(shard, name))


@pytest.mark.parametrize(
    ("count", "workers", "drawn"), [(2, 1, {}), (3, 2, {"distribution": "log-uniform"})]
)
def test_dataset_does_not_depend_on_shards_or_workers(count, workers, drawn):
    whole = generate(ShardOptions(300, 2, **drawn), progress=False)
    parts = [
        generate(ShardOptions(300, 2, number, count, **drawn), workers=workers, progress=False)
        for number in range(count)
    ]
    for name in COLUMNS:
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name))


def test_interrupted_write_leaves_nothing(tmp_path, shard, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(shards_module, "_new_column", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_shard(tmp_path / "shard.h5", shard)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda file: file.attrs.modify("schema_version", 1), "schema 1"),
        (lambda file: file.attrs.modify("kind", "modes"), "'modes'"),
        (lambda file: file.attrs.pop("objective"), "'objective'"),
        (lambda file: file.attrs.create("seed", "many"), "settings"),
        (lambda file: file.pop("coarse"), "'coarse'"),
        (lambda file: file.attrs.modify("stop", 299), "expected (299, 8)"),
        (put("coarse", lambda _: np.full((300, 8), np.nan)), "out of range"),
        (put("coarse", lambda _: np.zeros((300, 8))), "out of range"),
        (put("fine", lambda _: np.zeros((300, 8))), "out of range"),
    ],
)
def test_unfit_shards_are_refused_in_a_sentence(path, change, message):
    with edited(path) as file:
        change(file)
    with pytest.raises(UserError) as error:
        read_shard(path)
    text = str(error.value)
    assert message in text and str(path) in text and "\n" not in text


def test_a_shard_of_the_first_schema_is_refused(tmp_path):
    """As version 0.1.0 began to write them: without a seal."""
    path = tmp_path / "old.h5"
    with hdf5.create_h5(path, "dataset", 1) as file:
        file.attrs["sample_range"] = (0, 10)
    with pytest.raises(UserError, match="schema 1, this version reads schema 2"):
        read_shard(path)


def test_a_changed_shard_is_refused_even_if_hdf5_finds_no_fault(path):
    with h5py.File(path, "r+") as file:
        file.attrs.modify("poisson", 0.3)
    with pytest.raises(UserError, match="damaged"):
        read_shard(path)


def test_any_flipped_bit_is_noticed(path):
    content = path.read_bytes()
    generator = np.random.default_rng(0)
    size = len(content)
    for place in {0, 1, 60, 130, 511, 512, 520, 600, size - 1, *generator.integers(0, size, 300)}:
        flipped = bytearray(content)
        flipped[place] ^= 1 << int(generator.integers(8))
        path.write_bytes(flipped)
        with pytest.raises(UserError) as error:
            list(iterate_shard(path))
        assert "\n" not in str(error.value) and str(path) in str(error.value)


@pytest.mark.parametrize("size", [0, 1, 100, 511, 512, 513, 1000, 20_000, -1])
def test_a_truncated_file_is_noticed(path, size):
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(UserError) as error:
        read_shard(path)
    assert "\n" not in str(error.value)


def test_a_file_that_became_longer_is_noticed(path):
    path.write_bytes(path.read_bytes() + b"\0")
    with pytest.raises(UserError, match="damaged"):
        read_shard(path)


def write_all(tmp_path, several):
    paths = [tmp_path / f"{i}.h5" for i in range(len(several))]
    for file, item in zip(paths, several):
        write_shard(file, item)
    return paths


def test_shards_are_read_in_order_of_samples(tmp_path):
    parts = [generate(ShardOptions(30, 2, number, 3), progress=False) for number in (2, 0, 1)]
    assert [s.start for s in read_shards(write_all(tmp_path, parts))] == [0, 10, 20]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"objective": "hybrid"}, "objective hybrid"),
        ({"poisson": 0.3}, "Poisson's ratio 0.3"),
        ({"code": "0123456789ab"}, "code 0123456789ab"),
        ({}, "overlap"),
    ],
)
def test_mixtures_and_overlaps_are_refused(tmp_path, shard, change, message):
    paths = write_all(tmp_path, [shard, with_settings(shard, **change)])
    with pytest.raises(UserError, match=message):
        read_shards(paths)


@pytest.mark.parametrize("change", [{"seed": 3}, {"high": 9.0}, {"distribution": "log-uniform"}])
def test_same_numbers_of_other_samples_do_not_overlap(tmp_path, shard, change):
    assert len(read_shards(write_all(tmp_path, [shard, with_settings(shard, **change)]))) == 2


def test_part_of_a_shard_is_read_alone(tmp_path, shard):
    path = tmp_path / "s.h5"
    write_shard(path, shard)
    parts = list(read_runs(path, [(5, 12), (20, 25)]))
    assert [len(part.fine) for part in parts] == [7, 5]
    fine = np.concatenate([part.fine for part in parts])
    np.testing.assert_array_equal(fine, shard.fine[[*range(5, 12), *range(20, 25)]])
    assert parts[0].start == shard.start + 5 and parts[-1].stop == shard.start + 25


def test_no_shard_at_all_is_refused():
    with pytest.raises(UserError, match="at least one"):
        read_shards([])


@pytest.mark.parametrize("seed", [-1, 1 << 63])
def test_seeds_that_no_file_can_hold_are_refused(seed):
    with pytest.raises(UserError, match=f"seed: found {seed}, expected"):
        settings_of(ShardOptions(10, seed=seed))
