"""The built sensor in the terminal: frames as a live table and heat map, or lines and JSON; touches as a picture with
their numbers and uncertainty, or lines and JSON; the result of a check; and what is said of an exported recording."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.fabrication.driver import sensor as driver
from optopad.fabrication.driver.check import Verdict
from optopad.fabrication.driver.frame_source import FrameSource
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.touch_reader import AXES, Touch, TouchReader, with_sigma

if TYPE_CHECKING:
    from rich.console import RenderableType

    from optopad.fabrication.driver.recording.joined_log import JoinedLog
    from optopad.fabrication.driver.recording.recorded import Recorded

FULL_CHANGE = 0.5
"""Change of a signal, as a share of its baseline, that has the strongest colour."""

FAINTEST = 0.1
"""Share of the full change below which a cell keeps the terminal's own colour."""

CELL_WIDTH = 6
NAME_WIDTH = 5
OTHER_LINES = 5
"""Number of lines of the live view, not counting those of the emitters."""

LESS, MORE = (31, 102, 209), (209, 92, 20)
"""Colours (red, green, blue) of less and of more light than without contact; no change has the terminal's colour."""


def frame_json(frame: Frame, digits: int = 5) -> dict[str, Any]:
    """A frame as plain data; a ratio with a denominator near zero is null."""
    ratio = (
        None
        if frame.baseline is None
        else [_plain(row, digits) for row in np.round(frame.normalised, digits)]
    )
    return {
        "connection": frame.connection,
        "sequence": frame.sequence,
        "device_us": frame.device_us,
        "host_s": round(frame.host_s, 6),
        "lost_before": frame.lost_before,
        "counts": frame.counts.tolist(),
        "signals": frame.signals.tolist(),
        "normalised": ratio,
        "saturated": int(frame.saturated.sum()),
    }


def link_json(sensor: driver.Sensor) -> dict[str, Any]:
    """Port, board, and events on the line, as plain data."""
    counts = sensor.counts
    return {
        "port": sensor.port,
        "design": sensor.config.design,
        "digest": sensor.config.digest,
        "board_digest": sensor.hello.digest,
        "firmware": ".".join(map(str, sensor.hello.firmware)),
        "rate_hz": sensor.rate_hz,
        **{name: getattr(counts, name) for name in type(counts).__dataclass_fields__},
    }


def link_line(sensor: FrameSource) -> str:
    """One line with the frame rate, and the numbers of received, lost and damaged frames."""
    counts, rate = sensor.counts, sensor.rate_hz
    told = "-" if rate is None else f"{rate:.1f}"
    text = f"{counts.frames} frames, {told} Hz, {counts.lost} lost, {counts.damaged} damaged"
    rare = {"doubled": counts.doubled, "reconnects": counts.reconnects}
    return text + "".join(f", {number} {name}" for name, number in rare.items() if number)


def strongest_change(frame: Frame, sensor: driver.Sensor) -> str:
    """The pair that changed most relative to its baseline."""
    if frame.baseline is None or not np.isfinite(frame.normalised).any():
        return ""
    change = np.nan_to_num(frame.normalised - 1.0)
    i, j = np.unravel_index(int(np.abs(change).argmax()), change.shape)
    said = sensor.descriptor
    return f"{said.emitters.names[i]}-{said.receivers.names[j]} {change[i, j]:+.0%}"


def live_table(frame: Frame, sensor: driver.Sensor, size: tuple[int, int]) -> RenderableType:
    """Heat map of normalised signals, one line per emitter, below a line about the link and above an explanation.

    Parameters
    ----------
    size : columns and lines of the terminal; a layout whose numbers do not fit is drawn as coloured blocks
    """
    from rich.console import Group
    from rich.text import Text

    said = sensor.descriptor
    ratio = frame.normalised if frame.baseline is not None else np.full(frame.signals.shape, np.nan)
    emitters, receivers = said.emitters.names, said.receivers.names
    if NAME_WIDTH + CELL_WIDTH * len(receivers) <= size[0] and len(emitters) + OTHER_LINES <= size[1]:
        view = _numbers(frame, ratio, emitters, receivers)
        foot = "% of the untouched signal   ! at full scale   . too weak   Ctrl-C ends"
    else:
        view = _blocks(frame, ratio, emitters, receivers, wide=NAME_WIDTH + 2 * len(receivers) <= size[0])
        change = strongest_change(frame, sensor)
        foot = (
            f"blue: less light, orange: more, white: at full scale, black: too weak   {change}   Ctrl-C ends"
        )
    head = f"{said.design} on {sensor.port}: {link_line(sensor)}"
    return Group(Text(head, style="bold"), view, Text(foot, style="dim"))


def _numbers(
    frame: Frame, ratio: FloatArray, emitters: tuple[str, ...], receivers: tuple[str, ...]
) -> RenderableType:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=0, collapse_padding=True)
    table.add_column("", min_width=NAME_WIDTH)
    for name in receivers:
        table.add_column(Text(name + " "), justify="right", min_width=CELL_WIDTH)
    for i, name in enumerate(emitters):
        table.add_row(name, *(_cell(frame, ratio, i, j) for j in range(len(receivers))))
    table.add_row("dark", *(f"{int(count)} " for count in frame.counts[-1]), style="dim")
    return table


def _blocks(
    frame: Frame, ratio: FloatArray, emitters: tuple[str, ...], receivers: tuple[str, ...], *, wide: bool
) -> RenderableType:
    """Heat map of coloured blocks: a line shows two emitters, and every eighth receiver has a name."""
    from rich.text import Text

    step = 2 if wide else 1
    heads = "".join(name.ljust(8 * step) for name in receivers[::8])
    text = Text(" " * NAME_WIDTH + heads[: step * len(receivers)] + "\n", style="dim", no_wrap=True)
    for i in range(0, len(emitters), 2):
        text.append(emitters[i].ljust(NAME_WIDTH), style="not dim")
        for j in range(len(receivers)):
            upper = _colour(frame, ratio, i, j)
            lower = f" on {_colour(frame, ratio, i + 1, j)}" if i + 1 < len(emitters) else ""
            text.append("▀" * step, style=f"not dim {upper}{lower}")
        text.append("\n")
    return text


def _colour(frame: Frame, ratio: FloatArray, i: int, j: int) -> str:
    if frame.saturated[i, j]:
        return "rgb(255,255,255)"
    if not math.isfinite(ratio[i, j]):
        return "rgb(0,0,0)"
    return _mixed(float(ratio[i, j]) - 1.0)


def check_lines(verdict: Verdict) -> list[str]:
    """Lines of a check's result, for a person to read."""
    lines = [
        f"{'problem' if problem.is_error else 'note':<9} {problem.kind}: {problem.message}"
        for problem in verdict.problems
    ]
    if verdict.clipped_by_design:
        lines.append(f"{'note':<9} at full scale by design: {', '.join(verdict.clipped_by_design)}")
    if verdict.gain is not None and verdict.mismatch is not None:
        lines.append(
            f"{'pattern':<9} {verdict.compared} pairs compared over {verdict.frames} frames: {verdict.gain:.2f} times "
            f"the simulated readings, single pairs off by {verdict.mismatch:.0%} in the middle"
        )
    wrong = sum(problem.is_error for problem in verdict.problems)
    lines.append(f"{'verdict':<9} {'wired as designed' if verdict.is_good else f'{wrong} to fix'}")
    return lines


def _cell(frame: Frame, ratio: FloatArray, i: int, j: int) -> Any:
    from rich.text import Text

    mark = "!" if frame.saturated[i, j] else ""
    if not math.isfinite(ratio[i, j]):
        return Text(f"{mark or '.'} ".rjust(CELL_WIDTH), style="dim")
    return Text(f"{mark}{100 * ratio[i, j]:.0f} ".rjust(CELL_WIDTH), style=_style(float(ratio[i, j]) - 1.0))


def _style(change: float) -> str:
    return "" if abs(change) < FAINTEST * FULL_CHANGE else f"white on {_mixed(change)}"


def _mixed(change: float) -> str:
    share = min(abs(change) / FULL_CHANGE, 1.0)
    red, green, blue = (round(30 + (part - 30) * share) for part in (LESS if change < 0 else MORE))
    return f"rgb({red},{green},{blue})"


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
        "slipping": touch.is_slipping,
        "slip_mm_s": _plain(touch.slip_mm_s, digits) if told else None,
        "drift": round(drift.drift, 6),
        "drift_held": drift.is_held,
        "gain_steps": drift.gain_steps,
        "gain_like": drift.is_gain_like,
        "latency_ms": round(touch.latency_ms, 2),
    }


def contacts_json(touch: Touch, digits: int = 4) -> dict[str, Any]:
    """The touches of a frame as plain data: a list, empty for an untouched pad."""
    contacts = [
        {
            "number": one.number,
            **{
                f"{axis}_mm": round(float(value), digits)
                for axis, value in zip(AXES, one.press_mm, strict=True)
            },
            "sigma_mm": _plain(one.sigma_mm, digits),
            "force_n": None if one.force_n is None else round(one.force_n, digits),
            "force_sigma_n": round(one.force_sigma_n, digits) if math.isfinite(one.force_sigma_n) else None,
        }
        for one in touch.contacts
    ]
    return {"contacts": contacts}


def touch_view(touch: Touch, reader: TouchReader) -> RenderableType:
    """Picture of the pad next to the numbers, below a line about the link and above an explanation."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    sensor = reader.sensor
    numbers = Table(box=None, padding=(0, 1))
    for name, value in _rows(touch, reader.most_touches):
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
    for one in touch.contacts:
        depth = float(one.press_mm[2])
        _set(cells, one.press_mm[:2], low, high, MARKS[int(depth >= LIGHT_MM) + int(depth >= DEEP_MM)])
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


def _rows(touch: Touch, most_touches: int) -> list[tuple[str, str]]:
    told = touch.is_touched
    drift = touch.drift
    rows = [("touch", f"{'yes' if told else 'no'}   (score {touch.touch_score:+.2f})")]
    if most_touches == 1:
        rows += [
            (axis, with_sigma(touch.press_mm[k], touch.sigma_mm[k], "mm") if told else "-")
            for k, axis in enumerate(AXES)
        ]
        force = "not known" if touch.force_n is None else with_sigma(touch.force_n, touch.force_sigma_n, "N")
        rows.append(("force", "-" if touch.force_n is not None and not told else force))
    else:
        lines = [str(one).split(" ", 1) for one in touch.contacts]
        rows += [(number, line) for number, line in (lines + [["#-", "-"]] * most_touches)[:most_touches]]
    rows.append(("slip", f"{math.hypot(*touch.slip_mm_s):.0f} mm/s" if touch.is_slipping else "-"))
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


def recording_told(found: Recorded, join: JoinedLog | None) -> tuple[dict[str, Any], list[str]]:
    """What is said of a recording, as JSON and as lines."""
    document: dict[str, Any] = {
        "frames": len(found.sequence),
        "lost": found.lost,
        "doubled": found.doubled,
        "connections": int(found.connection[-1]),
        "ended_cleanly": found.ended_cleanly,
        "stray_bytes": found.stray_bytes,
        "left_out": found.left_out,
        "missing_files": list(found.missing_files),
        "has_presses": found.press_mm is not None,
    }
    lines = [f"{len(found.sequence)} frames, {found.losses}"]
    if join is not None:
        document["stage"] = _join_json(join)
        lines.append(_join_line(join))
    if found.press_mm is None:
        lines.append(
            "presses   none; `optopad compare` needs them (--presses, --stage, or the recorder's press())"
        )
    return document, lines


def _join_json(join: JoinedLog) -> dict[str, Any]:
    match = join.match
    has_edges = math.isfinite(match.spread_s)
    return {
        "offset_s": round(join.offset_s, 4),
        "edges": match.edges,
        "edges_met": round(match.share, 4),
        "lag_s": round(match.offset_s - join.offset_s, 4) if has_edges else None,
        "spread_s": round(match.spread_s, 4) if has_edges else None,
        "left_out": join.left_out,
    }


def _join_line(join: JoinedLog) -> str:
    match, text = join.match, f"log       offset {join.offset_s:.3f} s"
    if math.isfinite(match.spread_s):
        lag = match.offset_s - join.offset_s
        text += f"; {match.share:.0%} of {match.edges} touch edges match"
        text += f", {lag:+.3f} s late, scatter {match.spread_s:.3f} s"
    return text + f"; {join.left_out} frames without a known position left out"
