"""Training data of the workflow's forests: how samples are divided, and mistakes in that."""

import pytest
import yaml

from carillon.errors import UserError
from tests.workflow_runs import LAPTOP, planned, snakemake
from workflow import settings, training
from workflow.commands.digest import digest
from workflow.configuration.whole import completed

FORESTS = "results/forests/forests.h5"


def config(**dataset) -> dict:
    loaded = settings.complete([LAPTOP])
    loaded["dataset"] |= dataset
    return loaded


def test_distributions_share_the_samples_and_name_the_shards():
    plan = training.own(config(samples=1001, shards=2))
    assert plan.shards == ["uniform-0", "uniform-1", "log-uniform-0", "log-uniform-1"]
    assert [plan.samples_of(name) for name in plan.distributions] == [501, 500]
    arguments = plan.generate_arguments("log-uniform", 1)
    assert arguments[:8] == "--samples 500 --shard 1 --shards 2 --seed 0".split()
    assert arguments[-2:] == ["--distribution", "log-uniform"]
    assert plan.first_shards(1) == ["uniform-0", "log-uniform-0"]


def test_a_range_is_that_of_its_distribution_alone():
    plan = training.own(config(ranges={"uniform": [1, 20]}))
    assert plan.generate_arguments("uniform", 0)[-4:] == ["--low", "1", "--high", "20"]
    assert "--low" not in plan.generate_arguments("log-uniform", 0)


def test_samples_that_are_not_stored_are_those_of_the_shards():
    plan = training.own(config(store=False, samples=1000, ranges={"uniform": [1, 20]}))
    assert plan.shards == []
    text = " ".join(plan.data_arguments)
    assert text.startswith("--samples 1000 --data-seed 0 --objective calibrated")
    assert text.endswith("--distributions uniform:1:20 log-uniform")
    assert training.own(config()).data_arguments == ["--checked"]


def test_without_shards_nothing_else_of_the_run_is_missing(dry_run, tmp_path):
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config(store=False)))
    jobs = planned(dry_run(tmp_path, "-p", "--cores", 1, "--configfile", "config.yaml"))
    assert jobs["grow_tree"] == 6 and jobs["train_forests"] == 1
    assert not {"generate_shard", "describe_shard"} & set(jobs)


@pytest.mark.nightly
def test_a_run_makes_the_same_forests_with_and_without_shards(tmp_path):
    digests = set()
    for store in (True, False):
        folder = tmp_path / f"store-{store}"
        folder.mkdir()
        values = {
            "models": {"bar": {"mesh": "builtin:bar", "resolution": 12}},
            "dataset": {"samples": 2000, "shards": 1, "store": store},
            "forests": {"trees": 1, "ranks": 1 if store else 2, "threads": 1},
        }
        (folder / "config.yaml").write_text(yaml.safe_dump(values))
        run = snakemake(folder, FORESTS, "--cores", 2, "--configfile", "config.yaml")
        assert run.returncode == 0, run.stdout + run.stderr
        digests.add(digest(folder / FORESTS))
        assert (folder / "results" / "dataset").exists() == store
    assert len(digests) == 1


@pytest.mark.parametrize(
    ("forests", "usual", "cores"),
    [({}, 8, 8), ({"ranks": 3}, 8, 3), ({"ranks": 3, "threads": 4}, 8, 12), ({"threads": 2}, 8, 2)],
)
def test_ranks_and_threads_are_the_cores_of_a_job(forests, usual, cores):
    loaded = config()
    loaded["forests"] |= forests
    assert training.own(loaded).cores(usual) == cores


def test_every_parameter_of_the_training_is_passed_on():
    plan = training.default(config())
    for option in ("trees", "depth", "max-leaves", "min-leaf", "structure-rows", "seed"):
        assert f"--{option}" in plan.train_arguments
    assert plan.trees == range(6)
    assert plan.dataset["samples"] == 6_000_000


@pytest.mark.parametrize(
    ("dataset", "says"),
    [
        (
            {"distributions": ["uniform"], "ranges": {"log-uniform": [1, 2]}},
            "dataset.ranges.log-uniform: 'log-uniform' is not among the distributions uniform",
        ),
        ({"ranges": {"log-uniform": [0, 2]}}, "dataset.ranges.log-uniform: "),
        ({"ranges": {"uniform": [3, 2]}}, "dataset.ranges.uniform: "),
        ({"samples": 100, "shards": 51}, "dataset.shards: 50 samples of a distribution"),
    ],
)
def test_data_that_make_no_sense_are_answered_in_one_sentence(dataset, says):
    with pytest.raises(UserError) as caught:
        completed(config(**dataset))
    assert says in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("distributions", ["normal"], ["dataset.distributions[0]", "normal"]),
        ("distributions", [], ["dataset.distributions"]),
        ("ranges", {"uniform": [1]}, ["dataset.ranges.uniform", "least and largest modulus"]),
        ("low", 1, ["dataset", "low"]),
    ],
)
def test_distributions_and_ranges_are_checked(key, value, says):
    with pytest.raises(UserError) as caught:
        completed(config(**{key: value}))
    for words in says:
        assert words in str(caught.value)


def test_one_distribution_has_all_samples(dry_run, tmp_path):
    loaded = config(distributions=["uniform"], shards=3)
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(loaded))
    done = dry_run(tmp_path, "-p", "--cores", 1, "--configfile", "config.yaml")
    assert planned(done)["generate_shard"] == 3
    output = done.stdout + done.stderr
    assert "--samples 120000 --shard 2 --shards 3" in output
    assert "results/dataset/uniform-2.h5" in output and "log-uniform" not in output
