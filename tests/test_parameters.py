"""Parameters that are declared once: construction, command lines, files, sentences."""

import argparse
import dataclasses
import pickle
from typing import Annotated, Literal

import numpy as np
import pytest
from annotated_types import Ge, Le

from carillon.command_line.arguments import Parser
from carillon.errors import UserError
from carillon.parameters import (
    REQUIRED,
    Check,
    OneOf,
    checked,
    option,
    parameters,
    quantities,
)
from carillon.parameters.command_line import add_options, collect, reader
from carillon.parameters.documents import parameters_from, read_parameters
from carillon.parameters.fields import domain_of, parameters_of
from carillon.parameters.quantities import (
    Corrections,
    Density,
    NumberOfModes,
    PoissonRatio,
    Resolution,
    ToleranceOrNone,
    Workers,
    WorkersAnywhere,
)
from carillon.parameters.sentences import ParameterError
from solver.analysis.options import SolverOptions
from sound.project.settings import OptimiserSettings
from workflow.commands.validate import ValidateOptions
from workflow.configuration.forests import DatasetSection
from workflow.configuration.run import MadeCorrections, ProvedTolerance, SolverSection
from workflow.configuration.solids import ModelEntry, ModelModes

Vector = Annotated[tuple[float, float, float], "a position [m]"]


def _even(value: int) -> int:
    if value % 2:
        raise ValueError(f"{value} is odd")
    return value


@parameters
class Point:
    """A point."""

    name: str = option(REQUIRED, "name of the point")
    at: Vector | None = option(None)
    even: Annotated[int, Check(_even)] = option(0, "an even number")

    def __post_init__(self) -> None:
        if self.name == "nowhere":
            raise ValueError(f"{self.name} is no point")


@parameters
class Weights:
    """Weights."""

    frequency: float = option(1.0, "weight of frequencies [1]")


@parameters
class Solid:
    """A solid."""

    resolution: Resolution = option(REQUIRED)
    density: Density = option(1000.0)
    poisson: PoissonRatio = option(0.25)
    modes: Annotated[int, Ge(2), Le(9)] | Literal["auto"] = option("auto", "number of modes [1]")
    method: Annotated[str, OneOf("fast", "slow")] = option("fast", "how it is solved")
    lumped: bool = option(False, "lump the mass")
    points: tuple[Point, ...] = option((), "points of the solid")
    weights: Weights = option(Weights, "weights of the cost")
    seconds: Annotated[float, Ge(0.5)] | None = option(None, "wall time [s]")
    named: dict[str, Weights] = option(dict, "weights by name")


def test_construction_converts_numbers_of_numpy_and_lists():
    solid = Solid(np.int64(8), np.float32(2.0), points=[Point("a", [1, 2, 3])])  # type: ignore[arg-type]
    assert solid == Solid(resolution=8, density=2.0, points=(Point("a", (1.0, 2.0, 3.0)),))
    assert type(solid.resolution) is int and type(solid.density) is float
    assert dataclasses.replace(solid, resolution=9).resolution == 9
    with pytest.raises(dataclasses.FrozenInstanceError):
        solid.resolution = 3  # type: ignore[misc]


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"resolution": "8"}, "resolution: found '8', expected a whole number: voxels"),
        ({"resolution": True}, "resolution: found True, expected a whole number: voxels"),
        ({"resolution": 8, "density": "7850"}, "density: found '7850', expected a number: mass"),
    ],
)
def test_construction_takes_no_text_for_a_number(values, sentence):
    with pytest.raises(ParameterError) as error:
        Solid(**values)
    assert sentence in str(error.value)
    sent = pickle.loads(pickle.dumps(error.value))
    assert (str(sent), sent.place) == (str(error.value), error.value.place)


def test_a_value_of_a_call_is_checked_as_parameters_are():
    assert checked("density", np.float32(2.0), Density) == 2.0
    with pytest.raises(ParameterError, match="density: found 0, expected at least 0.001 kg/m"):
        checked("density", 0.0, Density)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({}, "the key resolution is missing, expected voxels, or lattice spacings, along the "),
        ({"resolution": 1}, "resolution: found 1, expected at least 2: voxels, or"),
        ({"resolution": 10**6}, "resolution: found 1000000, expected at most 100,000: voxels"),
        ({"resolution": 8.5}, "resolution: found 8.5, expected a whole number: voxels"),
        ({"resolution": "8"}, "resolution: found '8', expected a whole number: voxels"),
        ({"resolution": True}, "resolution: found true, expected a whole number: voxels"),
        ({"resolution": None}, "resolution: found nothing, expected a whole number: voxels"),
        ({"resoluton": 8}, "there is no key 'resoluton', only resolution, density, poisson, modes"),
        ({"density": 0}, "density: found 0, expected at least 0.001 kg/m^3: mass density [kg/m^3]"),
        ({"density": float("nan")}, "density: found nan, expected a finite number: mass density"),
        ({"density": 2**5000}, "density: found a whole number of 5,001 bits, expected 4,096 at"),
        ({"poisson": 0.5}, "poisson: found 0.5, expected below 0.5: Poisson's ratio [1]"),
        ({"modes": 1}, "modes: found 1, expected at least 2, or auto: number of modes [1]"),
        ({"modes": "x"}, "modes: found 'x', expected a whole number or auto: number of modes [1]"),
        ({"modes": "aut"}, "expected a whole number or auto (did you mean auto?): number of"),
        ({"method": "fats"}, "found 'fats', expected one of fast, slow (did you mean fast?): how"),
        ({"lumped": 1}, "lumped: found 1, expected true or false: lump the mass"),
        ({"lumped": None}, "lumped: found nothing, expected true or false: lump the mass"),
        ({"method": False}, "found false, as YAML reads no and off without quotes, expected one"),
        ({"points": 3}, "points: found 3, expected a list: points of the solid"),
        ({"points": [{"at": None}]}, "points[0]: the key name is missing, expected name of the"),
        ({"points": [{"name": "a", "at": [1, 2]}]}, "points[0].at (a): found [1, 2], expected 3"),
        (
            {"points": [{"name": "a", "at": [1, "b", 2]}]},
            "points[0].at[1] (a): found 'b', expected",
        ),
        ({"points": [{"name": "nowhere"}]}, "points[0] (nowhere): nowhere is no point"),
        ({"points": [{"name": "a", "even": 3}]}, "points[0].even (a): 3 is odd"),
        ({"weights": 3}, "weights: found 3, expected keys and values: weights of the cost"),
        ({"weights": {"frequenzy": 1}}, "weights: there is no key 'frequenzy', only frequency; "),
        ({"seconds": 0.1}, "seconds: found 0.1, expected at least 0.5 s: wall time [s]"),
        ({"seconds": "x"}, "seconds: found 'x', expected a number or null: wall time [s]"),
        ({"named": {"a": {"frequency": "x"}}}, "named.a.frequency: found 'x', expected a number"),
    ],
)
def test_a_mistake_in_a_document_is_one_sentence(values, sentence):
    document = {"resolution": 8, **values} if values else {}
    with pytest.raises(ParameterError) as error:
        parameters_from(document, Solid)
    assert sentence in str(error.value)


def test_a_document_may_write_whole_numbers_with_a_point():
    solid = parameters_from({"resolution": 8.0, "density": 7}, Solid)
    assert (solid.resolution, solid.density) == (8, 7.0)


def test_a_mistake_in_a_file_is_told_with_its_line(tmp_path):
    file = tmp_path / "solid.yaml"
    file.write_text("resolution: 8\npoints:\n- name: a\n- name: b\n  at: [1, 2, x]\n")
    with pytest.raises(
        UserError, match=r"solid.yaml, line 5: points\[1\].at\[2\] \(b\): found 'x'"
    ):
        read_parameters(file, Solid, "a solid")
    file.write_text("density: 8\n\npoints:\n- at: [1, 2, 3]\n")
    with pytest.raises(UserError, match=r"line 1: the key resolution is missing"):
        read_parameters(file, Solid, "a solid")


def _parsed(*words: str) -> Solid:
    parser = Parser(prog="solve")
    add_options(parser, Solid, leave_out=("points", "weights", "named"))
    return collect(Solid, parser.parse_args(words))


def test_a_command_line_is_made_from_the_fields():
    solid = _parsed("--resolution", "8", "--modes", "3", "--lumped", "--seconds", "2")
    assert solid == Solid(8, modes=3, lumped=True, seconds=2.0)
    assert _parsed("--resolution", "8", "--modes", "auto") == Solid(8)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("--resolution 1", "argument --resolution: found 1, expected at least 2 (see solve --help"),
        ("--resolution 8.0", "argument --resolution: found '8.0', expected a whole number (see"),
        ("--resolution 8 --density inf", "--density: found inf, expected a finite number"),
        ("--resolution 8 --seconds x", "--seconds: found 'x', expected a number (see"),
        ("--resolution 8 --seconds 0.1", "--seconds: found 0.1, expected at least 0.5 s"),
        ("--resolution 8 --modes x", "--modes: found 'x', expected a whole number or auto"),
        ("--resolution 8 --method fats", "invalid choice: 'fats', did you mean 'fast'?"),
    ],
)
def test_a_mistake_on_a_command_line_names_the_option(words, sentence):
    with pytest.raises(UserError) as error:
        _parsed(*words.split())
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("annotation", "word", "sentence"),
    [
        (Workers, "1025", "found 1025, expected at most 1,024"),
        (Workers, "65", "found 65, expected at most 64, since 2 cores are usable here"),
        (NumberOfModes, "6", "found 6, expected at least 7, since the first 6 are rigid motions"),
        (ModelModes, "7", "found 7, expected at least 12, since pages list them all and compare"),
        (ModelModes, "10001", "found 10001, expected at most 10,000, since pages list them all"),
        (ToleranceOrNone, "1e-16", "found 1e-16, expected 1e-15 to 1, or 0 for no tolerance"),
        (ProvedTolerance, "0", "found 0.0, expected at least 1e-15"),
        (ProvedTolerance, "0.5", "found 0.5, expected at most 0.1, since the validation holds"),
        (MadeCorrections, "0", "found 0, expected at least 1, since plain HCMS is"),
    ],
)
def test_limits_of_a_shared_quantity_are_told_with_their_reason(
    monkeypatch, annotation, word, sentence
):
    monkeypatch.setattr(quantities, "allowed_cores", lambda: 2)
    with pytest.raises(argparse.ArgumentTypeError) as error:
        reader(annotation)(word)
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("model", "name", "annotation"),
    [
        (DatasetSection, "workers", WorkersAnywhere),
        (OptimiserSettings, "workers", WorkersAnywhere),
        (SolverOptions, "tolerance", ToleranceOrNone),
        (SolverSection, "tolerance", ProvedTolerance),
        (ValidateOptions, "tolerance", ProvedTolerance),
        (SolverOptions, "corrections", Corrections),
        (SolverSection, "corrections", MadeCorrections),
        (SolverOptions, "modes", NumberOfModes),
        (SolverSection, "modes", ModelModes),
        (ModelEntry, "modes", ModelModes),
        (ValidateOptions, "modes", ModelModes),
    ],
)
def test_a_quantity_has_the_same_limits_wherever_it_is_given(model, name, annotation):
    assert parameters_of(model)[name].domain.limits == domain_of(annotation).limits


def test_help_shows_meanings_and_defaults():
    parser = argparse.ArgumentParser()
    add_options(parser, Solid, leave_out=("points", "weights", "named"))
    text = " ".join(parser.format_help().split())
    assert "--density DENSITY mass density [kg/m^3] (default 1000)" in text
    assert "--method {fast,slow} how it is solved (default fast)" in text


def test_fields_are_described():
    known = parameters_of(Solid)
    assert known["density"].domain.unit == "kg/m^3"
    assert known["density"].domain.limits == {"ge": 1e-3, "le": 1e6}
    assert known["weights"].domain.is_section and known["points"].domain.items[0].is_section
    assert known["modes"].domain.words == ("auto",) and known["seconds"].domain.nullable
    assert known["resolution"].default is REQUIRED


def test_several_words_of_an_option_are_an_item_each():
    parser = Parser()
    add_options(parser, ValidateOptions)
    given = parser.parse_args(["--out", "x", "--tolerances", "residual=1e-6", "response=2"])
    assert given.tolerances == [("residual", 1e-6), ("response", 2.0)]
