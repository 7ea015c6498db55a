"""The left panel: what can be changed, and the buttons."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from design.shape.cavity import cavity_of
from optopad.studio.knobs import Knob, knobs_of
from optopad.studio.session import Session
from optopad.studio.view.doing import Doing

TYPED_S = 0.35
"""Typing is taken for done after so long without a key [s]: a field tells every key."""
GROUPS = ("Pad", "Layout", "Parts", "Press", "Material", "Signal")
OPEN = ("Pad", "Layout", "Parts")
MOLDS = ("hidden", "cut", "whole")


class Controls:
    """Fields of the design, the press, and buttons; kept in step with the session.

    Parameters
    ----------
    gui : of the page
    session : takes the edits
    later : keeps a call for the page's thread, the newest of a name, after some seconds
    redraw : is called when only the picture changes
    buttons : what they do
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        session: Session,
        *,
        later: Callable[[str, Callable[[], object], float], None],
        redraw: Callable[[], None],
        buttons: Doing,
    ) -> None:
        self._gui, self._session, self._later, self._redraw = gui, session, later, redraw
        self._folders: dict[str, viser.GuiFolderHandle] = {}
        self._fields: dict[str, tuple[Knob, Any]] = {}
        self._signature: dict[str, tuple[Any, ...]] = {}
        self._typing: set[str] = set()
        self._add_file(session.file.default_name)
        self._add_press()
        for group in GROUPS:
            self._folders[group] = gui.add_folder(group, expand_by_default=group in OPEN)
        self._add_buttons(buttons)
        self._add_picture()

    @property
    def shows_rays(self) -> bool:
        """Whether sample rays are wanted."""
        return bool(self._rays.value)

    @property
    def mold(self) -> str:
        """How the mold is drawn, of `MOLDS`."""
        return str(self._mold.value)

    @property
    def moves_rows(self) -> bool:
        """Whether a dragged part takes its row along."""
        return bool(self._row.value)

    @property
    def is_dark(self) -> bool:
        """Whether the page is dark."""
        return bool(self._dark.value)

    @property
    def file_name(self) -> str:
        """The name to save under."""
        return str(self._name.value)

    def follow(self) -> None:
        """Show the session's values; fields that are being typed in are left alone."""
        design, press = self._session.design, self._session.press
        for group in GROUPS:
            self._follow_group(group, [knob for knob in knobs_of(design) if knob.group == group])
        space = cavity_of(design).workspace
        ends = ((space.x0_mm, space.x1_mm), (space.y0_mm, space.y1_mm), (0.0, design.operating.max_depth_mm))
        values = (press.x_mm, press.y_mm, press.depth_mm)
        for slider, (low, high), value in zip(self._sliders, ends, values, strict=True):
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

        def triggered(_event: object) -> None:
            self._later(f"button {label}", do, 0.0)

        command.on_trigger(triggered)

    def _add_press(self) -> None:
        gui, press, design = self._gui, self._session.press, self._session.design
        space = cavity_of(design).workspace
        with gui.add_folder("Tip"):
            spans = (
                (
                    "x [mm]",
                    space.x0_mm,
                    space.x1_mm,
                    press.x_mm,
                    "x_mm",
                    "Or drag the tip; click the pad to jump.",
                ),
                (
                    "y [mm]",
                    space.y0_mm,
                    space.y1_mm,
                    press.y_mm,
                    "y_mm",
                    "Or drag the tip; click the pad to jump.",
                ),
                (
                    "depth [mm]",
                    0.0,
                    design.operating.max_depth_mm,
                    press.depth_mm,
                    "depth_mm",
                    "Or shift-drag the tip.",
                ),
            )
            self._sliders = tuple(
                self._slider(label, low, high, value, name, hint)
                for label, low, high, value, name, hint in spans
            )
            self._rays = gui.add_checkbox(
                "sample rays", False, hint="Paths of the nearest pairs' light, by kind."
            )
            self._rays.on_update(lambda _event: self._redraw())
            self._row = gui.add_checkbox(
                "move whole rows", False, hint="A dragged part takes its row along: pitch or shift."
            )

    def _slider(self, label: str, low: float, high: float, value: float, name: str, hint: str) -> Any:
        slider = self._gui.add_slider(
            label,
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
            self._later(f"tip {name}", lambda: self._session.move_tip(**{name: wanted}), 0.0)

        slider.on_update(moved)
        return slider

    def _follow_group(self, group: str, knobs: list[Knob]) -> None:
        signature = tuple((knob.path, knob.kind, knob.choices) for knob in knobs)
        if self._signature.get(group) != signature:
            self._signature[group] = signature
            for path in [path for path, (knob, _) in self._fields.items() if knob.group == group]:
                self._fields.pop(path)[1].remove()
            with self._folders[group]:
                for knob in knobs:
                    self._fields[knob.path] = (knob, self._field(knob))
            return
        for knob in knobs:
            _, handle = self._fields[knob.path]
            self._fields[knob.path] = (knob, handle)
            if knob.path not in self._typing and handle.value != knob.value:
                handle.value = knob.value

    def _field(self, knob: Knob) -> Any:
        label = f"{knob.label} [{knob.unit}]" if knob.unit else knob.label
        hint = f"{knob.tells}{_range(knob)} ({knob.path})"
        if knob.kind == "choice":
            handle: Any = self._gui.add_dropdown(
                label, knob.choices, initial_value=str(knob.value), hint=hint
            )
        elif knob.kind == "whole":
            handle = self._gui.add_number(label, int(knob.value), step=1, hint=hint)
        else:
            handle = self._gui.add_number(label, float(knob.value), step=_fine(knob.step), hint=hint)
        path = knob.path

        def typed(event: Any) -> None:
            if event.client is None:
                return
            self._typing.add(path)
            self._later(f"field {path}", lambda: self._take(path), 0.0 if knob.kind == "choice" else TYPED_S)

        handle.on_update(typed)
        return handle

    def _take(self, path: str) -> None:
        self._typing.discard(path)
        if path in self._fields:
            self._session.set_field(path, self._fields[path][1].value)

    def _add_buttons(self, buttons: Doing) -> None:
        with self._gui.add_folder("Do"):
            for label, name, do in (
                ("Improve", "improve", buttons.improve),
                ("Build the bundle", "build", buttons.build),
                ("Open the report", "report", buttons.open_report),
                ("Export picture", "picture", buttons.export_picture),
                ("End what runs", "end", buttons.end),
            ):
                self._button(label, name, do)

    def _button(self, label: str, name: str, do: Callable[[], object]) -> None:
        button = self._gui.add_button(label)

        def clicked(_event: object) -> None:
            self._later(f"do {name}", do, 0.0)

        button.on_click(clicked)

    def _add_picture(self) -> None:
        with self._gui.add_folder("Picture", expand_by_default=False):
            self._mold = self._gui.add_dropdown(
                "mold", MOLDS, initial_value="hidden", hint="As it is printed."
            )
            self._mold.on_update(lambda _event: self._redraw())
            self._dark = self._gui.add_checkbox("dark page", False)
            self._dark.on_update(lambda _event: self._redraw())


def _range(knob: Knob) -> str:
    if knob.low is None and knob.high is None:
        return ""
    low = "any" if knob.low is None else f"{knob.low:g}"
    high = "any" if knob.high is None else f"{knob.high:g}"
    return f" From {low} to {high}{f' {knob.unit}' if knob.unit else ''}."


def _fine(step: float) -> float:
    """A step with so many decimals that a typed value is not cut."""
    return step if step < 0.01 else 0.01 if step < 1.0 else 0.1 if step < 10 else 1.0
