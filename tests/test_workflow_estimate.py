"""The estimate: it adds up, scales with what is asked for, and says where its numbers are from."""

from __future__ import annotations

import copy
import json
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from carillon.errors import UserError
from dataset_gen.objectives import DATASET_OBJECTIVES, SAMPLED
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions, build_problem
from solver.coarsening.choice import make_coarsening
from solver.refinement.coarse_or_fine import _Weighing
from solver.refinement.refined_model import RefinedModel
from workflow.__main__ import main
from workflow.commands import estimate as command
from workflow.commands.estimate import CONFIGURATIONS, estimate, load
from workflow.estimate import measure, solids, summary
from workflow.estimate import sizes as reading
from workflow.estimate.costs import Machine, serial_share
from workflow.estimate.laws import fit
from workflow.estimate.plan import plan
from workflow.estimate.rates import PACKAGED, checked, load_rates
from workflow.estimate.solids import NamedSolid, Size, size_of

NUMBERS = {"jobs", "core_hours", "wall_hours", "longest_job_hours", "memory_gb"}
NUMBERS |= {"kept_gb", "scratch_gb"}
HERE = Machine(1, 2)
HOUR = 3600.0


def sizes(solid):
    """Unknowns without voxels."""
    return Size(solid.resolution**3, solid.resolution**3 // 5, "made up")


@pytest.fixture(scope="module")
def configs():
    return {name: load(CONFIGURATIONS / f"{name}.yaml") for name in ("tiny", "laptop", "paper")}


@pytest.fixture
def config(configs):
    return copy.deepcopy(configs["laptop"])


@cache
def _planned(config, *cores):
    return plan(json.loads(config), *cores)


@pytest.fixture(autouse=True)
def planned_once(monkeypatch):
    """Plan what is the same only once, which takes seconds."""
    monkeypatch.setattr(
        command, "plan", lambda config, *cores: _planned(json.dumps(config), *cores)
    )


def rated(**changes):
    """The packaged rates with some of them changed."""
    return {**load_rates(), **changes}


def estimated(config, rates, machine):
    """What every job takes, and the solids, without voxels."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (command, reading):
            patch.setattr(module, "size_of", sizes)
        return estimate(config, rates, machine)


def jobs_of(config, rule, machine=HERE, rates=None):
    """What the jobs of a rule take."""
    jobs, _ = estimated(config, rates or load_rates(), machine)
    return jobs[jobs["rule"] == rule]


def values(config, machine=HERE, rates=None):
    rates = rates or load_rates()
    return summary.plain(*estimated(config, rates, machine), rates, machine)


def found(config, machine=HERE, rates=None):
    """Stages by name."""
    return {stage["stage"]: stage for stage in values(config, machine, rates)["stages"]}


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


def test_the_run_has_a_total_of_its_own(configs):
    for config in configs.values():
        result = values(config)
        run = [stage for stage in result["stages"] if stage["target"] == "all"]
        for name in summary.SUMMED:
            total = sum(stage[name] for stage in run)
            assert result["run_totals"][name] == pytest.approx(total)
            assert total <= result["totals"][name] * (1.0 + 1e-12)
        assert result["run_totals"]["memory_gb"] == max(stage["memory_gb"] for stage in run)


@pytest.mark.parametrize("mesh", ["builtin:box", "builtin:bell", "builtin:plate"])
@pytest.mark.parametrize("material", ["uniform", "smooth", "random", "noise"])
@pytest.mark.parametrize("resolution", [12, 20])
def test_a_solid_is_solved_in_full_where_the_solver_does_so(mesh, material, resolution):
    problem = build_problem(ProblemOptions(mesh, resolution, material, seed=3))
    refined = RefinedModel(problem.hexahedra, make_coarsening("galerkin"))
    command = f"python -m solver modes {mesh} --resolution {resolution} --material {material} "
    command += "--seed 3 --coarsen ddfem --method hcms --modes {modes}"
    for modes in (24, 256):
        decided = _Weighing(refined, 0.05, SolverOptions("hcms", modes)).before()
        told = reading.is_solved_in_full(command.format(modes=modes))
        assert told == (decided is not None), decided
        assert not reading.is_solved_in_full(command.format(modes=modes) + " --refine-to 0")


def test_what_is_solved_in_full_takes_what_the_fine_solid_takes(config):
    jobs = jobs_of(config, "find_modes").set_index("command")
    pitcher = jobs[jobs.index.str.contains("builtin:pitcher")].set_index("variant")
    assert pitcher.loc["ddfem_hcms_ec", "law"] == "find_modes hcms_ec"
    assert pitcher.loc["ddfem_slepc", "hours"] == pytest.approx(pitcher.loc["truth", "hours"])
    bell = jobs[jobs.index.str.contains("builtin:bell")].set_index("variant")
    assert bell.loc["ddfem_hcms_ec", "law"] == "find_modes ddfem_hcms_ec"
    named = values(config)["solids"]
    assert named["pitcher 32"]["in_full"] == ("random",) and named["bell 32"]["in_full"] == ()


def test_every_number_has_a_basis(configs):
    for stage in values(configs["paper"])["stages"]:
        assert NUMBERS == set(stage["basis"]) and NUMBERS < set(stage)
        assert all(stage["basis"].values())


def test_every_job_of_the_presets_has_a_rate(configs):
    for config in configs.values():
        assert not any("not measured" in told for told in values(config)["cautions"])


def test_a_rule_without_a_rate_takes_its_limit_and_says_so(config):
    laws = {name: law for name, law in load_rates()["laws"].items() if name != "audit_spectra"}
    config["resources"]["audit_spectra"] = {"memory_mb": 1234, "minutes": 7}
    audit = jobs_of(config, "audit_spectra", rates=rated(laws=laws))
    assert set(audit["hours"]) == {7 / 60} and set(audit["memory_gb"]) == {1.234}
    result = values(config, rates=rated(laws=laws))
    assert any("audit_spectra: not measured; the 7 min" in told for told in result["cautions"])
    stage = next(stage for stage in result["stages"] if stage["stage"] == "validation")
    assert "an upper bound" in stage["basis"]["core_hours"]


def test_data_scale_with_samples(config):
    more = copy.deepcopy(config)
    more["dataset"]["samples"] *= 3
    one, three = (jobs_of(each, "generate_shard") for each in (config, more))
    assert three["kept_gb"].sum() == pytest.approx(3.0 * one["kept_gb"].sum())
    start = load_rates()["laws"]["generate_shard"]["seconds"]["start"] / HOUR
    assert list(three["hours"] - start) == pytest.approx(list(3.0 * (one["hours"] - start)))
    assert found(more)["ground truth"] == found(config)["ground truth"]


def test_the_sampled_evaluator_costs_as_much_more_as_it_is_slower(configs):
    config = copy.deepcopy(configs["paper"])
    closed = found(config)["data generation"]
    config["dataset"]["objective"] = SAMPLED
    sampled = found(config)["data generation"]
    rates = load_rates()["fits_per_second"]
    ratio = rates["energy"] / rates[SAMPLED]
    assert 0.9 * ratio < sampled["core_hours"] / closed["core_hours"] < 1.1 * ratio
    assert any("dataset.shards" in caution for caution in values(config)["cautions"])


def test_more_cores_shorten_what_has_jobs_for_them(configs):
    paper = configs["paper"]
    one, many = (found(paper, Machine(nodes, 4))["data generation"] for nodes in (1, 100))
    assert many["core_hours"] == pytest.approx(one["core_hours"])
    assert one["wall_hours"] > 5.0 * many["wall_hours"]
    assert many["wall_hours"] >= many["longest_job_hours"]


def test_journals_are_those_of_shards_that_are_drawn_at_a_time(configs):
    for nodes in (1, 100):
        stage = found(configs["paper"], Machine(nodes, 4))["data generation"]
        shards = jobs_of(configs["paper"], "generate_shard")
        share = min(4 * nodes, len(shards)) / len(shards)
        assert stage["scratch_gb"] == pytest.approx(share * shards["kept_gb"].sum())


def test_rows_decide_about_the_memory_of_growing_trees(config):
    config["dataset"]["samples"] = 1_000_000_000
    memory = []
    for rows in (10_000_000, 20_000_000, 30_000_000):
        config["forests"]["structure_rows"] = rows
        memory.append(found(config)["growing trees"]["memory_gb"])
    assert memory[2] - memory[1] == pytest.approx(memory[1] - memory[0])
    assert memory[2] - memory[1] > 0.1
    config["forests"]["ranks"] = 2
    assert found(config)["growing trees"]["memory_gb"] == pytest.approx(2.0 * memory[2])


def test_forests_that_exist_are_not_trained(config):
    config["forests"]["model"] = "default"
    names = list(found(config))
    assert "ground truth" in names and not {"growing trees", "data generation"} & set(names)


def test_what_is_far_beyond_the_measurements_is_said(configs):
    told = values(configs["paper"])["cautions"]
    assert any("1,000,000,000 structure rows are far beyond" in caution for caution in told)
    assert not any("far beyond" in caution for caution in values(configs["tiny"])["cautions"])


def test_more_cores_than_were_measured_are_said_to_be_extrapolated(config):
    assert not any("speed-ups" in told for told in values(config)["cautions"])
    many = values(config, Machine(1, 64))["cautions"]
    assert any("64 cores are far beyond" in told and "speed-ups" in told for told in many)


def test_rates_of_a_busy_machine_say_so(config):
    known, unknown = rated(serial_share=0.3), rated(serial_share=None)
    assert serial_share(known) == 0.3 and 0.0 < serial_share(unknown) < 1.0
    assert not any("too busy" in told for told in values(config, rates=known)["cautions"])
    assert any("too busy" in told for told in values(config, rates=unknown)["cautions"])


def test_the_serial_share_decides_what_more_cores_are_worth(config):
    law = load_rates()["laws"]["find_modes truth"]["seconds"]
    for share in (0.0, 0.3, 1.0):
        hours = []
        for cores in (1, 16):  # a run takes a quarter of them
            jobs = jobs_of(config, "find_modes", Machine(1, cores), rated(serial_share=share))
            truth = jobs[jobs["variant"] == "truth"]["hours"] - law["start"] / HOUR
            hours.append(truth.to_numpy())
        assert hours[1] == pytest.approx((share + (1.0 - share) / 4.0) * hours[0])


def test_the_distance_from_the_solid_costs_what_its_exponent_says(config):
    laws = copy.deepcopy(load_rates()["laws"])
    law = laws["find_modes hcms_ec"]["seconds"]
    power = law["powers"].pop("estimate")
    jobs = [jobs_of(config, "find_modes", rates=rates) for rates in (None, rated(laws=laws))]
    told, plain = (
        each[each["variant"] == "hcms_ec"]["hours"] - law["start"] / HOUR for each in jobs
    )
    assert told.to_numpy() == pytest.approx(2.0**power * plain.to_numpy())


def test_jobs_are_those_of_the_rules(configs, plan):
    file = CONFIGURATIONS / "tiny.yaml"
    jobs = plan("all", "figures", "--configfile", file)
    estimated_jobs, _ = estimated(configs["tiny"], load_rates(), HERE)
    counts = estimated_jobs["rule"].value_counts().to_dict()
    assert counts | {"all": 1, "figures": 1} == {n: jobs[n] for n in jobs if n != "total"}
    stages = found(configs["tiny"])
    assert stages["data generation"]["jobs"] == jobs["generate_shard"] + jobs["describe_shard"]
    assert sum(stage["jobs"] for stage in stages.values()) == jobs["total"] - 2


def test_limits_of_the_configuration_reach_the_jobs(config):
    config["resources"]["find_modes"] = {"memory_mb": 4321, "minutes": 5}
    jobs = plan(config, 2)
    modes = jobs[jobs["rule"] == "find_modes"]
    assert set(modes["memory_mb"]) == {4321} and set(modes["minutes"]) == {5}


def test_jobs_wait_for_a_place():
    machine = Machine(2, 4)
    assert machine.wall(5 * [(10.0, 2)]) == 20.0
    assert machine.wall([(10.0, 8), (1.0, 1)]) == 11.0
    assert (machine.granted(16), machine.granted(16, ranks=2)) == (4, 8)


def test_an_absent_mesh_is_guessed_and_a_built_in_one_counted():
    assert "guessed" in size_of(NamedSolid("nowhere.obj", 32)).basis
    box = size_of(NamedSolid("builtin:box", 8))
    assert box.fine == 3 * 9 * 7 * 5 and box.coarse == 3 * 5 * 4 * 3 and "counted" in box.basis
    cells = size_of(NamedSolid("builtin:box", 8, discretisation="finite-cell"))
    assert cells.fine == box.fine and cells.basis == "counted on its finite cells"


def test_absent_meshes_are_planned_and_named(configs):
    assert {"stanford-bunny 32", "teapot 40"} <= set(values(configs["laptop"])["solids"])


# Command line ------------------------------------------------------------------------------------


def test_the_command_prints_text_and_json(capsys):
    assert main(["estimate", "--preset", "tiny"]) == 0
    text = capsys.readouterr().out
    assert "data generation" in text and "core-hours" in text and "528 unknowns" in text
    assert "total of target all" in text and "total with figures" in text
    assert main(["estimate", "--preset", "tiny", "--nodes", "2", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["machine"]["nodes"] == 2 and result["solids"]["bar 16"]["fine"] == 528


def test_the_paper_is_set_beside(capsys, monkeypatch):
    monkeypatch.setattr(command, "estimate", estimated)
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
        (["--rates", "partial.json"], "'laws' is a required property"),
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
        (
            ["--rates", "nan.json"],
            "laws.find_modes truth.seconds.start: nan is not of type 'number'",
        ),
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
    del partial["laws"]
    Path("partial.json").write_text(json.dumps(partial))
    spoiled = json.loads(PACKAGED.read_text())
    spoiled["laws"]["find_modes truth"]["seconds"]["start"] = float("nan")
    Path("nan.json").write_text(json.dumps(spoiled))
    Path("brackets.json").write_text(100_000 * "[")
    Path("metal.wav").write_bytes(b"RIFF\x24\x00\x00\x80WAVEfmt \xff")
    assert says in refuses(main, "estimate", *arguments)


def test_bad_input_ends_with_status_2(run_cli):
    done = run_cli("workflow", "estimate", "--rates", "absent.json")
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and not done.stdout


def test_a_mesh_that_is_none_is_one_sentence(tmp_path, monkeypatch, refuses):
    monkeypatch.chdir(tmp_path)
    Path("meshes").mkdir()
    Path("meshes/bad.obj").write_text("no mesh")
    Path("c.yaml").write_text("models: {bad: {mesh: bad.obj, resolution: 8}}")
    assert "bad.obj" in refuses(main, "estimate", "--configfile", "c.yaml")


# Measuring ---------------------------------------------------------------------------------------


TRUTH = "find_modes truth"
SMALL_RUN = {
    "results_dir": "results",
    "models": {"bar": {"mesh": "builtin:bar", "resolution": 12, "modes": 12}},
    "forests": {"model": "default"},
    "convergence": {"models": []},
    "times": {"models": []},
    "scaling": {"models": []},
}


def ran(words, folder):
    """A program that takes time and memory by the length of its files' names, and runs nothing."""
    if words[0] == "dataset_gen":
        fits = {name: 1e4 for name in DATASET_OBJECTIVES if name != SAMPLED}
        return json.dumps({"objectives": fits, "fits_per_second": {"sampled": 100.0}})
    assert words[0] == "snakemake"
    jobs = plan(load(folder / "config.json"), int(words[words.index("--cores") + 1]))
    for job in jobs.itertuples():
        if job.benchmark and job.outputs[0] in words:
            for name in (job.benchmark, *job.outputs):
                Path(folder, name).parent.mkdir(parents=True, exist_ok=True)
                Path(folder, name).write_bytes(1000 * b"x")
            work = 1.0 + len(folder.name)
            Path(folder, job.benchmark).write_text(f"s\th:m:s\tmax_rss\n{work}\t0:00:09\tNA\n")
    return ""


@pytest.mark.nightly
def test_what_is_measured_are_rates(monkeypatch, capsys):
    monkeypatch.setattr(measure, "_run", ran)
    rates = checked(measure.measure(), "here")
    assert set(rates["fits_per_second"]) == set(DATASET_OBJECTIVES)
    assert "measuring: run 1 of 4" in capsys.readouterr().err
    assert set(rates["laws"]) == set(load_rates()["laws"])
    assert rates["made"]["cores"] >= 1 and rates["made"]["date"] and rates["made"]["processor"]


@pytest.mark.nightly
def test_a_run_is_measured_by_its_benchmark_files(tmp_path):
    jobs = measure.finished(tmp_path / "run", SMALL_RUN, load_rates()["fits_per_second"], law=TRUTH)
    assert list(jobs["law"]) == [TRUTH] and 0.1 < jobs["seconds"].item() < 300.0
    assert jobs["memory_mb"].item() > 50.0 and jobs["files_mb"].item() > 0.01
    unknowns = size_of(NamedSolid("builtin:bar", 12)).fine
    assert jobs["sizes"].item()["unknowns"] == unknowns and jobs["sizes"].item()["modes"] == 12.0


def test_more_cores_are_worth_what_two_runs_show():
    def run(seconds):
        return pd.DataFrame({"law": [measure.SHARED, "other"], "seconds": [seconds, 99.0]})

    wide = run(8.0).head(1)
    assert measure.measured_share(run(2.0), run(12.0), wide, 2) == pytest.approx(0.2)
    assert measure.measured_share(run(2.0), run(12.0), run(1.0).head(1), 2) == 0.0


def test_measured_rates_are_kept_and_used(tmp_path, monkeypatch, capsys):
    packaged = json.loads(PACKAGED.read_text())
    monkeypatch.setattr(measure, "measure", lambda: packaged)
    kept = tmp_path / "rates.json"
    assert main(["estimate", "--preset", "tiny", "--measure", "--rates", str(kept)]) == 0
    assert json.loads(kept.read_text()) == packaged
    first = capsys.readouterr().out
    assert main(["estimate", "--preset", "tiny", "--rates", str(kept)]) == 0
    assert capsys.readouterr().out == first


def test_a_program_that_fails_is_named(tmp_path):
    assert "loop" in measure._run(["timeit", "-n", "1", "-r", "1", "pass"], tmp_path)
    with pytest.raises(UserError, match=r"python -m json.tool: failed \(.*--gong"):
        measure._run(["json.tool", "--gong"], tmp_path)


def test_the_law_follows_far_sizes_and_keeps_to_its_bounds_near_by():
    bounds = {"unknowns": [1.0, 2.0], "modes": 1.0}
    far = [{"unknowns": n, "modes": 64.0} for n in (1e2, 1e4, 1e6)]
    law = fit(bounds, far, [64e-5 * each["unknowns"] ** 1.6 for each in far])
    assert law["powers"] == pytest.approx({"unknowns": 1.6, "modes": 1.0}, abs=0.05)
    near = [{"unknowns": n, "modes": 8.0} for n in (1000.0, 1010.0)]
    law = fit(bounds, near, [1e-5 * each["unknowns"] ** 9 for each in near])
    assert law["powers"]["unknowns"] == pytest.approx(1.5, abs=0.1)
    noise = np.array([0.5, 2.0, 1.0])
    law = fit(bounds, far, noise * [each["unknowns"] ** 5 for each in far])
    assert law["powers"]["unknowns"] == pytest.approx(2.0)


def test_jobs_that_hardly_do_more_than_start_hardly_count():
    jobs = [{"unknowns": n} for n in (10.0, 1e4, 1e5)]
    law = fit({"unknowns": [1.0, 2.0]}, jobs, [1.01, 11.0, 317.2], start=1.0)
    assert law["powers"]["unknowns"] == pytest.approx(1.5, abs=0.02)


def test_packaged_rates_name_no_machine_but_its_processor():
    made = load_rates()["made"]
    assert {"processor", "cores", "blas", "commit", "date"} <= set(made)
    assert set(load_rates()["fits_per_second"]) == set(DATASET_OBJECTIVES)


def test_voxels_are_counted_no_finer_than_is_quick(monkeypatch):
    exact = size_of(NamedSolid("builtin:bell", 32, "centre"))
    monkeypatch.setattr(solids, "LARGEST_COUNTED", 20)
    size_of.cache_clear()
    scaled = size_of(NamedSolid("builtin:bell", 32, "centre"))
    size_of.cache_clear()
    assert "at resolution 20, times" in scaled.basis and exact.basis == "counted on its voxels"
    assert scaled.fine == pytest.approx(exact.fine, rel=0.15)
    assert scaled.coarse == pytest.approx(exact.coarse, rel=0.15)
