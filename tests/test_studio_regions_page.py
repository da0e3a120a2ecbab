"""Regions and supports on the studio's page: tables, forms, paint, colours and symbols."""

import numpy as np
import pytest

from carillon.composition.materials import named_material
from studio.binary import pack
from studio.processes.composition import NONE
from tests.panels_page import bank, state, window
from tests.studio_pages import (
    TWO_FRAMES,
    ToldStudio,
    axe_finds,
    open_page,
    serving,
    until_page,
    until_still,
)
from tests.test_studio_panels import expect, last_call, until

pytestmark = pytest.mark.nightly(unless=("studio",))

BODY = {"name": "body", "material": "iron", "dabs": None, "fault": None}
HANDLE = {"name": "handle", "material": "beech", "dabs": 3, "fault": None}
HELD = {"dabs": 2, "fault": None}
POINT = {"at": [0.0, 0.0, 0.0], "spring": 1e5, "dabs": None, "fault": None}


@pytest.fixture(scope="module")
def wide(browser):
    """A window of a desktop."""
    with window(browser) as wide:
        yield wide


@pytest.fixture
def panels(wide):
    """The page with a pan of iron whose handle is of beech, and held."""
    wide.open(state(regions=[BODY, HANDLE], supports=[HELD, POINT]))
    expect(wide.page.locator(".region-table .young").first).to_have_text("210")
    yield wide
    assert wide.faults == []


@pytest.fixture
def page(panels):
    return panels.page


def regions_of(page):
    return page.locator("#panel-regions")


def supports_of(page):
    return page.locator("#panel-supports")


def test_the_table_tells_what_regions_are_made_of(page):
    rows = page.locator(".region-table tbody tr")
    expect(rows).to_have_count(2)
    cells = rows.nth(1).locator("td")
    expect(cells).to_have_text(["beech", "13.7", "wood", "750", "0.022"])
    expect(rows.nth(0).locator(".place")).to_have_text("all that is left")
    chips = [
        rows.nth(row).locator(".chip").evaluate("(chip) => chip.style.background") for row in (0, 1)
    ]
    assert chips[0] != chips[1]


def test_a_region_is_added_and_painted(panels, page):
    regions_of(page).get_by_label("made of").select_option("glass")
    regions_of(page).get_by_role("button", name="Add a region").click()
    row = {"name": "region 3", "material": "glass", "painted": []}
    assert last_call(panels) == ("add_row", {"kind": "regions", "row": row})
    added = {"name": "region 3", "dabs": 0, "fault": None}
    panels.change(regions=[BODY, HANDLE, added])
    expect(page.locator(".region-table .chosen .name")).to_have_text("region 3")
    expect(regions_of(page).get_by_role("button", name="Paint", exact=True)).to_be_visible()


def test_the_first_region_is_all_of_the_solid(panels, page):
    panels.change(regions=[], supports=[])
    regions_of(page).get_by_role("button", name="Add a region").click()
    row = {"name": "body", "material": "steel"}
    assert last_call(panels) == ("add_row", {"kind": "regions", "row": row})


def test_a_region_keeps_the_constants_of_a_material_that_it_does_not_name_any_more(panels, page):
    chosen(page, "body")
    regions_of(page).get_by_label("Material").select_option("")
    iron = named_material("iron")
    changes = last_call(panels)[1]["changes"]
    assert changes["material"] is None
    assert (changes["young"], changes["density"]) == (iron.young, iron.density)
    regions_of(page).get_by_label("Material").select_option("glass")
    own = dict.fromkeys(("young", "poisson", "density", "loss_factor"))
    assert last_call(panels, 2)[1]["changes"] == own | {"material": "glass"}


def chosen(page, name):
    page.locator(".region-table tr", has_text=name).locator("input").check()


def test_the_form_changes_keys_of_the_selected_region(panels, page):
    chosen(page, "handle")
    form = regions_of(page)
    grain = {"kind": "regions", "number": 1, "changes": {"grain": [0, 0, 1]}}
    form.get_by_role("button", name="along z").click()
    assert last_call(panels, 1) == ("change_row", grain)
    form.get_by_label("Loss factor").fill("0.03")
    page.keyboard.press("Enter")
    assert last_call(panels, 2)[1]["changes"] == {"loss_factor": 0.03}
    form.get_by_label("E", exact=True).fill("12")
    page.keyboard.press("Enter")
    assert last_call(panels, 3)[1]["changes"] == {"young": 12e9}
    form.get_by_label("Density").fill("")
    form.get_by_label("Where").select_option("where")
    form.get_by_label("Expression").fill("x > 0.1")
    page.keyboard.press("Enter")
    assert last_call(panels, 4)[1]["changes"] == {"where": "x > 0.1"} | dict.fromkeys(
        ("painted", "box", "mesh", "part", "labels", "label", "unit", "depth")
    )
    form.get_by_role("button", name="Up").click()
    assert last_call(panels, 5) == ("move_row", {"kind": "regions", "number": 1, "to": 0})
    chosen(page, "body")
    form.get_by_role("button", name="Remove").click()
    assert last_call(panels, 6) == ("remove_row", {"kind": "regions", "number": 0})


def test_what_is_refused_stands_at_its_row(panels, page):
    chosen(page, "handle")
    panels.refused["change_row"] = "there is no material 'bech'; did you mean beech?"
    regions_of(page).get_by_label("Material").select_option("steel")
    fault = page.locator(".region-table .row-fault")
    expect(fault).to_have_text("there is no material 'bech'; did you mean beech?")
    assert panels.page.locator(".region-table tbody tr").nth(2).locator(".row-fault").count() == 1
    regions_of(page).get_by_label("Density").fill("heavy")
    page.keyboard.press("Enter")
    expect(fault).to_contain_text("found heavy, expected a number")


def test_what_the_solid_says_of_a_row_stands_at_it(panels, page):
    sentence = "pan: region 'handle' has no voxel of the solid"
    panels.change(regions=[BODY, HANDLE | {"fault": sentence}])
    expect(page.locator(".region-table .row-fault")).to_have_text(sentence)
    panels.change(supports=[HELD | {"fault": "support painted meets nothing"}, POINT])
    first = supports_of(page).locator(".row-fault").first
    expect(first).to_have_text("support painted meets nothing")
    panels.change(regions=[BODY, HANDLE])
    expect(page.locator(".region-table .row-fault")).to_have_count(0)


def test_supports_are_listed_and_become_others(panels, page):
    names = supports_of(page).locator(".target-name")
    expect(names).to_have_text(["Held", "Springs"])
    supports_of(page).get_by_text("Held", exact=True).click()
    form = supports_of(page)
    form.get_by_label("What").select_option("pad")
    nothing = dict.fromkeys(("spring", "mass"))
    changes = nothing | {"pad": "rubber", "thickness": 0.005}
    row = {"kind": "supports", "number": 0}
    assert last_call(panels) == ("change_row", row | {"changes": changes})
    form.get_by_label("y", exact=True).click()
    assert last_call(panels, 2)[1]["changes"] == {"along": "xz"}
    form.get_by_label("Where").select_option("region")
    changes = {"where": "region:body", "painted": None, "at": None, "radius": None}
    assert last_call(panels, 3)[1]["changes"] == changes
    form.get_by_role("button", name="Remove").click()
    assert last_call(panels, 4) == ("remove_row", {"kind": "supports", "number": 0})


def test_a_mass_waits_for_its_point(panels, page):
    supports_of(page).get_by_text("Held", exact=True).click()
    supports_of(page).get_by_label("What").select_option("mass")
    until(panels, lambda: page.evaluate("studio.selection.current.tool") == "point")
    assert page.evaluate("studio.selection.current.pending.mass") == 0.01
    assert panels.calls == []


def test_settings_that_regions_tell_are_not_shown(panels, page):
    density = page.locator("#panel-settings .field", has_text="Density").first
    expect(density).to_be_hidden()
    panels.change(regions=[])
    expect(density).to_be_visible()


def test_the_spectrum_tells_the_rigid_motions(panels, page):
    caption = page.locator("#panel-spectrum .hint").nth(1)
    for rigid, said in ((6, "all 6 rigid motions"), (1, "1 rigid motion of 6"), (0, "Held")):
        panels.tell(bank(number=10 + rigid, rigid_motions=rigid))
        expect(caption).to_contain_text(said)


def test_the_panels_can_be_used_by_all(page):
    chosen(page, "handle")
    assert axe_finds(page) == []


def test_constants_are_those_of_the_material_and_of_its_own(page):
    said = page.evaluate(
        """async () => {
          const { constantsOf, grainOf } = await import("/page/panels/materials.js");
          const beech = studio.materials.named("beech");
          const of = (keys) => constantsOf({ name: "a", dabs: null, fault: null, ...keys }, beech);
          return [
            of({}).poisson, of({ young: 1e10 }).poisson, of({ density: 5 }).density,
            grainOf({ grain: [0, 1, 0] }, beech), grainOf({ young: 1e10 }, beech),
            constantsOf({}, undefined),
          ];
        }"""
    )
    assert said[0] is None and 0.0 < said[1] < 0.5 and said[2] == 5
    assert said[3] == [0, 1, 0] and said[4] is None
    plain = {"young": 1e9, "poisson": 0.25, "density": 1000, "loss": None, "wood": False}
    assert said[5] == plain


def test_regions_of_one_material_have_other_colours(page):
    colours = page.evaluate(
        """async () => {
          const { coloursOf } = await import("/page/panels/materials.js");
          return coloursOf(Array(10).fill({ material: "iron" }), studio.materials);
        }"""
    )
    for first, one in enumerate(colours):
        for other in colours[first + 1 :]:
            assert np.linalg.norm(np.subtract(one, other)) > 0.1


def test_dabs_mark_what_the_server_will_tell(page):
    said = page.evaluate(
        """async () => {
          const { markDab, NONE } = await import("/page/solid/composition.js");
          const positions = Float32Array.from([0, 0, 0, 1, 0, 0, 3, 0, 0]);
          const numbers = new Uint16Array(3).fill(NONE);
          markDab(numbers, 1, positions, [0, 0, 0, 1.5], null, null);
          const added = [...numbers];
          markDab(numbers, 1, positions, [1, 0, 0, -0.5], null, null);
          const taken = [...numbers];
          const inward = Float32Array.from([0, 0, 1, 0, 0, -1, 0, 0, 1]);
          markDab(numbers, 2, positions, [0, 0, 0, 9], { inward, normal: [0, 0, 1] }, null);
          return [added, taken, [...numbers]];
        }"""
    )
    assert said == [[1, 1, NONE], [1, NONE, NONE], [2, NONE, 2]]


# The solid


class RowsStudio(ToldStudio):
    """A bell whose top is a region, and whose rim is held."""

    async def composition(self, number: int) -> bytes:
        z = self._mesh.vertices[:, 2]
        height = (z - z.min()) / np.ptp(z)
        region, support = np.where(height > 0.8, 1, 0), np.where(height < 0.1, 0, NONE)
        header = {"event": "composition", "number": number}
        return pack(header, {"region": ("u2", region), "support": ("u2", support)})


@pytest.fixture(scope="module")
def opened(browser):
    """A made-up studio with regions and supports, and its page."""
    studio = RowsStudio()
    with serving(studio) as address:
        yield studio, open_page(browser, address)


@pytest.fixture
def bell(opened):
    studio, page = opened
    studio.anew()
    painted = HANDLE | {"material": "beech"}
    studio.tell(regions=[BODY, painted], supports=[HELD, POINT], composition=7)
    until_page(page, "studio.view.composition.shown === 7 && studio.view.settled")
    page.evaluate(
        """() => {
          studio.view.drawing.reset();
          studio.selection.set(
            { tool: "strike", row: null, brush: 0.05, erasing: false, colouring: "regions" });
        }"""
    )
    until_still(page)
    page.faults.clear()
    yield studio, page
    assert page.faults == []


COLOURS = """() => {
  const { surface } = studio.view.drawing;
  const colours = surface.geometry.getAttribute("color"), found = new Set();
  for (let i = 0; i < colours.count; i++) {
    found.add([colours.getX(i), colours.getY(i), colours.getZ(i)].map((x) => x.toFixed(3)).join());
  }
  return found.size;
}"""


def test_colours_are_those_of_regions_or_of_moduli(bell):
    _, page = bell
    assert page.evaluate(COLOURS) == 2
    expect(page.locator(".legend-list li")).to_have_text(["body", "handle", "held"])
    page.get_by_role("button", name="Modulus").click()
    assert page.evaluate(COLOURS) > 20
    expect(page.locator(".legend-list")).to_be_hidden()
    page.get_by_role("button", name="Regions").click()
    assert page.evaluate(COLOURS) == 2


def test_held_places_are_hatched_and_springs_and_grain_drawn(bell):
    _, page = bell
    hatched = page.evaluate(
        """() => {
          const { geometry } = studio.view.drawing.surface;
          return new Set(geometry.getAttribute("hatch").array).size;
        }"""
    )
    assert hatched == 2
    names = page.evaluate("studio.view.symbols.group.children.map((child) => child.name)")
    assert sorted(names) == ["", "grain"]


def pressed(page) -> tuple[float, float]:
    middle = page.evaluate("studio.view.drawing.middle()")
    assert page.evaluate("({x, y}) => studio.view.pick(x, y) !== null", middle)
    return middle["x"], middle["y"]


def test_a_stroke_paints_the_selected_row_in_one_step(bell):
    studio, page = bell
    page.evaluate("studio.selection.set({ row: { kind: 'regions', number: 1 }, tool: 'paint' })")
    x, y = pressed(page)
    before = page.evaluate("studio.view.composition.arrays.region.reduce((a, b) => a + b, 0)")
    page.mouse.move(x - 40, y)
    page.mouse.down()
    page.mouse.move(x + 40, y + 30, steps=4)
    page.evaluate(TWO_FRAMES)
    after = page.evaluate("studio.view.composition.arrays.region.reduce((a, b) => a + b, 0)")
    assert after > before, "what is painted is seen at once"
    page.mouse.up()
    until_page(page, "!studio.view.gestures.painting.brush.stroke")
    until(Calls(studio, page), lambda: studio.calls)
    ((name, given),) = studio.calls
    assert (name, given["kind"], given["number"]) == ("paint", "regions", 1)
    dabs = np.array(given["dabs"])
    side = page.evaluate("studio.state.current.solid.longest_side_m")
    assert len(dabs) > 2 and np.allclose(dabs[:, 3], 0.05 * side, rtol=1e-5)
    apart = np.linalg.norm(np.diff(dabs[:, :3], axis=0), axis=1)
    assert (apart > 0.3 * 0.05 * side).all()
    assert page.evaluate("window.strikes") == []


def test_the_keyboard_paints_takes_away_and_ends(bell):
    studio, page = bell
    page.evaluate("studio.selection.set({ row: { kind: 'supports', number: 0 }, erasing: true })")
    page.locator("#view canvas").first.focus()
    page.keyboard.press("p")
    assert page.evaluate("studio.selection.current.tool") == "paint"
    page.keyboard.press(" ")
    until(Calls(studio, page), lambda: studio.calls)
    name, given = studio.calls[0]
    assert name == "paint" and len(given["dabs"]) == 1 and given["dabs"][0][3] < 0.0
    page.keyboard.press("Escape")
    assert page.evaluate("studio.selection.current.tool") == "strike"


def test_a_press_places_a_support(bell):
    studio, page = bell
    row = {"kind": "supports", "number": 1}
    given = {"row": row, "tool": "point", "pending": {"mass": 0.01}}
    page.evaluate("(given) => studio.selection.set(given)", given)
    x, y = pressed(page)
    page.mouse.click(x, y)
    until(Calls(studio, page), lambda: studio.calls)
    name, given = studio.calls[0]
    assert name == "change_row" and given["changes"]["mass"] == 0.01
    assert len(given["changes"]["at"]) == 3
    until_page(page, "studio.selection.current.tool === 'strike'")


class Calls:
    """What `until` asks of panels, for a studio."""

    def __init__(self, studio, page) -> None:
        self.studio, self.page = studio, page

    @property
    def calls(self):
        return self.studio.calls
