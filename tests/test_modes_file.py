"""A modes file is what it says, or it is refused in one sentence."""

import shutil
from operator import methodcaller

import h5py
import numpy as np
import pytest
import scipy.linalg

from carillon.errors import UserError
from carillon.fem.geometry import hexmesh_from_grid
from carillon.fem.model import fine_model
from carillon.files.hdf5 import SEAL_BYTES
from solver.assembly.sparse import assembled
from solver.files.modes_file import read_modes, write_modes
from solver.response.response_file import StrikeOptions, respond
from solver.verification.audit import audit, audit_files
from solver.verification.comparison import compare_files
from tests.edited_files import edited, put

MODES = 12


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Modes file of two cubes side by side, all of its modes computed densely."""
    path = tmp_path_factory.mktemp("modes") / "modes.h5"
    mesh = hexmesh_from_grid(np.argwhere(np.ones((3, 2, 2))), np.zeros(3), 0.1)
    model = fine_model(mesh, np.linspace(1e9, 2e9, mesh.n_cells))
    K, M = (part.toarray() for part in assembled(model))
    values, modes = scipy.linalg.eigh(K, M, subset_by_index=[0, MODES - 1])
    write_modes(path, model, values, [modes], np.zeros(MODES), {"method": "dense"}, {})
    return path


@pytest.fixture
def path(written, tmp_path):
    return shutil.copy(written, tmp_path / "modes.h5")


def test_what_was_written_is_read(path):
    file = read_modes(path)
    assert file.modes.shape == (3 * file.mesh.n_nodes, MODES)
    assert read_modes(path, with_modes=False).modes is None
    assert audit_files([path])["modes"].rigid_modes == 6


def with_value(value, place=-1):
    def change(values):
        values.flat[place] = value
        return values

    return change


EDITS = {
    **{
        f"{name} {value}": put(name, with_value(value))
        for name in ("eigenvalues", "frequencies", "modes", "residuals", "young")
        for value in (np.nan, np.inf)
    },
    **{
        f"no {name}": methodcaller("__delitem__", name)
        for name in ("eigenvalues", "modes", "residuals", "young", "cells", "grid", "fill")
    },
    "descending": put("eigenvalues", lambda values: values[::-1]),
    "negative": put("eigenvalues", with_value(-1e12, 0)),
    "fewer eigenvalues": put("eigenvalues", lambda values: values[:-1]),
    "no eigenvalues at all": put("eigenvalues", lambda values: values[:0]),
    "complex eigenvalues": put("eigenvalues", lambda values: values + 1j),
    "text for eigenvalues": put("eigenvalues", lambda values: values.astype("S")),
    "a matrix of eigenvalues": put("eigenvalues", lambda values: values.reshape(2, -1)),
    "modes of another mesh": put("modes", lambda values: values[3:]),
    "negative moduli": put("young", with_value(-1.0)),
    "moduli of other cells": put("young", lambda values: values[1:]),
    "a corner that is no node": put("cells", with_value(10_000)),
    "a corner below zero": put("cells", with_value(-1)),
    "another corner": put("cells", with_value(0)),
    "cells elsewhere": put("grid", lambda values: values + 1),
    "real cells": put("cells", lambda values: values.astype(float)),
    "other fill": put("fill", lambda values: values[1:]),
    "no edge": lambda file: file.attrs.__setitem__("cell_edge", 0.0),
    "edge nan": lambda file: file.attrs.__setitem__("cell_edge", np.nan),
    "huge density": lambda file: file.attrs.__setitem__("density", 1e300),
    "impossible ratio": lambda file: file.attrs.__setitem__("poisson", 0.7),
    "no point": lambda file: file.attrs.__setitem__("origin", np.array([0.0, np.nan, 0.0])),
    "text for density": lambda file: file.attrs.__setitem__("density", "heavy"),
    "broken attribute": lambda file: file.attrs.__setitem__("timings", "{"),
}


@pytest.mark.parametrize("name", EDITS)
def test_content_that_makes_no_sense_is_refused(name, path):
    with edited(path) as file:
        EDITS[name](file)
    for use in (read_modes, lambda path: audit_files([path])):
        with pytest.raises(UserError) as caught:
            use(path)
        assert str(path) in str(caught.value) and "generate the file again" in str(caught.value)


def test_a_file_without_its_seal_is_refused(path):
    path.write_bytes(bytes(SEAL_BYTES) + path.read_bytes()[SEAL_BYTES:])
    with h5py.File(path) as file:
        assert "modes" in file
    with pytest.raises(UserError, match="its checksum is gone"):
        read_modes(path)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_a_truncated_file_is_refused(share, path):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(UserError):
        read_modes(path)


def test_numbers_that_overflow_fail_the_audit(path):
    file = read_modes(path)
    file.modes *= 1e200
    with pytest.raises(ArithmeticError, match="not finite"):
        audit(file)
    with edited(path) as file:
        put("modes", lambda values: 1e200 * values)(file)
    with pytest.raises(UserError, match="modes.h5: residuals or products"):
        audit_files([path])


def test_elastic_modes_of_frequency_zero_are_neither_compared_nor_struck(path):
    with edited(path) as file:
        put("eigenvalues", with_value(0.0, slice(0, 8)))(file)
        put("frequencies", with_value(0.0, slice(0, 8)))(file)
    for use in (
        lambda: compare_files(path, path),
        lambda: respond(path, {}, StrikeOptions()),
    ):
        with pytest.raises(UserError, match="have frequency zero"):
            use()


def test_modes_of_another_solid_are_neither_compared_nor_struck(path, tmp_path):
    other = shutil.copy(path, tmp_path / "other.h5")
    with edited(other) as file:
        file.attrs["origin"] = np.array([0.0, 0.0, 0.15])
    for use in (
        lambda: compare_files(other, path),
        lambda: respond(path, {"other": other}, StrikeOptions()),
    ):
        with pytest.raises(UserError, match="is of another solid .* or place than"):
            use()


def test_audits_of_files_with_equal_names_are_told_apart(path, tmp_path):
    other = tmp_path / "other" / "modes.h5"
    other.parent.mkdir()
    shutil.copy(path, other)
    assert list(audit_files([path, other])) == [str(path), str(other)]
