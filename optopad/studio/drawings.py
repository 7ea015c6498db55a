"""Drawings for the studio's panel as SVG text: signals of pairs, map of the pad, live and simulated readings.

Text and axes have the page's text colour, so that a drawing suits light and dark pages.
"""

from __future__ import annotations

import base64
import math
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, outline_mm
from optopad.sims.score.objective import PlaceCurves
from optopad.sims.score.result import ContinuityScore, JudgedPair
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD
from optopad.sims.verdict.pad_map import PadMap
from optopad.studio.session import LivePress

Place = Callable[[float], float]

MODE_1, MODE_2, DEAD, FADE = "#d55e00", "#0077c8", "#d1242f", "#8c8c8c"
LINES = ("#0077c8", "#d55e00", "#009e73", "#cc79a7", "#b59a00", "#4aa8d8", "#8250df", "#7a7a7a")
EMITTER, RECEIVER = "#e69f00", "#0077c8"
WIDTH = 400
LEFT, RIGHT, TOP = 40, 8, 8
ROW, PLOT = 15, 130
LEAST_CELL = 16.0
"""Least width of a cell in which the readings are written as numbers [units of the drawing]."""
WEAKEST_COUNTS = 4.0
"""Smallest simulated reading that a live reading is compared with [counts]."""
MOST_SHARE = 4.0
"""Largest signal that is drawn, as a multiple of the untouched signal [-]; a pair with little untouched light may
receive far more under a press."""

_HATCH = (
    '<defs><pattern id="dead" width="5" height="5" patternTransform="rotate(45)" patternUnits="userSpaceOnUse">'
    f'<rect width="5" height="5" fill="{DEAD}" fill-opacity="0.25"/>'
    f'<line x1="0" y1="0" x2="0" y2="5" stroke="{DEAD}" stroke-width="2.4"/></pattern></defs>'
)


def curves_svg(found: PlaceCurves, depth_mm: float) -> str:
    """Signals of the pairs under the tip against depth, and below them each pair's modes and deadbands."""
    deepest = float(found.pairs[0].curves.depth_mm[-1])
    shares = [_share_of_untouched(pair.curves.total) for pair in found.pairs]
    highest = max(1.05, 1.05 * max(float(share.max()) for share in shares))
    height = TOP + PLOT + 26 + ROW * len(found.pairs) + 20

    def x(at_mm: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * at_mm / deepest

    def y(share: float) -> float:
        return TOP + PLOT * (1 - share / highest)

    body = [_HATCH, *_axes(x, y, deepest, highest)]
    for number, (pair, share) in enumerate(zip(found.pairs, shares, strict=True)):
        points = " ".join(
            f"{x(float(d)):.1f},{y(float(v)):.1f}" for d, v in zip(pair.curves.depth_mm, share, strict=True)
        )
        body.append(
            f'<polyline points="{points}" fill="none" stroke="{LINES[number % len(LINES)]}" stroke-width="1.6">'
            f"<title>{escape(pair.name)}</title></polyline>"
        )
    top = TOP + PLOT + 26
    for number, pair in enumerate(found.pairs):
        body += _spans(pair, number, top + ROW * number, x, deepest)
    foot = top + ROW * len(found.pairs)
    body.append(
        f'<line x1="{x(depth_mm):.1f}" x2="{x(depth_mm):.1f}" y1="{TOP}" y2="{foot}" stroke="currentColor" '
        'stroke-dasharray="3 3"/>'
    )
    body.append(_legend(foot + 14))
    words = f"Signals of the pairs under the tip over {deepest:g} mm of depth"
    return _svg(WIDTH, height, body, words)


def _share_of_untouched(signal: FloatArray) -> FloatArray:
    """A signal divided by the untouched signal, limited to `MOST_SHARE` [-]; 0 if the untouched signal is 0."""
    if not signal[0] > 0:
        return np.zeros_like(signal)
    return np.asarray(np.minimum(signal / signal[0], MOST_SHARE), dtype=np.float64)


def _axes(x: Place, y: Place, deepest: float, highest: float) -> list[str]:
    found = []
    step = 1.0 if deepest >= 3 else 0.5
    for at in np.arange(0.0, deepest + 1e-9, step):
        found.append(
            f'<line x1="{x(at):.1f}" x2="{x(at):.1f}" y1="{TOP}" y2="{TOP + PLOT}" stroke="currentColor" '
            f'stroke-opacity="0.12"/><text x="{x(at):.1f}" y="{TOP + PLOT + 12}" text-anchor="middle">{at:g}</text>'
        )
    for share in np.arange(0.0, highest, 0.25 if highest < 1.6 else 0.5):
        found.append(
            f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(share):.1f}" y2="{y(share):.1f}" stroke="currentColor" '
            f'stroke-opacity="0.12"/><text x="{LEFT - 4}" y="{y(share) + 3:.1f}" text-anchor="end">{share:.0%}</text>'
        )
    found.append(
        f'<text x="{WIDTH - RIGHT}" y="{TOP + PLOT + 23}" text-anchor="end">depth of the press, mm</text>'
        f'<text x="{LEFT + 4}" y="{TOP + PLOT - 4}">signal over untouched</text>'
    )
    return found


def _spans(pair: JudgedPair, number: int, top: float, x: Place, deepest: float) -> list[str]:
    """A line of the drawing for one pair: mode 1 above, mode 2 below, deadbands hatched, saturation grey."""
    modes, score = pair.score.modes, pair.score
    bars = [(modes.mode1_mm, MODE_1, top + 2, 4, "mode 1")]
    if modes.mode2_mm[0] is not None:
        last = modes.mode2_mm[1]
        bars.append(((modes.mode2_mm[0], deepest if last is None else last), MODE_2, top + 7, 4, "mode 2"))
    bars += [(span, "url(#dead)", top + 1, 12, "deadband") for span in score.deadbands_mm]
    if score.saturation_mm is not None:
        bars.append((score.saturation_mm, FADE, top + 4, 5, "saturated: the signal no longer changes"))
    found = [
        f'<text x="{LEFT - 4}" y="{top + 11}" text-anchor="end" fill="{LINES[number % len(LINES)]}" '
        f'style="fill:{LINES[number % len(LINES)]}">{escape(pair.name)}</text>'
    ]
    for (start, end), colour, y, high, words in bars:
        found.append(
            f'<rect x="{x(start):.1f}" y="{y:.1f}" width="{max(x(end) - x(start), 0.8):.1f}" height="{high}" '
            f'fill="{colour}"><title>{words}: {start:.2f} to {end:.2f} mm</title></rect>'
        )
    return found


def _legend(y: float) -> str:
    marks = (("mode 1", MODE_1), ("mode 2", MODE_2), ("deadband", "url(#dead)"), ("saturated", FADE))
    return "".join(
        f'<rect x="{LEFT + 88 * k}" y="{y - 8}" width="14" height="8" fill="{colour}"/>'
        f'<text x="{LEFT + 88 * k + 18}" y="{y}">{name}</text>'
        for k, (name, colour) in enumerate(marks)
    )


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A quantity that the map shows at each location.

    Attributes
    ----------
    title, unit : name and unit of the quantity
    values : (ny, nx) values on the grid; infinite or NaN where there is none
    x_mm, y_mm : (nx,) and (ny,) coordinates of the grid [mm]
    good, bad : values at the green and the red end of the colour scale
    absent : text for a missing value
    """

    title: str
    unit: str
    values: FloatArray
    x_mm: tuple[float, ...]
    y_mm: tuple[float, ...]
    good: float
    bad: float
    absent: str = "none"


QUANTITIES = ("deadband", "usable depth", "margin", "location bound", "depth bound", "detection threshold")


def quantity(name: str, score: ContinuityScore) -> Quantity | None:
    """The quantity with this name (one of `QUANTITIES`) from a score, for the map; None if it was not computed."""
    pad, bounds = score.pad_map, score.bounds
    if pad is None:
        return None
    if name in ("deadband", "usable depth", "margin"):
        return _of_map(name, pad)
    if bounds is None:
        return None
    if name == "detection threshold":
        if bounds.detection is None:
            return None
        detection = bounds.detection
        return Quantity(
            title="detection threshold",
            unit="N",
            values=detection.force_n,
            x_mm=detection.x_mm,
            y_mm=detection.y_mm,
            good=0.0,
            bad=2.0 * _middle(detection.force_n),
            absent="not detected",
        )
    values = bounds.location_mm if name == "location bound" else bounds.depth_bound_mm
    middle = int(np.argmin(np.abs(np.array(bounds.depth_mm) - 0.3 * bounds.max_depth_mm)))
    return Quantity(
        title=f"{name} of one frame, {bounds.depth_mm[middle]:g} mm deep",
        unit="mm",
        values=values[:, :, middle],
        x_mm=bounds.x_mm,
        y_mm=bounds.y_mm,
        good=0.0,
        bad=bounds.limits.dead_location_mm if name == "location bound" else bounds.limits.dead_depth_mm,
        absent="not resolved",
    )


def _of_map(name: str, pad: PadMap) -> Quantity:
    lines = (pad.x_mm, pad.y_mm)
    if name == "deadband":
        return _quantity(name, "mm", pad.deadband_grid_mm(), lines, good=0.0, bad=1.0)
    if name == "usable depth":
        deepest = max(place.usable_mm for place in pad.places)
        return _quantity(name, "mm", pad.usable_grid_mm(), lines, good=deepest, bad=0.0)
    margins = pad.grid([place.margin for place in pad.places])
    threshold = DEADBAND_THRESHOLD
    title = f"margin; a deadband is below {threshold:g}"
    return _quantity(title, "sigma", margins, lines, good=5.0 * threshold, bad=threshold)


def _quantity(
    title: str,
    unit: str,
    values: FloatArray,
    lines: tuple[tuple[float, ...], tuple[float, ...]],
    *,
    good: float,
    bad: float,
) -> Quantity:
    return Quantity(title=title, unit=unit, values=values, x_mm=lines[0], y_mm=lines[1], good=good, bad=bad)


def _middle(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else 1.0


def map_svg(cavity: CavityGeometry, shown: Quantity | None, press: LivePress, bad: Sequence[str] = ()) -> str:
    """The pad from above: a quantity at each location of the workspace, components with names, and the tip.

    Parameters
    ----------
    shown : quantity to show; None for none
    bad : names of components to mark
    """
    edge = 26.0
    scale = (WIDTH - 2 * edge) / max(cavity.length_mm, 0.9 * cavity.width_mm)
    wide = edge + (WIDTH - 2 * edge - scale * cavity.length_mm) / 2
    high = scale * cavity.width_mm

    def x(at_mm: float) -> float:
        return wide + scale * at_mm

    def y(at_mm: float) -> float:
        return edge + high - scale * at_mm

    body = [_HATCH]
    cells = [] if shown is None else _cells(cavity, shown, x, y, scale)
    corners = " ".join(f"{x(at_x):.1f},{y(at_y):.1f}" for at_x, at_y in outline_mm(cavity.plan))
    body.append(f'<clipPath id="pad"><polygon points="{corners}"/></clipPath><g clip-path="url(#pad)">')
    body += [*cells, f'</g><polygon points="{corners}" fill="none" stroke="currentColor"/>']
    body += [_part(part, x, y, is_bad=part.name in bad) for part in cavity.parts]
    radius = scale * cavity.tip_radius_mm
    names = ("the tip",) if press.second_mm is None else ("the first tip", "the second tip")
    for name, (at_x, at_y, _) in zip(names, press.tips_mm, strict=True):
        body.append(
            f'<circle cx="{x(at_x):.1f}" cy="{y(at_y):.1f}" r="{radius:.1f}" fill="none" stroke="currentColor" '
            f'stroke-width="1.6" stroke-dasharray="4 2"><title>{name}: x {at_x:g}, y {at_y:g} mm</title></circle>'
        )
    title = "" if shown is None else f"{shown.title} [{shown.unit}]"
    body.append(
        f'<text x="{WIDTH / 2}" y="{2 * edge + high + 8:.1f}" text-anchor="middle">{escape(title)}</text>'
    )
    return _svg(WIDTH, 2 * edge + high + 16, body, f"Map of the pad: {title or 'no map yet'}", 84)


def _cells(cavity: CavityGeometry, shown: Quantity, x: Place, y: Place, scale: float) -> list[str]:
    found = []
    wide, tall = _pitch(shown.x_mm, cavity.length_mm), _pitch(shown.y_mm, cavity.width_mm)
    for row, at_y in enumerate(shown.y_mm):
        for column, at_x in enumerate(shown.x_mm):
            if not cavity.workspace.contains(at_x, at_y, 1e-6):
                continue
            value = float(shown.values[row, column])
            is_known = bool(np.isfinite(value))
            span = shown.good - shown.bad
            good = (value - shown.bad) / span if is_known and span else 0.0
            fill = "url(#dead)" if not is_known else _shade(good)
            told = f"{value:.3g} {shown.unit}" if is_known else shown.absent
            x0, x1 = max(at_x - wide / 2, 0.0), min(at_x + wide / 2, cavity.length_mm)
            y0, y1 = max(at_y - tall / 2, 0.0), min(at_y + tall / 2, cavity.width_mm)
            found.append(
                f'<rect x="{x(x0):.1f}" y="{y(y1):.1f}" width="{scale * (x1 - x0):.1f}" '
                f'height="{scale * (y1 - y0):.1f}" fill="{fill}">'
                f"<title>x {at_x:g}, y {at_y:g} mm: {told}</title></rect>"
            )
            if scale * (x1 - x0) > 26:
                short = _short(value) if is_known else shown.absent
                found.append(
                    f'<text x="{x((x0 + x1) / 2):.1f}" y="{y((y0 + y1) / 2) + 3:.1f}" text-anchor="middle">'
                    f"{short}</text>"
                )
    return found


def _short(value: float) -> str:
    return f"{value:.3f}" if 0 < abs(value) < 0.1 else f"{value:.2f}" if abs(value) < 10 else f"{value:.0f}"


def _pitch(lines: tuple[float, ...], span: float) -> float:
    return lines[1] - lines[0] if len(lines) > 1 else span


def _shade(good: float) -> str:
    """A colour from red (0, bad) via sand to green (1, good), pale enough for text on light and dark pages."""
    bad, middle, fine = np.array([209, 36, 47]), np.array([230, 190, 90]), np.array([0, 158, 115])
    share = min(max(good, 0.0), 1.0)
    colour = (
        middle + (bad - middle) * (1 - 2 * share)
        if share < 0.5
        else middle + (fine - middle) * (2 * share - 1)
    )
    red, green, blue = (round(float(part)) for part in colour)
    return f"rgb({red} {green} {blue} / 0.42)"


def _part(part: PlacedPart, x: Place, y: Place, *, is_bad: bool) -> str:
    at_x, at_y, _ = part.position_mm
    right, up = part.label_way
    cx, cy = x(at_x), y(at_y)
    colour = DEAD if is_bad else EMITTER if part.kind == "emitter" else RECEIVER
    return (
        f'<circle cx="{cx:.1f}" cy="{cy:.1f}" r="3.4" fill="{colour}"/>'
        f'<text x="{cx + 14 * right:.1f}" y="{cy - 13 * up + 3:.1f}" text-anchor="middle">'
        f"{escape(part.name)}</text>"
    )


def readings_svg(
    emitters: Sequence[str],
    receivers: Sequence[str],
    live: FloatArray,
    simulated: FloatArray | None,
    bad: Sequence[str] = (),
    words: tuple[str, str] = ("live", "simulated"),
) -> str:
    """One cell per pair with the live reading and, below it, the simulated reading [counts].

    Cells with a large difference are coloured.

    Parameters
    ----------
    live, simulated : (emitter, receiver) readings [counts]
    bad : names of components or pairs that failed a check
    words : what both readings are
    """
    left, top = 34.0, 16.0
    wide, tall = (WIDTH - left - 2) / max(len(receivers), 1), 24.0
    is_picture = wide < LEAST_CELL
    tall = wide if is_picture else tall
    step = math.ceil(1.5 * LEAST_CELL / wide) if is_picture else 1
    body = [
        f'<text x="{left + wide * (j + 0.5):.1f}" y="{top - 5}" text-anchor="middle"{_bad(name, bad)}>'
        f"{escape(name)}</text>"
        for j, name in enumerate(receivers)
        if j % step == 0
    ]
    if is_picture:
        size = wide * len(receivers), tall * len(emitters)
        body += [
            f'<text x="{left - 4}" y="{top + tall * (i + 0.5) + 3:.1f}" text-anchor="end"{_bad(name, bad)}>'
            f"{escape(name)}</text>"
            for i, name in enumerate(emitters)
            if i % step == 0
        ]
        body.append(
            f'<image x="{left}" y="{top}" width="{size[0]:.1f}" height="{size[1]:.1f}" preserveAspectRatio="none" '
            f'style="image-rendering:pixelated" href="{_pixels(live, simulated)}"/>'
        )
        return _svg(WIDTH, top + size[1] + 2, body, f"Readings of every pair, {words[0]} against {words[1]}")
    for i, emitter in enumerate(emitters):
        y = top + tall * i
        body.append(
            f'<text x="{left - 4}" y="{y + 15}" text-anchor="end"{_bad(emitter, bad)}>{escape(emitter)}</text>'
        )
        for j, receiver in enumerate(receivers):
            value = float(live[i, j])
            model = None if simulated is None else float(simulated[i, j])
            x = left + wide * j
            is_bad = f"{emitter}-{receiver}" in bad
            body.append(
                f'<rect x="{x + 0.5:.1f}" y="{y + 0.5:.1f}" width="{wide - 1:.1f}" height="{tall - 1}" '
                f'fill="{_difference(value, model)}" stroke="{DEAD if is_bad else "none"}" stroke-width="1.5">'
                f"<title>{escape(f'{emitter}-{receiver}')}: {value:.0f} counts"
                f"{'' if model is None else f', {words[1]} {model:.0f}'}</title></rect>"
                f'<text x="{x + wide / 2:.1f}" y="{y + 10.5}" text-anchor="middle">{value:.0f}</text>'
            )
            if model is not None:
                body.append(
                    f'<text x="{x + wide / 2:.1f}" y="{y + 20.5}" text-anchor="middle" opacity="0.65">'
                    f"{model:.0f}</text>"
                )
    return _svg(
        WIDTH, top + tall * len(emitters) + 2, body, f"Readings of every pair, {words[0]} and {words[1]}"
    )


def _bad(name: str, bad: Sequence[str]) -> str:
    return f' style="fill:{DEAD};font-weight:bold"' if name in bad else ""


def _difference(live: float, simulated: float | None) -> str:
    """Colour of a cell: orange if the live reading is well below the simulated one, blue if well above."""
    colour = _differences(np.array(live), None if simulated is None else np.array(simulated))
    red, green, blue, opacity = colour.tolist()
    return f"rgb({red:.0f} {green:.0f} {blue:.0f} / {opacity:.2f})"


def _differences(live: FloatArray, simulated: FloatArray | None) -> FloatArray:
    """(..., 4) colours of `_difference`: red, green and blue from 0 to 255, and opacity from 0 to 1."""
    unknown = np.broadcast_to([128.0, 128.0, 128.0, 0.15], (*live.shape, 4))
    if simulated is None:
        return unknown
    is_known = simulated >= WEAKEST_COUNTS
    apart = np.clip((live - simulated) / np.where(is_known, simulated, 1.0), -1.0, 1.0)
    colour = np.where((apart > 0.0)[..., None], [0.0, 119.0, 200.0], [213.0, 94.0, 0.0])
    found = np.concatenate([colour, (0.08 + 0.5 * np.abs(apart))[..., None]], axis=-1)
    return np.asarray(np.where(is_known[..., None], found, unknown))


def _pixels(live: FloatArray, simulated: FloatArray | None) -> str:
    values = _differences(np.asarray(live, dtype=np.float64), simulated) * [1.0, 1.0, 1.0, 255.0]
    rows, columns, _ = values.shape
    pixels = np.zeros((rows, 1 + 4 * columns), dtype=np.uint8)  # each row begins with its filter: none
    pixels[:, 1:] = np.round(values).reshape(rows, -1)
    header = struct.pack(">IIBBBBB", columns, rows, 8, 6, 0, 0, 0)  # 8 bits of red, green, blue and opacity
    chunks = {b"IHDR": header, b"IDAT": zlib.compress(pixels.tobytes()), b"IEND": b""}
    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in chunks.items()
    )
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"


def _svg(width: float, height: float, body: Sequence[str], words: str, share: int = 100) -> str:
    return (
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" width="{share}%" role="img" '
        f'aria-label="{escape(words, quote=True)}" '
        'style="display:block;margin:auto;font:9px system-ui,sans-serif">'
        "<style>svg text{fill:currentColor}</style>" + "".join(body) + "</svg>"
    )
