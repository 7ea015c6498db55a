"""Panels of the page: editable fields and buttons on the left, results on the right.

The buttons start `optopad improve` and `optopad run`, open the report, and export the picture. The results are the last
message, verdict, pairs under the tip, map, pinned designs, and sensor.
"""

from __future__ import annotations

import math
import time
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import viser

from optopad.cad.mesh import png_bytes
from optopad.design.errors import OptopadError
from optopad.design.held_object import KINDS, HeldObject, held_of
from optopad.design.shape.cavity import cavity_of
from optopad.fabrication.bundle import bundle_name
from optopad.studio.actions import Ghost, Task
from optopad.studio.drawings import QUANTITIES, curves_svg, map_svg, quantity, readings_svg
from optopad.studio.editable_fields import EditableField, editable_fields_of
from optopad.studio.live import LiveSensor, LiveView
from optopad.studio.sentences import (
    bad_parts,
    curves_title,
    held_html,
    pins_html,
    said_html,
    sensor_html,
    verdict_html,
)
from optopad.studio.session import FIRST_MM, MOST_SIDEWAYS_MM, Session
from optopad.studio.workshop import Curves, Failed, LiveVerdict, Look, Progress, Readings, Result

PICTURE_S = 20.0
LEAST_PX = (800, 600)


class BackgroundJobs:
    """Actions of the page's buttons.

    Parameters
    ----------
    server : the page's server
    session, task : session with the present design, and runner of tasks
    changed : called when a task begins or ends
    found : called with the alternatives that `optopad improve` found
    """

    def __init__(
        self,
        server: viser.ViserServer,
        session: Session,
        task: Task,
        *,
        changed: Callable[[], None],
        found: Callable[[tuple[Ghost, ...]], None],
    ) -> None:
        self._server, self._session, self._task = server, session, task
        self._changed, self._found = changed, found

    def improve(self) -> None:
        """Search for verified alternatives with `optopad improve`."""

        def done(ghosts: tuple[Ghost, ...]) -> None:
            self._found(ghosts)
            self._changed()

        self._begin(lambda: self._task.improve(self._session.design, done))

    def build(self) -> None:
        """Make the whole bundle with `optopad run`."""
        self._begin(lambda: self._task.build(self._session.design, lambda _folder: self._changed()))

    def end(self) -> None:
        """End the running task."""
        if not self._task.is_running:
            self._session.say("no running job")
        self._task.end()
        self._changed()

    def open_report(self) -> None:
        """Open the report of the design's bundle in the browser of this machine."""
        report = self._task.out / bundle_name(self._session.design) / "report.html"
        if not report.is_file():
            self._session.say("no report of this design yet: make the bundle first", is_bad=True)
            return
        webbrowser.open(report.absolute().as_uri())
        self._session.say(f"opened: {report}")

    def export_picture(self) -> None:
        """Save the 3D picture as the browser shows it, as a PNG file in the folder of the bundles."""
        clients = list(self._server.get_clients().values())
        if not clients:
            self._session.say("no open page to take a picture of", is_bad=True)
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
        target = self._task.out / f"{self._session.design.name}-{time.strftime('%Y%m%d-%H%M%S')}.png"
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
            self._session.say(f"not started: {self._session.now.errors[0]}", is_bad=True)
        elif not start():
            self._session.say("one job at a time: end the running job first", is_bad=True)
        self._changed()


Later = Callable[[str, Callable[[], object], float], None]
NO_GHOST, NO_PIN = "none", "…"


class AnswersPanel:
    """The right panel with the results.

    Parameters
    ----------
    gui : viser's interface for panel elements
    session : the present design
    live : a sensor, or None
    later : schedules a call on the page's thread after some seconds; a newer call with the same name replaces it
    redraw_map : called when another quantity is selected
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
            "alternatives", (NO_GHOST,), visible=False, hint="Verified designs of improve: load one."
        )
        self._choose.on_update(lambda _event: later("ghost", self._take_chosen, 0.0))
        self._curves_title, self._curves = gui.add_html(""), gui.add_html("")
        self._quantity = gui.add_dropdown(
            "map of",
            QUANTITIES,
            initial_value=QUANTITIES[0],
            hint="Quantity shown at each location of the pad.",
        )
        self._quantity.on_update(lambda _event: redraw_map())
        self._map, self._pins = gui.add_html(""), gui.add_html("")
        self._back = gui.add_dropdown(
            "go back to", (NO_PIN,), visible=False, hint="Load a pinned design again."
        )
        self._back.on_update(lambda _event: later("pin", self._take_pin, 0.0))

    def _add_sensor(self, gui: viser.GuiApi, live: LiveSensor | None) -> None:
        self._sensor = gui.add_html("", visible=live is not None)
        self._readings = gui.add_html("", visible=live is not None)
        self._follows = gui.add_checkbox(
            "tip follows touch",
            True,
            visible=live is not None,
            hint="The press follows the touch that the sensor detects.",
        )
        if live is not None:
            rebase = gui.add_button("New baseline: do not touch the pad")
            rebase.on_click(lambda _event: live.rebase())

    @property
    def follows_touch(self) -> bool:
        """Whether the press follows the sensor's touch."""
        return bool(self._follows.value)

    def draw_words(self, answers: Mapping[type, Result], judged: Mapping[str, LiveVerdict]) -> None:
        """Show message, verdict and pinned designs."""
        session, now = self._session, self._session.now
        failed, progress = answers.get(Failed), answers.get(Progress)
        why_not = failed.text if isinstance(failed, Failed) and failed.digest == now.design.digest else ""
        found = judged.get(now.design.digest) or answers.get(LiveVerdict)
        self._said.content = said_html(session.said, words=now.words, is_saved=session.is_saved)
        self._verdict.content = verdict_html(
            now,
            found if isinstance(found, LiveVerdict) else None,
            why_not,
            progress if isinstance(progress, Progress) else None,
        )
        self._pins.content = pins_html(session.pinned, now, judged)
        self._back.visible = bool(session.pinned)
        _offer(
            self._back,
            (NO_PIN, *(f"pin {k + 1}: {_short(one.design.digest)}" for k, one in enumerate(session.pinned))),
        )

    def draw_curves(self, answers: Mapping[type, Result]) -> None:
        """Show the signals of the pairs under the tip; curves of an earlier design are faint."""
        curves, look, press = answers.get(Curves), answers.get(Look), self._session.press
        if not press.is_single_tip:
            self._draw_changes(answers)
            return
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

    def _draw_changes(self, answers: Mapping[type, Result]) -> None:
        """Show the readings under the object or the tips that press; those of an earlier design are faint."""
        look, found, press = answers.get(Look), answers.get(Readings), self._session.press
        cavity = cavity_of(self._session.design)
        names = [part.name for part in cavity.emitters], [part.name for part in cavity.receivers]
        self._curves_title.content = self._curves.content = ""
        if (
            Failed in answers
            or not isinstance(look, Look)
            or look.press.is_single_tip
            or not isinstance(found, Readings)
            or found.changes is None
            or found.changes.shape != tuple(map(len, names))
        ):
            return
        is_old = found.digest != self._session.design.digest or type(look.press.held) is not type(press.held)
        drawing = readings_svg(*names, found.pressed, found.untouched, words=("pressed", "untouched"))
        self._curves_title.content = held_html(look, found.changes, cavity)
        self._curves.content = _padded(drawing, ";opacity:0.4" if is_old else "")

    def draw_map(self, judged: Mapping[str, LiveVerdict]) -> None:
        """Show the selected quantity at each location of the pad."""
        now = self._session.now
        found = judged.get(now.design.digest)
        try:
            cavity = cavity_of(now.design)
        except OptopadError:
            return
        shown = None if found is None else quantity(str(self._quantity.value), found.score)
        self._map.content = _padded(map_svg(cavity, shown, self._session.press, bad_parts(now, cavity.parts)))

    def offer_ghosts(self, ghosts: tuple[Ghost, ...]) -> None:
        """Offer the alternatives that `optopad improve` found, for selection."""
        self._ghosts = ghosts
        self._choose.visible = bool(ghosts)
        _offer(self._choose, (NO_GHOST, *(_title(number, ghost) for number, ghost in enumerate(ghosts))))

    def draw_sensor(self, view: LiveView, answers: Mapping[type, Result], bad: Sequence[str]) -> None:
        """Show the state of the connection, and every pair's live and simulated reading."""
        self._sensor.content = sensor_html(view)
        if view.signals is None:
            return
        found = answers.get(Readings)
        simulated = found.pressed if isinstance(found, Readings) else view.expected
        if simulated is not None and simulated.shape != view.signals.shape:  # another layout now
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


TYPED_S = 0.35
"""Time without a keystroke after which typing counts as finished [s]; a field reports every keystroke."""
GROUPS = ("Pad", "Layout", "Parts", "Press", "Material", "Signal")
OPEN = ("Pad", "Layout", "Parts")
MOLDS = ("hidden", "cut", "whole")
OWN_TIP = "own tip"
PRESSED_BY = {
    OWN_TIP: "",
    **{kind: held_of(kind).line for kind in KINDS if kind not in ("box", "mesh")},
    **{f"box {pose}": held_of(f"box,pose={pose}").line for pose in ("face", "edge", "corner")},
    "mesh": "mesh,file=part.stl,units=mm",
}
"""What can press the pad, and the line with which it starts."""


class Controls:
    """The left panel: fields of the design, the press, and buttons, synchronised with the session.

    Parameters
    ----------
    gui : viser's interface for panel elements
    session : receives the edits
    later : schedules a call on the page's thread after some seconds; a newer call with the same name replaces it
    redraw : called when a setting changes the picture but not the design
    buttons : actions of the buttons
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        session: Session,
        *,
        later: Later,
        redraw: Callable[[], None],
        buttons: BackgroundJobs,
    ) -> None:
        self._gui, self._session, self._later, self._redraw = gui, session, later, redraw
        self._folders: dict[str, viser.GuiFolderHandle] = {}
        self._fields: dict[str, tuple[EditableField, Any]] = {}
        self._signature: dict[str, tuple[Any, ...]] = {}
        self._typing: set[str] = set()
        self._shown_held: HeldObject | None = None
        self._held_of_line: HeldObject | None = None
        self._add_file(session.file.default_name)
        self._add_press()
        for group in GROUPS:
            self._folders[group] = gui.add_folder(group, expand_by_default=group in OPEN)
        self._add_buttons(buttons)
        self._add_picture()

    @property
    def shows_rays(self) -> bool:
        """Whether to show sample rays."""
        return bool(self._rays.value)

    @property
    def mold(self) -> str:
        """How to draw the mold: one of `MOLDS`."""
        return str(self._mold.value)

    @property
    def moves_rows(self) -> bool:
        """Whether dragging a component moves its whole row."""
        return bool(self._row.value)

    @property
    def is_dark(self) -> bool:
        """Whether the page has the dark theme."""
        return bool(self._dark.value)

    @property
    def file_name(self) -> str:
        """The file name for saving, as typed."""
        return str(self._name.value)

    def follow(self) -> None:
        """Show the session's values; fields that the user is typing in are not changed."""
        design, press = self._session.design, self._session.press
        for group in GROUPS:
            self._follow_group(group, [field for field in editable_fields_of(design) if field.group == group])
        space = cavity_of(design).workspace
        ends = ((space.x0_mm, space.x1_mm), (space.y0_mm, space.y1_mm), (0.0, design.operating.max_depth_mm))
        self._follow_object()
        self._second.value, second = press.second_mm is not None, press.second_mm
        for slider in self._second_sliders:
            slider.visible = second is not None
        for sliders, tip in ((self._sliders, press.tips_mm[0]), (self._second_sliders, press.tips_mm[-1])):
            for slider, (low, high), value in zip(sliders, ends, tip, strict=True):
                if high <= low:
                    continue
                if slider.min != low or slider.max != high:
                    slider.min, slider.max = min(low, slider.value), max(high, slider.value)
                    slider.value = min(max(value, low), high)
                    slider.min, slider.max = low, high
                elif abs(slider.value - value) > 1e-6:
                    slider.value = value

    def _add_file(self, name: str) -> None:
        gui = self._gui
        actions = {
            "Undo": (self._session.undo, "Z", "cmd/ctrl"),
            "Redo": (self._session.redo, "Z", "cmd/ctrl+shift"),
            "Save": (lambda: self._session.save(self.file_name), "S", "cmd/ctrl"),
            "Pin": (self._session.pin, "P", "cmd/ctrl"),
        }
        for label, names in (("history", ("Undo", "Redo")), ("this design", ("Save", "Pin"))):
            self._button_row(label, names, actions)
        self._name = gui.add_text(
            "save as", name, hint="Name of the file to write in the design's folder, ending in .toml."
        )
        for label, (do, key, modifier) in actions.items():
            self._hotkey(label, do, key, modifier)

    def _button_row(self, label: str, names: tuple[str, ...], actions: dict[str, Any]) -> None:
        group = self._gui.add_button_group(label, names)

        def pressed(_event: object) -> None:
            chosen = str(group.value)
            self._later(f"button {chosen}", actions[chosen][0], 0.0)

        group.on_click(pressed)

    def _hotkey(self, label: str, do: Callable[[], object], key: Any, modifier: Any) -> None:
        command = self._gui.add_command(label, hotkey=key, modifier=modifier)
        command.on_trigger(lambda _event: self._later(f"button {label}", do, 0.0))

    def _add_press(self) -> None:
        gui, press, design = self._gui, self._session.press, self._session.design
        space = cavity_of(design).workspace
        with gui.add_folder("Tip"):
            drag, shift = "Or drag the tip; click the pad to jump.", "Or shift-drag the tip."
            self._pressed_by: Any = gui.add_dropdown(
                "pressed by", tuple(PRESSED_BY), initial_value=OWN_TIP, hint="What presses the pad."
            )
            self._line: Any = gui.add_text(
                "object",
                "",
                multiline=True,
                visible=False,
                hint="Kind and sizes [mm], angles [deg], as --object takes them.",
            )
            self._pressed_by.on_update(self._choose_object)
            self._line.on_update(self._type_object)
            ends = {
                "x": (space.x0_mm, space.x1_mm, press.x_mm),
                "y": (space.y0_mm, space.y1_mm, press.y_mm),
                "depth": (0.0, design.operating.max_depth_mm, press.depth_mm),
            }
            hints = {"x": drag, "y": drag, "depth": shift}
            self._sliders = [
                self._slider(axis, *of, hints[axis], self._session.move_tip) for axis, of in ends.items()
            ]
            self._second: Any = gui.add_checkbox(
                "second touch", False, hint="A second tip of the same kind presses at the same time."
            )
            self._second.on_update(self._choose_second)
            self._second_sliders = [
                self._slider(f"second {axis}", *of, "Or drag the second tip.", self._session.move_second)
                for axis, of in ends.items()
            ]
            turn = "Or control-drag the object."
            self._angles = {
                name: self._angle_slider(name, turn if name == "yaw" else "")
                for name in ("yaw", "pitch", "roll")
            }
            self._sideways = [
                self._sideways_slider("x", "Moves it after the press; or drag it with control and shift."),
                self._sideways_slider("y", ""),
            ]
            self._rays: Any = gui.add_checkbox(
                "sample rays", False, hint="Paths of the nearest pairs' light, by kind."
            )
            self._rays.on_update(lambda _event: self._redraw())
            self._row = gui.add_checkbox(
                "move whole rows", False, hint="A dragged part moves its row: pitch or shift."
            )

    def _slider(
        self, axis: str, low: float, high: float, value: float, hint: str, move: Callable[..., None]
    ) -> Any:
        name = f"{axis.split()[-1]}_mm"
        slider = self._gui.add_slider(
            f"{axis} [mm]",
            min=low,
            max=max(high, low + 0.01),
            step=0.05,
            initial_value=min(max(value, low), high),
            hint=hint,
        )

        def moved(event: Any) -> None:
            if event.client is None:  # set by the page itself
                return
            wanted = float(slider.value)
            self._later(f"tip {axis}", lambda: move(**{name: wanted}), 0.0)

        slider.on_update(moved)
        return slider

    def _angle_slider(self, name: str, hint: str) -> Any:
        slider = self._gui.add_slider(
            f"{name} [deg]", min=-180.0, max=180.0, step=1.0, initial_value=0.0, visible=False, hint=hint
        )

        def turned(event: Any) -> None:
            if event.client is None:
                return
            wanted = float(slider.value)
            self._later(f"turn {name}", lambda: self._session.turn(**{name: wanted}), 0.0)

        slider.on_update(turned)
        return slider

    def _sideways_slider(self, axis: str, hint: str) -> Any:
        most = MOST_SIDEWAYS_MM
        slider = self._gui.add_slider(
            f"sideways {axis} [mm]",
            min=-most,
            max=most,
            step=0.01,
            initial_value=0.0,
            visible=False,
            hint=hint,
        )

        def sheared(event: Any) -> None:
            if event.client is None:
                return
            wanted = float(slider.value)
            self._later(f"sideways {axis}", lambda: self._session.shear(**{f"{axis}_mm": wanted}), 0.0)

        slider.on_update(sheared)
        return slider

    def _choose_second(self, event: Any) -> None:
        if event.client is not None:
            is_on = bool(self._second.value)
            self._later("second", lambda: self._session.add_second(is_on), 0.0)

    def _choose_object(self, event: Any) -> None:
        if event.client is not None:
            line = PRESSED_BY[str(self._pressed_by.value)]
            self._line.value, self._line.visible = line, bool(line)
            self._later("object", lambda: self._begin_with(line), 0.0)

    def _begin_with(self, line: str) -> None:
        if line:
            self._session.move_tip(depth_mm=min(self._session.press.depth_mm, FIRST_MM))
        self._session.hold(line)

    def _type_object(self, event: Any) -> None:
        if event.client is not None:
            self._later("object", self._take_line, TYPED_S)

    def _take_line(self) -> None:
        """Press by the object of the line, which stays as typed; an empty line is being typed."""
        if str(self._line.value).strip() and self._session.hold(str(self._line.value)):
            self._held_of_line = self._session.press.held

    def _follow_object(self) -> None:
        """Show the object that presses; a line that was rejected is kept until there is another object."""
        held = self._session.press.held
        for slider, value in zip(self._sideways, self._session.press.sideways_mm, strict=True):
            slider.visible, slider.value = held is not None, value
        self._rays.visible = self._session.press.is_single_tip  # they are traced under one tip
        if held == self._shown_held:
            return
        self._shown_held = held
        self._line.visible = held is not None
        if held is not None and held != self._held_of_line:
            self._line.value, self._held_of_line = held.line, held
        kind = OWN_TIP if held is None else f"{held.kind} {getattr(held, 'pose', '')}".strip()
        self._pressed_by.value = kind
        for name, slider in self._angles.items():
            slider.visible = held is not None
            slider.value = 0.0 if held is None else math.remainder(getattr(held, name), 360.0)

    def _follow_group(self, group: str, fields: list[EditableField]) -> None:
        signature = tuple((field.path, field.kind, field.choices) for field in fields)
        if self._signature.get(group) != signature:
            self._signature[group] = signature
            for path in [path for path, (field, _) in self._fields.items() if field.group == group]:
                self._fields.pop(path)[1].remove()
            with self._folders[group]:
                for field in fields:
                    self._fields[field.path] = (field, self._field(field))
            return
        for field in fields:
            _, handle = self._fields[field.path]
            self._fields[field.path] = (field, handle)
            if field.path not in self._typing and handle.value != field.value:
                handle.value = field.value

    def _field(self, field: EditableField) -> Any:
        label = f"{field.label} [{field.unit}]" if field.unit else field.label
        hint = f"{field.tells}{_range(field)} ({field.path})"
        if field.kind == "choice":
            handle: Any = self._gui.add_dropdown(
                label, field.choices, initial_value=str(field.value), hint=hint
            )
        elif field.kind == "whole":
            handle = self._gui.add_number(label, int(field.value), step=1, hint=hint)
        else:
            handle = self._gui.add_number(label, float(field.value), step=_fine(field.step), hint=hint)
        path = field.path

        def typed(event: Any) -> None:
            if event.client is None:
                return
            self._typing.add(path)
            self._later(f"field {path}", lambda: self._take(path), 0.0 if field.kind == "choice" else TYPED_S)

        handle.on_update(typed)
        return handle

    def _take(self, path: str) -> None:
        self._typing.discard(path)
        if path in self._fields:
            self._session.set_field(path, self._fields[path][1].value)

    def _add_buttons(self, buttons: BackgroundJobs) -> None:
        with self._gui.add_folder("Tasks"):
            self._button("Improve", "improve", buttons.improve)
            self._button("Make the bundle", "build", buttons.build)
            self._button("Open the report", "report", buttons.open_report)
            self._button("Export picture", "picture", buttons.export_picture)
            self._button("End the job", "end", buttons.end)

    def _button(self, label: str, name: str, do: Callable[[], object]) -> None:
        self._gui.add_button(label).on_click(lambda _event: self._later(f"do {name}", do, 0.0))

    def _add_picture(self) -> None:
        with self._gui.add_folder("Picture", expand_by_default=False):
            self._mold = self._gui.add_dropdown(
                "mold", MOLDS, initial_value="hidden", hint="The mold as printed."
            )
            self._mold.on_update(lambda _event: self._redraw())
            self._dark = self._gui.add_checkbox("dark page", False)
            self._dark.on_update(lambda _event: self._redraw())


def _range(field: EditableField) -> str:
    if field.low is None and field.high is None:
        return ""
    low = "any" if field.low is None else f"{field.low:g}"
    high = "any" if field.high is None else f"{field.high:g}"
    return f" From {low} to {high}{f' {field.unit}' if field.unit else ''}."


def _fine(step: float) -> float:
    """A step that is fine enough that typed values are not rounded."""
    return step if step < 0.01 else 0.01 if step < 1.0 else 0.1 if step < 10 else 1.0
