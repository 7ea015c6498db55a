"""State of the studio: the edited design with its history, the press, pinned designs, and the last message.

    edit ──► rejected by the schema: nothing changes, a message says why
        └──► a new version; broken rules are findings: shown in red, not judged, not saved

Every change is reported to the listeners, in the thread that made it. The module has no browser and no physics.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from optopad.design.errors import InputError, OptopadError
from optopad.design.fields.base import is_value
from optopad.design.fields.finding import Finding
from optopad.design.held_object import HeldObject, held_of
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of, workspace_of
from optopad.design.spec import SensorDesign
from optopad.screen.verdict_sentences import changes_words
from optopad.studio.design_file import DesignFile
from optopad.studio.editable_fields import changes_of
from optopad.studio.moves import moved, part_named

MERGE_S = 1.5
"""Time within which consecutive edits of one field count as one step of the history [s]."""
MOST_VERSIONS = 500
MOST_SIDEWAYS_MM = 1.0
"""Longest sideways motion of an object along x and along y [mm]."""
FIRST_MM = 1.0
"""Depth with which objects and two tips start at most [mm]; the contact model covers it on most pads, also at edges."""
FIRST_APART = 3.0
"""Distance at which a second tip starts if there is room [tip radii]."""
Tip = tuple[float, float, float]
"""Location (x, y) and depth of a tip in the coordinate system of the cavity [mm]."""


@dataclass(frozen=True, kw_only=True)
class Version:
    """One step of the history.

    Attributes
    ----------
    design : the design after the step
    findings : findings of the design rules
    words : description of the change, for display
    """

    design: SensorDesign
    findings: tuple[Finding, ...]
    words: str

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that prevent fabrication, a verdict and saving."""
        return tuple(one for one in self.findings if one.severity == "error")


@dataclass(frozen=True, kw_only=True)
class LivePress:
    """Location (x, y) in the coordinate system of the cavity, depth [mm], and the object that presses.

    The object is None for the design's own tip; its location and depth are those of the press. `sideways_mm` is how far
    the object then moves along the cavity's x and y. `second_mm` is a second tip of the design's radius.
    """

    x_mm: float
    y_mm: float
    depth_mm: float
    held: HeldObject | None = None
    sideways_mm: tuple[float, float] = (0.0, 0.0)
    second_mm: Tip | None = None

    @property
    def is_single_tip(self) -> bool:
        """Whether the design's own tip presses alone."""
        return self.held is None and self.second_mm is None

    @property
    def tips_mm(self) -> tuple[Tip, ...]:
        """The tips that press, one or two."""
        first = (self.x_mm, self.y_mm, self.depth_mm)
        return (first,) if self.second_mm is None else (first, self.second_mm)

    @property
    def place_mm(self) -> tuple[float, float]:
        """(x, y) location in the coordinate system of the cavity [mm]."""
        return self.x_mm, self.y_mm


@dataclass(frozen=True, kw_only=True)
class Said:
    """A message for the user; `is_bad` marks a problem."""

    text: str
    is_bad: bool = False


class Session:
    """The present design with its history; it can be used from several threads.

    Parameters
    ----------
    file : the design file that is edited
    start : the initial design, if `--set` makes it differ from the file

    Raises
    ------
    InputError : the components of the design cannot be placed.
    """

    def __init__(self, file: DesignFile, start: SensorDesign | None = None) -> None:
        self.file = file
        self._lock = threading.RLock()
        self._done = [_version(file.saved, "as in the file")]
        self._undone: list[Version] = []
        self._merge: tuple[str, float] = ("", 0.0)
        self._listeners: list[Callable[[], None]] = []
        self.pinned: tuple[Version, ...] = ()
        self.said = Said(text="")
        size, deepest = file.saved.cavity, file.saved.operating.max_depth_mm
        middle = LivePress(x_mm=size.length_mm / 2, y_mm=size.width_mm / 2, depth_mm=round(0.4 * deepest, 2))
        self.press = self._within(middle)
        if start is not None and start.digest != file.saved.digest:
            self._push(_version(start, "as on the command line"), "")

    @property
    def now(self) -> Version:
        """The present step of the history."""
        return self._done[-1]

    @property
    def design(self) -> SensorDesign:
        """The present design."""
        return self.now.design

    @property
    def is_saved(self) -> bool:
        """Whether the file contains the present design."""
        is_there = self.file.path is not None and self.file.is_in_step
        return is_there and self.design.digest == self.file.saved.digest

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return len(self._done) > 1

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to redo."""
        return bool(self._undone)

    def listen(self, call: Callable[[], None]) -> None:
        """Register a function to call after every change."""
        self._listeners.append(call)

    def set_field(self, path: str, value: Any) -> bool:
        """Set one field; returns False if the value was rejected, in which case a message says why."""
        return self._edit(lambda: changes_of(self.design, path, value), merge=path)

    def move_part(
        self,
        name: str,
        *,
        along_mm: float | None = None,
        angle_deg: float | None = None,
        height_mm: float | None = None,
        x_mm: float | None = None,
        y_mm: float | None = None,
        with_row: bool = False,
    ) -> bool:
        """Move a component to a position on its wall or on the floor, or to a direction on a disc.

        Returns False if the move was rejected; a message then says why.
        """
        where = {
            "along_mm": along_mm,
            "angle_deg": angle_deg,
            "height_mm": height_mm,
            "x_mm": x_mm,
            "y_mm": y_mm,
        }
        return self._edit(
            lambda: moved(self.design, name, **where, with_row=with_row),
            merge=f"move {name}",
            words=lambda design: _place_words(design, name),
        )

    def take(self, design: SensorDesign, words: str) -> None:
        """Make another design the present one, as a step of the history; an equal design adds none.

        Raises
        ------
        InputError : the components of the design cannot be placed.
        """
        with self._lock:
            if design.digest != self.design.digest:
                self._push(_version(design, words), "")
            self._say(words)

    def undo(self) -> None:
        """Undo the last step."""
        with self._lock:
            if self.can_undo:
                last = self._done.pop()
                self._undone.append(last)
                self._settle()
                self._say(f"undone: {last.words}")

    def redo(self) -> None:
        """Redo the step that was undone last."""
        with self._lock:
            if self.can_redo:
                again = self._undone.pop()
                self._done.append(again)
                self._settle()
                self._say(f"redone: {again.words}")

    def move_tip(
        self, *, x_mm: float | None = None, y_mm: float | None = None, depth_mm: float | None = None
    ) -> None:
        """Move the press; it is limited to the workspace and the usable depth range.

        A coordinate that is None stays unchanged.
        """
        with self._lock:
            now = self.press
            self.press = self._within(
                replace(
                    now,
                    x_mm=_hundredth(x_mm, now.x_mm),
                    y_mm=_hundredth(y_mm, now.y_mm),
                    depth_mm=_hundredth(depth_mm, now.depth_mm),
                )
            )
            if self.press != now:
                self._tell()

    def add_second(self, is_on: bool) -> None:
        """Press by a second tip at the same time, or no longer; it takes the place of an object."""
        with self._lock:
            if not is_on:
                self.press = replace(self.press, second_mm=None)
                self._say("pressed by one tip")
                return
            depth = min(self.press.depth_mm, FIRST_MM)
            press = replace(self.press, held=None, sideways_mm=(0.0, 0.0), depth_mm=depth)
            away = FIRST_APART * self.design.indenter.tip_radius_mm
            found = [
                self._within(replace(press, second_mm=(press.x_mm + x * away, press.y_mm + y * away, depth)))
                for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
            ]
            self.press = max(found, key=lambda one: math.dist(*(tip[:2] for tip in one.tips_mm)))
            self._say("pressed by two tips")

    def move_second(
        self, *, x_mm: float | None = None, y_mm: float | None = None, depth_mm: float | None = None
    ) -> None:
        """Move the second tip, if there is one, as `move_tip` moves the first."""
        with self._lock:
            now = self.press
            if now.second_mm is not None:
                x, y, depth = map(_hundredth, (x_mm, y_mm, depth_mm), now.second_mm)
                self.press = self._within(replace(now, second_mm=(x, y, depth)))
            if self.press != now:
                self._tell()

    def hold(self, text: str) -> bool:
        """Press by the object of a text, as `--object` takes it, or by the design's own tip if the text is empty.

        A location or depth in the text moves the press. Returns False if the object was rejected; a message then says
        why.
        """
        with self._lock:
            try:
                held = held_of(text.strip()) if text.strip() else None
            except OptopadError as err:
                self._say(f"not taken: {err}", is_bad=True)
                return False
            if held is None:
                self.press = replace(self.press, held=None, sideways_mm=(0.0, 0.0))
                self._say("pressed by the design's own tip")
                return True
            self.press = replace(
                self.press,
                held=held.model_copy(update={"x": None, "y": None, "depth": None}),
                second_mm=None,
            )
            self.move_tip(x_mm=held.x, y_mm=held.y, depth_mm=held.depth)
            self._say("; ".join([f"pressed by {held.words}", *held.notes]))
            return True

    def turn(self, **angles_deg: float) -> None:
        """Set angles of the object that presses, by name: yaw, pitch, roll; each is rounded to a degree."""
        with self._lock:
            now = self.press
            if now.held is not None:
                whole = {name: math.remainder(round(angle), 360) for name, angle in angles_deg.items()}
                self.press = replace(now, held=now.held.model_copy(update=whole))
            if self.press != now:
                self._tell()

    def shear(self, *, x_mm: float | None = None, y_mm: float | None = None) -> None:
        """Move the object sideways after the press, at most `MOST_SIDEWAYS_MM` each way; None leaves it as it is."""
        with self._lock:
            now = self.press
            if now.held is not None:
                given = zip((x_mm, y_mm), now.sideways_mm, strict=True)
                x, y = (min(max(_hundredth(*one), -MOST_SIDEWAYS_MM), MOST_SIDEWAYS_MM) for one in given)
                self.press = replace(now, sideways_mm=(x, y))
            if self.press != now:
                self._tell()

    def save(self, target: str | None = None) -> bool:
        """Write the design to the file; returns False if it was not written, in which case a message says why."""
        with self._lock:
            if self.now.errors:
                more = f" (and {len(self.now.errors) - 1} more)" if len(self.now.errors) > 1 else ""
                self._say(f"not saved: {self.now.errors[0]}{more}", is_bad=True)
                return False
            try:
                written = self.file.save(self.design, target)
            except (OptopadError, OSError) as err:
                self._say(str(err), is_bad=True)
                return False
            self._say(f"saved: {written}")
            return True

    def look_at_file(self) -> None:
        """Load the file if another program changed it; if it is unusable, a message says so, and the edits remain."""
        with self._lock:
            was_in_step = self.file.is_in_step
            try:
                found = self.file.changed_outside()
                version = None if found is None else _version(found, f"{self.file.path} read again")
            except (OptopadError, OSError) as err:
                self._say(f"{err}; the design here is unchanged, and Save writes it", is_bad=True)
                return
            if version is not None:
                self._push(version, "")
                self._say(
                    f"{self.file.path} was changed outside and is read again; Undo brings your edits back"
                )
            elif self.file.is_in_step and not was_in_step:
                self._say(f"{self.file.path} is readable again")

    def pin(self) -> None:
        """Pin the present design for comparison."""
        with self._lock:
            if all(one.design.digest != self.design.digest for one in self.pinned):
                self.pinned = (*self.pinned, self.now)[-4:]
                self._say(f"pinned: {self.design.digest[:8]}")

    def say(self, text: str, *, is_bad: bool = False) -> None:
        """Show a message to the user."""
        with self._lock:
            self._say(text, is_bad=is_bad)

    def _edit(
        self,
        changes: Callable[[], dict[str, Any]],
        *,
        merge: str,
        words: Callable[[SensorDesign], str] | None = None,
    ) -> bool:
        with self._lock:
            try:
                wanted = changes()
                if not wanted:
                    return True
                design = self.design.with_(**wanted)
                told = _words(self._before(merge), wanted) if words is None else words(design)
                version = _version(design, told)
            except (OptopadError, OSError) as err:
                self._say(f"not taken: {_first_fault(err)}", is_bad=True)
                return False
            if design.digest != self.design.digest:
                self._push(version, merge)
                self._say(told)
            return True

    def _is_going_on(self, merge: str) -> bool:
        """Whether an edit continues the last step of the history, so that both are merged."""
        key, at = self._merge
        return bool(merge) and key == merge and time.monotonic() - at < MERGE_S and len(self._done) > 1

    def _before(self, merge: str) -> SensorDesign:
        """The design before an edit, or before the step with which the edit is merged."""
        return self._done[-2].design if self._is_going_on(merge) else self.design

    def _push(self, version: Version, merge: str) -> None:
        if not self._is_going_on(merge):
            self._done = [*self._done, version][-MOST_VERSIONS:]
        elif version.design.digest == self._done[-2].design.digest:  # the same design as before the step
            self._done, merge = self._done[:-1], ""
        else:
            self._done[-1] = version
        self._merge = (merge, time.monotonic())
        self._undone = []
        self.press = self._within(self.press)

    def _settle(self) -> None:
        self._merge = ("", 0.0)
        self.press = self._within(self.press)

    def _within(self, wanted: LivePress) -> LivePress:
        """The nearest press in the workspace; if the pad has no workspace, the nearest press in the pad."""
        size, space = self.design.cavity, workspace_of(self.design)
        if space.is_empty:
            space = space.in_box((0.0, 0.0, size.length_mm, size.width_mm))
        deepest = self.design.operating.max_depth_mm
        (x_mm, y_mm, depth_mm), *more = (
            (*space.clamped(x, y), min(max(depth, 0.0), deepest)) for x, y, depth in wanted.tips_mm
        )
        second = more[0] if more else None
        return replace(wanted, x_mm=x_mm, y_mm=y_mm, depth_mm=depth_mm, second_mm=second)

    def _say(self, text: str, *, is_bad: bool = False) -> None:
        self.said = Said(text=text, is_bad=is_bad)
        self._tell()

    def _tell(self) -> None:
        for call in self._listeners:
            call()


def _version(design: SensorDesign, words: str) -> Version:
    """A step of the history with the findings of the design rules.

    A design with an unknown component raises an error, because it cannot be drawn.
    """
    try:
        cavity_of(design)
        findings = check(design)
    except OptopadError as err:
        raise InputError(str(err)) from None
    return Version(design=design, findings=findings, words=words)


def _words(design: SensorDesign, wanted: dict[str, Any]) -> str:
    if "layout" in wanted:
        return "parts moved"
    document = design.model_dump(mode="json")
    known = {path: value for path, value in wanted.items() if is_value(document, path)}
    return (
        changes_words(design, known)
        if known
        else ", ".join(f"{path} {value}" for path, value in wanted.items())
    )


def _place_words(design: SensorDesign, name: str) -> str:
    part = part_named(design, name)
    if part.is_on_floor:
        return f"{name}: {part.place_words}"
    if part.angle_deg is not None:
        return f"{name}: at {part.angle_deg:g}°, {part.height_mm:g} mm high"
    return f"{name}: {part.along_mm:g} mm along the {part.wall} wall, {part.height_mm:g} mm high"


def _hundredth(wanted_mm: float | None, is_mm: float) -> float:
    """The requested position rounded to 0.01 mm [mm]; the present one if the request is None or not finite."""
    return is_mm if wanted_mm is None or not math.isfinite(wanted_mm) else round(wanted_mm, 2)


def _first_fault(err: Exception) -> str:
    """The first finding in an error's text, without the heading of the list of findings."""
    lines = [line.strip() for line in str(err).splitlines() if line.strip()]
    return lines[1] if len(lines) > 1 and lines[0].endswith("not a usable design") else lines[0]
