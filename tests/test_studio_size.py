"""The size of the studio's solid, its unit, what points up, and shells: told, and mended."""

import numpy as np
import pytest
import trimesh

from carillon.errors import UserError
from studio.session import open_studio
from studio.session.document import Document, Target
from studio.session.mesh_axes import mesh_document, moved_with_mesh
from tests.mesh_files import block
from tests.patience import HANG_SECONDS
from tests.studio_pages import open_page, serving
from tests.studio_pages import until as until_page
from tests.test_studio_panels import expect
from tests.test_studio_session import folder, opened, until  # noqa: F401

BOARD = block((-200, 0, -50), (200, 20, 50))
"""A board in millimetres that lies flat where y points up."""
COARSE = {"settings": {"resolution": 20, "coarsen": "none"}}


def written(surface: trimesh.Trimesh, ending: str) -> bytes:
    content = surface.export(file_type=ending)
    return content.encode() if isinstance(content, str) else content


def bowl() -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(3, 0.1)
    low = ball.triangles_center[:, 2] < 0.0
    return trimesh.Trimesh(ball.vertices, ball.faces[low], process=False)


async def test_a_mesh_in_millimetres_that_lies_on_its_side_is_mended_and_undone(folder):  # noqa: F811
    async with opened(folder) as (studio, page):
        mesh = await studio.take_mesh("board.obj", written(BOARD, "obj"))
        await studio.call("open_mesh", {"mesh": mesh})
        await until(lambda: (page.state["solid"] or {}).get("extents_m"), page)
        solid = page.state["solid"]
        assert solid["extents_m"] == pytest.approx((400.0, 20.0, 100.0))
        assert [each["name"] for each in solid["units"]] == ["mm"]
        assert solid["units"][0]["longest_m"] == pytest.approx(0.4)
        assert solid["up"] == "y" and solid["shell_m"] is None
        await studio.call("change_settings", {"settings": {"unit": 0.001}})
        await studio.call("change_settings", {"settings": {"up": "y"}})
        await studio.call("change_settings", COARSE)
        await until(lambda: page.is_idle, page)
        solid = page.state["solid"]
        assert solid["extents_m"] == pytest.approx((0.4, 0.1, 0.02))
        assert not solid["units"] and solid["up"] is None
        for _ in range(3):
            await studio.call("undo", {})
        await until(lambda: max(page.state["solid"]["extents_m"] or [0]) > 1.0, page)


async def test_an_open_mesh_is_told_to_be_filled_and_becomes_a_shell(folder):  # noqa: F811
    async with opened(folder) as (studio, page):
        mesh = await studio.take_mesh("bowl.ply", written(bowl(), "ply"))
        await studio.call("open_mesh", {"mesh": mesh})
        await until(lambda: (page.state["solid"] or {}).get("shell_m"), page)
        assert page.state["solid"]["shell_m"] == pytest.approx(0.002)
        wall = {"wall": "4 mm", "discretisation": "finite-cell", "resolution": 12}
        await studio.call("change_settings", {"settings": wall})
        await until(lambda: page.is_idle and page.state["solid"]["shell_m"] is None, page)
        assert page.state["settings"]["wall"] == 0.004


async def test_a_gltf_file_stands_up_as_its_format_says(folder):  # noqa: F811
    async with opened(folder) as (studio, page):
        board = BOARD.copy().apply_scale(0.001)
        mesh = await studio.take_mesh("board.glb", written(board, "glb"))
        await studio.call("open_mesh", {"mesh": mesh})
        await until(lambda: (page.state["solid"] or {}).get("extents_m"), page)
        assert page.state["solid"]["extents_m"] == pytest.approx((0.4, 0.1, 0.02))


def test_the_command_opens_a_mesh_as_it_is_told(tmp_path):
    (tmp_path / "board.obj").write_bytes(written(BOARD, "obj"))
    settings = {"unit": 0.001, "up": "y", "wall": 0.002, "discretisation": "finite-cell"}
    studio = open_studio(str(tmp_path / "board.obj"), tmp_path, settings)
    state = studio.session
    assert dict(state.document.settings) == {"mesh": "board.obj", **settings}
    assert state.history.undo_name is None
    state.workspace.close()
    for what in (None, str(tmp_path / "p.yaml")):
        with pytest.raises(UserError, match="found --unit and no mesh"):
            open_studio(what, tmp_path, {"unit": 0.001})


def test_places_of_a_project_stay_on_the_solid_that_is_turned_and_scaled():
    """Turned upright and scaled to a tenth: x stays, y becomes z, z becomes -y."""
    region = {
        "name": "a",
        "painted": [[0.1, 0.2, 0.3, 0.05]],
        "depth": 0.01,
        "grain": [0, 0, 1],
    }
    rest = {"name": "b", "box": [[0, 0, 0], [1, 2, 3]]}
    some = {"name": "c", "where": "z > 0.1 and x < max(y, 0.2)"}
    held = [{"at": [1.0, 2.0, 3.0], "radius": 0.1, "along": "xz"}, {"where": "region:a"}]
    document = Document(
        {"mesh": "a.obj", "regions": [region, rest, some], "supports": held},
        (Target("t", at=(1.0, 2.0, 3.0)), Target("u", vertex=4)),
    )
    moved = moved_with_mesh(document, {}, {"unit": 0.1, "up": "y"})
    first, second, third = moved.settings["regions"]
    assert first["painted"] == [[0.01, -0.03, 0.02, 0.005]] and first["depth"] == 0.001
    assert first["grain"] == [0.0, -1.0, 0.0]
    assert second["box"] == [[0.0, -0.3, 0.0], [0.1, 0.0, 0.2]]
    assert third["where"] == "(-y / 0.1) > 0.1 and (x / 0.1) < max((z / 0.1), 0.2)"
    assert moved.settings["supports"][0] == {"at": [0.1, -0.3, 0.2], "radius": 0.01, "along": "xy"}
    assert moved.settings["supports"][1] == {"where": "region:a"}
    back = moved_with_mesh(
        Document({**moved.settings, "unit": 0.1, "up": "y"}), {}, {"unit": 1.0, "up": None}
    )
    assert back.settings["regions"][:2] == [region | {"grain": [0.0, 0.0, 1.0]}, rest]
    assert moved_with_mesh(document, {}, {"resolution": 8}) is document
    assert mesh_document("a.glb", {"up": "z"}).settings["up"] == "z"


@pytest.mark.nightly(unless=("studio",))
def test_the_page_shows_the_size_and_mends_it_by_a_press_each(browser, tmp_path, monkeypatch):
    monkeypatch.setenv("CARILLON_CACHE", str(tmp_path / "cache"))
    open_board = trimesh.Trimesh(BOARD.vertices, BOARD.faces[1:], process=False)
    (tmp_path / "board.obj").write_bytes(written(open_board, "obj"))
    studio = open_studio(str(tmp_path / "board.obj"), tmp_path, {"resolution": 20})

    def so(page, expression: str) -> None:
        until_page(lambda: page.evaluate(expression), HANG_SECONDS)

    with serving(studio) as address:
        page = open_page(browser, address, ready="studio.state?.current?.solid?.extents_m")
        panel = page.locator("#panel-size")
        expect(panel.locator("#solid-size")).to_have_text("board: 400 × 20 × 100 m")
        so(page, "document.querySelector('[data-about=unit]')?.innerText.includes('below hearing')")
        panel.get_by_role("button", name="millimetres? (40 cm)").click()
        so(page, "studio.state.current.solid.extents_m?.[0] < 1")
        expect(panel.locator("[data-about=unit]")).to_have_count(0)
        panel.get_by_role("button", name="Turn it upright").click()
        so(page, "studio.state.current.solid.extents_m?.[2] < 0.05")
        expect(panel.locator("#solid-size")).to_have_text("board: 40 × 10 × 2 cm")
        panel.get_by_role("button", name="Make it a shell of 5 mm").click()
        so(page, "studio.state.current.settings.wall === 0.005")
        expect(panel.locator("[data-about=shell]")).to_have_count(0)
        page.get_by_role("button", name="Undo").click()
        so(page, "studio.state.current.settings.wall === null")
        panel.get_by_text("Unit, up axis, wall").click()
        panel.get_by_label("Up axis", exact=True).select_option("z")
        so(page, "studio.state.current.settings.up === null")
        assert np.allclose(page.evaluate("studio.state.current.settings.unit"), 0.001)
        page.context.close()
