"""Files that stand for far more than they hold are refused before anything is allocated for them.

All are read by one process with little memory, the valid ones near them too.
"""

import json
import resource
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.geometry import hexmesh_from_grid, load_surface
from carillon.fem.model import fine_model
from carillon.files.content import require_whole
from carillon.files.hdf5 import kind_of, open_h5
from carillon.processes.memory import require_less_than
from solver.files.modes_file import KIND, SCHEMA, read_modes, write_modes
from tests.hostile import zoo_growing
from tests.mesh_files import gltf
from tests.programs import python

ROOM, RISE = 400 << 20, 150 << 20
"""Bytes that the process may have beyond what it begins with, and may use for one file."""
SECONDS = 60
"""Of processor time for all files."""

REFUSED = {
    "grows-buffer.gltf": "with the file 'large.bin' that it names, expected at most",
    "grows-zeros.glb": "far more than the",
    "grows-sparse.glb": "far more than the",
    "grows-instances.glb": "far more than the",
    "grows-chain.glb": "nodes are more than 128 deep",
    "grows-circle.glb": "or in themselves",
    "grows-rows.glb": "begin every 1 bytes",
    "grows-parts.3mf": "far more than the 12 of the file",
    "grows-text.3mf": "its models would take 268,4",
    "grows-points.vtu": "would take 24,000,000,000,000 bytes in a file of",
    "grows-blocks.vtu": "could not be read as a mesh",
    "grows-image.vtk": "holds STRUCTURED_POINTS, expected UNSTRUCTURED_GRID",
    "grows-nodes.msh": "could not be read as a mesh",
    "grows-parts.dae": "the mesh format '.dae' is not read; convert",
    "grows-tree.h5": "'b', to what has another name too",
    "grows-deep.h5": "has groups more than 16 deep",
    "grows-circle.h5": "to what has another name too",
    "grows-texts.h5": "take 3,000,",
    "grows-attribute.h5": "take 3,00",
    "grows-attributes.h5": "the whole file has",
    "grows-kind.h5": "holds 'something else', expected",
    "grows-chunks.h5": "'residuals' is compressed",
    "grows-filled.h5": "'residuals' is incomplete",
    "grows-overflow.h5": "'residuals' is incomplete",
    "grows-nothing.h5": "the whole file has",
    "grows-lists.h5": "holds references or lists",
    "grows-references.h5": "holds references or lists",
}
"""What is said of each."""
READ = (
    *("box.glb", "near-shared.glb", "near-deep.glb", "near-beside.gltf", "modes.h5"),
    *("grows-materials.obj", "grows-texture.ply", "grows-picture.gltf", "grows-views.glb"),
)
"""Valid files near those, and those of which only what is out of proportion is left out."""


def make(folder: Path) -> None:
    """Write all files."""
    cube = hexmesh_from_grid(np.zeros((1, 3), int), np.zeros(3), 1.0)
    solid, rigid = fine_model(cube, np.ones(1)), np.tile([[1.0], [0.0], [0.0]], (8, 1))
    write_modes(folder / "modes.h5", solid, np.zeros(1), [rigid], np.zeros(1), {}, {}, near)
    zoo_growing.make(folder)
    gltf(zoo_growing.BOX).written(folder / "box.glb")
    file = gltf(zoo_growing.BOX)
    file.header["nodes"] = [{"mesh": 0, "translation": [n, 0, 0]} for n in range(500)]
    file.header["scenes"] = [{"nodes": list(range(500))}]
    file.written(folder / "near-shared.glb")
    file = gltf(zoo_growing.BOX)
    file.header["nodes"] = [*[{"children": [n + 1]} for n in range(100)], {"mesh": 0}]
    file.written(folder / "near-deep.glb")
    path = Path(file.written(folder / "near-beside.gltf"))
    header = json.loads(path.read_text())
    header["buffers"][0]["uri"] = "large.bin"
    (folder / "data.bin").write_bytes(bytes(file.data) + b"more")
    path.write_text(json.dumps(header).replace("large.bin", "data.bin"))


def near(file: h5py.File) -> None:
    """What programs write, of every kind."""
    more = file.create_group("some/more/groups")
    more["names"] = ["a", "b" * 1000, ""]
    more.create_dataset("none", data=[], dtype=h5py.string_dtype())
    more["nothing"] = h5py.Empty("f8")
    more.create_dataset("chunks", data=np.ones((100, 3)), chunks=(64, 2), fletcher32=True)
    more["settings"] = "{}" * 5000
    more.attrs.update({f"attribute {n}": "text" * n for n in range(100)})
    more.attrs["order"] = [f"{n}" * 20 for n in range(200)]
    more.attrs["yes"], more.attrs["empty"] = True, h5py.Empty("f8")


def outcome(path: Path) -> str:
    """What is said of a file, or that it was read."""
    try:
        if path.suffix == ".h5":
            kind_of(path, "a file")
            read_modes(path)
        else:
            load_surface(str(path))
    except UserError as error:
        return str(error)
    return "read"


def read_all(folder: Path) -> None:
    """Print what becomes of each file, and how much memory it took, within bounds."""
    load_surface(str(folder / "box.glb"))
    read_modes(folder / "modes.h5")
    require_less_than(ROOM)
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    for name in (*READ, *REFUSED):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        said = outcome(folder / name)
        rise = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
        print(json.dumps({"name": name, "said": said, "rise": rise}), flush=True)


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("growing")
    make(folder)
    done = python("-m", "tests.test_growing_files", folder)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, f"ended after {rows[-1:]}: {done.stderr[-2000:]}"
    return {row["name"]: row for row in rows}


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_grows_is_refused_in_a_sentence(outcomes, name):
    found = outcomes[name]
    assert REFUSED[name] in found["said"]
    assert found["said"].isprintable() and len(found["said"]) < 500
    assert found["rise"] < RISE


@pytest.mark.parametrize("name", READ)
def test_a_file_near_those_is_read(outcomes, name):
    assert outcomes[name]["said"] == "read"
    assert outcomes[name]["rise"] < RISE


def test_all_growing_files_are_tried():
    made = {*zoo_growing.BOXES, *zoo_growing.MESHES, *zoo_growing.FILES}
    assert made == {*REFUSED, *(name for name in READ if name.startswith("grows-"))}


def test_texts_that_have_heaps_of_their_own_are_no_growth(tmp_path, monkeypatch):
    """Also where a list of them is too long to be sure at once."""
    monkeypatch.setattr("carillon.files.content.LIST_BYTES", 1 << 18)
    with h5py.File(tmp_path / "file.h5", "w") as file:
        file.attrs["order"] = [f"{n}" for n in range(20)]
        file["numbers"] = np.ones(100_000)
    with h5py.File(tmp_path / "file.h5") as file:
        require_whole(file)


def test_numbers_that_many_datasets_claim_are_refused(tmp_path):
    """Their layouts name the same bytes."""
    path, count = tmp_path / "file.h5", 1000
    with h5py.File(path, "w") as file:
        file["one"] = np.ones(count)
        place = file["one"].id.get_offset()
        for number in range(20):
            file.create_dataset(str(number), (count,), "f8")  # which has no place yet
    length = (8 * count).to_bytes(8, "little")
    content = path.read_bytes()
    path.write_bytes(content.replace(b"\xff" * 8 + length, place.to_bytes(8, "little") + length))
    with h5py.File(path) as file:
        assert (file["7"][()] == 1.0).all()
        with pytest.raises(UserError, match="the whole file has"):
            require_whole(file)


def test_a_text_said_to_be_a_kind_is_cut(tmp_path):
    with h5py.File(tmp_path / "file.h5", "w") as file:
        file.attrs["kind"] = "x" * 100_000
    with pytest.raises(UserError) as error, open_h5(tmp_path / "file.h5", KIND, SCHEMA):
        pass
    assert len(str(error.value)) < 300


def test_a_process_with_little_memory_is_told_so():
    """What it has room for it gets, and a sentence ends it else."""
    program = (
        "import numpy as np\n"
        "from carillon.command_line.exit_status import meaning\n"
        "from carillon.processes.memory import require_less_than\n"
        f"require_less_than({ROOM})\n"
        f"np.ones({ROOM // 2}, np.uint8)\n"
        "try:\n"
        f"    np.ones({2 * ROOM}, np.uint8)\n"
        "except MemoryError as error:\n"
        "    print(*meaning(error))\n"
    )
    done = python("-c", program)
    assert done.stdout.startswith("2 out of memory (Unable to allocate"), done.stderr


if __name__ == "__main__":
    read_all(Path(sys.argv[1]))
