"""The built sensor in the terminal: a live table and heat map, or lines and JSON, and the result of a check."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.fabrication.driver import sensor as driver
from optopad.fabrication.driver.check import Verdict
from optopad.fabrication.driver.link.frames import Frame

if TYPE_CHECKING:
    from rich.console import RenderableType

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
    ratio = None if frame.baseline is None else _plain(np.round(frame.normalised, digits))
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


def link_line(sensor: driver.Sensor) -> str:
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


def _plain(values: FloatArray) -> list[list[float | None]]:
    return [[float(value) if math.isfinite(value) else None for value in row] for row in values]
