"""The estimate: it adds up, scales with what is asked for, and says where its numbers are from."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from carillon.errors import UserError
from dataset_gen.objectives import DATASET_OBJECTIVES, SAMPLED
from tests.workflow_runs import planned, snakemake
from workflow.__main__ import main
from workflow.commands import estimate as command
from workflow.commands.estimate import CONFIGURATIONS, estimate, load
from workflow.estimate import measure, summary
from workflow.estimate import sizes as sizes_module
from workflow.estimate.machine import Jobs, Machine
from workflow.estimate.rates import PACKAGED, load_rates, rates_of
from workflow.estimate.sizes import Size, Solid, size_of

NUMBERS = {"jobs", "core_hours", "wall_hours", "longest_job_hours", "memory_gb"}
NUMBERS |= {"kept_gb", "scratch_gb"}
HERE = Machine(1, 2)


def sizes(solid):
    """Unknowns without voxels."""
    return Size(solid.resolution**3, solid.resolution**3 // 5, "made up")


@pytest.fixture(scope="module")
def configs():
    return {name: load(CONFIGURATIONS / f"{name}.yaml") for name in ("tiny", "laptop", "paper")}


@pytest.fixture
def config(configs):
    return copy.deepcopy(configs["laptop"])


def found(config, machine=HERE):
    """Stages by name."""
    stages, _ = estimate(config, load_rates(), machine, sizes)
    return {stage.name: stage for stage in stages}


def values(config, machine=HERE):
    stages, solids = estimate(config, load_rates(), machine, sizes)
    return summary.plain(stages, solids, load_rates(), machine)


def test_everything_takes_something(configs):
    for stage in values(configs["tiny"])["stages"]:
        assert stage["core_hours"] > 0.0 and stage["wall_hours"] > 0.0 and stage["memory_gb"] > 0.0
        assert stage["longest_job_hours"] <= stage["wall_hours"] * (1 + 1e-12)


def test_totals_add_up(configs):
    for config in configs.values():
        result = values(config)
        for name in summary.SUMMED:
            total = sum(stage[name] for stage in result["stages"])
            assert result["totals"][name] == pytest.approx(total)
        assert result["totals"]["memory_gb"] == max(s["memory_gb"] for s in result["stages"])


def test_every_number_has_a_basis(configs):
    for stage in values(configs["paper"])["stages"]:
        assert NUMBERS == set(stage["basis"]) and NUMBERS < set(stage)
        assert all(stage["basis"].values())


def test_data_scale_with_samples(config):
    one = found(config)
    config["dataset"]["samples"] *= 3
    three = found(config)
    name = "data generation"
    assert three[name].kept_mb == pytest.approx(3.0 * one[name].kept_mb)
    start = load_rates().numbers["fitting_start_seconds"]
    for before, after in zip(one[name].jobs, three[name].jobs):
        assert after.seconds - start == pytest.approx(3.0 * (before.seconds - start))
    assert three["ground truth"] == one["ground truth"]


def test_the_sampled_evaluator_costs_as_much_more_as_it_is_slower(configs):
    config = copy.deepcopy(configs["paper"])
    closed = found(config)["data generation"]
    config["dataset"]["objective"] = SAMPLED
    sampled = found(config)["data generation"]
    rates = load_rates().fits_per_second
    ratio = rates["energy"] / rates[SAMPLED]
    assert 0.9 * ratio < sampled.core_hours / closed.core_hours < 1.1 * ratio
    assert any("dataset.shards" in caution for caution in sampled.cautions)


def test_more_cores_shorten_what_has_jobs_for_them(configs):
    paper = configs["paper"]
    one, many = (found(paper, Machine(nodes, 4))["data generation"] for nodes in (1, 100))
    assert many.core_hours == pytest.approx(one.core_hours)
    few, enough = Machine(1, 4).wall(one.jobs), Machine(100, 4).wall(many.jobs)
    assert few > 5.0 * enough
    assert enough >= max(jobs.seconds for jobs in many.jobs)


def test_rows_decide_about_the_memory_of_growing_trees(config):
    config["dataset"]["samples"] = 1_000_000_000
    memory = []
    for rows in (10_000_000, 20_000_000, 30_000_000):
        config["forests"]["structure_rows"] = rows
        memory.append(found(config)["growing trees"].memory_mb)
    assert memory[2] - memory[1] == pytest.approx(memory[1] - memory[0])
    config["forests"]["ranks"] = 2
    assert found(config)["growing trees"].memory_mb == pytest.approx(2.0 * memory[2])


def test_forests_that_exist_are_not_trained(config):
    config["forests"]["model"] = "default"
    names = list(found(config))
    assert names[0] == "ground truth" and "growing trees" not in names


def test_what_is_far_beyond_the_measurements_is_said(configs):
    told = values(configs["paper"])["cautions"]
    assert any("1,000,000,000 rows are far beyond" in caution for caution in told)
    assert not any(stage.cautions for stage in found(configs["tiny"]).values())


def test_rates_of_a_busy_machine_say_so():
    known = replace(load_rates(), measured_share=0.3)
    unknown = replace(known, measured_share=None)
    assert known.serial_share == 0.3 and not known.unmeasured
    assert 0.0 < unknown.serial_share < 1.0 and "too busy" in unknown.unmeasured


def test_jobs_are_those_of_the_rules(configs, tmp_path):
    file = CONFIGURATIONS / "tiny.yaml"
    jobs = planned(snakemake(tmp_path, "--dry-run", "--cores", 2, "--configfile", file))
    stages = found(configs["tiny"])
    fits, reads = stages["data generation"].jobs
    assert (fits.count, reads.count) == (jobs["generate_shard"], jobs["describe_shard"])
    assert stages["growing trees"].count + stages["fitting leaves"].count == jobs["train_forests"]
    modes = stages["ground truth"].count + stages["HCMS and other variants"].count
    others = ("follow_convergence", "time_methods", "measure_scaling_of_run")
    assert modes == jobs["find_modes"] + sum(jobs.get(rule, 0) for rule in others)
    estimated = sum(stage.count for stage in stages.values() if stage.target == "all")
    assert math.isclose(estimated, jobs["total"], rel_tol=0.1)


def test_jobs_wait_for_a_place():
    machine = Machine(2, 4)
    assert machine.wall([Jobs(5, 10.0, 2, 0.0)]) == 20.0
    assert machine.wall([Jobs(1, 10.0, 8, 0.0, ranks=8), Jobs(1, 1.0, 1, 0.0)]) == 11.0
    assert (machine.granted(16), machine.granted(16, ranks=2)) == (4, 8)


def test_an_absent_mesh_is_guessed_and_a_built_in_one_counted():
    assert "guessed" in size_of(Solid("nowhere.obj", 32)).basis
    box = size_of(Solid("builtin:box", 8))
    assert box.fine == 3 * 9 * 7 * 5 and box.coarse == 3 * 5 * 4 * 3 and "counted" in box.basis


# Command line ------------------------------------------------------------------------------------


def test_the_command_prints_text_and_json(capsys):
    assert main(["estimate", "--preset", "tiny"]) == 0
    text = capsys.readouterr().out
    assert "data generation" in text and "core-hours" in text and "528 unknowns" in text
    assert main(["estimate", "--preset", "tiny", "--nodes", "2", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["machine"]["nodes"] == 2 and result["solids"]["bar 16"]["fine"] == 528


def test_the_paper_is_set_beside(capsys, monkeypatch):
    monkeypatch.setattr(command, "estimate", partial(estimate, sizes=sizes))
    name = CONFIGURATIONS / "paper.yaml"
    assert main(["estimate", "--configfile", str(name), "--cores-per-node", "4"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    for words in ("twelve", "10 d", "2 d", "12 h"):
        assert words in last


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--preset", "huge"], "huge"),
        (["--configfile", "absent.yaml"], "absent.yaml: no such file, expected a configuration"),
        (["--configfile", "list.yaml"], "expected a configuration, keys and values"),
        (["--configfile", "broken.yaml"], "broken.yaml: is not readable as YAML (line 1: "),
        (["--configfile", "unknown.yaml"], "colour"),
        (["--rates", "absent.json"], "absent.json: no such file"),
        (["--rates", "broken.yaml"], "broken.yaml: is no JSON"),
        (["--rates", "partial.json"], "'numbers' is a required property"),
        (["--objective", "guess"], "guess"),
        (["--nodes", "0"], "at least 1"),
        (["--nodes", "1000000000"], "at most 100000"),
        (["--cores-per-node", "1000000000"], "at most 10000"),
        (["--configfile", "metal.wav"], "metal.wav: is not readable as YAML"),
        (["--configfile", "."], ".: no such file, expected a configuration"),
        (["--configfile", "/dev/null"], "/dev/null: no such file, expected a configuration"),
        (["--configfile", 5000 * "x"], "cannot be read (File name too long)"),
        (["--rates", "."], ".: is a folder"),
        (["--rates", "metal.wav"], "metal.wav: is no JSON"),
        (["--rates", "brackets.json"], "brackets.json: is no JSON"),
        (["--rates", "nan.json"], "numbers.start_seconds: nan is not of type 'number'"),
    ],
)
def test_bad_input_is_answered_in_a_sentence(arguments, says, tmp_path, monkeypatch, refuses):
    monkeypatch.chdir(tmp_path)
    Path("list.yaml").write_text("[1, 2]")
    Path("broken.yaml").write_text("models: {bar: [")
    Path("unknown.yaml").write_text(
        "models: {bar: {mesh: 'builtin:bar', resolution: 8}}\ncolour: 1"
    )
    partial = json.loads(PACKAGED.read_text())
    del partial["numbers"]
    Path("partial.json").write_text(json.dumps(partial))
    spoiled = json.loads(PACKAGED.read_text())
    spoiled["numbers"]["start_seconds"] = float("nan")
    Path("nan.json").write_text(json.dumps(spoiled))
    Path("brackets.json").write_text(100_000 * "[")
    Path("metal.wav").write_bytes(b"RIFF\x24\x00\x00\x80WAVEfmt \xff")
    assert says in refuses(main, "estimate", *arguments)


def test_bad_input_ends_with_status_2(run_cli):
    done = run_cli("workflow", "estimate", "--rates", "absent.json")
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and not done.stdout


# Measuring ---------------------------------------------------------------------------------------


def ran(folder, arguments, threads=1):
    """A program that takes time and memory by its numbers, and runs nothing."""
    words = arguments.split()
    numbers = [float(word) for word in words if word.replace(".", "").isdigit()]
    (folder / "data.h5").write_bytes(b"x" * 1000)
    output = ""
    if words[:2] == ["dataset_gen", "benchmark"]:
        rates = {name: 1e4 for name in DATASET_OBJECTIVES if name != SAMPLED}
        output = json.dumps({"objectives": rates, "fits_per_second": {"sampled": 100.0}})
    if words[:2] == ["forests", "inspect"]:
        facts = {"leaves_seconds": 1.0, "training_rows": 1000}
        output = json.dumps({"provenance": facts, "leaves": 1000})
    work = math.prod(max(number, 1.0) for number in numbers) ** 0.25
    return measure.Run(1.0 + 1e-3 * work, 1.0 + 1e-3 * work / threads, 100.0 + work, output)


def test_what_is_measured_are_rates(monkeypatch, capsys):
    monkeypatch.setattr(measure, "run_module", ran)
    monkeypatch.setattr(measure, "size_of", sizes)
    leaves = iter([6000, 2000, 90000])
    monkeypatch.setattr(measure.Bench, "_fit", lambda self, options: (1.0, 100.0, next(leaves)))
    rates = rates_of(measure.measure(), "here")
    assert set(rates.fits_per_second) == set(DATASET_OBJECTIVES)
    assert "measuring 1 of" in capsys.readouterr().err
    assert all(cost.seconds(1000, 10) > 0.0 for cost in rates.laws.values())


def test_measured_rates_are_kept_and_used(tmp_path, monkeypatch, capsys):
    packaged = json.loads(PACKAGED.read_text())
    monkeypatch.setattr(measure, "measure", lambda: packaged)
    kept = tmp_path / "rates.json"
    assert main(["estimate", "--preset", "tiny", "--measure", "--rates", str(kept)]) == 0
    assert json.loads(kept.read_text()) == packaged
    first = capsys.readouterr().out
    assert main(["estimate", "--preset", "tiny", "--rates", str(kept)]) == 0
    assert capsys.readouterr().out == first


def test_a_program_is_charged_what_it_took(tmp_path):
    run = measure.run_module(tmp_path, "timeit -n 1 -r 1 pass")
    assert 0.0 < run.seconds < 60.0 and run.memory_mb > 1.0 and "loop" in run.output
    with pytest.raises(UserError, match=r"python -m timeit --gong: failed \("):
        measure.run_module(tmp_path, "timeit --gong")


def test_packaged_rates_name_no_machine_but_its_processor():
    made = load_rates().made
    assert {"processor", "cores", "blas", "commit", "date"} <= set(made)
    assert set(load_rates().fits_per_second) == set(DATASET_OBJECTIVES)


def test_voxels_are_counted_no_finer_than_a_machine_can(monkeypatch):
    monkeypatch.setattr(sizes_module, "LARGEST_COUNTED", 8)
    coarse = sizes_module.size_of(Solid("builtin:bar", 8, "centre"))
    fine = sizes_module.size_of(Solid("builtin:bar", 16, "centre"))
    assert (fine.fine, fine.coarse) == (8 * coarse.fine, 8 * coarse.coarse)
    assert fine.basis == "counted on its voxels at resolution 8, times 8.0"
