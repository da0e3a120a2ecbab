"""Shards are complete or absent, the same for any split, and validated when read."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from carillon.errors import UserError
from dataset_gen import shards as shards_module
from dataset_gen.generate import generate
from dataset_gen.shards import read_shard, read_shards, write_shard


@pytest.fixture(scope="module")
def shard():
    return generate(300, seed=2, progress=False)


@pytest.fixture
def path(tmp_path, shard):
    file = tmp_path / "shard.h5"
    write_shard(file, shard, {"seed": 2})
    return file


def test_round_trip_keeps_every_bit(path, shard):
    found = read_shard(path)
    for name in ("fine", "coarse", "residual", "converged"):
        np.testing.assert_array_equal(getattr(found, name), getattr(shard, name))
    assert (found.objective, found.seed, found.start, found.stop) == ("factored", 2, 0, 300)
    assert found.poisson == 0.25
    assert found.provenance["commit"]


def test_columns_carry_units_and_checksums(path):
    with h5py.File(path) as file:
        for name in ("fine", "coarse"):
            assert file[name].attrs["units"] == "GPa"
        for name in ("fine", "coarse", "residual", "converged"):
            assert file[name].fletcher32 and file[name].attrs["long_name"]


@pytest.mark.parametrize(("count", "workers"), [(2, 1), (3, 2)])
def test_dataset_does_not_depend_on_shards_or_workers(shard, count, workers):
    parts = [
        generate(300, 2, number, count, workers=workers, progress=False) for number in range(count)
    ]
    for name in ("fine", "coarse", "residual", "converged"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(shard, name))


def test_more_workers_than_tasks_do_not_change_a_bit(monkeypatch, shard):
    monkeypatch.setattr("dataset_gen.generate.TASK_ROWS", 100)
    found = generate(300, 2, workers=2, progress=False)
    np.testing.assert_array_equal(found.coarse, shard.coarse)


def test_interrupted_write_leaves_nothing(tmp_path, shard, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(shards_module.provenance, "write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_shard(tmp_path / "shard.h5", shard, {})
    assert list(tmp_path.iterdir()) == []


def edit(path, change):
    with h5py.File(path, "r+") as file:
        change(file)


def replace_column(name, values):
    def change(file):
        del file[name]
        file[name] = values

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda file: file.attrs.modify("schema_version", 0), "schema 0"),
        (lambda file: file.attrs.modify("kind", "modes"), "'modes'"),
        (lambda file: file.attrs.pop("objective"), "no attribute 'objective'"),
        (lambda file: file.pop("coarse"), "no dataset 'coarse'"),
        (lambda file: file.attrs.modify("sample_range", (0, 299)), "expected (299, 8)"),
        (replace_column("coarse", np.full((300, 8), np.nan)), "out of range"),
        (replace_column("coarse", np.zeros((300, 8))), "out of range"),
        (replace_column("fine", np.zeros((300, 8))), "out of range"),
    ],
)
def test_unfit_shards_are_refused_in_a_sentence(path, change, message):
    edit(path, change)
    with pytest.raises(UserError) as error:
        read_shard(path)
    text = str(error.value)
    assert message in text and str(path) in text and "\n" not in text


def test_flipped_byte_is_noticed(path):
    with h5py.File(path) as file:
        chunk = file["coarse"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(UserError, match="damaged"):
        read_shard(path)


def test_truncated_file_is_noticed(path):
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(UserError, match="damaged"):
        read_shard(path)


def write_all(tmp_path, several):
    paths = [tmp_path / f"{i}.h5" for i in range(len(several))]
    for file, item in zip(paths, several):
        write_shard(file, item, {})
    return paths


def test_shards_are_read_in_order_of_samples(tmp_path):
    parts = [generate(30, 2, number, 3, progress=False) for number in (2, 0, 1)]
    assert [s.start for s in read_shards(write_all(tmp_path, parts))] == [0, 10, 20]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"objective": "hybrid"}, "objective hybrid"),
        ({"poisson": 0.3}, "poisson 0.3"),
        ({}, "overlap"),
    ],
)
def test_mixtures_and_overlaps_are_refused(tmp_path, shard, change, message):
    paths = write_all(tmp_path, [shard, replace(shard, **change)])
    with pytest.raises(UserError, match=message):
        read_shards(paths)


def test_same_samples_of_another_seed_do_not_overlap(tmp_path, shard):
    assert len(read_shards(write_all(tmp_path, [shard, replace(shard, seed=3)]))) == 2


def test_no_shard_at_all_is_refused():
    with pytest.raises(UserError, match="at least one"):
        read_shards([])
