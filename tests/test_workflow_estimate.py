"""The estimate: it adds up, scales with what is asked for, and says how it was reckoned."""

import copy
import json
from functools import cache
from pathlib import Path

import pandas as pd
import pytest

from dataset_gen.objectives import DATASET_OBJECTIVES, SAMPLED
from workflow.__main__ import main
from workflow.commands.estimate import CONFIGURATIONS, load
from workflow.estimate import costs
from workflow.estimate.costs import load_medians, with_costs, with_work
from workflow.estimate.jobs import plan
from workflow.estimate.summary import SUMMED, summarised

HERE = (1, 2)
"""Nodes and cores of each."""


@pytest.fixture(scope="module")
def configs():
    return {name: load(CONFIGURATIONS / f"{name}.yaml") for name in ("tiny", "laptop", "paper")}


@pytest.fixture
def config(configs):
    return copy.deepcopy(configs["laptop"])


@cache
def _planned(config, *cores):
    return plan(json.loads(config), *cores)


def costed(config, machine=HERE, medians=None):
    """What every job takes; what is the same is planned only once, which takes seconds."""
    nodes, cores = machine
    jobs = _planned(json.dumps(config), cores, nodes * cores)
    return with_costs(with_work(jobs, config), load_medians() if medians is None else medians)


def values(config, machine=HERE, medians=None):
    return summarised(costed(config, machine, medians), machine[0] * machine[1])


def stages(config, machine=HERE):
    """Stages by name."""
    return {stage["stage"]: stage for stage in values(config, machine)["stages"]}


def test_everything_takes_something(configs):
    for stage in values(configs["tiny"])["stages"]:
        assert stage["core_hours"] > 0.0 and stage["wall_hours"] > 0.0 and stage["memory_gb"] > 0.0
        assert stage["longest_job_hours"] <= stage["wall_hours"] * (1 + 1e-12)


@pytest.mark.parametrize(("totals", "targets"), [("totals", 2), ("run_totals", 1)])
def test_totals_add_up(configs, totals, targets):
    for config in configs.values():
        result = values(config)
        counted = [
            each for each in result["stages"] if each["target"] in ("all", "figures")[:targets]
        ]
        for name in SUMMED:
            assert result[totals][name] == pytest.approx(sum(stage[name] for stage in counted))
        assert result[totals]["memory_gb"] == max(stage["memory_gb"] for stage in counted)


def test_every_job_of_the_presets_is_measured(configs):
    for config in configs.values():
        assert not any("not measured" in caution for caution in values(config)["cautions"])


def test_a_rule_that_was_not_measured_takes_its_limit_and_says_so(config):
    medians = load_medians().drop("audit_spectra")
    config["resources"]["audit_spectra"] = {"memory_mb": 1234, "minutes": 7}
    jobs = costed(config, HERE, medians)
    audit = jobs[jobs["kind"] == "audit_spectra"]
    assert set(audit["hours"]) == {7 / 60} and set(audit["memory_gb"]) == {1.234}
    cautions = values(config, HERE, medians)["cautions"]
    assert any("audit_spectra: not measured; the 7 min" in caution for caution in cautions)


def test_data_scale_with_samples(config):
    more = copy.deepcopy(config)
    more["dataset"]["samples"] *= 3
    one, three = (stages(each)["data generation"]["kept_gb"] for each in (config, more))
    assert three == pytest.approx(3.0 * one, rel=1e-2)
    assert stages(more)["ground truth"] == stages(config)["ground truth"]


def test_the_sampled_evaluator_costs_as_much_more_as_it_is_slower(configs):
    config = copy.deepcopy(configs["paper"])
    closed = stages(config)["data generation"]["core_hours"]
    config["dataset"]["objective"] = SAMPLED
    ratio = costs.FIT_COSTS[SAMPLED] / costs.FIT_COSTS["energy"]
    assert stages(config)["data generation"]["core_hours"] == pytest.approx(
        ratio * closed, rel=0.01
    )
    assert set(costs.FIT_COSTS) == set(DATASET_OBJECTIVES)


def test_more_cores_shorten_what_has_jobs_for_them(configs):
    one, many = (stages(configs["paper"], (nodes, 4))["data generation"] for nodes in (1, 100))
    assert many["core_hours"] == pytest.approx(one["core_hours"])
    assert one["wall_hours"] > 5.0 * many["wall_hours"]
    assert many["wall_hours"] >= many["longest_job_hours"]


def on_ranks(config, ranks):
    """The configuration with every solver run on so many ranks of one core each."""
    config = copy.deepcopy(config)
    config["solver"] |= {"ranks": ranks, "cores": ranks}
    return config


def test_more_ranks_take_fewer_hours_and_no_fewer_core_hours(configs):
    one, four, many = (
        stages(on_ranks(configs["laptop"], ranks), (16, 4))["ground truth"] for ranks in (1, 4, 16)
    )
    assert one["longest_job_hours"] > four["longest_job_hours"] > many["longest_job_hours"]
    assert one["core_hours"] <= four["core_hours"] <= many["core_hours"]
    assert one["ranks"] == 1 and one["rank_speed_up"] == [1.0, 1.0]
    assert four["ranks"] == 4 and 1.5 < four["rank_speed_up"][0] <= four["rank_speed_up"][1] < 4.0


def test_a_job_that_starts_no_ranks_is_not_faster_by_them(configs):
    jobs = costed(on_ranks(configs["laptop"], 4), (16, 4)).set_index("kind")
    assert set(jobs.loc["follow_convergence", "rank_speed_up"]) == {1.0}
    assert (jobs.loc["find_modes truth", "rank_speed_up"] > 1.5).all()


def test_what_was_measured_on_ranks_is_not_taken_as_on_one(configs):
    config = on_ranks(configs["laptop"], 4)
    jobs = costed(config, (16, 4))
    truth = jobs[jobs["kind"] == "find_modes truth"].iloc[0]
    medians = load_medians()
    medians.loc["find_modes truth", ["work", "seconds", "speed_up"]] = (
        truth["work"],
        100.0,
        truth["speed_up"],
    )
    again = costed(config, (16, 4), medians)
    hours = again.loc[truth.name, "hours"]
    assert hours == pytest.approx(100.0 / 3600.0)


def test_the_text_says_how_much_faster_ranks_are(tmp_path, capsys):
    Path(tmp_path, "ranks.yaml").write_text(
        "models: {bar: {mesh: 'builtin:bar', resolution: 24}}\nsolver: {ranks: 2, cores: 2}\n"
    )
    assert main(["estimate", "--configfile", str(tmp_path / "ranks.yaml")]) == 0
    assert "ground truth: on 2 ranks 1." in capsys.readouterr().out


def test_forests_that_exist_are_not_trained(config):
    config["forests"]["model"] = "default"
    names = list(stages(config))
    assert "ground truth" in names and not {"growing trees", "data generation"} & set(names)


def test_what_is_far_beyond_the_measurements_is_said(configs):
    assert any(
        "growing trees: the largest" in each for each in values(configs["paper"])["cautions"]
    )
    assert not values(configs["tiny"])["cautions"]


def test_jobs_are_those_of_the_rules(configs, plan):
    jobs = plan("all", "figures", "--configfile", CONFIGURATIONS / "tiny.yaml")
    rules = _planned(json.dumps(configs["tiny"]), 2, 2)["kind"].str.split(" ").str[0]
    counts = rules.value_counts().to_dict()
    assert counts | {"all": 1, "figures": 1} == {n: jobs[n] for n in jobs if n != "total"}


def test_an_absent_mesh_is_guessed_and_a_built_in_one_counted():
    assert costs.unknowns("nowhere.obj", 30) == costs.TYPICAL * 30**3
    assert costs.unknowns("builtin:box", 8) == 3 * 9 * 7 * 5
    assert costs.unknowns("builtin:box", 48) == 8 * costs.unknowns("builtin:box", 24)


def test_results_of_a_run_replace_what_comes_along(tmp_path):
    Path(tmp_path, "config.yaml").write_text((CONFIGURATIONS / "tiny.yaml").read_text())
    benchmark = tmp_path / "benchmarks/models/bar/truth.tsv"
    benchmark.parent.mkdir(parents=True)
    benchmark.write_text("s\th:m:s\tmax_rss\n501\t0:08:21\tNA\n")
    (tmp_path / "models/bar").mkdir(parents=True)
    (tmp_path / "models/bar/truth.h5").write_bytes(bytes(3000))
    own, packaged = load_medians([tmp_path]), load_medians()
    truth = own.loc["find_modes truth"]
    assert truth["seconds"] == 501.0 and truth["megabytes"] == 0.003
    others = own.index.drop("find_modes truth")
    pd.testing.assert_frame_equal(own.loc[others], packaged.loc[others], check_dtype=False)


# Command line ------------------------------------------------------------------------------------


def test_the_command_prints_text_and_json(capsys):
    assert main(["estimate", "--preset", "tiny"]) == 0
    text = capsys.readouterr().out
    assert "data generation" in text and "core-hours" in text
    assert "total of target all" in text and "total with figures" in text
    assert "factor of three" in text
    assert main(["estimate", "--preset", "tiny", "--nodes", "2", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["machine"]["nodes"] == 2 and result["measured"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--preset", "huge"], "huge"),
        (["--configfile", "absent.yaml"], "absent.yaml: no such file, expected a configuration"),
        (["--configfile", "list.yaml"], "expected a configuration, keys and values"),
        (["--configfile", "broken.yaml"], "broken.yaml: is not readable as YAML (line 1: "),
        (["--configfile", "unknown.yaml"], "colour"),
        (["--results", "absent"], "absent/config.yaml: no such file"),
        (["--results", "."], "holds no benchmark files"),
        (["--results", "spoiled"], "truth.tsv: expected a benchmark file of Snakemake"),
        (["--objective", "guess"], "guess"),
        (["--nodes", "0"], "at least 1"),
        (["--nodes", "1000000000"], "at most 100,000"),
        (["--cores-per-node", "1000000000"], "at most 10,000"),
        (["--configfile", "metal.wav"], "metal.wav: is not readable as YAML"),
        (["--configfile", "."], ".: is a folder, expected a configuration"),
        (["--configfile", "/dev/null"], "/dev/null: no such file, expected a configuration"),
        (["--configfile", 5000 * "x"], "cannot be read (File name too long)"),
    ],
)
def test_bad_input_is_answered_in_a_sentence(arguments, says, tmp_path, monkeypatch, refuses):
    monkeypatch.chdir(tmp_path)
    Path("list.yaml").write_text("[1, 2]")
    Path("broken.yaml").write_text("models: {bar: [")
    model = "models: {bar: {mesh: 'builtin:bar', resolution: 8}}\n"
    Path("unknown.yaml").write_text(f"{model}colour: 1")
    for folder in (Path(), Path("spoiled")):
        folder.mkdir(exist_ok=True)
        (folder / "config.yaml").write_text(model)
    Path("spoiled/benchmarks/models/bar").mkdir(parents=True)
    Path("spoiled/benchmarks/models/bar/truth.tsv").write_bytes(b"RIFF\x24\x00\x00\x80WAVEfmt \xff")
    Path("metal.wav").write_bytes(b"RIFF\x24\x00\x00\x80WAVEfmt \xff")
    assert says in refuses(main, "estimate", *arguments)


def test_a_mesh_that_is_none_is_one_sentence(tmp_path, monkeypatch, refuses):
    monkeypatch.chdir(tmp_path)
    Path("meshes").mkdir()
    Path("meshes/bad.obj").write_text("no mesh")
    Path("c.yaml").write_text("models: {bad: {mesh: bad.obj, resolution: 8}}")
    assert "bad.obj" in refuses(main, "estimate", "--configfile", "c.yaml")
