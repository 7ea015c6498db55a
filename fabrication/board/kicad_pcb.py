"""The board as a KiCad file (version 6 and later), with the design rules of its project.

KiCad's y runs downward; the board's lower left corner is `SHIFT_MM` from the sheet's corner.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import pairwise
from uuid import UUID, uuid5

from optopad.design.shape.outline import Point
from optopad.fabrication.board.gerber import EDGE_LINE_MM, LINE_MM, MASK_MM, corners
from optopad.fabrication.board.lettering import pitch_mm
from optopad.fabrication.board.model import (
    CLEARANCE_MM,
    EDGE_MM,
    GROUND,
    TRACK_MM,
    VIA_DRILL_MM,
    VIA_MM,
    Board,
    Footprint,
    Pad,
    moved,
)

SHIFT_MM = 25.0
SPACE = UUID("5a3fb2a0-6c1e-4d0e-9f0e-0e6f70746f70")
LAYERS = ("F.Cu", "B.Cu")
TABLE = (
    (0, "F.Cu", "signal"), (31, "B.Cu", "signal"), (34, "B.Paste", "user"), (35, "F.Paste", "user"),
    (36, "B.SilkS", "user"), (37, "F.SilkS", "user"), (38, "B.Mask", "user"), (39, "F.Mask", "user"),
    (44, "Edge.Cuts", "user"), (46, "B.CrtYd", "user"), (47, "F.CrtYd", "user"), (48, "B.Fab", "user"),
    (49, "F.Fab", "user"),
)  # fmt: skip


def quoted(text: str) -> str:
    """A text in quotation marks."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def stamp(*names: object) -> str:
    """An identifier that depends on names alone."""
    return str(uuid5(SPACE, "/".join(map(str, names))))


def effects(height_mm: float) -> str:
    """Size of a text."""
    return f"(effects (font (size {height_mm:g} {height_mm:g}) (thickness {1.25 * pitch_mm(height_mm):.3f})))"


def pcb_text(board: Board) -> str:
    """Text of the board's file."""
    return "\n".join([*_lines(board), ")", ""])


def _lines(board: Board) -> Iterator[str]:
    place = _Place(board)
    yield "(kicad_pcb (version 20211014) (generator optopad)"
    yield '  (general (thickness 1.6)) (paper "A3")'
    yield f"  (title_block (title {quoted(board.title)}))"
    yield "  (layers " + " ".join(f'({number} "{name}" {kind})' for number, name, kind in TABLE) + ")"
    yield f"  (setup (pad_to_mask_clearance {MASK_MM:g}))"
    yield from (f"  (net {number} {quoted(name)})" for name, number in place.nets.items())
    for one in board.footprints:
        yield from _footprint(one, place)
    for k, hole in enumerate(board.holes, start=1):
        size = f"(size {hole.diameter_mm:g} {hole.diameter_mm:g}) (drill {hole.diameter_mm:g})"
        yield f'  (footprint "optopad:hole" (layer "F.Cu") (tstamp {stamp("hole", k)}) (at {place(hole.x, hole.y)})'
        yield "    (attr exclude_from_pos_files exclude_from_bom)"
        yield f'    (fp_text reference "H{k}" (at 0 0) (layer "F.Fab") {effects(0.5)})'
        yield f'    (fp_text value "hole" (at 0 1) (layer "F.Fab") hide {effects(0.5)})'
        yield f'    (pad "" np_thru_hole circle (at 0 0) {size} (layers *.Cu *.Mask) (tstamp {stamp("H", k)})))'
    yield from _drawing("Edge.Cuts", corners(board), EDGE_LINE_MM, place)
    for line in board.lines:
        yield from _drawing("F.SilkS", line, LINE_MM, place)
    for k, label in enumerate(board.labels):
        words = f"(gr_text {quoted(label.text)} (at {place(label.x, label.y)})"
        yield f'  {words} (layer "F.SilkS") (tstamp {stamp("label", k)}) {effects(label.height_mm)})'
    for k, track in enumerate(board.tracks):
        ends = f"(start {place(*track.start)}) (end {place(*track.end)}) (width {TRACK_MM:g})"
        net = f"(net {place.nets[track.net]})"
        yield f'  (segment {ends} (layer "{LAYERS[track.layer]}") {net} (tstamp {stamp("track", k)}))'
    for k, via in enumerate(board.vias):
        size = f'(size {VIA_MM:g}) (drill {VIA_DRILL_MM:g}) (layers "F.Cu" "B.Cu")'
        yield f"  (via (at {place(via.x, via.y)}) {size} (net {place.nets[via.net]}) (tstamp {stamp('via', k)}))"
    for layer, pour in enumerate(board.pours):
        if pour:
            yield from _zone(board, layer, place)


class _Place:
    """Positions of a board on KiCad's sheet, and the numbers of its nets."""

    def __init__(self, board: Board) -> None:
        self.x0, self.y1 = board.box[0] - SHIFT_MM, board.box[3] + SHIFT_MM
        self.nets = {"": 0} | {name: number for number, name in enumerate(board.nets, start=1)}

    def __call__(self, x: float, y: float) -> str:
        return f"{x - self.x0:.6g} {self.y1 - y:.6g}"


def _drawing(layer: str, points: tuple[Point, ...], width_mm: float, place: _Place) -> Iterator[str]:
    for k, (start, end) in enumerate(pairwise(points)):
        ends = f"(start {place(*start)}) (end {place(*end)})"
        yield f'  (gr_line {ends} (layer "{layer}") (width {width_mm:g}) (tstamp {stamp(layer, points, k)}))'


def _footprint(one: Footprint, place: _Place) -> Iterator[str]:
    kind = "through_hole" if any(pad.drill_mm for pad in one.pads) else "smd"
    left_out = "" if one.is_placed else " exclude_from_pos_files exclude_from_bom"
    name = one.library or f"optopad:{one.package}"
    at = f"{place(one.x, one.y)} {one.angle_deg:g}"
    yield f'  (footprint {quoted(name)} (layer "F.Cu") (tstamp {stamp(one.reference)}) (at {at})'
    yield f"    (attr {kind}{left_out})"
    yield f'    (fp_text reference {quoted(one.reference)} (at 0 0) (layer "F.Fab") {effects(0.5)})'
    yield f'    (fp_text value {quoted(one.value)} (at 0 1) (layer "F.Fab") hide {effects(0.5)})'
    half_x, half_y = one.body[0] / 2, one.body[1] / 2
    ends = f"(start {-half_x:g} {-half_y:g}) (end {half_x:g} {half_y:g})"
    yield f'    (fp_rect {ends} (layer "F.Fab") (width 0.1) (tstamp {stamp(one.reference, "body")}))'
    for k, pad in enumerate(one.pads):
        yield f"    {_pad(one, pad, place)} (tstamp {stamp(one.reference, pad.number, k)}))"
    yield "  )"


def _pad(one: Footprint, pad: Pad, place: _Place) -> str:
    x, y = moved((pad.x - one.x, pad.y - one.y), (0.0, 0.0), -one.angle_deg)
    shape = "circle" if pad.is_round else "rect"
    kind, layers, drill = "smd", '"F.Cu" "F.Paste" "F.Mask"', ""
    if pad.drill_mm:
        kind, layers, drill = "thru_hole", '"*.Cu" "*.Mask"', f" (drill {pad.drill_mm:g})"
    net = f" (net {place.nets[pad.net]} {quoted(pad.net)})" if pad.net else ""
    at = f"(at {x:.6g} {-y:.6g} {pad.angle_deg:g}) (size {pad.width:g} {pad.height:g}){drill}"
    return f"(pad {quoted(pad.number)} {kind} {shape} {at} (layers {layers}){net}"


def _zone(board: Board, layer: int, place: _Place) -> Iterator[str]:
    """The ground pour as a zone that KiCad has yet to fill."""
    x0, y0, x1, y1 = board.box
    ends = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    name, net = LAYERS[layer], place.nets[GROUND]
    yield f'  (zone (net {net}) (net_name "{GROUND}") (layer "{name}") (tstamp {stamp("zone", layer)}) (hatch edge 0.5)'
    yield f"    (connect_pads no (clearance {CLEARANCE_MM:g})) (min_thickness 0.2)"
    yield "    (fill (thermal_gap 0.3) (thermal_bridge_width 0.3))"
    yield "    (polygon (pts " + " ".join(f"(xy {place(*end)})" for end in ends) + ")))"


def project_text(board: Board) -> str:
    """Text of the project's file: the design rules that the board keeps."""
    rules = {
        "min_clearance": CLEARANCE_MM,
        "min_copper_edge_clearance": EDGE_MM,
        "min_track_width": TRACK_MM,
        "min_via_diameter": VIA_MM,
        "min_through_hole_diameter": VIA_DRILL_MM,
        "min_hole_to_hole": 0.25,
        "min_hole_clearance": 0.2,
    }
    default = {
        "name": "Default",
        "clearance": CLEARANCE_MM,
        "track_width": TRACK_MM,
        "via_diameter": VIA_MM,
        "via_drill": VIA_DRILL_MM,
    }
    document = {
        "board": {"design_settings": {"rules": rules}},
        "meta": {"filename": "optopad.kicad_pro", "version": 1},
        "net_settings": {"classes": [default], "meta": {"version": 2}},
        "schematic": {"meta": {"version": 1}},
        "text_variables": {"DESIGN": board.title},
    }
    return json.dumps(document, indent=2) + "\n"
