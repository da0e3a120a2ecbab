"""An audit says in a sentence each what is wrong with a spectrum, and nothing of a right one."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from solver.__main__ import main
from solver.files.modes_file import read_modes
from solver.verification.audit import audit

BAR = "modes builtin:bar --resolution 12 --modes 20 --no-estimate --out bar.h5".split()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("faults")


@pytest.fixture(scope="module")
def file(folder):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(BAR) == 0
    return read_modes(folder / "bar.h5")


def without(file, mode):
    values, frequencies, residuals = (
        np.delete(each, mode) for each in (file.eigenvalues, file.frequencies, file.residuals)
    )
    modes = np.ascontiguousarray(np.delete(file.modes, mode, axis=1))
    return replace(
        file, eigenvalues=values, frequencies=frequencies, residuals=residuals, modes=modes
    )


def stands_twice(modes):
    modes[:, 10] = modes[:, 9]


def swapped(modes):
    modes[:, [9, 12]] = modes[:, [12, 9]]


def shifted(values):
    values[9] *= 1.0001


@pytest.mark.parametrize(
    ("part", "change", "sentences"),
    [
        ("mode", 9, ["1 eigenvalue is missing"]),
        ("mode", 2, ["1 eigenvalue is missing", "5 of 6 rigid motions are there"]),
        (
            *("modes", stands_twice),
            [
                "modes are orthonormal to 1.0e+00",
                "1 mode has too large a residual, mode 11",
                "the eigenvalue of mode 11 is",
            ],
        ),
        (
            *("modes", swapped),
            ["2 modes have too large a residual", "the eigenvalue of mode 10 is"],
        ),
        (
            *("eigenvalues", shifted),
            ["the eigenvalue of mode 10 is 1.0e-04 off", "frequency of mode 10"],
        ),
        (
            *("frequencies", shifted),
            ["the frequency of mode 10 is not that of its eigenvalue"],
        ),
    ],
)
def test_each_damage_is_told_and_nothing_else(file, part, change, sentences):
    if part == "mode":
        damaged = without(file, change)
    else:
        values = getattr(file, part).copy()
        change(values)
        damaged = replace(file, **{part: values})
    faults = audit(damaged).faults
    assert len(faults) == len(sentences)
    for fault, sentence in zip(faults, sentences):
        assert sentence in fault


def test_nothing_is_wrong_with_a_right_spectrum(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    assert main(["audit", "--strict", "bar.h5"]) == 0
    assert "nothing is wrong" in capsys.readouterr().out


@pytest.mark.parametrize("count", [7, 8, 9])
def test_nothing_is_wrong_where_the_last_modes_are_some_of_several_equal_ones(count, tmp_path):
    trimesh.creation.box((0.1, 0.02, 0.02)).export(tmp_path / "square.obj")
    words = ["--resolution", "15", "--modes", str(count), "--no-estimate"]
    out = tmp_path / "square.h5"
    assert main(["modes", str(tmp_path / "square.obj"), *words, "--out", str(out)]) == 0
    assert audit(read_modes(out)).faults == []


def test_strict_tells_a_program(folder, file, monkeypatch, capsys):
    """Component mode synthesis without a correction is not as accurate as the default asks."""
    monkeypatch.chdir(folder)
    assert main([*BAR[:-1], "rough.h5", "--method", "hcms", "--corrections", "0"]) == 0
    assert main(["audit", "rough.h5"]) == 0
    assert main(["audit", "rough.h5", "--strict"]) == 1
    assert "too large a residual" in capsys.readouterr().out
