"""Regions and supports in the studio without its page: rows, paint, places, what is wrong."""

import numpy as np
import pytest
import yaml

from carillon.composition.entries import CompositionEntry
from carillon.errors import UserError
from carillon.parameters.documents import parameters_from
from studio.binary import unpack
from studio.interface import NotFoundError
from studio.materials import material_table
from studio.processes.composition import NONE
from studio.rows import KINDS, rows_of
from studio.session import open_studio
from tests.test_studio_session import folder, opened, until  # noqa: F401

BODY = {"name": "body", "material": "iron"}
HANDLE = {"name": "handle", "material": "beech", "grain": [1, 0, 0], "where": "x > 0.05"}


async def opened_rows(studio, page, *rows):
    """A bar with these rows, whose places on the surface the page knows."""
    await studio.call("open_mesh", {"mesh": "builtin:bar"})
    await studio.call("change_settings", {"settings": {"resolution": 16, "coarsen": "none"}})
    for kind, row in rows:
        await studio.call("add_row", {"kind": kind, "row": row})
    await until(lambda: page.is_idle, page)


async def places(studio, page):
    """Where regions and supports are on the surface, and the surface's points."""
    solid = page.state["solid"]
    _, surface = unpack(await studio.surface(solid["surface"]))
    rows = {kind: rows_of(studio.session.document.settings, kind) for kind in KINDS}
    await until(lambda: studio.session.placing._placed[2] == rows, page)
    await until(lambda: page.state["composition"] == studio.session.placing.number, page)
    _, arrays = unpack(await studio.composition(page.state["composition"]))
    return surface["positions"], arrays["region"], arrays["support"]


def fault(page, kind, number):
    """What is wrong with a row, once the page has it."""
    rows = page.state[kind]
    return rows[number]["fault"] if number < len(rows) else None


async def test_regions_are_added_shown_changed_moved_and_removed(folder):  # noqa: F811
    async with opened(folder) as (studio, page):
        await opened_rows(studio, page, ("regions", BODY), ("regions", HANDLE))
        points, region, support = await places(studio, page)
        assert ((region == 1) == (points[:, 0] > 0.05)).mean() > 0.97
        assert (support == NONE).all()
        await studio.call(
            "change_row",
            {"kind": "regions", "number": 1, "changes": {"name": "grip", "grain": None}},
        )
        row = studio.state()["regions"][1]
        assert row["name"] == "grip" and "grain" not in row and row["fault"] is None
        assert studio.state()["undo"] == "change region handle"
        await studio.call("move_row", {"kind": "regions", "number": 1, "to": 0})
        assert [each["name"] for each in studio.state()["regions"]] == ["grip", "body"]
        await until(lambda: fault(page, "regions", 0), page)
        assert "'grip' has no voxel" in page.state["regions"][0]["fault"]
        await studio.call("undo", {})
        await until(lambda: page.is_idle, page)
        assert page.state["regions"][0]["fault"] is None
        await studio.call("remove_row", {"kind": "regions", "number": 1})
        assert [each["name"] for each in studio.state()["regions"]] == ["body"]


async def test_regions_take_the_place_of_the_settings_that_they_tell(folder):  # noqa: F811
    async with opened(folder) as (studio, page):
        await studio.call("open_mesh", {"mesh": "builtin:bar"})
        told = {"density": 7000.0, "material": {"young": 2e9, "dimensions": 12}}
        await studio.call("change_settings", {"settings": told})
        await studio.call("add_row", {"kind": "regions", "row": BODY})
        settings = studio.state()["settings"]
        assert settings["density"] != 7000.0 and settings["material"]["dimensions"] == 12
        with pytest.raises(UserError, match="beside regions"):
            await studio.call("change_settings", {"settings": {"density": 7000.0}})


async def test_paint_places_a_region_and_a_support(folder):  # noqa: F811
    async with opened(folder) as (studio, page):
        rows = (
            ("regions", BODY),
            ("regions", {"name": "patch", "material": "brass", "painted": []}),
            ("supports", {"painted": []}),
        )
        await opened_rows(studio, page, *rows)
        assert [each["dabs"] for each in page.state["regions"]] == [None, 0]
        points, region, support = await places(studio, page)
        assert (region == 0).all() and (support == NONE).all()
        at = points[np.argmax(points[:, 0])]
        dabs = [[*map(float, at), 0.0413]]
        await studio.call("paint", {"kind": "regions", "number": 1, "dabs": dabs})
        await studio.call("paint", {"kind": "supports", "number": 0, "dabs": dabs})
        await until(lambda: page.state["supports"][0]["dabs"] == 1, page)
        _, region, support = await places(studio, page)
        near = np.linalg.norm(points - at, axis=1) < 0.0413
        assert ((region == 1) == near).mean() > 0.97
        assert (support[~near] == NONE).all() and (support == 0).any()
        described = studio.session.document.described()
        entry = {key: described[key] for key in ("regions", "supports")}
        assert parameters_from(entry, CompositionEntry).regions[1].painted is not None
        with pytest.raises(UserError, match="choose painted"):
            await studio.call("paint", {"kind": "regions", "number": 0, "dabs": dabs})


async def test_paint_that_only_takes_away_is_none(folder):  # noqa: F811
    async with opened(folder) as (studio, _):
        await studio.call("open_mesh", {"mesh": "builtin:bar"})
        row = {"name": "patch", "material": "steel", "painted": []}
        await studio.call("add_row", {"kind": "regions", "row": row})
        dabs = [[0.0, 0.0, 0.0, -0.01]]
        await studio.call("paint", {"kind": "regions", "number": 0, "dabs": dabs})
        assert studio.state()["regions"][0]["dabs"] == 0
        assert "regions" not in studio.session.document.described()


@pytest.mark.parametrize(
    ("kind", "changes", "said"),
    [
        ("regions", {"material": "irn"}, "there is no material 'irn'"),
        ("regions", {"where": "x >"}, "cannot be read"),
        ("regions", {"poisson": 0.5}, "poisson"),
        ("regions", {"grain": [0, 0, 0]}, "expected a direction"),
        ("regions", {"name": "body"}, "two regions are called 'body'"),
        ("regions", {"colour": "red"}, "colour"),
        ("regions", {"mesh": "/etc/passwd"}, "there is no mesh"),
        ("regions", {"labels": "/etc/passwd", "label": "1"}, "there are no labels"),
        ("supports", {"spring": -1.0}, "spring"),
        ("supports", {"pad": "jelly", "thickness": 0.01}, "there is no material 'jelly'"),
        ("supports", {"at": [0, 0, 0]}, "expected where, at or painted"),
    ],
)
async def test_rows_that_are_none_are_refused_in_one_sentence(folder, kind, changes, said):  # noqa: F811
    async with opened(folder) as (studio, _):
        await studio.call("open_mesh", {"mesh": "builtin:bar"})
        for row in (BODY, HANDLE):
            await studio.call("add_row", {"kind": "regions", "row": row})
        await studio.call("add_row", {"kind": "supports", "row": {"where": "x > 9"}})
        before = studio.state()
        number = 1 if kind == "regions" else 0
        with pytest.raises(UserError, match=said) as caught:
            await studio.call("change_row", {"kind": kind, "number": number, "changes": changes})
        assert "\n" not in str(caught.value)
        assert studio.state()[kind] == before[kind]


async def test_what_is_wrong_with_a_place_is_told_at_its_row(folder):  # noqa: F811
    async with opened(folder) as (studio, page):
        await opened_rows(studio, page, ("regions", BODY))
        await studio.call("add_row", {"kind": "supports", "row": {"where": "region:lid"}})
        await until(lambda: fault(page, "supports", 0), page)
        assert "there is no region 'lid'" in page.state["supports"][0]["fault"]
        box = {"name": "box", "material": "steel", "box": [[0, 0, 0], [0, 1, 1]]}
        await studio.call("add_row", {"kind": "regions", "row": box})
        await until(lambda: fault(page, "regions", 1), page)
        assert "is empty" in page.state["regions"][1]["fault"]


async def test_rows_that_are_not_there_are_refused(folder):  # noqa: F811
    async with opened(folder) as (studio, _):
        with pytest.raises(UserError, match="open one first"):
            await studio.call("add_row", {"kind": "regions", "row": BODY})
        await studio.call("open_mesh", {"mesh": "builtin:bar"})
        for name, more in (
            ("remove_row", {}),
            ("move_row", {"to": 0}),
            ("change_row", {"changes": {}}),
            ("paint", {"dabs": [[0, 0, 0, 1]]}),
        ):
            with pytest.raises(NotFoundError, match="no row 3"):
                await studio.call(name, {"kind": "regions", "number": 2, **more})
        with pytest.raises(UserError, match="expected one of regions, supports"):
            await studio.call("remove_row", {"kind": "targets", "number": 0})
        with pytest.raises(NotFoundError, match="no composition 99"):
            await studio.composition(99)


def test_a_region_whose_mesh_is_elsewhere_is_refused(folder):  # noqa: F811
    described = yaml.safe_load((folder / "bar.yaml").read_text())
    described["regions"] = [{"name": "body"}, {"name": "lid", "mesh": "../lid.stl"}]
    (folder / "bar.yaml").write_text(yaml.safe_dump(described))
    with pytest.raises(UserError, match="outside of the workspace"):
        open_studio(str(folder / "bar.yaml"), folder)


def test_materials_are_listed_with_their_constants():
    table = {each["name"]: each for each in material_table()}
    assert table["steel"]["young"] == 2e11 and not table["steel"]["wood"]
    assert table["beech"]["wood"] and len(table["beech"]["grain_young"]) == 3
    assert 0.0 < table["steel"]["loss_factor"] < 0.01
