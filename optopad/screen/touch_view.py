"""Output of `driver read --model`: a picture of the touch with its numbers and uncertainty, or lines, or JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.fabrication.driver.touch_reader import AXES, Touch, TouchReader, with_sigma
from optopad.screen.live_sensor import link_line

if TYPE_CHECKING:
    from rich.console import RenderableType

PICTURE_ROWS, PICTURE_COLUMNS = 15, 31
"""Size of the picture in characters, which are about twice as high as wide."""

LIGHT_MM, DEEP_MM = 0.5, 2.0
MARKS = ("○", "◉", "●")
"""Marks of a touch that is less than 0.5 mm deep, less than 2 mm deep, or deeper."""

FAR_START = 0.1
"""Difference between the readings at the start and the training data, after gains, above which a note is shown."""


def touch_json(touch: Touch, digits: int = 4) -> dict[str, Any]:
    """The estimate from a frame as plain data; location, uncertainty and depth are null without a touch."""
    frame, drift = touch.frame, touch.drift
    told = touch.is_touched
    return {
        "connection": frame.connection,
        "sequence": frame.sequence,
        "device_us": frame.device_us,
        "host_s": round(frame.host_s, 6),
        "lost_before": frame.lost_before,
        "touched": told,
        "score": round(touch.touch_score, digits),
        **{
            f"{axis}_mm": round(float(value), digits) if told else None
            for axis, value in zip(AXES, touch.press_mm, strict=True)
        },
        "sigma_mm": _plain(touch.sigma_mm, digits) if told else None,
        "force_n": None if touch.force_n is None else round(touch.force_n, digits),
        "force_sigma_n": round(touch.force_sigma_n, digits) if math.isfinite(touch.force_sigma_n) else None,
        "drift": round(drift.drift, 6),
        "drift_held": drift.is_held,
        "gain_steps": drift.gain_steps,
        "gain_like": drift.is_gain_like,
        "latency_ms": round(touch.latency_ms, 2),
    }


def touch_view(touch: Touch, reader: TouchReader) -> RenderableType:
    """Picture of the pad next to the numbers, below a line about the link and above an explanation."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    sensor = reader.sensor
    numbers = Table(box=None, padding=(0, 1))
    for name, value in _rows(touch):
        numbers.add_row(name, value)
    both = Table(box=None, padding=(0, 2))
    both.add_row(Text("\n".join(picture(touch, reader)), no_wrap=True), numbers)
    head = f"{sensor.descriptor.design} on {sensor.port}, {reader.model.header.kind}: {link_line(sensor)}"
    foot = "E emitters, R receivers, ○ ◉ ● touched lightly, to 2 mm, deeper   Ctrl-C ends"
    return Group(Text(head, style="bold"), both, Text(foot, style="dim"))


def picture(touch: Touch, reader: TouchReader) -> list[str]:
    """The pad from above, y upward, one string per row: parts at their positions, and the touch."""
    said = reader.sensor.descriptor
    places = np.concatenate([said.emitters.position_mm, said.receivers.position_mm])[:, :2]
    low, high = places.min(axis=0), places.max(axis=0)
    cells = [[" "] * PICTURE_COLUMNS for _ in range(PICTURE_ROWS)]
    for mark, parts in (("E", said.emitters), ("R", said.receivers)):
        for place in parts.position_mm[:, :2]:
            _set(cells, place, low, high, mark)
    if touch.is_touched and np.isfinite(touch.press_mm).all():
        depth = float(touch.press_mm[2])
        _set(cells, touch.press_mm[:2], low, high, MARKS[int(depth >= LIGHT_MM) + int(depth >= DEEP_MM)])
    line = "+" + "-" * PICTURE_COLUMNS + "+"
    return [line, *("|" + "".join(row) + "|" for row in cells), line]


def start_note(reader: TouchReader) -> str:
    """A note if the readings at the start are far from the model's training data; otherwise empty."""
    far = reader.tracker.start_mismatch
    if far < FAR_START:
        return ""
    return (
        f"note      the untouched pad is {far:.0%} from the training data beyond gains: the model is of "
        "another manufactured unit, or the pad was touched at the start"
    )


def _rows(touch: Touch) -> list[tuple[str, str]]:
    told = touch.is_touched
    drift = touch.drift
    rows = [("touch", f"{'yes' if told else 'no'}   (score {touch.touch_score:+.2f})")]
    rows += [
        (axis, with_sigma(touch.press_mm[k], touch.sigma_mm[k], "mm") if told else "-")
        for k, axis in enumerate(AXES)
    ]
    force = "not known" if touch.force_n is None else with_sigma(touch.force_n, touch.force_sigma_n, "N")
    rows.append(("force", "-" if touch.force_n is not None and not told else force))
    rows.append(("drift", f"{round(drift.drift, 4) + 0.0:+.2%}{', held' if drift.is_held else ', followed'}"))
    rows.append(("gain steps", str(drift.gain_steps)))
    rows.append(("delay", f"{touch.latency_ms:.1f} ms"))
    if touch.note:
        rows.append(("note", touch.note))
    return rows


def _set(
    cells: list[list[str]],
    place: FloatArray,
    low: FloatArray,
    high: FloatArray,
    mark: str,
) -> None:
    share = np.clip((place - low) / np.maximum(high - low, 1e-9), 0.0, 1.0)
    column = round(float(share[0]) * (PICTURE_COLUMNS - 1))
    row = round((1.0 - float(share[1])) * (PICTURE_ROWS - 1))
    cells[row][column] = mark


def _plain(values: FloatArray, digits: int) -> list[float | None]:
    return [round(float(value), digits) if math.isfinite(value) else None for value in values]
