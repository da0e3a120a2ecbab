"""Materials from files: one positive real number per voxel, or one sentence."""

import io

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.moduli import read_moduli

COUNT = 6
YOUNG = np.linspace(1e8, 1e10, COUNT)


def npy(values, allow_pickle=False):
    stream = io.BytesIO()
    np.save(stream, values, allow_pickle=allow_pickle)
    return stream.getvalue()


def header(shape, kind="<f8", data=b""):
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        stream, {"descr": kind, "fortran_order": False, "shape": shape}
    )
    return stream.getvalue() + data


def read(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_moduli(path, COUNT, "mesh 'bar', resolution 2")


@pytest.mark.parametrize(
    "values",
    [
        YOUNG,
        YOUNG.astype(">f8"),
        YOUNG.astype(np.float32),
        YOUNG.astype(np.int64),
        YOUNG.astype(np.uint64),
        YOUNG.reshape(2, 3),
        np.asfortranarray(YOUNG.reshape(2, 3)),
    ],
)
def test_arrays_of_real_numbers_are_read_in_order(values, tmp_path):
    found = read(tmp_path, "young.npy", npy(values))
    assert found.dtype == float and np.allclose(found, YOUNG, rtol=1e-6)


@pytest.mark.parametrize("between", [" ", "\n", "\t", " # Pa\n"])
def test_text_of_real_numbers_is_read(between, tmp_path):
    text = "# moduli\n" + between.join(map(repr, YOUNG.tolist()))
    assert np.array_equal(read(tmp_path, "young.txt", text), YOUNG)
    assert np.array_equal(read(tmp_path, "young.txt", "\ufeff" + text), YOUNG)


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (npy(YOUNG + 1j), "holds complex128"),
        (npy(np.ones(COUNT, dtype=bool)), "holds bool"),
        (npy(np.arange(COUNT).astype("M8[s]")), "holds datetime64[s]"),
        (npy(np.arange(COUNT).astype("m8[s]")), "holds timedelta64[s]"),
        (npy(YOUNG.astype(object), allow_pickle=True), "holds object"),
        (npy(np.array(["1"] * COUNT)), "holds <U1"),
        (npy(np.zeros(COUNT, dtype=[("young", float)])), "holds [('young', '<f8')]"),
        (npy(YOUNG[:-1]), "5 values for 6 voxels (mesh 'bar', resolution 2)"),
        (npy(YOUNG[:0]), "0 values for 6 voxels"),
        (npy(YOUNG)[:-1], "shorter or longer than its header says"),
        (npy(YOUNG) + b"\0", "shorter or longer than its header says"),
        (npy(YOUNG)[:20], "is not readable as an array of numbers"),
        (b"", "is not readable as an array of numbers"),
        (b"\x93NUMPY\x09\x00", "version (9, 0) of the format"),
        (header((-6,)), "-6 values for 6 voxels"),
        (header((10**14,)), "100,000,000,000,000 values for 6 voxels"),
        (header((10**30,)), "values for 6 voxels"),
        (header((COUNT,)), "shorter or longer than its header says"),
        (npy(np.r_[YOUNG[1:], np.nan]), "1 values are not finite"),
        (npy(np.r_[YOUNG[1:], np.inf]), "1 values are not finite"),
        (npy(-YOUNG), "6 values are negative"),
        (npy(np.zeros(COUNT)), "all 6 values are zero"),
        (npy(1e20 * YOUNG), "expected 0.001 to 1e+15 Pa"),
        (npy(1e-20 * YOUNG), "expected 0.001 to 1e+15 Pa"),
        (npy(np.r_[YOUNG[1:], 1e-3]), "the largest at most 1e+12 times the least"),
    ],
)
def test_other_arrays_are_refused(content, fault, tmp_path):
    with pytest.raises(UserError) as caught:
        read(tmp_path, "young.npy", content)
    assert fault in str(caught.value)


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("", "0 values for 6 voxels"),
        ("1 2 3", "3 values for 6 voxels"),
        ("1 2 3 4 5 6+2j", "could not convert string to float: '6+2j'"),
        ("1 2 3 4 5 1_0", "found '1_0'"),
        ("1 2 3 4 5 ٦", "found '٦'"),
        ("1 2 3 4 5 nan", "1 values are not finite"),
        ("1 2 3 4 5 1e999", "1 values are not finite"),
        ("1,2,3,4,5,6", "could not convert"),
        (b"1 2 3 4 5 \xff", "codec can't decode"),
        ("1 " * 10**6, "2,000,000 bytes of text"),
    ],
)
def test_other_texts_are_refused(content, fault, tmp_path):
    with pytest.raises(UserError) as caught:
        read(tmp_path, "young.txt", content)
    assert fault in str(caught.value) and len(str(caught.value)) < 500
