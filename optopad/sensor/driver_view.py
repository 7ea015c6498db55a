"""What `driver read` and `driver check` show: a live table and heat map for a terminal, lines and JSON for the rest."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from design.arrays import FloatArray
from fabrication.driver.check import Verdict
from fabrication.driver.link.frames import Frame
from fabrication.driver.sensor import Sensor

if TYPE_CHECKING:
    from rich.console import RenderableType

FULL_CHANGE = 0.5
"""Change of a signal, as a share of its baseline, that has the strongest colour."""

FAINTEST = 0.1
"""Share of the full change below which a cell keeps the terminal's own colour."""

CELL_WIDTH = 6

LESS, MORE = (31, 102, 209), (209, 92, 20)
"""Colours (red, green, blue) of less and of more light than untouched; between them the terminal's own."""


def frame_json(frame: Frame, digits: int = 5) -> dict[str, Any]:
    """A frame as plain data; a ratio over nearly nothing is null."""
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


def link_json(sensor: Sensor) -> dict[str, Any]:
    """Port, board, and what happened on the line, as plain data."""
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


def link_line(sensor: Sensor) -> str:
    """One line: rate and losses."""
    counts, rate = sensor.counts, sensor.rate_hz
    told = "-" if rate is None else f"{rate:.1f}"
    text = f"{counts.frames} frames, {told} Hz, {counts.lost} lost, {counts.damaged} damaged"
    rare = {"doubled": counts.doubled, "reconnects": counts.reconnects}
    return text + "".join(f", {number} {name}" for name, number in rare.items() if number)


def strongest_change(frame: Frame, sensor: Sensor) -> str:
    """The pair that changed most against its baseline."""
    if frame.baseline is None or not np.isfinite(frame.normalised).any():
        return ""
    change = np.nan_to_num(frame.normalised - 1.0)
    i, j = np.unravel_index(int(np.abs(change).argmax()), change.shape)
    said = sensor.descriptor
    return f"{said.emitters.names[i]}-{said.receivers.names[j]} {change[i, j]:+.0%}"


def live_table(frame: Frame, sensor: Sensor) -> RenderableType:
    """Heat map of normalised signals, a row an emitter, between a line about the link and a line of explanation."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    said = sensor.descriptor
    table = Table(box=None, padding=0, collapse_padding=True)
    table.add_column("", min_width=5)
    for name in said.receivers.names:
        table.add_column(Text(name + " "), justify="right", min_width=CELL_WIDTH)
    ratio = frame.normalised if frame.baseline is not None else np.full(frame.signals.shape, np.nan)
    for i, name in enumerate(said.emitters.names):
        table.add_row(name, *(_cell(frame, ratio, i, j) for j in range(len(said.receivers.names))))
    table.add_row("dark", *(f"{int(count)} " for count in frame.counts[-1]), style="dim")
    head = f"{said.design} on {sensor.port}: {link_line(sensor)}"
    foot = "% of the untouched signal   ! at full scale   . too weak to tell   Ctrl-C ends"
    return Group(Text(head, style="bold"), table, Text(foot, style="dim"))


def check_lines(verdict: Verdict) -> list[str]:
    """A check's outcome for people."""
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
    lines.append(f"{'verdict':<9} {'wired as designed' if verdict.is_good else f'{wrong} to mend'}")
    return lines


def _cell(frame: Frame, ratio: FloatArray, i: int, j: int) -> Any:
    from rich.text import Text

    mark = "!" if frame.saturated[i, j] else ""
    if not math.isfinite(ratio[i, j]):
        return Text(f"{mark or '.'} ".rjust(CELL_WIDTH), style="dim")
    return Text(f"{mark}{100 * ratio[i, j]:.0f} ".rjust(CELL_WIDTH), style=_style(float(ratio[i, j]) - 1.0))


def _style(change: float) -> str:
    share = min(abs(change) / FULL_CHANGE, 1.0)
    if share < FAINTEST:
        return ""
    red, green, blue = (round(30 + (part - 30) * share) for part in (LESS if change < 0 else MORE))
    return f"white on rgb({red},{green},{blue})"


def _plain(values: FloatArray) -> list[list[float | None]]:
    return [[float(value) if math.isfinite(value) else None for value in row] for row in values]
