"""Whatever is read, the answer is content or one sentence: bytes of files, damaged in every way."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from carillon.errors import UserError
from carillon.fem.geometry.surface import load_surface
from carillon.fem.moduli import read_moduli
from dataset_gen.generate import generate_file
from dataset_gen.journal import journal_of
from dataset_gen.settings import ShardOptions, settings_of
from dataset_gen.shards import origin_of
from dataset_gen.tasks import ShardPlan
from forests.model import load_model
from forests.training.tree_file import load_trees
from solver.files.modes_file import read_modes
from solver.response.response_file import read_response
from sound.clips.wav import read_wav
from sound.project.design_file import read_design
from tests.hostile.fuzzing import damaged, examples, or_refused
from tests.shard_files import read_shard
from tests.solids import box_mesh

# Sealed files ------------------------------------------------------------------------------------

READERS = {
    "shard": read_shard,
    "forests": load_model,
    "tree0": lambda path: load_trees([path], {}),
    "modes": read_modes,
    "response": read_response,
    "design": read_design,
}


def plain(value):
    """The content of a reader's result as what can be compared: arrays become their bytes."""
    if isinstance(value, np.ndarray):
        return (value.dtype.str, value.shape, value.tobytes())
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    if hasattr(value, "__dict__"):
        return plain({key: part for key, part in vars(value).items() if key[0] != "_"})
    return repr(value)


@pytest.mark.parametrize("kind", READERS)
@examples(60)
@given(data=st.data())
def test_a_damaged_file_says_the_same_or_is_refused(kind, data, zoo, tmp_path_factory):
    content = (zoo.folder / f"{kind}.h5").read_bytes()
    path = folder_of(tmp_path_factory) / f"{kind}.h5"
    rewrite(path, data.draw(damaged(content)))
    found = or_refused(lambda: READERS[kind](path))
    if found is not None:
        assert plain(found) == plain(READERS[kind](zoo.folder / f"{kind}.h5"))


def folder_of(tmp_path_factory) -> Path:
    """A folder for all examples of this process."""
    folder = tmp_path_factory.getbasetemp() / "damaged"
    folder.mkdir(exist_ok=True)
    return folder


def rewrite(path: Path, content: bytes) -> None:
    """Write a new file, so that nobody remembers that the old one was sound."""
    path.unlink(missing_ok=True)
    path.write_bytes(content)


@pytest.mark.parametrize("kind", ["shard", "forests", "modes", "response", "design"])
def test_an_undamaged_file_is_read(kind, zoo):
    assert READERS[kind](zoo.folder / f"{kind}.h5") is not None


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("other", READERS)
def test_a_file_of_another_kind_is_refused(kind, other, zoo):
    if kind != other:
        with pytest.raises(UserError, match="holds"):
            READERS[kind](zoo.folder / f"{other}.h5")


# The journal -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Begun:
    """A shard under way: its plan and origin, its journal's bytes, the bytes it ends with."""

    plan: ShardPlan
    origin: dict
    journal: bytes
    shard: bytes


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    options = ShardOptions(6, objective="oversampled")
    settings = settings_of(options)
    plan = ShardPlan(settings, task_rows=1)
    origin = origin_of(settings, options)
    folder = tmp_path_factory.mktemp("begun")

    def stopped(plan, tasks):
        for task in tasks[:4]:
            yield plan.work(task)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate_file(folder / "shard.h5", plan, origin, stopped)
    journal = journal_of(folder / "shard.h5").read_bytes()
    generate_file(folder / "shard.h5", plan, origin)
    return Begun(plan, origin, journal, (folder / "shard.h5").read_bytes())


@examples(80)
@given(data=st.data())
def test_a_damaged_journal_ends_in_the_same_shard_or_is_refused(data, begun, tmp_path_factory):
    path = folder_of(tmp_path_factory) / "continued.h5"
    content = data.draw(damaged(begun.journal))
    path.unlink(missing_ok=True)
    rewrite(journal_of(path), content)
    if or_refused(lambda: generate_file(path, begun.plan, begun.origin)) is None:
        assert journal_of(path).read_bytes() == content, "work that somebody may want was lost"
        assert not path.exists()
    else:
        assert path.read_bytes() == begun.shard
        assert not journal_of(path).exists()


# Files that others write -------------------------------------------------------------------------


@pytest.mark.parametrize("end", ["obj", "stl", "ply", "off", "glb"])
@examples(60)
@given(data=st.data())
def test_a_damaged_mesh_is_a_finite_surface_or_refused(end, data, zoo, tmp_path_factory):
    path = folder_of(tmp_path_factory) / f"mesh.{end}"
    rewrite(path, data.draw(damaged((zoo.folder / f"box.{end}").read_bytes())))
    found = or_refused(lambda: load_surface(str(path)))
    if found is not None:
        assert isinstance(found, trimesh.Trimesh) and len(found.faces)
        corners = np.asarray(found.vertices)[found.faces]
        assert np.isfinite(corners).all()
        assert np.ptp(corners.reshape(-1, 3), axis=0).min() > 0.0


VOXELS = box_mesh(4, 3, 2)


@pytest.mark.parametrize("name", ["good.npy", "whole.npy", "single.npy", "good.txt"])
@examples(80)
@given(data=st.data())
def test_damaged_moduli_are_moduli_or_refused(name, data, zoo, tmp_path_factory):
    path = folder_of(tmp_path_factory) / name
    rewrite(path, data.draw(damaged((zoo.folder / name).read_bytes())))
    found = or_refused(lambda: read_moduli(path, VOXELS.n_cells, "the box"))
    if found is not None:
        assert found.shape == (VOXELS.n_cells,) and found.dtype == float
        assert np.isfinite(found).all() and (found > 0.0).all()


@examples(60)
@given(data=st.data())
def test_any_array_is_moduli_or_refused(data, tmp_path_factory):
    from hypothesis.extra import numpy as arrays

    kinds = st.one_of(
        arrays.scalar_dtypes(), arrays.array_dtypes(max_size=2), st.just(np.dtype(float))
    )
    shapes = arrays.array_shapes(min_dims=0, max_dims=3, max_side=4) | st.just((VOXELS.n_cells,))
    array = data.draw(arrays.arrays(kinds, shapes))
    path = folder_of(tmp_path_factory) / "any.npy"
    path.unlink(missing_ok=True)
    np.save(path, array)
    found = or_refused(lambda: read_moduli(path, VOXELS.n_cells, "the box"))
    if found is not None:
        assert array.dtype.kind in "iuf"
        assert np.isfinite(found).all() and (found > 0.0).all()
        np.testing.assert_array_equal(found, array.ravel().astype(float))


@pytest.mark.parametrize("name", ["tone.wav", "24-bit.wav", "tone.flac"])
@examples(80)
@given(data=st.data())
def test_a_damaged_clip_is_a_finite_sound_or_refused(name, data, zoo, tmp_path_factory):
    path = folder_of(tmp_path_factory) / name
    content = (zoo.folder / name).read_bytes()
    rewrite(
        path,
        data.draw(damaged(content[:200]).map(lambda head: head + content[200:]) | damaged(content)),
    )
    found = or_refused(lambda: read_wav(path))
    if found is not None:
        samples, rate = found
        assert samples.ndim == 1 and len(samples) and np.isfinite(samples).all() and samples.any()
        assert rate >= 1
