"""What is read from HDF5 files has the shape and the kind of numbers that it should have."""

import h5py
import numpy as np
import pytest

from carillon.errors import UserError
from carillon.files.content import require_whole
from carillon.files.datasets import INTEGER, number, read


@pytest.fixture
def group(tmp_path):
    with h5py.File(tmp_path / "file.h5", "w") as file:
        part = file.create_group("part")
        part["real"] = np.linspace(0.0, 1.0, 6).reshape(2, 3)
        part["whole"] = np.arange(4)
        part["nan"] = np.array([1.0, np.nan, np.inf])
        part["complex"] = np.ones(3, dtype=complex)
        part["text"] = np.array([b"a", b"b"])
        part["scalar"] = 1.0
        part["empty"] = h5py.Empty("f8")
        part.create_group("group")
        part.attrs["one"], part.attrs["nan"], part.attrs["text"] = 1.0, np.nan, "a"
        part.attrs["several"] = np.ones(3)
        yield part


def test_what_fits_is_read(group):
    assert read(group, "real", (2, 3)).shape == read(group, "real", (None, 3)).shape == (2, 3)
    assert read(group, "whole", (4,), INTEGER).tolist() == [0, 1, 2, 3]
    assert number(group, "one", 0.0, 1.0) == 1.0


@pytest.mark.parametrize(
    ("name", "shape", "fault"),
    [
        ("absent", (None,), "has no dataset 'absent'"),
        ("group", (None,), "has no dataset 'group'"),
        ("real", (3, 2), "has shape (2, 3), expected (3, 2)"),
        ("real", (None,), "has shape (2, 3), expected (any,)"),
        ("scalar", (1,), "has shape (), expected (1,)"),
        ("empty", (1,), "has shape None"),
        ("whole", (4,), "holds int64, expected real numbers"),
        ("complex", (3,), "holds complex128"),
        ("text", (2,), "holds |S1"),
        ("nan", (3,), "holds 2 values that are not finite"),
    ],
)
def test_anything_else_is_one_sentence(group, name, shape, fault):
    with pytest.raises(UserError) as caught:
        read(group, name, shape)
    text = str(caught.value)
    assert "file.h5: " in text and fault in text and "generate the file again" in text


def claim(part):
    part.create_dataset("x", (1 << 40, 1 << 20), float, chunks=(8, 8))


def borrow(part):
    part.create_dataset("x", (4,), float, external=[("other.raw", 0, 32)])


def look_elsewhere(part):
    layout = h5py.VirtualLayout(shape=(4,), dtype=float)
    layout[...] = h5py.VirtualSource("other.h5", "x", shape=(4,))
    part.create_virtual_dataset("x", layout)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (claim, "'x' is incomplete"),
        (borrow, "'x' takes its numbers from another file"),
        (look_elsewhere, "'x' takes its numbers from another file"),
        (lambda part: part.__setitem__("x", h5py.ExternalLink("other.h5", "/x")), "a link, 'x'"),
        (lambda part: part.__setitem__("x", h5py.SoftLink("/part/whole")), "a link, 'x'"),
    ],
)
def test_a_file_holds_all_that_it_says(group, change, fault):
    require_whole(group.file)
    change(group)
    with pytest.raises(UserError) as caught:
        require_whole(group.file)
    assert fault in str(caught.value) and "(in /part)" in str(caught.value)


@pytest.mark.parametrize("name", ["absent", "nan", "text", "several"])
def test_an_attribute_is_a_finite_number(group, name):
    with pytest.raises(UserError):
        number(group, name)
    with pytest.raises(UserError, match="expected 2 to 3"):
        number(group, "one", 2.0, 3.0)
