"""Examples of sound design: what they are, how they are planned, and their pages."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from carillon.builtin_names import BUILTIN_PREFIX, THICK
from carillon.fem.model import RIGID_MODES, fine_model
from carillon.records.provenance import record
from solver import solve
from solver.files.modes_file import write_modes
from sound.clips.wav import read_wav, write_wav
from sound.design import preparation
from sound.project.design import HISTORY_TYPE, Design
from sound.project.design_file import read_design, write_design
from sound.project.project import load_project, project_of
from sound.rendering.likeness import Likeness
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, rendered_parts
from sound.rendering.solid import SoundingSolid
from sound.rendering.verdict import DesignVerdict
from studies.base.table import read_table
from studies.recordings.recordings import recordings
from studies.sounds import comparison, config, heard, index, pairs, tables
from studies.sounds.examples import (
    DESIGN,
    ELSEWHERE,
    EXAMPLES,
    FOLDER,
    LISTS,
    OF_RECORDINGS,
    PROJECT,
    REACHED,
    START,
    TRUTH,
    Example,
    ExampleTarget,
    examples,
    project,
    seeded,
)
from studies.sounds.pictures import fine_mesh
from studies.sounds.plots import _ticks
from studies.sounds.results import MODES, SoundResults
from studies.sounds.study import COMPARED_SOUNDS, SOUND, SOUNDS, SOUNDS_OF_CLIPS
from tests.pages import Page, assert_holds, assert_same_numbers, assert_self_contained, page_of
from tests.small_design import N_MODES, SIDES, small_design
from tests.workflow_runs import TINY, snakemake
from workflow.commands.estimate import CONFIGURATIONS, load

RATE = 22_050
EXAMPLE = Example(
    name="box",
    title="A box",
    figure="no figure",
    about="Two targets on a box.",
    mesh="builtin:box",
    resolution=6,
    density=1000.0,
    modes=N_MODES,
    dimensions=5,
    seconds=1.0,
    targets=(
        ExampleTarget("corner", SIDES, "metal", 1),
        ExampleTarget("side", (0.0, 0.0, 0.0), "wood", 2),
    ),
    elsewhere=("top", (0.12, 0.08, 0.08)),
    compared=True,
)
CONFIG = load(CONFIGURATIONS / "laptop.yaml")


class Box(SoundResults):
    """Results of an example that is not among those of the workflow."""

    example = EXAMPLE


def history(*rows: tuple[float, float]) -> np.ndarray:
    """Costs over seconds, ten evaluations a second."""
    return np.array([(s, 10 * s + 1, c, 0.5 * c, 0.05 * c, 0.0) for s, c in rows], HISTORY_TYPE)


def costs(before: float, after: float) -> dict:
    """What a design tells of its search."""
    parts = {"frequency_cost": 0.5 * after, "amplitude_cost": 0.05 * after}
    return {"cost_start": before, "cost": after, **parts}


def designed(**parts: object) -> Design:
    resolved = {
        "mesh": "builtin:box",
        "unit": 1.0,
        "weights": {"frequency": 1.0, "amplitude": 10.0},
    }
    return replace(small_design(), settings=resolved, **parts)


def compared() -> dict:
    """Output of `sound benchmark`."""
    times = ("cold_seconds", "warm_seconds", "gradient_seconds", "analysis_seconds")
    sizes = {"n_dofs": 72, "modes": N_MODES, "coordinates": 5, "runs": 3}
    rows = [
        {
            "method": method,
            "cost_start": 9.0,
            "cost_end": end,
            "fall_percent": 100.0 * (1.0 - end / 9.0),
            "seconds_to_90_percent": 2.5 if end < 0.9 else None,
            "evaluations": 30,
            "evaluations_per_minute": 600.0,
            "seconds": 3.0,
            "workers": 2,
            "curve": [[0.1, 9.0], [3.0, end]],
        }
        for method, end in (("hybrid", 0.5), ("cma", 4.0), ("bfgs", 2.0))
    ]
    return {
        "evaluation": dict.fromkeys(times, 0.05) | sizes,
        "rows": rows,
        "provenance": record({"seed": 0}),
    }


def reached(*verdicts: str) -> dict:
    """Output of `sound reach`."""
    modes = [
        {
            "mode": number,
            "target_hz": 100.0 * number,
            "cents": 20.0,
            "alone_cents": 0.0,
            "beside_cents": 5.5,
            "verdict": verdict,
        }
        for number, verdict in enumerate(verdicts, 2)
    ]
    answer = {"modes": modes, "together": 3, "seconds": 9.0, "had_cents": 15.0} if modes else {}
    return {"fall": 0.5, **answer, "provenance": record({"seed": 0})}


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> SoundResults:
    """Results of an example, made without optimisation."""
    root = tmp_path_factory.mktemp("results")
    (root / "config.yaml").write_text(yaml.safe_dump(CONFIG))
    box = Box(root / FOLDER, EXAMPLE.name)
    folder = box.file("")
    for name in ("edit-1", "tables", *(f"{state}/{MODES}" for state in heard.STATES)):
        (folder / name).mkdir(parents=True)
    first = designed(history=history((0.1, 9.0), (1.0, 4.0)), evidence=costs(9.0, 4.0))
    rows = history((0.1, 9.0), (1.0, 4.0), (1.2, 6.0), (3.0, 0.5))
    final = designed(history=rows, evidence=costs(6.0, 0.5))
    write_design(folder / "edit-1" / DESIGN, first)
    write_design(folder / DESIGN, final)
    write_design(folder / START, designed(history=history((0.1, 9.0))))
    (folder / PROJECT).write_text("mesh: builtin:box\n")
    write_truth(folder / TRUTH, final)
    write_sounds(folder, final)
    (folder / "optimisers.json").write_text(json.dumps(compared()))
    (folder / REACHED).write_text(json.dumps(reached("had", "not with all others")))
    return box


def write_truth(path: Path, design: Design) -> None:
    model = fine_model(fine_mesh(design), design.young)
    modes = solve(model, modes=RIGID_MODES + N_MODES, method="slepc")
    assert modes.modes is not None
    write_modes(path, model, modes.eigenvalues, [modes.modes], modes.residuals, {}, {})


def write_sounds(folder: Path, design: Design) -> None:
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    for strike in design.strikes:
        hits = [Hit(0.0, strike.position, strike.inward)]
        modes, noise = rendered_parts(solid, hits, 0.3, RATE, 0.0, listening)
        places = [(state, strike.name) for state in heard.STATES] + [("after", ELSEWHERE)]
        for state, name in places:
            write_wav(folder / state / f"{name}.wav", modes + noise, RATE)
            write_wav(folder / state / MODES / f"{name}.wav", modes, RATE)


@pytest.fixture(scope="module")
def built(results: SoundResults) -> Page:
    return page_of(SOUND, results, results.file("page.html"))


def test_the_page_can_be_heard(results, built):
    rendered = 2 * (len(heard.STATES) - 1) + 1
    alone = len(heard.ALONE) * len(EXAMPLE.targets)
    assert built.source.count("data:audio/wav;base64,") == 2 * rendered + 2 + alone
    assert built.source.count("of the energy that are noise") == rendered
    assert built.source.count("data:image/png;base64,") >= 2
    assert len(built.source) < 4e6


def test_files_that_the_page_leads_to_are_there(results, built):
    assert {DESIGN, START, TRUTH, PROJECT, "optimisers.json", "clips/corner.wav"} <= set(built.led)
    assert f"edit-1/{DESIGN}" in built.led
    assert all(results.file(name).is_file() for name in built.led if not name.startswith("#"))


def test_tables_of_the_page_are_those_of_the_files(results, built):
    names = set(SOUND.tables) - set(results.absent)
    assert_holds(built, SOUND, results.file(""), names)


def test_every_edit_counts_its_own_time(results, built):
    rows = tables.designs(results).rows
    assert [row["cost_before"] for row in rows] == [9.0, 6.0]
    assert [row["cost"] for row in rows] == [4.0, 0.5]
    assert rows[1]["seconds"] == pytest.approx(2.0) and rows[1]["evaluations"] == 20
    assert rows[1]["per_minute"] == pytest.approx(600.0)


def test_the_fine_model_is_set_beside_the_coarse_one(results):
    rows = tables.truth(results).rows
    assert len(rows) == N_MODES
    for row in rows:
        assert row["error"] == pytest.approx(row["found"] / row["truth"] - 1.0)
    assert max(abs(row["error"]) for row in rows) > 0.0


def test_the_page_says_which_modes_the_solid_can_have_where_the_search_fell_short(results, built):
    assert "first 3 modes were had together" in built.source and REACHED in built.led
    assert "reach" not in results.absent
    enough = Box(results.folder, results.name)
    enough.__dict__["reached"] = reached()
    assert "reach" in enough.absent
    assert "What the solid can have" not in SOUND.build(enough)


def test_optimisers_are_set_beside_each_other_on_the_recorded_solids(tmp_path):
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(CONFIG))
    found = compared()
    for row in found["rows"]:
        numbers = ("cost_end", "fall_percent", "evaluations", "fine_rms_cents", "seconds")
        row["fine_rms_cents"] = 8.0
        row |= {f"{key}_{end}": row[key] for key in numbers for end in ("min", "max")}
    results = comparison.ComparedSounds(tmp_path / FOLDER)
    results.__dict__["config"] = CONFIG
    results.__dict__["compared"] = dict.fromkeys(("recorded-bar", "recorded-bell"), found)
    read = page_of(COMPARED_SOUNDS, results, tmp_path / "page.html")
    rows = COMPARED_SOUNDS.made(results)["comparison"].rows
    assert len(rows) == 6 and rows[0]["fall_max"] == pytest.approx(1.0 - 0.5 / 9.0)
    assert_holds(read, COMPARED_SOUNDS, tmp_path)


def test_the_comparison_is_planned_for_recorded_solids_alone(plan):
    jobs = plan("compared_sounds")
    assert jobs["compare_optimisers_by_seeds"] == 4 and jobs["compared_sounds"] == 1
    assert "design_sound" not in jobs


def test_a_common_factor_does_not_count_as_distance_of_frequencies(results):
    rows = {row["solid"]: row for row in tables.nearness(results).rows}
    design = results.design
    apart = np.log2(design.coarse_frequencies / design.targets.frequencies)
    expected = 1200.0 * np.std(apart)
    assert rows["coarse"]["rms_cents"] == pytest.approx(expected)
    for row in rows.values():
        assert 0.0 < row["rms_cents"] <= row["worst_cents"]
        assert 0.0 < row["rms_bark"] <= row["worst_bark"]


def test_what_is_compared_begins_where_the_modes_of_the_clip_do(results):
    target = results.target("corner", RATE)
    assert len(target.clip) == len(target.modes) == len(target.wanted)
    rest = target.clip - target.modes
    assert rest @ rest < 0.2 * (target.clip @ target.clip)


def test_silence_is_farther_from_a_clip_than_what_is_known_of_it(results):
    for row in tables.distances(results).rows:
        assert row["modes"] < row["silence"]


def test_loudness_is_told_beside_that_of_the_clip(results):
    """The clips of this example are the sounds themselves."""
    for row in tables.loudness(results).rows:
        assert [row[state] for state in ("before", "after", "fine")] == [0.0, 0.0, 0.0]
        assert -40.0 < row["clip"] < 10.0


@pytest.mark.parametrize("listed", [index.Examples, index.OfRecordings])
def test_the_index_leads_to_the_page(results, built, tmp_path, listed):
    examples = SimpleNamespace(
        examples=[results], title=listed.title, about=listed.about, prefix=listed.prefix
    )
    read = page_of(SOUNDS, examples, tmp_path / "index.html")
    assert_self_contained(read)
    for name in SOUNDS.tables:
        assert_same_numbers(read, tmp_path / "tables", f"{listed.prefix}{name}")
    assert "box/page.html" in read.led
    assert read.source.count("data:audio/wav;base64,") == 2


def judged(results: SoundResults, verdict: DesignVerdict | None, seed: int = 0) -> SoundResults:
    """The same results as those of a pair whose design has a verdict."""
    told = {} if verdict is None else {"verdict": verdict.as_dict()}
    design = replace(
        results.design,
        evidence={**results.design.evidence, "seconds": 9.0, **told},
        settings={**results.design.settings, "optimiser": {"seed": seed}},
    )
    pair = Box(results.folder, results.name)
    pair.__dict__["designs"] = {**results.designs, results.name: design}
    return pair


def verdict(word: str, cents: float, distance: float, decay: float) -> DesignVerdict:
    reason = "" if word == "like" else "too faint"
    return DesignVerdict(word, cents, (Likeness("corner", distance, 30.0, decay),), reason, "")


def of_clips(*pairs: SoundResults) -> SimpleNamespace:
    listed = index.OfClips
    return SimpleNamespace(
        examples=list(pairs),
        seeded=list(pairs[:1]),
        title=listed.title,
        about=listed.about,
        prefix=listed.prefix,
        config=CONFIG,
    )


@pytest.mark.parametrize(
    ("told", "goals"),
    [
        (verdict("like", 10.0, 10.0, 0.8), "met"),
        (verdict("near", 40.0, 23.0, 1.6), "missed: error, decay"),
        (verdict("near", 10.0, 25.0, 0.5), "missed: distance, decay"),
        (verdict("cannot", 90.0, 25.0, 0.5), "says it cannot"),
        (None, None),
    ],
)
def test_a_pair_tells_which_goals_it_misses(results, told, goals):
    row = pairs.pairs(of_clips(judged(results, told))).rows[0]
    assert row.get("goals") == goals and row.get("word") == (told and told.word)
    assert row["heard"] == row["taken"] == N_MODES and row["left_out"] == 0
    assert row["seconds"] == 9.0 and row["worst_cents"] > 0.0


def test_pairs_end_with_their_medians(results):
    told = [verdict("like", 10.0, 9.0, 0.8), verdict("near", 20.0, 17.0, 1.6), None]
    *_, last = pairs.pairs(of_clips(*(judged(results, each) for each in told))).rows
    assert last["title"] == "Median" and last["word"] == "1 like, 1 near"
    assert last["distance_db"] == 13.0 and last["decay_ratio"] == pytest.approx(1.2)
    assert last["taken"] == N_MODES and last["goals"] == "missed: distance"


def test_modes_of_one_partial_and_partials_without_a_mode_are_counted(results):
    targets = results.design.targets
    hertz = targets.frequencies.copy()
    hertz[1] = hertz[0]
    silent = np.arange(N_MODES) == 2
    pair = judged(results, verdict("like", 10.0, 9.0, 0.8))
    changed = replace(targets, frequencies=hertz, silent=silent, left_out=np.array([9e3]))
    pair.designs[pair.name] = replace(pair.design, targets=changed)
    row = pairs.pairs(of_clips(pair)).rows[0]
    assert (row["heard"], row["taken"], row["left_out"]) == (N_MODES - 1, N_MODES - 2, 1)
    for table in (tables.frequencies, tables.truth):
        assert [each["mode"] for each in table(pair).rows] == [1, 2, *range(4, N_MODES + 1)]


def test_the_page_of_pairs_leads_to_each_and_has_the_seeds(results, built, tmp_path):
    pair = judged(results, verdict("near", 40.0, 10.0, 1.0), seed=3)
    read = page_of(SOUNDS_OF_CLIPS, of_clips(pair), tmp_path / "clips.html")
    assert_self_contained(read)
    for name in SOUNDS_OF_CLIPS.tables:
        assert_same_numbers(read, tmp_path / "tables", f"{SOUNDS_OF_CLIPS.prefix}{name}")
    assert "box/page.html" in read.led and "too faint" in read.source
    assert read_table(tmp_path / "tables/clips-seeds.json").rows[0]["seed"] == "3"


def test_the_page_of_a_pair_has_its_verdict_and_asks_not_what_the_solid_can_have(results):
    pair = judged(results, verdict("near", 40.0, 10.0, 1.0))
    pair.__dict__["example"] = replace(EXAMPLE, by_default=True)
    assert "reach" in pair.absent and not any(REACHED in name for name in pair.origins)
    assert "near the clip, not like it: too faint." in SOUND.build(pair)


@pytest.mark.parametrize(("low", "high"), [(0.01, 10.0), (0.9, 1.1), (0.3, 7.0), (1.0, 1.002)])
def test_a_colour_bar_has_round_ticks_within_its_range(low, high):
    ticks = _ticks(low, high)
    assert 3 <= len(ticks) <= 12
    assert all(0.98 * low <= tick <= 1.02 * high for tick in ticks)


def test_the_configuration_names_the_examples():
    assert [*config.EXAMPLES, *config.RECORDED] == list(yaml.safe_load(EXAMPLES.read_text()))


def test_pairs_are_of_tonal_recordings_and_built_in_solids():
    pairs = [each for each in examples(CONFIG).values() if each.by_default]
    assert len(config.PAIRS) == 12 and len(pairs) == 12 + CONFIG["sound"]["clip_seeds"] - 1
    for pair in pairs:
        (target,) = pair.targets
        assert recordings()[target.recording].tonal
        assert pair.mesh.removeprefix(BUILTIN_PREFIX) in THICK


def test_pairs_have_the_defaults_of_projects():
    target = {"name": "a", "clip": "a.wav", "vertex": 0}
    plain = project_of({"mesh": "builtin:bowl", "targets": [target]}, Path())
    for pair in (each for each in examples(CONFIG).values() if each.by_default):
        assert pair.resolution == plain.resolution and pair.density == plain.density
        assert pair.dimensions == plain.material.dimensions
        assert pair.seconds == plain.optimiser.seconds
        assert pair.modes == preparation.MODES


def test_a_pair_is_searched_by_several_seeds_the_first_of_which_is_the_default():
    pairs = examples(CONFIG)
    assert [pairs[name].search["seed"] for name in seeded(CONFIG)] == [None, 1, 2, 3, 4]
    short = {**CONFIG, "sound": {**CONFIG["sound"], "clip_evaluations": 60}}
    assert all(examples(short)[name].search["evaluations"] == 60 for name in seeded(short))


def test_clips_are_recordings_in_the_examples_that_are_listed_so_and_in_no_other():
    asked = examples(CONFIG)
    for key in LISTS:
        for name in CONFIG["sound"][key]:
            given = [target.recording for target in asked[name].targets]
            assert all(given) if key == OF_RECORDINGS else not any(given)
            assert {*given} - {""} <= {each.name for each in recordings().values() if each.tonal}


def test_projects_of_all_examples_are_valid_and_their_points_on_the_surface(tmp_path):
    config = {**CONFIG, "results_dir": str(tmp_path)}
    for name in (name for key in LISTS for name in CONFIG["sound"][key]):
        example = examples(config)[name]
        clips = tmp_path / FOLDER / example.name / "clips"
        clips.mkdir(parents=True)
        for target in example.targets:
            (clips / f"{target.name}.wav").touch()
        for part in example.parts:
            file = tmp_path / FOLDER / part / PROJECT
            file.parent.mkdir(exist_ok=True)
            file.write_text(yaml.safe_dump(project(example, part, config)))
            read = load_project(file)
            strikes = read.strikes(read.surface())
            assert [strike.name for strike in strikes] == [
                target.name for target in example.targets_of(part)
            ]
            assert read.optimiser.seconds == example.seconds


def test_the_pitcher_is_edited_twice():
    pitcher = examples(CONFIG)["pitcher"]
    assert pitcher.parts == ["pitcher/edit-1", "pitcher/edit-2", "pitcher"]
    counts = [len(pitcher.targets_of(part)) for part in pitcher.parts]
    assert counts == [1, 2, 3]


def test_the_chord_is_on_the_bunny_where_its_mesh_is_and_on_a_bell_otherwise(tmp_path):
    config = {**CONFIG, "mesh_folder": str(tmp_path)}
    assert examples(config)["chord"].mesh == "builtin:bell"
    (tmp_path / config["sound"]["bunny"]).touch()
    chord = examples(config)["chord"]
    assert chord.mesh_files == [str(tmp_path / "stanford-bunny.obj")]
    relative = project(chord, "chord", {**config, "results_dir": str(tmp_path / "results")})["mesh"]
    assert relative == "../../../stanford-bunny.obj"


def test_all_examples_are_planned_without_any_mesh_file(plan):
    jobs = plan("sounds")
    chosen = [examples(CONFIG)[name] for name in CONFIG["sound"]["examples"]]
    assert jobs["design_sound"] == sum(example.edits for example in chosen) == 9
    assert jobs["begin_design"] == jobs["check_design"] == jobs["build_sound_page"] == 7
    assert jobs["record_clip"] == 8 and jobs["synthesise_clip"] == 9
    assert jobs["find_reach"] == 7 and "compare_optimisers_by_seeds" not in jobs
    assert jobs["build_sounds"] == 1 and jobs["compare_optimisers"] == 2


def test_examples_of_recordings_are_planned_and_need_no_other(plan):
    jobs = plan("sounds_of_recordings")
    count = len(CONFIG["sound"]["recordings"])
    assert jobs["take_recording"] == jobs["design_sound"] == jobs["build_sound_page"] == count
    assert jobs["bring_recordings"] == jobs["build_sounds_of_recordings"] == 1
    assert "synthesise_clip" not in jobs and "build_sounds" not in jobs


def test_pairs_are_planned_with_their_seeds_and_no_question_what_the_solid_can_have(plan):
    jobs = plan("sounds_of_clips")
    count = len(CONFIG["sound"]["clips"])
    searches = count + CONFIG["sound"]["clip_seeds"] - 1
    assert jobs["take_recording"] == jobs["init_project"] == jobs["design_sound"] == searches
    assert jobs["build_sound_page"] == jobs["check_design"] == jobs["begin_design"] == count
    assert "find_reach" not in jobs and "write_project" not in jobs


@pytest.mark.nightly
def test_a_tiny_design_is_made_from_synthesised_clips_and_sounds(tmp_path):
    folder = Path("results-tiny", FOLDER, "frying-pan")
    target = folder / "after" / "plate.wav"
    done = snakemake(tmp_path, target, "--configfile", TINY, "--cores", 2)
    log = tmp_path / "results-tiny" / "logs" / FOLDER / "frying-pan" / "design.log"
    assert done.returncode == 0, done.stderr + (log.read_text() if log.exists() else "")
    design = read_design(tmp_path / folder / DESIGN)
    assert design.targets.names == ("plate", "handle")
    assert np.log(design.frequencies / design.targets.frequencies).mean() == pytest.approx(0.0)
    assert design.evidence["cost"] <= design.evidence["cost_start"]
    sound, rate = read_wav(tmp_path / target)
    assert rate == 44_100 and len(sound) > 0.1 * rate
