"""The studio in a real browser: Chromium without a screen, its picture drawn in software."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import viser

from optopad.design.io import load_design
from optopad.design.preset import SHAPED_PRESETS, preset_text
from optopad.design.shape.cavity import cavity_of
from optopad.screen.verdict_sentences import sentences_of
from optopad.sims.score.scoring import score
from optopad.studio.design_file import DesignFile
from optopad.studio.moves import part_named
from optopad.studio.session import Session
from optopad.studio.view.page import Page
from tests.optopad.studio.chromium import chromium_page, middle, needs_chromium, screen_place

pytestmark = [needs_chromium, pytest.mark.slow]


@contextmanager
def studio(tmp_path: Path, name: str = "piacenza2017-pair"):
    """A page on a copy of a preset."""
    file = tmp_path / "pad.toml"
    file.write_text(preset_text(name), encoding="utf-8")
    page = Page(Session(DesignFile(str(file))), out=tmp_path / "outputs", port=0)
    page.start()
    try:
        yield page, file
    finally:
        page.close()


def drag_part(browser, page: Page, name: str, along_mm: float) -> None:
    """Drag a part by its face along its wall, by the mouse."""
    client = next(iter(page.server.get_clients().values()))
    part = part_named(page.session.design, name)
    start = part.position_mm
    end = (
        (start[0] + along_mm, start[1], start[2])
        if part.wall in ("south", "north")
        else (start[0], start[1] + along_mm, start[2])
    )
    canvas = browser.box("canvas")
    browser.drag(screen_place(client.camera, start, canvas), screen_place(client.camera, end, canvas))


def test_a_layer_made_thicker_tells_the_words_of_its_score_and_a_dragged_part_is_undone_and_saved(
    tmp_path: Path,
) -> None:
    with studio(tmp_path) as (page, file), chromium_page(f"{page.url}?fixedDpr=1", 1300, 800) as browser:
        browser.wait_for_text("clear layer [mm]")
        browser.settle()
        browser.close_notes()
        before = page.session.design
        browser.wait_for_text("Pairs under the tip", 60)

        browser.fill("clear layer [mm]", 11)
        thick = before.with_(**{"cavity.clear_thickness_mm": 11.0})
        browser.wait_for_text(sentences_of(thick, score(thick, tolerance=False)).verdict, 120)
        assert page.session.design.digest == thick.digest

        receiver = part_named(thick, "R3")
        drag_part(browser, page, "R3", 1.0)
        browser.wait_for_text("R3: ", 10)
        browser.settle()
        moved = part_named(page.session.design, "R3")
        assert moved.along_mm - receiver.along_mm == pytest.approx(1.0, abs=0.2)  # a pixel is 0.1 mm there
        others = [p.along_mm for p in cavity_of(page.session.design).parts if p.name != "R3"]
        assert others == pytest.approx([p.along_mm for p in cavity_of(thick).parts if p.name != "R3"])

        while page.session.design.digest != thick.digest:
            browser.click_text("Undo")
            browser.settle()
        browser.click_text("Save")
        browser.wait_for_text(f"saved: {file}", 10)
        text = file.read_text(encoding="utf-8")
        assert load_design(file).digest == thick.digest
        assert "strongest effect" in text
        assert browser.errors == []


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.full] if name != "crowned-40x25" else [])
        for name in SHAPED_PRESETS
    ],
)
def test_a_shaped_pad_is_pressed_by_a_click_and_a_disc_s_part_is_turned_undone_and_saved(
    tmp_path: Path, name: str
) -> None:
    with (
        studio(tmp_path, name) as (page, file),
        chromium_page(f"{page.url}?fixedDpr=1", 1300, 800) as browser,
    ):
        browser.wait_for_text("clear layer [mm]")
        browser.settle()
        browser.close_notes()
        session, before = page.session, page.session.design
        plan, canvas = cavity_of(before).plan, browser.box("canvas")
        camera = next(iter(page.server.get_clients().values())).camera
        place = (0.4 * plan.length_mm, 0.45 * plan.width_mm)
        browser.click_at(*screen_place(camera, (*place, plan.top_mm(*place)), canvas))
        browser.wait_for("new Promise((done) => setTimeout(() => done(true), 500))")
        assert session.press.place_mm == pytest.approx(place, abs=0.02 * plan.length_mm)  # a few pixels

        part = cavity_of(before).receivers[-2]
        if part.angle_deg is not None:
            middle, angle = np.array(plan.centre_mm), part.angle_deg
            out_mm = plan.stands_mm(part.line) + part.part.body_depth_mm.value

            def on_back(at_deg: float) -> tuple[float, float, float]:
                turn = np.radians(at_deg)
                x, y = middle + out_mm * np.array([np.cos(turn), np.sin(turn)])
                return float(x), float(y), part.height_mm

            start, end = (screen_place(camera, on_back(at), canvas) for at in (angle, angle + 6.0))
            browser.drag(start, end)
            browser.wait_for_text(f"{part.name}: at ", 10)
            browser.settle()
            found = part_named(session.design, part.name)
            assert found.angle_deg is not None
            assert found.angle_deg - angle == pytest.approx(6.0, abs=1.5)
            assert found.height_mm == part.height_mm
            while session.design.digest != before.digest:
                browser.click_text("Undo")
                browser.settle()
            browser.click_text("Save")
            browser.wait_for_text(f"saved: {file}", 10)
            assert file.read_text(encoding="utf-8") == preset_text(name)
        assert browser.errors == []


@pytest.mark.full
def test_an_object_is_chosen_dragged_turned_refused_and_taken_away(tmp_path: Path) -> None:
    with studio(tmp_path) as (page, _), chromium_page(f"{page.url}?fixedDpr=1", 1300, 860) as browser:
        browser.wait_for_text("Pairs under the tip", 60)
        browser.settle()
        browser.close_notes()
        browser.click_at(*middle(browser.input_box("pressed by")))
        browser.click_text("cylinder")
        browser.wait_for_text("Under a cylinder of radius 5 mm", 60)
        browser.slide("yaw [deg]", 0.75)
        browser.wait_for_text("turned by", 30)
        session = page.session
        assert session.press.held is not None
        assert session.press.depth_mm == 1.0
        assert session.press.held.yaw == pytest.approx(90.0, abs=10.0)

        camera = next(iter(page.server.get_clients().values())).camera
        x_mm, y_mm = session.press.place_mm
        canvas = browser.box("canvas")
        start, end = (screen_place(camera, (x, y_mm - 4.0, 13.0), canvas) for x in (x_mm, x_mm + 2.0))
        browser.drag(start, end)
        browser.wait_for("new Promise((done) => setTimeout(() => done(true), 500))")
        assert session.press.x_mm - x_mm == pytest.approx(2.0, abs=0.5)

        browser.fill("object", "cylinder,radius=0")
        browser.wait_for_text("not taken: object 'cylinder,radius=0': radius=0 is refused", 10)
        browser.fill("object", "box,length=14,width=12,x=6")
        browser.wait_for_text("would touch the rim", 30)
        browser.click_at(*middle(browser.input_box("pressed by")))
        browser.click_text("own tip")
        browser.wait_for_text("Pairs under the tip", 30)
        assert session.press.held is None
        assert browser.errors == []


@pytest.mark.full
def test_a_second_tip_is_added_dragged_refused_and_taken_away(tmp_path: Path) -> None:
    with (
        studio(tmp_path, "piacenza2017-pad") as (page, _),
        chromium_page(f"{page.url}?fixedDpr=1", 1300, 860) as browser,
    ):
        browser.wait_for_text("Pairs under the tip", 60)
        browser.settle()
        browser.close_notes()
        browser.click_text("second touch")
        browser.wait_for_text("Under two touches, 9.0 mm apart", 120)
        browser.slide("second depth [mm]", 0.1)
        browser.wait_for_text("y 16.0 mm: 0.50 mm deep", 60)
        session = page.session
        assert session.press.second_mm is not None
        x_mm, y_mm = session.press.second_mm[:2]
        camera = next(iter(page.server.get_clients().values())).camera
        canvas = browser.box("canvas")
        start, end = (screen_place(camera, (x, y_mm - 2.9, 13.0), canvas) for x in (x_mm, x_mm - 2.0))
        browser.drag(start, end)
        browser.wait_for("new Promise((done) => setTimeout(() => done(true), 500))")
        assert session.press.second_mm[0] - x_mm == pytest.approx(-2.0, abs=0.5)
        assert session.press.place_mm == (16.0, 16.0)
        session.move_second(x_mm=18.0, y_mm=16.0)
        browser.wait_for_text("overlap", 60)
        browser.click_text("second touch")
        browser.wait_for_text("Pairs under the tip", 60)
        assert session.press.is_single_tip
        assert browser.errors == []


def test_another_page_of_the_same_browser_is_refused_even_with_the_token(tmp_path: Path) -> None:
    opens = """(address) => new Promise((done) => { const line = new WebSocket(address, %r);
      line.onopen = () => done('open'); line.onerror = () => done('refused'); })"""
    ours = [f"viser-v{viser.__version__}"]
    with studio(tmp_path) as (page, _), chromium_page(page.url, 1300, 800) as browser:
        browser.wait_for_text("clear layer [mm]")
        address = page.url.replace("http", "ws")
        assert browser.evaluate(f"({opens % ours})({address!r})") == "open"
        browser.reload()
        browser.wait_for_text("clear layer [mm]")
        browser.open("data:text/html,another page")
        assert browser.evaluate(f"({opens % ours})({address!r})") == "refused"


def test_what_does_not_fit_is_said_in_the_words_of_the_check_and_never_saved(tmp_path: Path) -> None:
    with studio(tmp_path) as (page, file), chromium_page(f"{page.url}?fixedDpr=1", 1300, 800) as browser:
        browser.wait_for_text("clear layer [mm]")
        browser.settle()
        browser.close_notes()
        text = file.read_text(encoding="utf-8")
        browser.fill("clear layer [mm]", 4)
        browser.wait_for_text("does not fit", 10)
        browser.wait_for_text(str(page.session.now.errors[0])[:60], 10)
        browser.click_text("Save")
        browser.wait_for_text("not saved: ", 10)
        assert file.read_text(encoding="utf-8") == text
        file.write_text(
            text.replace("clear_thickness_mm = 8.0 ", "clear_thickness_mm = 9.0 "), encoding="utf-8"
        )
        browser.wait_for_text("read again", 10)
        assert page.session.design.cavity.clear_thickness_mm == 9.0
        file.write_text("[cavity", encoding="utf-8")
        browser.wait_for_text("not valid TOML", 10)
        assert page.session.design.cavity.clear_thickness_mm == 9.0
