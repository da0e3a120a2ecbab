"""The rules: they lint, and the default run is planned as promised."""

import pytest

from tests.programs import python
from tests.workflow_runs import CHECKOUT, PROFILE


def test_default_run_is_planned_without_a_gap(plan):
    jobs = plan()
    models, shards = 4, 4
    assert jobs["generate_shard"] == shards
    assert jobs["find_modes"] == 7 * models
    assert jobs["compare_with_truth"] == 2 * models
    assert jobs["train_forests"] == jobs["tabulate_report"] == jobs["build_report"] == 1


def test_default_profile_is_read(dry_run, tmp_path):
    done = dry_run(tmp_path, "--profile", PROFILE)
    assert done.returncode == 0, done.stdout + done.stderr


def test_rules_lint():
    lint = CHECKOUT / ".ci" / "lint_rules.py"
    done = python(lint, cwd=CHECKOUT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_bad_value_on_the_command_line_stops_the_run_with_a_sentence(dry_run, tmp_path):
    done = dry_run(tmp_path, "--cores", 1, "--config", "poisson=0.7")
    assert done.returncode != 0
    output = done.stdout + done.stderr
    assert "poisson: found 0.7, expected below 0.5" in output
    assert "Traceback" not in output


def test_one_variant_of_a_model_tells_its_distance_and_all_have_one_mesh(dry_run, tmp_path):
    config = tmp_path / "config.yaml"
    config.write_text(
        "models:\n"
        "  bar: {mesh: 'builtin:bar', resolution: 16}\n"
        "  bell: {mesh: 'builtin:bell', resolution: 16, discretisation: finite-cell}\n"
    )
    done = dry_run(tmp_path, "validation", "-p", "--cores", 2, "--configfile", config)
    assert done.returncode == 0, done.stdout + done.stderr
    runs = [line.split() for line in done.stdout.splitlines() if "-m solver modes" in line]
    telling = {run[run.index("--out") + 1] for run in runs if "--no-estimate" not in run}
    assert telling == {f"results/models/{model}/hcms_ec.h5" for model in ("bar", "bell")}
    assert sum("--estimate" in run for run in runs) == 1
    undivided = ["--refine-to 0 " in " ".join(run) for run in runs]
    assert undivided == ["builtin:bell" in run for run in runs] and sum(undivided) == 3


@pytest.mark.parametrize("ranks", [1, 2])
def test_ranks_get_a_launcher_only_where_there_are_several(dry_run, tmp_path, ranks):
    config = tmp_path / "config.yaml"
    config.write_text(
        "models: {bar: {mesh: 'builtin:bar', resolution: 16}}\n"
        f"solver: {{ranks: {ranks}, modes: 20}}\n"
    )
    target = "results/models/bar/truth.h5"
    done = dry_run(tmp_path, target, "-p", "--cores", 2, "--configfile", config)
    output = done.stdout + done.stderr
    assert done.returncode == 0, output
    assert ("mpiexec -n 2 python" in output) == (ranks == 2)
