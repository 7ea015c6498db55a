"""The right panel: what was said, the verdict, the pairs under the tip, the map, pinned designs, the sensor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import viser

from design.errors import OptopadError
from design.shape.cavity import cavity_of
from optopad.studio.actions import Ghost
from optopad.studio.answers import Answer, Curves, Doing, Failed, Judged, Look, Readings
from optopad.studio.drawings import QUANTITIES, curves_svg, map_svg, quantity, readings_svg
from optopad.studio.live import LiveSensor, LiveView
from optopad.studio.sentences import bad_parts, curves_title, pins_html, said_html, sensor_html, verdict_html
from optopad.studio.session import Session

Later = Callable[[str, Callable[[], object], float], None]
NO_GHOST, NO_PIN = "none", "…"


class AnswersPanel:
    """What the page tells.

    Parameters
    ----------
    gui : of the page
    session : what is on the table
    live : a sensor; None: none
    later : keeps a call for the page's thread, the newest of a name, after some seconds
    redraw_map : is called when another quantity is wanted
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        session: Session,
        live: LiveSensor | None,
        *,
        later: Later,
        redraw_map: Callable[[], None],
    ) -> None:
        self._session, self._later = session, later
        self._ghosts: tuple[Ghost, ...] = ()
        built = cavity_of(session.file.saved)
        self._built = [part.name for part in built.emitters], [part.name for part in built.receivers]
        self._said, self._verdict = gui.add_html(""), gui.add_html("")
        self._add_sensor(gui, live)
        self._choose = gui.add_dropdown(
            "alternatives", (NO_GHOST,), visible=False, hint="Verified by improve: one of them on the table."
        )
        self._choose.on_update(lambda _event: later("ghost", self._take_chosen, 0.0))
        self._curves_title, self._curves = gui.add_html(""), gui.add_html("")
        self._quantity = gui.add_dropdown(
            "map of", QUANTITIES, initial_value=QUANTITIES[0], hint="What each place of the pad says."
        )
        self._quantity.on_update(lambda _event: redraw_map())
        self._map, self._pins = gui.add_html(""), gui.add_html("")
        self._back = gui.add_dropdown(
            "go back to", (NO_PIN,), visible=False, hint="A pinned design on the table again."
        )
        self._back.on_update(lambda _event: later("pin", self._take_pin, 0.0))

    def _add_sensor(self, gui: viser.GuiApi, live: LiveSensor | None) -> None:
        self._sensor = gui.add_html("", visible=live is not None)
        self._readings = gui.add_html("", visible=live is not None)
        self._follows = gui.add_checkbox(
            "tip follows touch",
            True,
            visible=live is not None,
            hint="The press is where the sensor feels one.",
        )
        if live is not None:
            rebase = gui.add_button("New baseline: leave the pad alone")
            rebase.on_click(lambda _event: live.rebase())

    @property
    def follows_touch(self) -> bool:
        """Whether the press goes where the sensor feels one."""
        return bool(self._follows.value)

    def draw_words(self, answers: Mapping[type, Answer], judged: Mapping[str, Judged]) -> None:
        """Message, verdict, pinned designs."""
        session, now = self._session, self._session.now
        failed, doing = answers.get(Failed), answers.get(Doing)
        why_not = failed.text if isinstance(failed, Failed) and failed.digest == now.design.digest else ""
        found = judged.get(now.design.digest) or answers.get(Judged)
        self._said.content = said_html(session.said, words=now.words, is_saved=session.is_saved)
        self._verdict.content = verdict_html(
            now,
            found if isinstance(found, Judged) else None,
            why_not,
            doing if isinstance(doing, Doing) else None,
        )
        self._pins.content = pins_html(session.pinned, now, judged)
        self._back.visible = bool(session.pinned)
        _offer(
            self._back,
            (NO_PIN, *(f"pin {k + 1}: {_short(one.design.digest)}" for k, one in enumerate(session.pinned))),
        )

    def draw_curves(self, answers: Mapping[type, Answer]) -> None:
        """Pairs under the tip; those of an earlier design are faint."""
        curves, look, press = answers.get(Curves), answers.get(Look), self._session.press
        if not isinstance(curves, Curves):
            return
        force = look.force_n if isinstance(look, Look) and look.press == press else None
        is_old = curves.digest != self._session.design.digest
        self._curves_title.content = curves_title(
            curves.found.place_mm,
            is_draft=curves.found.is_draft,
            force_n=force,
            depth_mm=press.depth_mm,
            is_old=is_old,
        )
        faint = ";opacity:0.4" if is_old else ""
        self._curves.content = _padded(curves_svg(curves.found, press.depth_mm), faint)

    def draw_map(self, judged: Mapping[str, Judged]) -> None:
        """The chosen quantity, place by place."""
        now = self._session.now
        found = judged.get(now.design.digest)
        try:
            cavity = cavity_of(now.design)
        except OptopadError:
            return
        shown = None if found is None else quantity(str(self._quantity.value), found.score)
        self._map.content = _padded(map_svg(cavity, shown, self._session.press, bad_parts(now, cavity.parts)))

    def offer_ghosts(self, ghosts: tuple[Ghost, ...]) -> None:
        """Alternatives to choose from."""
        self._ghosts = ghosts
        self._choose.visible = bool(ghosts)
        _offer(self._choose, (NO_GHOST, *(_title(number, ghost) for number, ghost in enumerate(ghosts))))

    def draw_sensor(self, view: LiveView, answers: Mapping[type, Answer], bad: Sequence[str]) -> None:
        """The line's state, and every pair's reading beside its simulated one."""
        self._sensor.content = sensor_html(view)
        if view.signals is None:
            return
        found = answers.get(Readings)
        simulated = found.pressed if isinstance(found, Readings) else view.expected
        if simulated is not None and simulated.shape != view.signals.shape:  # another layout is on the table
            simulated = None
        self._readings.content = _padded(
            readings_svg(*self._built, view.signals.astype(np.float64), simulated, bad)
        )

    def _take_chosen(self) -> None:
        for number, ghost in enumerate(self._ghosts):
            if str(self._choose.value) == _title(number, ghost):
                self._session.take(ghost.design, f"taken: {ghost.kind}")

    def _take_pin(self) -> None:
        for one in self._session.pinned:
            if str(self._back.value).endswith(_short(one.design.digest)):
                self._session.take(one.design, f"pinned design {_short(one.design.digest)} again")


def _title(number: int, ghost: Ghost) -> str:
    return f"{number + 1}: {ghost.kind}"


def _short(digest: str) -> str:
    return digest[:8]


def _offer(dropdown: viser.GuiDropdownHandle[str], options: tuple[str, ...]) -> None:
    if tuple(dropdown.options) != options:
        dropdown.options = options


def _padded(svg: str, style: str = "") -> str:
    return f'<div style="padding:0 6px{style}">{svg}</div>'
