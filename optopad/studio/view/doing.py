"""What the buttons of the page do: improve, build, open the report, export the picture."""

from __future__ import annotations

import time
import webbrowser
from collections.abc import Callable
from pathlib import Path

import viser

from cad.picture import png_bytes
from fabrication.bundle import bundle_name
from optopad.studio.actions import Errand, Ghost
from optopad.studio.session import Session

PICTURE_S = 20.0
LEAST_PX = (800, 600)


class Doing:
    """The buttons' work.

    Parameters
    ----------
    server : of the page
    session, errand : what is on the table, what is under way
    changed : is called when an errand begins or ends
    found : gets the alternatives of improve
    """

    def __init__(
        self,
        server: viser.ViserServer,
        session: Session,
        errand: Errand,
        *,
        changed: Callable[[], None],
        found: Callable[[tuple[Ghost, ...]], None],
    ) -> None:
        self._server, self._session, self._errand = server, session, errand
        self._changed, self._found = changed, found

    def improve(self) -> None:
        """Look for up to three verified alternatives."""

        def done(ghosts: tuple[Ghost, ...]) -> None:
            self._found(ghosts)
            self._changed()

        self._begin(lambda: self._errand.improve(self._session.design, done))

    def build(self) -> None:
        """Make the whole bundle."""
        self._begin(lambda: self._errand.build(self._session.design, lambda _folder: self._changed()))

    def end(self) -> None:
        """End what is under way."""
        if not self._errand.is_running:
            self._session.say("nothing runs")
        self._errand.end()
        self._changed()

    def open_report(self) -> None:
        """Open the page of the design's bundle in the browser of this machine."""
        report = self._errand.out / bundle_name(self._session.design) / "report.html"
        if not report.is_file():
            self._session.say("no report of this design yet: build the bundle first", is_bad=True)
            return
        webbrowser.open(report.absolute().as_uri())
        self._session.say(f"opened: {report}")

    def export_picture(self) -> None:
        """What the browser shows of the scene, as a PNG among the bundles."""
        clients = list(self._server.get_clients().values())
        if not clients:
            self._session.say("no page is open to take a picture of", is_bad=True)
            return
        camera = clients[-1].camera
        try:
            image = clients[-1].get_render(
                height=max(camera.image_height, LEAST_PX[1]),
                width=max(camera.image_width, LEAST_PX[0]),
                transport_format="png",
                timeout=PICTURE_S,
            )
        except (RuntimeError, TimeoutError) as err:  # the tab is hidden or closed, or sent no picture
            self._session.say(
                f"no picture: {err} Bring the page to the front, then export again", is_bad=True
            )
            return
        target = self._errand.out / f"{self._session.design.name}-{time.strftime('%Y%m%d-%H%M%S')}.png"
        self._write(target, png_bytes(image))

    def _write(self, target: Path, content: bytes) -> None:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        except OSError as err:
            self._session.say(f"{target}: cannot be written: {err.strerror}", is_bad=True)
        else:
            self._session.say(f"picture: {target}")

    def _begin(self, start: Callable[[], bool]) -> None:
        if self._session.now.errors:
            self._session.say(f"not begun: {self._session.now.errors[0]}", is_bad=True)
        elif not start():
            self._session.say("one thing at a time: end what runs first", is_bad=True)
        self._changed()
