"""Every key of a project with values of every kind: each is taken, or refused in one sentence."""

import copy
import json
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
import yaml

from carillon.errors import UserError
from carillon.parameters.schema import schema_of
from sound.clips.wav import read_wav
from sound.project.project import Project, load_project, project_of
from studio.session import open_studio

LEAST = {"mesh": "builtin:bar", "targets": [{"name": "end", "vertex": 3, "clip": "end.wav"}]}
ENTRIES = {
    "regions": [{"name": "body"}],
    "supports": [{"where": "x < 0"}],
    "build": {"own_materials": [{"name": "own"}]},
}
"""Entries of the lists that are empty unless given, whose values are put in place."""
VALUES: tuple[Any, ...] = (
    None,
    True,
    0,
    5,
    -1,
    10**30,
    10**5000,
    0.5,
    float("nan"),
    float("inf"),
    [],
    [1, 2],
    [None],
    [[]],
    [{}],
    {},
    {"key": 1},
    {"key": {"key": []}},
    "",
    " ",
    "builtin:",
    "builtin:a\0b",
    "a\0b",
    "\ud800",
    "a\nb",
    "..",
    "../" * 1000,
    "x" * 300,
    "x" * 4000,
    "x" * 100_000,
)
Place = tuple[str | int, ...]


def keys(schema: dict[str, Any], path: Place = ()) -> Iterator[Place]:
    """Places of all values of a project, those in its first target among them."""
    for key, part in schema.get("properties", {}).items():
        yield (*path, key)
        yield from keys(part, (*path, key))
        if "items" in part:
            yield (*path, key, 0)
            yield from keys(part["items"], (*path, key, 0))


def put(described: Any, path: Place, value: Any) -> Any:
    """Keys and values with another one at a place."""
    entries = {key: each for key, each in ENTRIES.items() if key == path[0] and len(path) > 2}
    result = copy.deepcopy({**described, **entries})
    place = result
    for key, following in zip(path, path[1:]):
        if isinstance(key, str):
            place = place.setdefault(key, [] if isinstance(following, int) else {})
        else:
            place = place[key]
    if path[-1] == 0 and not place:
        place.append(value)
    else:
        place[path[-1]] = value
    return result


def shown(value: Any) -> str:
    """A value for a message; Python writes no number of thousands of digits."""
    return "a long number" if value == 10**5000 else f"{value!r:.40}"


def cases() -> Iterator[tuple[str, Any]]:
    for path in keys(schema_of(Project)):
        for value in VALUES:
            yield f"{path}: {shown(value)}", put(LEAST, path, value)


def require_sentence(said: str) -> None:
    assert said and "\n" not in said and said.isprintable() and len(said) <= 1200, said


def read(project: Project) -> None:
    """Read the files that it names, none of which is there."""
    if not project.solid.mesh.startswith("builtin:bar"):
        with pytest.raises(UserError) as caught:
            project.surface()
        require_sentence(str(caught.value))
    with pytest.raises(UserError) as caught:
        read_wav(project.targets[0].clip)
    require_sentence(str(caught.value))


def test_a_project_is_taken_or_refused_in_one_sentence(tmp_path):
    taken = 0
    for name, described in cases():
        try:
            project = project_of(described, tmp_path)
        except UserError as error:
            require_sentence(str(error))
        except Exception as error:
            raise AssertionError(name) from error
        else:
            read(project)
            taken += 1
    assert taken > 50


async def test_the_studio_takes_settings_or_refuses_them_in_one_sentence(tmp_path):
    """All that a page may send, and then the state is one that it can be told."""
    schema = schema_of(Project)
    studio, taken = open_studio("builtin:bar", tmp_path), 0
    for path in keys(schema):
        for value in VALUES:
            settings = put({}, path, value) if path[0] not in ("mesh", "targets") else None
            for each in (settings, {path[-1]: value} if len(path) == 1 else None):
                if each is None:
                    continue
                try:
                    await studio.call("change_settings", {"settings": each})
                    json.dumps(studio.state(), allow_nan=False)
                    await studio.call("undo", {})
                    taken += 1
                except UserError as error:
                    require_sentence(str(error))
                except Exception as error:
                    raise AssertionError(f"{path}: {shown(value)}") from error
    await studio.close()
    assert taken > 50


WRITTEN = {
    "targets that are a number": "mesh: builtin:bar\ntargets: 5\n",
    "targets that are a mapping": "mesh: builtin:bar\ntargets: {a: 1}\n",
    "a forest with a null byte": 'mesh: builtin:bar\nforest: "a\\0b"\n'
    + yaml.safe_dump({"targets": LEAST["targets"]}),
    "a mesh with a null byte": 'mesh: "a\\0b"\n' + yaml.safe_dump({"targets": LEAST["targets"]}),
    "a clip with a null byte": "mesh: builtin:bar\n"
    'targets: [{name: a, vertex: 3, clip: "a\\0b"}]\n',
    "a key that is a list": "? [a]\n: 1\nmesh: builtin:bar\n",
    "a key that is a number": "5: 1\nmesh: builtin:bar\ntargets: []\n",
    "a key that is null": "~: 1\nmesh: builtin:bar\ntargets: []\n",
    "nothing": "",
    "a list": "[]\n",
    "a text": "text\n",
    "deep": "mesh: " + "[" * 1000,
}


@pytest.mark.parametrize("what", WRITTEN)
def test_a_file_that_is_no_project_is_not_opened(tmp_path, what):
    path = tmp_path / "pan.yaml"
    path.write_text(WRITTEN[what])
    with pytest.raises(UserError) as caught:
        open_studio(str(path), tmp_path)
    require_sentence(str(caught.value))
    assert not (tmp_path / ".studio" / "session.json").exists()
    with suppress(UserError):
        load_project(path)
