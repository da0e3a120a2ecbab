"""Presets: they fit the schema, are planned without any mesh, and hold the counts they promise."""

import pytest
import schema_keys

from tests.configuration_keys import every_key
from workflow import settings
from workflow.commands.estimate import CONFIGURATIONS, load
from workflow.configuration.whole import limits
from workflow.estimate.costs import FIT_COSTS, START, load_medians

PRESETS = ("tiny", "laptop", "cluster", "paper")


def preset(name: str) -> dict:
    return load(CONFIGURATIONS / f"{name}.yaml")


@pytest.mark.parametrize("name", PRESETS)
def test_presets_need_no_file(name):
    settings.check_files(preset(name))
    assert all(model["mesh"].startswith("builtin:") for model in preset(name)["models"].values())


@pytest.mark.parametrize("name", ["cluster", "paper"])
def test_presets_are_planned_on_a_fresh_clone(name, plan):
    config = preset(name)
    jobs = plan("all", "figures", "--configfile", CONFIGURATIONS / f"{name}.yaml")
    shards = config["dataset"]["shards"] * len(config["dataset"]["distributions"])
    assert jobs["generate_shard"] == shards
    assert jobs["find_modes"] == 7 * len(config["models"])
    # Solids whose mesh is absent are left out.
    shapes = config["figures"]["models"].values()
    builtin = sum(shape["mesh"].startswith("builtin:") for shape in shapes)
    assert jobs["time_methods_in_full"] == builtin < len(shapes)


def test_presets_grow():
    samples = [preset(name)["dataset"]["samples"] for name in PRESETS]
    assert samples == sorted(samples)
    assert 8 * preset("cluster")["dataset"]["samples"] > 100_000_000
    assert preset("cluster")["solver"]["ranks"] > 1


def test_the_papers_counts():
    config = preset("paper")
    dataset, forests = config["dataset"], config["forests"]
    assert 8 * dataset["samples"] == 10_000_000_000
    assert forests["structure_rows"] == 1_000_000_000
    assert (forests["trees"], forests["depth"], forests["max_leaves"]) == (3, 20, 2**20)
    assert (dataset["distributions"], dataset["ranges"]) == (["uniform"], {"uniform": [0, 10]})
    assert config["poisson"] == 0.25 and config["solver"]["modes"] == 256
    assert {model["density"] for model in config["models"].values()} == {1.0}


def test_a_shard_of_the_papers_data_is_about_an_hour():
    dataset = preset("paper")["dataset"]
    fits = FIT_COSTS[dataset["objective"]] * dataset["samples"] / dataset["shards"]
    drawn = load_medians().loc["generate_shard"]
    hours = fits * (drawn["seconds"] - START) / drawn["work"] / 3600.0
    assert 0.5 < hours < 2.0


def test_the_page_has_every_key():
    text = schema_keys.of_configuration()
    for name, _ in every_key():
        assert f"`{name}`" in text or f"## {name}" in text, name
    assert all(f"| `{rule}` |" in text for rule in limits())


def test_the_page_lists_every_preset():
    lines = schema_keys.of_presets().splitlines()
    assert [line.split("`")[1] for line in lines] == sorted(
        f.stem for f in CONFIGURATIONS.glob("*.yaml")
    )
    assert "- `laptop`: The default run: four solids on two cores in a few minutes." in lines


def test_the_page_tells_type_default_unit_and_meaning():
    text = schema_keys.of_configuration()
    assert "hyphens. Required." in text
    tolerance = text[text.index("`solver.tolerance` ") :].split("\n")[0]
    assert "at least 1e-15, at most 0.1, since the validation holds spectra to ten" in tolerance
    assert "`dataset.shards` integer, at least 1, at most 10,000; default `2`\n: " in text
    density = text[text.index("`models.NAME.density` ") :].split("\n\n")[0]
    assert " [kg/m^3]; default `1000.0`\n: Mass density." in density
