"""Footprints of packages and of optical parts (`design/data/board_packages.toml`).

Pads of an optical part that looks up follow from its catalogue entry: their middles are `lead_pitch_mm` apart, and they
reach `TOE_MM` beyond the body, a nominal solder joint of IPC-7351 (0.35 mm) plus placement. Holes are `HOLE_ROOM_MM`
wider than a lead, with a copper ring of `RING_MM`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from optopad.design.fields.packaged import data_table
from optopad.design.mold.sockets import WallFrame, lead_offsets_mm, lead_setback_mm
from optopad.design.parts.catalog import Part
from optopad.design.parts.orders import order_of
from optopad.design.shape.cavity import PlacedPart
from optopad.design.shape.outline import Point
from optopad.fabrication.board.model import Footprint, Pad, moved

TOE_MM = 0.4
HOLE_ROOM_MM = 0.2
RING_MM = 0.35
WIRE_OUT_MM = 2.0
"""Distance of the holes for wires from the mold's outer face [mm]."""
HEADER_PITCH_MM, HEADER_DRILL_MM, HEADER_PAD_MM = 2.54, 1.0, 1.7
"""A pin header, as KiCad's Connector_PinHeader_2.54mm."""
BEND_MM = 1.5
"""From the base of a part that lies on its back to the bend of its leads [mm]."""
WIRES = "two wires"
SIDE_LOOKING_DEG = 45.0
"""Tilt from which a floor part with leads stands upright, with its leads straight below the body."""


@cache
def board_data() -> Mapping[str, Any]:
    """The packages, the pins of chips and the order numbers."""
    return data_table("board_packages.toml")


def packaged(
    package: str,
    reference: str,
    value: str,
    nets: Mapping[str, str],
    at: Point,
    angle_deg: float = 0.0,
    **more: Any,
) -> Footprint:
    """A part in a standard package.

    Parameters
    ----------
    nets : net of each pad by its number; a pad that is missing is not connected
    """
    data = board_data()
    entry = data["rows"].get(package) or data["pads"][package]
    pads = _row_pads(entry) if "pins" in entry else entry["pads"]
    return Footprint(
        reference=reference,
        value=value,
        package=package,
        library=entry["footprint"],
        x=at[0],
        y=at[1],
        angle_deg=angle_deg,
        pads=tuple(_pad(one, nets, at, angle_deg) for one in pads),
        body=(entry["body"][0], entry["body"][1]),
        **more,
    )


def _row_pads(entry: Mapping[str, Any]) -> Iterator[list[Any]]:
    each = entry["pins"] // 2
    for k in range(entry["pins"]):
        is_left = k < each
        step = k if is_left else entry["pins"] - 1 - k
        y = ((each - 1) / 2 - step) * entry["pitch"]
        yield [str(k + 1), -entry["row"] if is_left else entry["row"], y, *entry["pad"]]
    if "below" in entry:
        yield [str(entry["pins"] + 1), 0.0, 0.0, *entry["below"]]


def _pad(row: Sequence[Any], nets: Mapping[str, str], at: Point, angle_deg: float) -> Pad:
    number, x, y, width, height = row
    x, y = moved((x, y), at, angle_deg)
    return Pad(
        number=number, net=nets.get(number, ""), x=x, y=y, width=width, height=height, angle_deg=angle_deg
    )


def round_pad(number: str, net: str, at: Point, drill_mm: float, width: float | None = None) -> Pad:
    """A round pad with a hole."""
    size = drill_mm + 2 * RING_MM if width is None else width
    return Pad(
        number=number,
        net=net,
        x=at[0],
        y=at[1],
        width=size,
        height=size,
        is_round=True,
        drill_mm=round(drill_mm, 2),
    )


def pin_header(nets: Sequence[str], at: Point) -> Footprint:
    """A header of two rows; `at` is its middle. Odd pins are on the left, from the top."""
    rows = (len(nets) + 1) // 2
    half = HEADER_PITCH_MM / 2
    pads = []
    for k, net in enumerate(nets):
        place = at[0] + (half if k % 2 else -half), at[1] + ((rows - 1) / 2 - k // 2) * HEADER_PITCH_MM
        pads.append(round_pad(str(k + 1), net, place, HEADER_DRILL_MM, HEADER_PAD_MM))
    return Footprint(
        reference="J1",
        value=f"pin header 2x{rows}",
        package=f"2x{rows:02d}, 2.54 mm",
        library=f"Connector_PinHeader_2.54mm:PinHeader_2x{rows:02d}_P2.54mm_Vertical",
        x=at[0],
        y=at[1],
        pads=tuple(pads),
        body=(2 * HEADER_PITCH_MM, rows * HEADER_PITCH_MM),
    )


def cathode_is_left(part_id: str) -> tuple[bool, bool]:
    """Whether the cathode's lead is left, seen from the light with the leads down, and whether that is known."""
    side = board_data()["optical"].get(part_id, {}).get("cathode")
    return side != "right", side is not None


def wall_part(part: PlacedPart, frame: WallFrame, reference: str, anode: str, cathode: str) -> Footprint:
    """Holes for a part in a wall of the mold: for its leads below it, or for two wires outside the mold."""
    if part.part.mounting == "radial":
        return _upright(part, reference, anode, cathode, lead_setback_mm(part.part))
    out = frame.thickness_at_mm(part.along_mm) + WIRE_OUT_MM
    return _wired(part, reference, anode, cathode, lambda offset: frame.point(part.along_mm + offset, out))


def _wired(
    part: PlacedPart,
    reference: str,
    anode: str,
    cathode: str,
    place: Callable[[float], Point],
    note: str = "",
) -> Footprint:
    """Two holes for wires; `place` is the position of a hole by its distance along the part's width."""
    entry = part.part
    drill = round(entry.lead_diameter_mm.value + 0.1, 2)
    pitch = max(entry.lead_pitch_mm.value, drill + 2 * RING_MM + 0.4)
    pads = round_pad("A", anode, place(-pitch / 2), drill), round_pad("K", cathode, place(pitch / 2), drill)
    x, y = place(0.0)
    return Footprint(
        reference=reference, value=entry.title, package=WIRES, x=x, y=y, pads=pads,
        body=(pads[0].width, pads[0].width), is_placed=False, note=note,
    )  # fmt: skip


def floor_part(part: PlacedPart, reference: str, anode: str, cathode: str) -> Footprint:
    """A part that stands on the board, with its active area at its position.

    Leads go through the board: below a part that looks level, beyond the base of one that looks up. A tilted
    surface-mount part has wires behind its back.
    """
    entry, own = part.part, board_data()["optical"].get(part.part_id, {})
    if entry.mounting == "radial":
        stands = part.tilt_deg > SIDE_LOOKING_DEG
        beyond = lead_setback_mm(entry) if stands else -entry.active_height_in_body_mm.value - BEND_MM
        return _upright(part, reference, anode, cathode, beyond)
    if part.tilt_deg > 0.0:
        behind = entry.body_depth_mm.value + WIRE_OUT_MM
        note = "tilted surface-mount parts have holes for two wires behind them: hold them while the silicone cures"
        return _wired(part, reference, anode, cathode, lambda offset: part.line.point(offset, behind), note)
    angle = _angle_deg(part.line.tangent)
    # The active area is this far below the middle of the body, which points against the turn.
    off = entry.body_height_mm.value / 2 - entry.active_height_in_body_mm.value
    at, middle = part.line.point(part.along_mm), part.line.point(part.along_mm, off)
    nets, pitch = {"K": cathode, "A": anode}, entry.lead_pitch_mm.value
    # A body that is deeper than wide, as that of a 5 mm LED, stands on leads.
    if own.get("through_hole", entry.body_depth_mm.value > entry.body_width_mm.value):
        drill = round(entry.lead_diameter_mm.value + HOLE_ROOM_MM, 2)
        pads = tuple(
            round_pad(name, nets[name], moved((x, 0.0), middle, angle), drill)
            for name, x in (("K", -pitch / 2), ("A", pitch / 2))
        )
    elif "pads" in own:
        pads = tuple(_pad(row, nets, at, angle) for row in own["pads"])
    else:
        pads = tuple(_pad(row, nets, middle, angle) for row in surface_pads(entry))
    ordered = order_of((part.part_id,))
    note = (
        own.get("note", "")
        if own
        else f"{part.part_id}: its pads and polarity are assumed from its size; see its data sheet"
    )
    return Footprint(
        reference=reference, value=entry.title, package=part.part_id, x=middle[0], y=middle[1], angle_deg=angle,
        pads=pads, body=(entry.body_width_mm.value, entry.body_height_mm.value), note=note,
        part_number="" if ordered is None else ordered[1],
    )  # fmt: skip


def coupler(reference: str, emitter: Footprint, receiver: Footprint) -> Footprint:
    """The package that an emitter and a receiver share."""
    value, _, _ = emitter.value.partition(",")
    corners = [
        moved((x - emitter.x, y - emitter.y), (0.0, 0.0), -emitter.angle_deg)
        for one in (emitter, receiver)
        for x, y in one.body_corners
    ]
    xs, ys = zip(*corners, strict=True)
    x, y = moved(
        ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2), (emitter.x, emitter.y), emitter.angle_deg
    )
    pads = tuple(
        replace(pad, number=kind + pad.number)
        for kind, one in (("E", emitter), ("R", receiver))
        for pad in one.pads
    )
    return replace(
        emitter, reference=reference, value=value, x=x, y=y, pads=pads,
        body=(max(xs) - min(xs), max(ys) - min(ys)), note=emitter.note or receiver.note,
    )  # fmt: skip


def surface_pads(entry: Part) -> list[list[Any]]:
    """Two pads of a surface-mount part along its width, the cathode's first."""
    pitch, width = entry.lead_pitch_mm.value, entry.body_width_mm.value
    outer = max(width / 2 + TOE_MM, pitch / 2 + TOE_MM / 2)
    length = round(min(2 * (outer - pitch / 2), pitch - 0.4), 3)
    height = round(min(entry.body_height_mm.value + 0.15, 2.8), 3)
    return [["K", -pitch / 2, 0.0, length, height], ["A", pitch / 2, 0.0, length, height]]


def _upright(part: PlacedPart, reference: str, anode: str, cathode: str, behind_mm: float) -> Footprint:
    """A part whose leads go straight down into the board at a distance behind its active face."""
    entry = part.part
    drill = round(entry.lead_diameter_mm.value + HOLE_ROOM_MM, 2)
    (ox, oy), (tx, ty) = part.line.outward, part.line.tangent
    # Seen from the light, left is its direction (-outward) turned clockwise, as seen from above.
    is_left_last = tx * -oy + ty * ox > 0
    left, is_known = cathode_is_left(part.part_id)
    offsets = lead_offsets_mm(entry)
    names = ["", *[""] * (len(offsets) - 2), ""]
    names[0], names[-1] = ("A", "K") if left == is_left_last else ("K", "A")
    nets = {"K": cathode, "A": anode}
    places = [part.line.point(part.along_mm + offset, behind_mm) for offset in offsets]
    at = part.line.point(part.along_mm, behind_mm)
    pads = tuple(
        round_pad(name or str(k + 1), nets.get(name, ""), place, drill)
        for k, (name, place) in enumerate(zip(names, places, strict=True))
    )
    note = (
        ""
        if is_known
        else f"{part.part_id}: the cathode is assumed left, seen from the light; see its data sheet"
    )
    return Footprint(
        reference=reference, value=entry.title, package="leads", x=at[0], y=at[1], angle_deg=_angle_deg((tx, ty)),
        pads=pads, body=(entry.body_width_mm.value, entry.body_depth_mm.value), is_placed=False, note=note,
    )  # fmt: skip


def _angle_deg(direction: Point) -> float:
    return round(math.degrees(math.atan2(direction[1], direction[0])), 6) % 360.0
