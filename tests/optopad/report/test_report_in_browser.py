"""The page in a real browser: it loads nothing, complains of nothing, and answers mouse, keyboard, theme and print."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from optopad.design.preset import preset
from optopad.fabrication.sheets.all_sheets import write_sheets
from optopad.report.page import write_report
from tests.optopad.report.bounded_score import PAD, bounded_score
from tests.optopad.report.browser import NAMES, Tab, browser_path, tab
from tests.optopad.report.shell_mold import shell_stl
from tests.said import says
from tests.sims.made_up_scores import CHECKS, dead_score

pytestmark = pytest.mark.skipif(
    browser_path() is None, reason=f"no browser: none of {', '.join(NAMES)} is installed"
)
PAIR = preset("piacenza2017-pair")
WIDE, NARROW = 1200, 390
SECTIONS = ["rays", "sensor", "signals", "map", "pairs", "tolerance", "force", "build", "mold", "warnings"]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bundle")
    for name in ("cad", "fabrication"):
        (folder / name).mkdir()
    (folder / "cad" / "mold.stl").write_bytes(shell_stl(PAIR))
    write_sheets(PAIR, folder / "fabrication")
    return write_report(PAIR, folder, dead_score(PAIR), CHECKS, seed=7)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with tab(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture
def shown(browser: Tab, page: Path) -> Tab:
    """The page, fresh, wide and light."""
    browser.complaints.clear()
    browser.requests.clear()
    browser.open(page, width=WIDE)
    return browser


def told(tab: Tab, view: str) -> dict[str, str]:
    found: dict[str, str] = tab.run(f"({{...document.getElementById('{view}').dataset}})")
    return found


def do(tab: Tab, script: str) -> Any:
    value = tab.run(script)
    tab.settle()
    return value


def choose(tab: Tab, query: str) -> None:
    do(
        tab,
        f"document.querySelector({json.dumps(query)}).dispatchEvent(new MouseEvent('click', {{bubbles: true}}))",
    )


def focus(tab: Tab, query: str) -> None:
    do(tab, f"document.querySelector({json.dumps(query)}).focus()")


def text_of(tab: Tab, query: str) -> str:
    return str(tab.run(f"document.querySelector({json.dumps(query)}).textContent"))


@pytest.mark.slow
def test_the_page_loads_nothing_but_itself_and_complains_of_nothing(shown, page):
    own = [address for address in shown.requests if not address.startswith("data:")]
    assert own == [page.resolve().as_uri()]
    assert shown.complaints == []
    assert shown.run("[...document.querySelectorAll('section[id]')].map((s) => s.id)")[1:11] == SECTIONS
    for view in ("rays-view", "pairs-view", "maps-view"):
        assert told(shown, view)["ready"] == "yes"


@pytest.mark.slow
def test_the_views_stand_in_for_the_stills(shown):
    hidden = "['rays', 'pairs', 'maps'].map((n) => getComputedStyle(document.getElementById(n + '-still')).display)"
    assert shown.run(hidden) == ["none"] * 3


@pytest.mark.slow
def test_keys_turn_and_size_the_view(shown):
    start = told(shown, "rays-view")
    focus(shown, "#rays-view canvas")
    shown.press("ArrowRight")
    shown.press("ArrowUp")
    turned = told(shown, "rays-view")
    assert float(turned["yaw"]) == float(start["yaw"]) + 6
    assert float(turned["pitch"]) == float(start["pitch"]) + 6
    shown.press("+")
    assert told(shown, "rays-view")["zoom"] == "1.15"
    shown.press("ArrowUp", times=12)
    assert told(shown, "rays-view")["pitch"] == "90.0"  # and no further
    shown.press("0")
    back = told(shown, "rays-view")
    assert (back["yaw"], back["pitch"], back["zoom"]) == (start["yaw"], start["pitch"], "1.00")


INK = """(() => {
  const canvas = document.querySelector('#rays-view canvas');
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let k = 3; k < pixels.length; k += 4) if (pixels[k] > 0) count += 1;
  return count / (pixels.length / 4);
})()"""


@pytest.mark.slow
def test_the_mold_is_drawn_cut_open_whole_or_not_at_all(shown):
    painted = {}
    for look in ("cut", "whole", "none"):
        choose(shown, f"input[name=rays-mold][value={look}]")
        assert told(shown, "rays-view")["mold"] == look
        painted[look] = shown.run(INK)
    assert painted["cut"] > 0.2
    assert painted["whole"] > painted["cut"]  # the walls that were cut away cover more of the ground


@pytest.mark.slow
def test_a_press_a_kind_and_a_pair_can_be_chosen(shown):
    choose(shown, "input[name=rays-press][value='3']")
    pressed = told(shown, "rays-view")
    assert pressed["state"] == "3"
    assert json.loads(pressed["drawn"])["lost"] > 0
    choose(shown, "input[name=rays-kind][value=direct]")
    assert json.loads(told(shown, "rays-view")["drawn"]) == json.loads(pressed["drawn"]) | {"direct": 0}
    focus(shown, "select[name=rays-pair]")
    shown.press("ArrowDown")
    assert told(shown, "rays-view")["pair"] == "1"
    assert "untouched light arrives" in text_of(shown, "[data-total]")


@pytest.mark.slow
def test_the_picker_draws_each_pair_with_its_modes_and_deadband(shown):
    score = dead_score(PAIR)
    for _ in score.pairs:
        name = told(shown, "pairs-view")["pair"]
        pair = next(found for found in score.pairs if found.name == name)
        start, end = pair.score.deadbands_mm[0]
        assert f"deadband {start:.2f} to {end:.2f} mm" in text_of(shown, "[data-reading]")
        kinds = shown.run("[...document.querySelectorAll('[data-plot] .band')].map((b) => b.classList[1])")
        assert {"mode1", "mode2", "dead"} <= set(kinds)
        assert shown.run("document.querySelectorAll('[data-plot] polyline').length") == 4
        choose(shown, "[data-step='1']")
    assert told(shown, "pairs-view")["pair"] == score.pairs[0].name  # round again


@pytest.mark.slow
def test_the_slider_moves_the_map(shown):
    fills = (
        "[...document.querySelectorAll('[data-map] [data-place]')].map((c) => c.getAttribute('fill')).join()"
    )
    focus(shown, "#maps-depth")
    shown.press("Home")
    surface = shown.run(fills)
    assert text_of(shown, "#maps-view output") == "0.00 mm"
    depths = shown.run("JSON.parse(document.getElementById('maps-data').textContent).maps[0].depth")
    steps = next(number for number, depth in enumerate(depths) if depth >= 1.3)
    shown.press("ArrowRight", times=steps)
    assert told(shown, "maps-view")["depth"] == f"{depths[steps]:.2f}"
    deeper = shown.run(fills)
    assert deeper != surface
    # the made-up map's deadband begins at 1.2 mm at ten of its places
    assert shown.run("document.querySelectorAll('[data-map] .dead-cell').length") == 10
    assert "10 of 25 locations" in text_of(shown, "[data-summary]")


@pytest.mark.slow
def test_arrow_keys_move_from_place_to_place(shown):
    before = int(told(shown, "maps-view")["place"])
    focus(shown, "[data-map]")
    shown.press("ArrowRight")
    assert int(told(shown, "maps-view")["place"]) == before + 1
    shown.press("ArrowUp")
    assert int(told(shown, "maps-view")["place"]) == before + 6
    assert "x 8, y 8 mm" in text_of(shown, "#maps-view [data-reading]")


@pytest.mark.slow
def test_a_blind_place_is_said_and_hatched_at_its_depth_only(browser, tmp_path):
    page = write_report(PAD, tmp_path, bounded_score(), CHECKS, seed=0)
    browser.open(page)
    choose(browser, "input[name=maps-which][value='1']")
    assert told(browser, "maps-view")["quantity"] == "location"
    focus(browser, "#maps-depth")
    browser.press("Home")
    hatched = "document.querySelectorAll('[data-map] .dead-cell').length"
    assert browser.run(hatched) == 0
    assert says(text_of(browser, "#maps-view [data-reading]"), "0.0040 mm (0.0039 to ... 0.0041 mm")
    browser.press("ArrowRight", times=4)
    assert told(browser, "maps-view")["depth"] == "4.90"
    assert browser.run(hatched) == 25
    choose(browser, "[data-map] [data-place='0']")
    assert "not resolved" in text_of(browser, "#maps-view [data-reading]")
    choose(browser, "input[name=maps-which][value='3']")
    assert browser.run("document.getElementById('maps-depth').disabled")
    assert text_of(browser, "#maps-view output") == "any depth"
    assert browser.complaints == []


CONTRAST = """(() => {
  const light = (text) => text.match(/[\\d.]+/g).slice(0, 3).map((v) => v / 255)
    .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const groundOf = (node) => {
    for (let at = node; at; at = at.parentElement) {
      const colour = getComputedStyle(at).backgroundColor;
      if (!/rgba\\(.*, 0\\)|transparent/.test(colour)) return colour;
    }
    return 'rgb(255, 255, 255)';
  };
  const found = [];
  for (const node of document.querySelectorAll('p, td, th, dt, dd, h1, h2, h3, a, label, figcaption, summary, li')) {
    if (!node.textContent.trim() || !node.offsetParent) continue;
    const [a, b] = [light(getComputedStyle(node).color), light(groundOf(node))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < 4.5) found.push(`${node.tagName} ${node.className} ${ratio.toFixed(1)}`);
  }
  return [...new Set(found)];
})()"""


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_text_has_the_contrast_that_wcag_asks_for(browser, page, dark):
    browser.open(page, dark=dark)
    assert browser.run(CONTRAST) == []


@pytest.mark.slow
def test_tab_reaches_every_control_in_the_order_of_the_page(shown):
    order = """(() => {
      const kinds = 'a[href], button, select, input, canvas[tabindex], svg[tabindex], summary';
      const able = [...document.querySelectorAll(kinds)]
        .filter((node) => node.getClientRects().length);
      return able.every((node) => node.tabIndex === 0) && able.length;
    })()"""
    assert shown.run(order) > 40
    shown.press("Tab")
    assert shown.run("document.activeElement.className") == "skip"


@pytest.mark.slow
def test_every_control_has_a_name_and_every_table_its_heads(shown):
    nameless = """[...document.querySelectorAll('button, select, input, canvas, output')].filter((node) =>
      !(node.getAttribute('aria-label') || node.textContent.trim() || node.closest('label')
        || (node.labels && node.labels.length))).map((node) => node.outerHTML.slice(0, 80))"""
    assert shown.run(nameless) in ([], None)
    heads = "[...document.querySelectorAll('table')].every((t) => t.querySelectorAll('thead th[scope=col]').length > 1)"
    assert shown.run(heads)
