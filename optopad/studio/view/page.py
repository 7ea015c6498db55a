"""The page: passes the user's actions to the session, and shows the state of session, workshop and sensor.

One thread of the page applies edits and draws, at most thirty times a second. Other threads only record the browser's
messages and the results of the computations.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path

import numpy as np
import viser

from optopad.cad.mesh import Mesh
from optopad.design.errors import OptopadError
from optopad.design.shape.cavity import cavity_of
from optopad.studio import workshop as found_by_work
from optopad.studio.actions import Ghost, MoldShop, Task
from optopad.studio.live import LiveSensor, LiveView
from optopad.studio.sentences import bad_parts
from optopad.studio.session import Said, Session
from optopad.studio.view.controls import AnswersPanel, BackgroundJobs, Controls
from optopad.studio.view.local_server import local_server
from optopad.studio.view.scene import PadScene
from optopad.studio.workshop import Failed, LiveVerdict, Look, Rays, Readings, Request, Result, Workshop

FRAME_S = 1.0 / 30.0
IDLE_S = 0.1
FILE_EVERY_S = 0.5
TOUCH_EVERY_S = 0.1
MOLD_AFTER_S = 1.0
"""Time without an edit after which the mold is made again [s]."""
KEPT_VERDICTS = 12
NARROW_PX = 300
"""The left panel is folded away if both panels leave less than this width for the picture [px]."""
RIGHT_PX, LEFT_PX, NARROW_RIGHT_PX = 400, 290, 320

EVERYTHING = frozenset({"design", "press", "words", "curves", "map", "rays", "mold", "theme", "ghosts"})
OF_SESSION = ("design", "press", "words", "map", "curves", "mold")
OF_ANSWER: dict[type, tuple[str, ...]] = {
    Look: ("press", "curves"),
    found_by_work.Curves: ("curves",),
    Rays: ("rays",),
    Readings: ("curves",),
    LiveVerdict: ("map", "words"),
    found_by_work.Progress: ("words",),
    Failed: ("press", "words"),
}
"""Parts of the page that are drawn again when a result arrives, by the result's class."""


class Page:
    """The studio's page.

    Parameters
    ----------
    session : the present design
    out : folder of the bundles
    port : port of the page; None for the first free port
    seed : random seed of the light model
    live : a sensor to show, or None

    Raises
    ------
    InputError : the port is taken.
    """

    def __init__(
        self, session: Session, *, out: Path, port: int | None, seed: int = 0, live: LiveSensor | None = None
    ) -> None:
        self.session, self._live = session, live
        self._wake, self._lock = threading.Event(), threading.Lock()
        self._todo: dict[str, tuple[float, Callable[[], object]]] = {}
        self._is_closing, self._is_folded = False, False
        self._answers: dict[type, Result] = {}
        self._judged: dict[str, LiveVerdict] = {}
        self._ghosts: tuple[Ghost, ...] = ()
        self._dirty = set(EVERYTHING)
        self._drawn_live: LiveView | None = None
        self._faulty: tuple[str, ...] = ()
        self.live_updates = 0
        self.workshop = Workshop(self._post, seed=seed)
        self._task = Task(out, self._tell)
        self._molds = MoldShop(self._take_mold)
        self.server = local_server(port)
        self._build()
        self._thread = threading.Thread(target=self._run, name="studio-page", daemon=True)
        session.listen(self._changed)

    @property
    def url(self) -> str:
        """Address of the page on this machine, including the required token."""
        return self.server.url

    def start(self) -> None:
        """Start computing and drawing."""
        self.workshop.start()
        if self._live is not None:
            self._live.start()
        self._thread.start()
        self._changed()

    def close(self) -> None:
        """End computations, tasks, sensor and server."""
        self._is_closing = True
        self._wake.set()
        self._task.end()
        self._molds.end()
        self.workshop.close(2.0)
        if self._live is not None:
            self._live.close()
        if self._thread.is_alive():
            self._thread.join(2.0)
        self.server.stop()

    def _build(self) -> None:
        gui = self.server.gui
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.set_panel_label("optopad studio")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(RIGHT_PX)
        self._panel = AnswersPanel(
            gui, self.session, self._live, later=self._later, redraw_map=lambda: self._mark("map")
        )
        buttons = BackgroundJobs(
            self.server, self.session, self._task, changed=self._changed, found=self._take_ghosts
        )
        self._left = gui.add_panel()
        with self._left.add_tab("Design"):
            self._controls = Controls(
                gui,
                self.session,
                later=self._later,
                redraw=lambda: self._mark("rays", "mold", "theme"),
                buttons=buttons,
            )
        self._left.dock_left()
        self._left.set_width(LEFT_PX)
        self._scene = PadScene(
            self.server,
            self.session,
            later=lambda name, do: self._later(name, do, 0.0),
            with_row=lambda: self._controls.moves_rows,
        )
        self.server.on_client_connect(self._fit)

    def _fit(self, client: viser.ClientHandle) -> None:
        """Fold the left panel away if both panels leave too little room for the picture."""

        def looked(camera: viser.CameraHandle) -> None:
            if camera.image_width < NARROW_PX and not self._is_folded:
                self._is_folded = True
                self._left.minimize()
                self.server.gui.main_panel.set_width(NARROW_RIGHT_PX)

        client.camera.on_update(looked)
        looked(client.camera)

    def _later(self, name: str, do: Callable[[], object], wait_s: float) -> None:
        with self._lock:
            self._todo.pop(name, None)
            self._todo[name] = (time.monotonic() + wait_s, do)
        self._wake.set()

    def _mark(self, *what: str) -> None:
        with self._lock:
            self._dirty |= set(what)
        self._wake.set()

    def _request(self) -> Request | None:
        """The request to the workshop; None for a design that breaks a rule."""
        now = self.session.now
        if now.errors:
            return None
        return Request(
            design=now.design,
            press=self.session.press,
            with_rays=self._controls.shows_rays,
            with_readings=self._live is not None,
            is_thorough=not self._task.is_running,
        )

    def _changed(self) -> None:
        self.workshop.want(self._request())
        self._mark(*OF_SESSION)

    def _post(self, answer: Result) -> None:
        with self._lock:
            self._answers[type(answer)] = answer
            if isinstance(answer, LiveVerdict):
                self._judged[answer.digest] = answer
                self._forget_some()
            is_verdict = isinstance(answer, LiveVerdict) and self.session.press.is_single_tip
            if is_verdict or isinstance(answer, Look):  # there is a result again
                self._answers.pop(Failed, None)
        if isinstance(answer, Readings) and self._live is not None and self._live.expected is None:
            self._live.set_expected(answer.untouched)
        self._mark(*OF_ANSWER[type(answer)])

    def _forget_some(self) -> None:
        """Remove the oldest verdicts, except those of pinned designs and of the present design."""
        kept = {one.design.digest for one in (*self.session.pinned, self.session.now)}
        for digest in [one for one in self._judged if one not in kept][:-KEPT_VERDICTS]:
            self._judged.pop(digest)

    def _tell(self, said: Said) -> None:
        self.session.say(said.text, is_bad=said.is_bad)

    def _take_mold(self, digest: str, found: Mesh | str) -> None:
        if isinstance(found, str):
            self._tell(Said(text=f"mold: {found}", is_bad=True))
            return
        self._scene.set_mold(digest, found)
        self._mark("mold")

    def _take_ghosts(self, ghosts: tuple[Ghost, ...]) -> None:
        self._ghosts = ghosts
        self._mark("ghosts")

    def _run(self) -> None:
        looked_at = 0.0
        while not self._is_closing:
            self._wake.wait(FRAME_S if self._live is not None else IDLE_S)
            self._wake.clear()
            began = time.monotonic()
            try:
                self._do_what_is_due(began)
                if began - looked_at > FILE_EVERY_S:
                    looked_at = began
                    self.session.look_at_file()
                self._draw()
            except Exception as err:  # all, on purpose: one bad drawing must not end the page
                if self._is_closing:
                    return
                traceback.print_exception(err)
                self.session.say(f"the page: {type(err).__name__}: {err}", is_bad=True)
            time.sleep(max(FRAME_S - (time.monotonic() - began), 0.0))

    def _do_what_is_due(self, now: float) -> None:
        with self._lock:
            due = {name: do for name, (at, do) in self._todo.items() if at <= now}
            for name in due:
                self._todo.pop(name)
        for do in due.values():
            do()

    def _draw(self) -> None:
        with self._lock:
            dirty, self._dirty = self._dirty, set()
            answers, judged = dict(self._answers), dict(self._judged)
        with self.server.atomic():
            if "theme" in dirty:
                self.server.gui.configure_theme(
                    show_logo=False, show_share_button=False, dark_mode=self._controls.is_dark
                )
            if dirty & {"design", "press"}:
                self._controls.follow()
                self._draw_scene(answers, is_new="design" in dirty)
            if dirty & {"rays", "press", "design"}:
                self._draw_rays(answers)
            if "mold" in dirty:
                self._draw_mold()
            if dirty & {"curves", "press"}:
                self._panel.draw_curves(answers)
            if dirty & {"map", "press", "design"}:
                self._panel.draw_map(judged)
            if "words" in dirty:
                self._panel.draw_words(answers, judged)
            if "ghosts" in dirty:
                self._scene.draw_ghosts(self._ghosts)
                self._panel.offer_ghosts(self._ghosts)
            if self._live is not None:
                self._draw_live(self._live.latest(), answers)

    def _draw_scene(self, answers: dict[type, Result], *, is_new: bool) -> None:
        now, look = self.session.now, answers.get(Look)
        try:
            cavity = cavity_of(now.design)
        except OptopadError:
            return
        if is_new:
            self._scene.draw_design(
                now.design, (*bad_parts(now, cavity.parts), *self._faulty), is_bad=bool(now.errors)
            )
        self._scene.draw_tip(now.design, self.session.press)
        failed, digest = answers.get(Failed), now.design.digest
        has_none = isinstance(failed, Failed) and failed.digest == digest
        by_tip = self.session.press.is_single_tip
        if isinstance(look, Look) and not now.errors and (not has_none or (by_tip and look.digest == digest)):
            self._scene.draw_top(look)
        else:
            self._scene.draw_untouched_top(now.design, is_bad=bool(now.errors))

    def _draw_rays(self, answers: dict[type, Result]) -> None:
        rays, shown = answers.get(Rays), self._controls.shows_rays
        fits = (
            isinstance(rays, Rays)
            and rays.digest == self.session.design.digest
            and rays.press == self.session.press
        )
        self._scene.draw_rays(
            rays if shown and fits and isinstance(rays, Rays) else None, is_dark=self._controls.is_dark
        )
        if shown and not fits:
            self.workshop.want(self._request())

    def _draw_mold(self) -> None:
        now, shown = self.session.now, self._controls.mold
        if shown != "hidden" and not now.errors:
            self._later("mold", lambda: self._molds.want(self.session.design), MOLD_AFTER_S)
        self._scene.draw_mold(now.design, shown)

    def _draw_live(self, view: LiveView | None, answers: dict[type, Result]) -> None:
        if view is None or view is self._drawn_live:
            return
        self._drawn_live = view
        self.live_updates += 1
        faulty = tuple(name for problem in view.problems if problem.is_error for name in problem.parts)
        if faulty != self._faulty:
            self._faulty = faulty
            self._mark("design")
        self._panel.draw_sensor(view, answers, faulty)
        touch = view.touch
        self._scene.draw_touch(touch)
        if (
            touch is not None
            and touch.is_touched
            and self._panel.follows_touch
            and np.isfinite(touch.press_mm).all()
        ):
            x, y, depth = (float(value) for value in touch.press_mm)
            if "touch" not in self._todo:
                self._later(
                    "touch", lambda: self.session.move_tip(x_mm=x, y_mm=y, depth_mm=depth), TOUCH_EVERY_S
                )
