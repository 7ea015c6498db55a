"""The pictures of docs/how-to/studio.md, with Chromium: `python -m tests.optopad.studio.studio_pictures`."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from optopad.studio.design_file import DesignFile
from optopad.studio.live import FAKE, LiveSensor
from optopad.studio.session import Session
from optopad.studio.view.page import Page
from optopad.work import read_design
from tests.optopad.studio.chromium import Page as Browser
from tests.optopad.studio.chromium import chromium_page

IMAGES = Path(__file__).parents[3] / "docs" / "images"
PRESET = "piacenza2017-pad"
SIZE = (1300, 860)


@contextmanager
def _shown(changes: list[str], out: Path, *, is_built: bool = False) -> Iterator[tuple[Page, Browser]]:
    session = Session(DesignFile(PRESET), read_design(PRESET, changes))
    live = LiveSensor(session.design, port=FAKE, model=None, bundles=out) if is_built else None
    page = Page(session, out=out, port=0, live=live)
    page.start()
    try:
        with chromium_page(f"{page.url}?fixedDpr=1", *SIZE) as browser:
            browser.wait_for_text("clear layer [mm]")
            browser.settle()
            browser.close_notes()
            yield page, browser
    finally:
        page.close()


def draw(out: Path) -> None:
    """Draw all."""
    with _shown([], out) as (page, browser):
        page.session.hold("cylinder,yaw=30,x=12,depth=1.5")
        browser.wait_for_text("Under a cylinder", 300)
        browser.settle()
        browser.screenshot(IMAGES / "studio-object.png")
    with _shown([], out) as (page, browser):
        page.session.add_second(True)
        browser.wait_for_text("Under two touches", 300)
        browser.settle()
        browser.screenshot(IMAGES / "studio-two-touches.png")
    with _shown(["cavity.clear_thickness_mm=11"], out) as (page, browser):
        page.session.move_tip(depth_mm=3.0)
        browser.click_text("sample rays")
        browser.wait_for_text("(as optopad score)", 300)
        browser.settle()
        browser.screenshot(IMAGES / "studio.png")
    with _shown([], out, is_built=True) as (page, browser):
        browser.wait_for_text("(as optopad score)", 300)
        browser.settle()
        browser.screenshot(IMAGES / "studio-sensor.png")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        draw(Path(folder))
