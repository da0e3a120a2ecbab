"""The paper's own variants: what their preset asks for, and that poor results make whole pages."""

from dataclasses import fields

import pytest
import yaml

from forests.training.options import TrainingOptions
from solver.files.modes_file import read_modes
from studies.base.table import read_table
from tests.pages import Page, assert_self_contained
from tests.workflow_runs import CHECKOUT, PROFILE, planned, snakemake
from workflow import settings, training

PRESET = CHECKOUT / "workflow" / "config" / "as-printed.yaml"
TINY = {
    "results_dir": "results",
    "models": {
        "bar": {
            **{"mesh": "builtin:bar", "resolution": 12, "material": "two-region"},
            **{"density": 1.0, "lumped": True},
        }
    },
    "dataset": {"samples": 1500, "shards": 1},
    "forests": {"structure_rows": 12000, "blocks": 100, "materials": 3},
    "solver": {
        **{"modes": 16, "subdomains": 4, "retained_modes": 40},
        **{"corrections": 1, "tolerance": 1e-12},
    },
}
"""In small, and with a tolerance that one correction cannot reach."""


def merged(*layers: dict) -> dict:
    result: dict = {}
    for layer in layers:
        for key, value in layer.items():
            nested = isinstance(value, dict) and key not in ("models", "ranges")
            result[key] = merged(result.get(key, {}), value) if nested else value
    return result


def test_every_option_of_the_training_is_passed_on():
    assert set(training.TRAINING) == {each.name for each in fields(TrainingOptions)}


def test_the_preset_asks_for_the_papers_variants():
    config = settings.complete([PRESET])
    assert config["dataset"]["objective"] == "energy"
    assert config["dataset"]["ranges"] == {"uniform": [0, 10]}
    forests, solver = config["forests"], config["solver"]
    assert (forests["grower"], forests["transform"], forests["uniform_weight"]) == (
        *("best", "ratio"),
        1.0,
    )
    assert (solver["interface"], solver["acceleration"], solver["linear_solver"]) == (
        *("fixed", "relaxation"),
        "icc-pcg",
    )
    assert 10 <= solver["subdomains"] <= 20 and solver["retained_modes"] == 512
    assert solver["refine_to"] == 0 and config["poisson"] == 0.25
    assert all(model["lumped"] and model["density"] == 1.0 for model in config["models"].values())


def test_the_rules_hand_them_on(tmp_path):
    done = snakemake(
        tmp_path, "--dry-run", "--printshellcmds", "--cores", 1, "--configfile", PRESET
    )
    assert planned(done)["train_forests"] == 1
    commands = [line for line in (done.stdout + done.stderr).splitlines() if " -m " in line]
    (train,) = (line for line in commands if "forests train" in line)
    assert "--transform ratio" in train and "--grower best" in train
    (generate, _) = (line for line in commands if "dataset_gen generate" in line)
    assert "--objective energy" in generate and "--low 0 --high 10" in generate
    for line in commands:
        if "solver modes" not in line:
            continue
        assert "--lumped" in line
        assert ("--refine-to 0" in line) == ("--coarsen ddfem" in line)
        if "--method hcms" in line:
            assert "--interface fixed" in line
            corrected = "--corrections 0" not in line
            for words in ("--acceleration relaxation", "--linear-solver icc-pcg"):
                assert (words in line) == corrected
            assert ("--missed-tolerance keep" in line) == corrected


@pytest.mark.slow
@pytest.mark.nightly
def test_poor_results_make_whole_pages(tmp_path):
    config = merged(yaml.safe_load(PRESET.read_text()), TINY)
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    done = snakemake(tmp_path, "--profile", PROFILE, "--configfile", "config.yaml")
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-6000:]
    results = tmp_path / "results"
    modes = read_modes(str(results / "models" / "bar" / "hcms_ec.h5"), with_modes=False).attributes
    assert modes["missed_tolerance"] == 1e-12 < modes["eigenvalue_error_estimate"]
    assert (modes["linear_solver"], modes["interface"]) == ("icc-pcg", "fixed")
    report, validation = (Page(results / f"{name}.html") for name in ("report", "validation/bar"))
    assert "<em>missed</em> its tolerance of 10⁻¹²" in report.source
    assert "HCMS + EC of Bar reached" in " ".join(report.source.split())
    for page in (report, validation):
        assert_self_contained(page)
    rows = read_table(results / "validation" / "tables" / "bar-criteria.json").rows
    verdicts = {row["key"]: row["verdict"] for row in rows if row["group"] == "ddfem_hcms_ec"}
    assert verdicts["frequency_rms"] == "missed"
