"""One scene by several modes: how it is planned, its table, figure and page."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import soundfile
import yaml

from sound.scenes.scene_file import scene_of
from studies.scene_spectra import scene
from studies.scene_spectra.results import FOLDER, SceneSpectra
from studies.scene_spectra.study import SCENE_SPECTRA
from tests.pages import assert_same_numbers, page_of
from tests.scenes import require_engine
from tests.workflow_runs import TINY, planned, snakemake
from workflow.commands.estimate import CONFIGURATIONS, load
from workflow.variants import TRUTH

CONFIG = load(CONFIGURATIONS / "laptop.yaml")
RATE = 8000
GAIN_DECIBELS = 6.0


def test_every_rendering_moves_by_the_truth_and_is_heard_by_its_own_modes(tmp_path):
    for name in scene.RENDERINGS:
        described = scene_of(scene.scene_of(CONFIG, name), tmp_path / name)
        for body, each in zip(scene.BODIES, described.objects):
            assert each.modes == str(tmp_path / name / ".." / f"modes/{body}-{TRUTH}.h5")
            heard = each.heard_modes or each.modes
            assert heard.endswith(scene.modes_file(body, name))


def test_the_truth_is_of_another_program_and_the_control_of_another_coarsening():
    how = {name: each.how for name, each in scene.RENDERINGS.items()}
    assert how[TRUTH] == {"coarsen": "none", "method": "slepc"}
    assert how["average_hcms_ec"]["coarsen"] == "average"
    words = scene.modes_arguments(CONFIG, "bell", "ddfem_everywhere")
    assert words[0] == "builtin:bell" and words[words.index("--refine-to") + 1] == "0"


def test_the_target_makes_the_study_alone(tmp_path):
    jobs = planned(snakemake(tmp_path, "scene_spectra", "--dry-run", "--cores", 2))
    bodies, heard = len(scene.BODIES), len(scene.RENDERINGS)
    assert jobs["find_modes_of_body"] == bodies * heard
    assert jobs["hear_scene"] == jobs["write_heard_scene"] == heard
    once = (
        "tabulate_scene_spectra",
        "plot_scene_spectra_scene_spectrograms",
        "build_scene_spectra",
    )
    assert all(jobs[rule] == 1 for rule in once)
    assert not {"find_modes", "train_forests", "play_scene"} & set(jobs)


@pytest.fixture
def results(tmp_path, monkeypatch) -> SceneSpectra:
    """Decaying tones: the truth, itself again, the same but louder, and another one."""
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(CONFIG))
    times = np.arange(RATE) / RATE
    tone = 0.2 * np.exp(-4.0 * times) * np.sin(2.0 * np.pi * 800.0 * times)
    other = 0.2 * np.exp(-4.0 * times) * np.sin(2.0 * np.pi * 2500.0 * times)
    louder = 10.0 ** (GAIN_DECIBELS / 20.0)
    sounds = {
        TRUTH: (tone, 2.0),
        "ddfem_hcms_ec": (2.0 * tone, 1.0),
        "ddfem_everywhere": (tone, 2.0 * louder),
        "average_hcms_ec": (other, 2.0),
    }
    for name, (samples, scale) in sounds.items():
        folder = tmp_path / FOLDER / name
        folder.mkdir(parents=True)
        ears = np.stack([samples, np.zeros(RATE)], axis=1)
        soundfile.write(folder / scene.SOUND, ears, RATE, subtype="PCM_24")
        told = {"rate_hz": RATE, "full_scale_pascal": scale, "impacts": 5}
        (folder / scene.TOLD).write_text(json.dumps(told))

    def spectrum(factor):
        frequencies = np.array([0.0] * 6 + [800.0 * factor, 1600.0])
        attributes = {"timings": {"solve": 1.5, "estimate": 9.0}}
        model = SimpleNamespace(n_dofs=300)
        return SimpleNamespace(frequencies=frequencies, attributes=attributes, model=model)

    spectra = {
        name: [spectrum(1.1 if name == "average_hcms_ec" else 1.0)] * len(scene.BODIES)
        for name in scene.RENDERINGS
    }
    monkeypatch.setattr(SceneSpectra, "spectra", spectra)
    return SceneSpectra(tmp_path)


def test_distances_are_of_pressures_whatever_the_scale_of_a_file(results):
    table = SCENE_SPECTRA.entries["scene_spectra"](results)
    rows = {row["rendering"]: row for row in table.rows}
    assert rows[TRUTH].get("distance_decibels") is None
    assert rows["ddfem_hcms_ec"]["distance_decibels"] < 0.01
    # But for what is below the floor, a gain is the distance.
    assert rows["ddfem_everywhere"]["distance_decibels"] == pytest.approx(GAIN_DECIBELS, rel=0.1)
    assert rows["average_hcms_ec"]["distance_decibels"] > 20.0
    assert rows["average_hcms_ec"]["frequency_error"] == pytest.approx(0.1 / np.sqrt(2.0))
    assert rows[TRUTH]["solve_seconds"] == 1.5 * len(scene.BODIES)
    assert rows[TRUTH]["unknowns"] == 300 * len(scene.BODIES)


def test_the_page_plays_every_rendering_and_shows_the_numbers(results):
    read = page_of(SCENE_SPECTRA, results, results.folder / "scene-spectra.html")
    assert_same_numbers(read, results.folder / "tables", "scene_spectra", ())
    played = [link for link in read.links if link.endswith(".wav")]
    assert played == [f"{FOLDER}/{name}/{scene.SOUND}" for name in scene.RENDERINGS]
    assert all((results.folder / link).is_file() for link in played)
    assert len(read.ids) == len(set(read.ids)) and "<script" not in read.source


@pytest.mark.nightly
def test_the_tiny_scene_is_heard_by_all_modes(tmp_path):
    require_engine()
    done = snakemake(tmp_path, "scene_spectra", "--configfile", TINY, "--cores", 2)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "results-tiny"
    assert (folder / "figures" / "scene-spectrograms.png").stat().st_size > 0
    results = SceneSpectra(folder)
    rows = {row["rendering"]: row for row in results.table("scene_spectra").rows}
    assert len({row["impacts"] for row in rows.values()}) == 1
    assert rows["average_hcms_ec"]["frequency_error"] > rows["ddfem_hcms_ec"]["frequency_error"]
    assert rows["ddfem_hcms_ec"]["unknowns"] <= rows[TRUTH]["unknowns"]
