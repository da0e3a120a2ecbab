"""Blends of measured heads, and the search for the one that a listener prefers."""

import json
from pathlib import Path

import numpy as np
import pytest

from carillon.__main__ import main
from carillon.errors import UserError
from sound.heads.calibration import GENERATION, HeadCalibration, calibration_of, load_calibration
from sound.heads.head_space import HeadSpace, distance, features_of, read_heads
from sound.heads.measured_head import read_head
from sound.heads.preference import Preference, RatedPair
from tests.head_calibration import absolute_costs, answer_all, at_random, listener_of, made_heads
from tests.synthetic_heads import Anatomy, sphere_directions, write_head

COUNT = 16
"""Number of heads."""
SCALES = np.array([2.0, 1.0, 0.5])


@pytest.fixture(scope="module")
def space() -> HeadSpace:
    return made_heads(COUNT, 30.0, seed=3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("heads")
    for name, anatomy in {
        "small": Anatomy(radius=0.075, scale=0.85),
        "large": Anatomy(radius=0.1, scale=1.15),
        "usual": Anatomy(),
    }.items():
        write_head(path / f"{name}.sofa", anatomy, sphere_directions((-40.0, 90.0), 30.0))
    return path


# Blends


def test_a_blend_of_one_head_is_that_head(space):
    point = space.coordinates[3]
    blend = space.blend(np.eye(COUNT)[3])
    assert distance(blend, space.heads[3]) < 1e-9
    # 10 of 15 components have most of it.
    assert space.weights(point).sum() == pytest.approx(1.0)
    mean = features_of(space.blend(space.weights(np.zeros(space.dimensions))))
    whole = np.linalg.norm(space.features[3] - mean)
    assert np.linalg.norm(space.features_at(point) - space.features[3]) < 0.6 * whole


def test_features_of_a_blend_are_those_of_its_weights(space):
    weights = space.weights(np.linspace(-1.0, 1.0, space.dimensions))
    found = features_of(space.blend(weights))
    np.testing.assert_allclose(found, weights @ space.features, atol=1e-6)


def test_coordinates_are_standard_deviations(space):
    np.testing.assert_allclose(space.coordinates.std(axis=0), 1.0)
    np.testing.assert_allclose(space.coordinates.mean(axis=0), 0.0, atol=1e-12)
    assert (np.diff(space.scales) <= 0.0).all()


def test_heads_of_other_directions_are_blended_too(folder, tmp_path):
    for each in ("small", "large"):
        (tmp_path / f"{each}.sofa").write_bytes((folder / f"{each}.sofa").read_bytes())
    write_head(tmp_path / "z.sofa", Anatomy(), sphere_directions((-50.0, 90.0), 15.0))
    same, other = read_heads(folder), read_heads(tmp_path)
    usual = same.heads[same.titles.index("usual")]
    assert other.heads[2].directions.shape == usual.directions.shape
    apart = distance(same.heads[0], same.heads[1])
    assert distance(other.heads[2], usual) < 0.1 * apart


# Preferences


def test_costs_follow_what_was_said():
    random = np.random.default_rng(0)
    best = np.array([1.0, -0.5, 0.5])
    comparisons = []
    for _ in range(120):
        first, second = random.standard_normal((2, 3))
        apart = [np.linalg.norm(SCALES * (each - best)) for each in (first, second)]
        score = int(np.clip(np.round(3.0 + apart[0] - apart[1]), 1, 5))
        comparisons.append(RatedPair(first, second, score))
    preference = Preference(comparisons, SCALES)
    found = preference.least(np.zeros(3))
    # The mean head is 2.1 away; answers are rounded to a quarter of that.
    assert np.linalg.norm(SCALES * (found - best)) < 0.5
    assert preference.costs(found[None])[0] < preference.costs(np.zeros((1, 3)))[0]


def test_least_squares_keeps_what_was_said_of_each_pair():
    """Eq. 5.9: the first of a pair that is definitely better costs less."""
    points = np.random.default_rng(0).standard_normal((8, 4))
    costs = absolute_costs(points, [1, 2, 4, 5]).reshape(4, 2)
    assert (np.sign(costs[:, 0] - costs[:, 1]) == [-1, -1, 1, 1]).all()
    assert np.abs(absolute_costs(points, [3, 3, 3, 3])).max() < 1e-12


# Calibrations


def answered(seed: int, scores: list[int]) -> HeadCalibration:
    calibration = HeadCalibration(SCALES, ["a", "b", "c", "d"], seed)
    for score in scores:
        calibration.answer(score)
    return calibration


def test_the_same_answers_lead_to_the_same_pairs():
    scores = [1, 3, 5, 2, 4, 1, 1, 2, 5]
    first, second = (answered(4, scores) for _ in range(2))
    np.testing.assert_array_equal(first.next_pair(), second.next_pair())
    np.testing.assert_array_equal(first.best, second.best)
    assert not np.array_equal(first.next_pair(), answered(5, scores).next_pair())


def test_a_pair_stays_until_it_is_answered():
    calibration = answered(0, [])
    first = calibration.next_pair()
    np.testing.assert_array_equal(first, calibration.next_pair())
    calibration.answer(3)
    assert calibration.count == 1 and not np.array_equal(first, calibration.next_pair())


@pytest.mark.parametrize("count", [0, 3, GENERATION // 2, 13])
def test_a_saved_calibration_goes_on_as_if_it_had_not_been(count, space, tmp_path):
    kept = calibration_of(space, 9)
    scores = np.random.default_rng(1).integers(1, 6, 30)
    for score in scores[:count]:
        kept.answer(int(score))
    kept.save(tmp_path / "mine.json")
    resumed = load_calibration(tmp_path / "mine.json", space)
    for score in scores[count:]:
        np.testing.assert_array_equal(kept.next_pair(), resumed.next_pair())
        kept.answer(int(score))
        resumed.answer(int(score))
    np.testing.assert_array_equal(kept.best, resumed.best)


def test_files_that_are_no_calibration_are_told(space, folder, tmp_path):
    path = tmp_path / "mine.json"
    with pytest.raises(UserError, match="no such file, expected a calibration"):
        load_calibration(path, space)
    path.write_text("{}")
    with pytest.raises(UserError, match="cannot be understood"):
        load_calibration(path, space)
    calibration_of(space, 0).save(path)
    with pytest.raises(UserError, match="is of other heads"):
        load_calibration(path, read_heads(folder))
    calibration = calibration_of(space, 0)
    calibration.answer(2)
    calibration.save(path)
    for wrong in ("9", '"x"', "null"):
        path.write_text(path.read_text().replace('"score": 2', f'"score": {wrong}'))
        with pytest.raises(UserError, match="cannot be understood"):
            load_calibration(path, space)
        calibration.save(path)
    with pytest.raises(UserError, match="a score of 6, expected 1 to 5"):
        calibration.answer(6)


def test_heads_that_are_alike_leave_nothing_to_compare(space):
    with pytest.raises(UserError, match="nothing to compare"):
        calibration_of(HeadSpace(space.heads[:1]), 0)
    with pytest.raises(UserError, match="nothing to compare"):
        calibration_of(HeadSpace([space.heads[2]] * 3), 0)


@pytest.mark.parametrize("is_left_out", [True, False])
def test_a_listener_is_found_within_120_comparisons(is_left_out, space):
    """Nearer than every other head, and than by chance; `tests.head_calibration` tries more."""
    listener, nearest = listener_of(space, 5, 0.25, is_left_out)
    calibration = calibration_of(listener.space, 1)
    answer_all(calibration, listener)
    assert calibration.count == 120
    reached = listener.distance(calibration.best)
    assert reached < nearest and reached < listener.distance(at_random(listener, 1))


# Command


def test_heads_of_a_folder_are_listed(folder, capsys):
    assert main(["heads", str(folder), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["heads"]
    assert [row["name"] for row in rows] == ["large", "small", "usual"]
    delays = {row["name"]: row["interaural_delay_seconds"] for row in rows}
    assert delays["small"] < delays["usual"] < delays["large"]
    assert main(["heads", str(folder)]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("large ")


def test_blends_are_written_for_scenes(folder, tmp_path, capsys):
    out, mine = tmp_path / "blend.sofa", tmp_path / "mine.json"
    space = read_heads(folder)
    assert main(["heads", str(folder), "--mix", "small=3", "large=1", "--out", str(out)]) == 0
    expected = space.blend(np.array([0.25, 0.75, 0.0]))
    # Filters end after 11.6 ms.
    assert distance(read_head(out), expected) < 0.05
    calibration = calibration_of(space, 0)
    for _ in range(5):
        calibration.answer(1)
    calibration.save(mine)
    words = ["heads", str(folder), "--calibration", str(mine), "--out", str(out), "--json"]
    capsys.readouterr()
    assert main(words) == 0
    weights = json.loads(capsys.readouterr().out)["weights"]
    np.testing.assert_allclose(list(weights.values()), space.weights(calibration.best))
    assert distance(read_head(out), space.blend(space.weights(calibration.best))) < 0.05


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["--mix", "nobody=1", "--out", "x.sofa"],
            "no head 'nobody', expected one of large, small",
        ),
        (["--mix", "small=much", "--out", "x.sofa"], "'much' is no number"),
        (["--mix", "small=0", "--out", "x.sofa"], "weights of sum 0"),
        (["--mix", "small=1"], "give --out FILE.sofa"),
        (["--out", "x.wav"], "ends in .wav"),
    ],
)
def test_blends_that_make_no_sense_are_refused(words, said, folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["heads", str(folder), *words]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_folders_without_heads_are_told(tmp_path, capsys):
    assert main(["heads", str(tmp_path)]) == 2
    assert "has no measured heads" in capsys.readouterr().err
    assert main(["heads", str(tmp_path / "none")]) == 2
    assert "no such folder" in capsys.readouterr().err
