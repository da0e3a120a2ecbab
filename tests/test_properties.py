"""Whatever is read, the answer is content or one sentence: texts that people write."""

import argparse
import copy
import json
import math
from contextlib import contextmanager
from typing import Annotated

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from carillon.errors import LONGEST_MESSAGE, one_line
from carillon.files.yaml_input import parse_yaml
from carillon.parameters.command_line import reader
from carillon.parameters.quantities import Count, NonNegative, PoissonRatio, Positive, between
from sound.clips.instruments import note_hertz
from sound.project.project import project_of
from studies.forests.training import require_counts
from studies.scaling.runs import rank_counts
from tests.hostile.fuzzing import damaged, examples, or_refused, values, yaml_texts
from tests.hostile.zoo import CONFIGURATION, PROJECT
from workflow.commands.validate import _tolerance
from workflow.configuration.whole import completed

NUMBERS = st.one_of(
    st.text(max_size=30),
    st.integers().map(str),
    st.floats().map(repr),
    st.sampled_from(["１２", "1_000", "0x10", "1e999", "-0", "+5", "", " 5", "5\n", "٣", "1e-400"]),
)
BETWEEN = Annotated[float, between(-2.0, 3.0)]
TYPES = {
    "whole": (reader(Count), int, lambda value: 1 <= value < 2**63),
    "not negative": (reader(NonNegative), float, lambda value: 0.0 <= value < math.inf),
    "positive": (reader(Positive), float, lambda value: 0.0 < value < math.inf),
    "ratio": (reader(PoissonRatio), float, lambda value: -1.0 < value < 0.5),
    "between": (reader(BETWEEN), float, lambda value: -2.0 <= value <= 3.0),
}


@contextmanager
def taken_or_refused():
    try:
        yield
    except argparse.ArgumentTypeError as error:
        assert str(error)


@pytest.mark.parametrize("name", TYPES)
@examples(150)
@given(text=NUMBERS)
def test_a_number_is_in_its_range_or_refused(name, text):
    convert, kind, allowed = TYPES[name]
    with taken_or_refused():
        value = convert(text)
        assert type(value) is kind and allowed(value)


@examples(150)
@given(text=NUMBERS | st.lists(NUMBERS, max_size=3).map(",".join))
def test_numbers_of_ranks_ascend_or_are_refused(text):
    with taken_or_refused():
        counts = rank_counts(text)
        assert counts and list(counts) == sorted(set(counts)) and counts[0] >= 1


@examples(150)
@given(text=NUMBERS | st.lists(NUMBERS, max_size=3).map(",".join))
def test_numbers_of_rows_ascend_or_are_refused(text):
    counts = or_refused(lambda: require_counts(text))
    assert counts is None or (counts and counts == sorted(set(counts)) and counts[0] >= 1)


@examples(150)
@given(text=st.text(max_size=8) | st.from_regex(r"[A-H][#b]?-?[0-9]{1,3}", fullmatch=True))
def test_a_note_sounds_or_is_refused(text):
    hertz = or_refused(lambda: note_hertz(text))
    assert hertz is None or 0.0 < hertz < math.inf


@examples(15)
@given(text=NUMBERS.map("residual=".__add__) | st.text(max_size=20))
def test_a_tolerance_is_positive_or_refused(text):
    with taken_or_refused():
        name, value = _tolerance(text)
        assert name and 0.0 < value < math.inf


@examples(200)
@given(text=st.text(max_size=3000))
def test_a_message_is_one_printable_line_of_bounded_length(text):
    line = one_line(text)
    assert "\n" not in line and line.isprintable()
    assert len(text) > LONGEST_MESSAGE or len(line) <= 10 * len(text)
    assert line == one_line(line) or len(line) > LONGEST_MESSAGE


@examples(300)
@given(text=yaml_texts())
def test_yaml_is_plain_values_or_refused(text):
    assert_plain(or_refused(lambda: parse_yaml(text)))


def assert_plain(value):
    assert value is None or type(value) in (bool, int, float, str, list, dict, set, bytes), value
    for part in value.values() if isinstance(value, dict) else ():
        assert_plain(part)
    for part in value if isinstance(value, (list, set)) else ():
        assert_plain(part)


@examples(100)
@given(content=damaged(PROJECT.encode()))
def test_a_damaged_project_is_a_project_or_refused(content, clips):
    described = or_refused(lambda: parse_yaml(content.decode(errors="replace")))
    if isinstance(described, dict):
        assert_project(described, clips)


@examples(200)
@given(
    key=st.sampled_from([*yaml.safe_load(PROJECT), "unit", "weights", "forest", "x"]),
    value=values(),
)
def test_any_value_in_a_project_makes_sense_or_is_refused(key, value, clips):
    assert_project({**yaml.safe_load(PROJECT), key: value}, clips)


@examples(150)
@given(
    place=st.sampled_from(
        [
            *(("targets", 0, key) for key in ("name", "at", "vertex", "clip", "modes")),
            *(("material", key) for key in ("young", "dimensions", "law")),
            *(("optimiser", key) for key in ("seconds", "evaluations", "workers", "seed")),
        ]
    ),
    value=values(),
)
def test_any_value_deep_in_a_project_makes_sense_or_is_refused(place, value, clips):
    assert_project(replaced(yaml.safe_load(PROJECT), place, value), clips)


def replaced(described, place, value):
    described = copy.deepcopy(described)
    part = described
    for step in place[:-1]:
        part = part[step]
    part[place[-1]] = value
    return described


def assert_project(described, clips):
    project = or_refused(lambda: project_of(described, clips))
    if project is None:
        return
    numbers = [project.solid.unit, project.solid.density, project.material.young]
    assert all(0.0 < number < math.inf for number in numbers)
    assert project.targets and (project.modes == "auto" or project.modes >= 2)
    json.dumps(project.as_dict(), allow_nan=False)


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    """A folder in which the clips of the project are."""
    folder = tmp_path_factory.mktemp("clips")
    for target in yaml.safe_load(PROJECT)["targets"]:
        (folder / target["clip"]).touch()
    return folder


@examples(30)
@given(
    place=st.sampled_from(
        [
            *(("models", "bar", key) for key in ("mesh", "resolution", "material", "unit", "seed")),
            *(("dataset", key) for key in ("samples", "distributions", "shards", "ranges")),
            *(("solver", key) for key in ("modes", "cores", "launcher", "tolerance")),
            *((key,) for key in ("models", "results_dir", "title", "poisson", "x", "mesh_folder")),
        ]
    ),
    value=values(),
)
def test_any_value_in_a_configuration_fits_or_is_refused(place, value):
    config = replaced(yaml.safe_load(CONFIGURATION), place, value)
    or_refused(lambda: completed(config))


def test_the_memory_of_a_reader_is_bounded():
    with pytest.raises(MemoryError):
        or_refused(lambda: np.empty(1 << 33))


def test_the_values_tried_are_real(clips):
    assert project_of(yaml.safe_load(PROJECT), clips).modes == 6
    completed(yaml.safe_load(CONFIGURATION))
