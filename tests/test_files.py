"""A result file is complete or absent, and a bad one is named in one sentence."""

import errno
import fcntl
import json
import os
import socket
import stat
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from carillon import ROOMS
from carillon.errors import UserError
from carillon.files import hdf5, system
from carillon.files.atomic import atomic_path
from carillon.files.hdf5 import create_h5, kind_of, open_h5
from carillon.files.paths import require_file, require_writable
from tests.programs import CHECKOUT, python


@pytest.fixture
def shard(tmp_path):
    path = tmp_path / "shard.h5"
    with create_h5(path, "shard", 3) as file:
        file["young"] = np.arange(1000.0)
    return path


def one_sentence(caught: pytest.ExceptionInfo[UserError]) -> str:
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_what_was_written_is_read_back(shard):
    with open_h5(shard, "shard", 3) as file:
        assert np.array_equal(file["young"], np.arange(1000.0))


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_an_exception_leaves_no_file_behind(tmp_path, error):
    with pytest.raises(error), create_h5(tmp_path / "modes.h5", "modes", 1) as file:
        file["eigenvalues"] = np.ones(3)
        raise error
    assert list(tmp_path.iterdir()) == []


def test_an_exception_keeps_the_earlier_file(shard):
    before = shard.read_bytes()
    with pytest.raises(RuntimeError), create_h5(shard, "shard", 3):
        raise RuntimeError("interrupted")
    assert shard.read_bytes() == before
    assert list(shard.parent.iterdir()) == [shard]


def test_the_final_name_appears_only_when_the_file_is_complete(tmp_path):
    path = tmp_path / "modes.h5"
    with atomic_path(path) as temporary:
        temporary.write_text("half")
        assert not path.exists()
        assert temporary.parent == path.parent, "a rename across file systems is not atomic"
    assert path.read_text() == "half"


def test_permissions_follow_the_umask(shard):
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE(shard.stat().st_mode) == 0o666 & ~umask


@pytest.mark.parametrize(
    ("path", "says"),
    [
        ("nowhere/modes.h5", "nowhere does not exist"),
        ("", "is a folder"),
        # Not even root may create files there.
        ("/proc/modes.h5", "/proc/modes.h5: cannot be written"),
    ],
)
def test_where_nothing_can_be_written_is_told_before_any_work(tmp_path, path, says):
    with pytest.raises(UserError, match=says) as caught:
        require_writable(tmp_path / path)
    one_sentence(caught)


def foreign(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["x"] = 1


@pytest.mark.parametrize(
    ("change", "kind", "schema", "says"),
    [
        (Path.unlink, "shard", 3, "shard.h5: no such file, expected a Carillon shard file"),
        (lambda path: path.write_text("no numbers"), "shard", 3, "is not readable as HDF5"),
        (lambda path: path.write_text(""), "shard", 3, "is not readable as HDF5"),
        (lambda path: os.truncate(path, 5000), "shard", 3, "is not readable as HDF5"),
        (Path.touch, "modes", 3, "holds 'shard', expected a Carillon modes file"),
        (foreign, "modes", 3, "expected a Carillon modes file"),
        (Path.touch, "shard", 4, "schema 3, .*schema 4.*generate the file again"),
    ],
)
def test_what_is_no_file_of_the_kind_and_schema_is_refused(shard, change, kind, schema, says):
    change(shard)
    with pytest.raises(UserError, match=says) as caught, open_h5(shard, kind, schema):
        pass
    one_sentence(caught)


def test_a_flipped_byte_is_noticed_on_reading(tmp_path):
    path = tmp_path / "shard.h5"
    with create_h5(path, "shard", 3) as file:
        young = file.create_dataset("young", data=np.arange(1000.0), fletcher32=True)
        offset = young.id.get_chunk_info(0).byte_offset
    with open(path, "rb+") as stream:
        stream.seek(offset + 100)
        byte = stream.read(1)[0]
        stream.seek(offset + 100)
        stream.write(bytes([byte ^ 0xFF]))
    with pytest.raises(UserError) as caught, open_h5(path, "shard", 3) as file:
        file["young"][:]
    assert "shard.h5: is damaged" in one_sentence(caught)


def test_a_dataset_that_is_not_there_is_named(shard):
    with pytest.raises(UserError) as caught, open_h5(shard, "shard", 3) as file:
        file["density"][:]
    assert "is incomplete" in one_sentence(caught) and "density" in str(caught.value)


# Seals, full disks, leftovers ---------------------------------------------------------------------


@pytest.fixture
def sealed(tmp_path):
    path = tmp_path / "sealed.h5"
    with create_h5(path, "shard", 3, sealed=True) as file:
        file.attrs["seed"] = 4
        file["young"] = np.arange(1000.0)
    return path


def test_a_sealed_file_is_an_ordinary_hdf5_file(sealed):
    with open_h5(sealed, "shard", 3, sealed=True) as file:
        assert file.attrs["seed"] == 4
    with h5py.File(sealed) as file:
        assert np.array_equal(file["young"], np.arange(1000.0))


def test_the_same_content_has_the_same_bytes(sealed, tmp_path):
    again = tmp_path / "again.h5"
    with create_h5(again, "shard", 3, sealed=True) as file:
        file.attrs["seed"] = 4
        file["young"] = np.arange(1000.0)
    assert again.read_bytes() == sealed.read_bytes()


@pytest.mark.parametrize("place", [0, 100, 200, 511, 512, 530, 1000, 5000, -1])
def test_a_flipped_bit_breaks_the_seal(sealed, place):
    content = bytearray(sealed.read_bytes())
    content[place] ^= 1
    sealed.write_bytes(content)
    with pytest.raises(UserError) as caught, open_h5(sealed, "shard", 3, sealed=True):
        pass
    assert "is damaged" in one_sentence(caught)


def test_a_seal_is_read_once_unless_the_file_changes(sealed, monkeypatch):
    read = []
    seal_of = hdf5._seal_of
    monkeypatch.setattr(hdf5, "_seal_of", lambda stream: read.append(1) or seal_of(stream))
    for _ in range(3):
        with open_h5(sealed, "shard", 3, sealed=True):
            pass
    assert len(read) == 1
    sealed.write_bytes(sealed.read_bytes()[:-1] + b"\1")
    os.utime(sealed, ns=(0, 0))  # clocks of file systems may tick slower than this test runs
    with pytest.raises(UserError, match="is damaged"), open_h5(sealed, "shard", 3, sealed=True):
        pass


def test_a_file_without_a_seal_is_refused_where_one_is_demanded(shard):
    with pytest.raises(UserError) as caught, open_h5(shard, "shard", 3, sealed=True):
        pass
    assert "its checksum is gone" in one_sentence(caught)


FULL_DISK = """
import resource, sys
import numpy as np
from carillon.command_line import exit_status
from carillon.files.hdf5 import create_h5

def main():
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
    with create_h5(sys.argv[1], "shard", 3) as file:
        column = file.create_dataset("young", (100_000,), "f8", chunks=(1000,))
        for start in range(0, 100_000, 1000):
            column[start : start + 1000] = np.random.rand(1000)

sys.exit(exit_status.run("program", main))
"""


@pytest.mark.parametrize("largest_file", [100, 3000, 200_000, 400_000])
def test_a_full_disk_is_one_sentence_and_no_crash_of_hdf5(tmp_path, largest_file):
    path = tmp_path / "modes.h5"
    done = python("-c", FULL_DISK, path, largest_file, cwd=CHECKOUT)
    assert done.returncode == 2, done.stderr
    assert done.stderr == (
        f"program: {path}: could not be written (File too large; make room and run the same "
        "command again)\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_leftovers_of_killed_writers_are_removed_and_nothing_else(shard):
    folder = shard.parent
    left = folder / ".shard.h5.abc.partial.h5"
    others = [folder / ".other.h5.abc.partial.h5", folder / ".shard.h5.journal", shard]
    for path in (left, *others[:2]):
        path.touch()
    with atomic_path(shard) as temporary:
        assert sorted(folder.iterdir()) == sorted([temporary, *others])
    assert sorted(folder.iterdir()) == sorted(others)


def test_a_writer_under_way_is_no_leftover(tmp_path):
    path = tmp_path / "modes.h5"
    with create_h5(path, "modes", 1) as first:
        with create_h5(path, "modes", 1) as second:
            second["eigenvalues"] = np.ones(3)
        with open_h5(path, "modes", 1):
            first["eigenvalues"] = np.zeros(3)
    with open_h5(path, "modes", 1) as file:
        assert np.array_equal(file["eigenvalues"], np.zeros(3))
    assert list(tmp_path.iterdir()) == [path]


def test_a_new_file_that_is_taken_for_a_leftover_is_made_anew(tmp_path, monkeypatch):
    lock = system.lock
    taken = []

    def late(file, **kind):
        if not taken:
            taken.append(next(tmp_path.iterdir()))
            taken[0].unlink()
        lock(file, **kind)

    monkeypatch.setattr(system, "lock", late)
    with atomic_path(tmp_path / "text") as temporary:
        temporary.write_text("whole")
    assert (tmp_path / "text").read_text() == "whole"


# What may be written to, and read from ------------------------------------------------------------


@pytest.fixture(params=["device", "pipe", "socket"])
def special(request, tmp_path):
    """Something in the file system that is no regular file."""
    path = tmp_path / "special"
    if request.param == "device":
        path = Path("/dev/null")
    elif request.param == "pipe":
        os.mkfifo(path)
    else:
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(str(path))
    return path


def test_only_regular_files_are_replaced(special):
    kind = stat.S_IFMT(special.stat().st_mode)
    for use in (require_writable, lambda path: atomic_path(path).__enter__()):
        with pytest.raises(UserError) as caught:
            use(special)
        assert "expected the name of a file to write" in one_sentence(caught)
    assert stat.S_IFMT(special.stat().st_mode) == kind


def test_nothing_else_is_replaced_through_a_link(special, tmp_path):
    link = tmp_path / "link"
    link.symlink_to(special)
    with pytest.raises(UserError), atomic_path(link):
        pass
    assert link.is_symlink() and not stat.S_ISREG(special.stat().st_mode)


def test_what_came_there_in_the_meantime_is_not_replaced(tmp_path):
    path = tmp_path / "modes.h5"
    with pytest.raises(UserError, match="is a pipe"), atomic_path(path) as temporary:
        temporary.write_text("hours of work")
        os.mkfifo(path)
    assert path.is_fifo() and list(tmp_path.iterdir()) == [path]


def test_a_link_stays_and_the_file_that_it_names_is_replaced(tmp_path):
    there = tmp_path / "there"
    there.mkdir()
    link = tmp_path / "link.txt"
    link.symlink_to("there/text.txt")  # names nothing so far
    for content in ("first", "second"):
        with atomic_path(link) as temporary:
            assert temporary.parent == there
            temporary.write_text(content)
        assert link.is_symlink() and (there / "text.txt").read_text() == content
    assert list(there.iterdir()) == [there / "text.txt"]


def test_a_link_into_a_missing_folder_or_to_itself_is_refused(tmp_path):
    away, loop = tmp_path / "away", tmp_path / "loop"
    away.symlink_to(tmp_path / "nowhere" / "text")
    loop.symlink_to(loop)
    for path in (away, loop):
        with pytest.raises(UserError, match="cannot be written"):
            require_writable(path)


@pytest.mark.parametrize(
    "name",
    [
        "two\nlines",
        "null\0byte",
        "bell\x07",
        "no text \udcff",
        "paragraph\u2029",
        "x" * 201,
        "é" * 101,
    ],
)
def test_names_that_not_everything_can_hold_are_refused(name, tmp_path):
    with pytest.raises(UserError) as caught:
        require_writable(tmp_path / name)
    assert one_sentence(caught).isprintable()


@pytest.mark.parametrize(
    "name", ["x" * 200, "a." + "x" * 198, "blank 'quote' \"$(x)\" {y} ;.txt", "-dash", "é" * 100]
)
def test_other_names_are_written_to(name, tmp_path):
    with atomic_path(tmp_path / name) as temporary:
        temporary.write_text("whole")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_only_regular_files_are_read(special, tmp_path):
    for path in (special, tmp_path, tmp_path / "absent", tmp_path / ("x" * 300), Path("a\0b")):
        with pytest.raises(UserError) as caught:
            require_file(path, "a mesh")
        assert "expected a mesh" in one_sentence(caught)
    with pytest.raises(UserError), open_h5(special, "modes", 1):
        pass


@pytest.mark.parametrize(
    "read",
    [
        lambda file: file["young"]["part"],
        lambda file: file["group"][()],
        lambda file: file["group"].shape,
        lambda file: file["text"][()].astype(float),
        lambda file: json.loads(file.attrs["text"]),
        lambda file: int(file.attrs["text"]),
        lambda file: file["young"][()].reshape(7, 7),
        lambda file: file.attrs["absent"],
    ],
)
def test_what_cannot_be_read_as_expected_is_the_fault_of_the_file(tmp_path, read):
    path = tmp_path / "modes.h5"
    with create_h5(path, "modes", 1) as file:
        file["young"] = np.ones(3)
        file["text"] = np.array([b"a"])
        file.attrs["text"] = "a"
        file.create_group("group")
    with pytest.raises(UserError) as caught, open_h5(path, "modes", 1) as file:
        read(file)
    assert "generate the file again" in one_sentence(caught)


# Several at a time --------------------------------------------------------------------------------

WRITERS, ROUNDS = 3, 20

WRITER = """
import sys
from carillon.files.atomic import atomic_path
path, letter, rounds = sys.argv[1], sys.argv[2].encode(), int(sys.argv[3])
print("ready", flush=True)
sys.stdin.readline()
for _ in range(rounds):
    with atomic_path(path) as temporary, open(temporary, "wb") as stream:
        for _ in range(64):
            stream.write(4096 * letter)
"""


def test_readers_beside_several_writers_see_one_whole_file_or_another(tmp_path):
    path = tmp_path / "modes.h5"
    command = [sys.executable, "-c", WRITER, str(path)]
    writers = [
        subprocess.Popen(
            [*command, "abc"[number], str(ROUNDS)],
            cwd=CHECKOUT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for number in range(WRITERS)
    ]
    for writer in writers:
        assert writer.stdout.readline() == "ready\n"
    for writer in writers:
        writer.stdin.write("go\n")
        writer.stdin.flush()
    seen = []
    while any(writer.poll() is None for writer in writers):
        if path.exists():
            seen.append(path.read_bytes())
    for writer in writers:
        writer.communicate()
    assert [writer.returncode for writer in writers] == [0] * WRITERS
    whole = {64 * 4096 * letter for letter in (b"a", b"b", b"c")}
    assert set(seen) <= whole and path.read_bytes() in whole
    assert list(tmp_path.iterdir()) == [path]


# Locks --------------------------------------------------------------------------------------------


def test_a_file_is_read_while_another_holds_it(shard):
    """Reading takes no lock, so neither others' locks nor file systems without any are in its way.

    What the system would answer, errno 11 here or 37 of a file system, comes from taking one.
    """
    with open(shard, "rb+") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(OSError, match="errno = 11"):
            h5py.File(shard, "r")
        with open_h5(shard, "shard", 3) as file:
            assert file.attrs["kind"] == "shard"
        assert kind_of(shard, "a shard") == ("shard", 3)


def test_what_the_system_refuses_is_not_called_damaged(shard, monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.EIO, "Unable to synchronously open file (..., errno = 5)")

    monkeypatch.setattr(h5py, "File", refuse)
    with pytest.raises(UserError) as caught, open_h5(shard, "shard", 3):
        pass
    text = one_sentence(caught)
    assert "cannot be read" in text and "damaged" not in text


def test_all_rooms_open_files_in_one_way():
    """So that no command reads with a lock."""
    openers = {
        path.relative_to(CHECKOUT)
        for room in ROOMS
        for path in (CHECKOUT / room).rglob("*.py")
        if "h5py.File(" in path.read_text()
    }
    assert openers == {Path("carillon/files/hdf5.py")}
