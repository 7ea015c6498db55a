"""Gerber (RS-274X with X2 attributes) and Excellon files of a board, as texts by file name.

Coordinates are in millimetres from the board's lower left corner. Vias are covered by the solder mask.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from optopad.design.shape.outline import Point
from optopad.fabrication.board.lettering import strokes
from optopad.fabrication.board.model import BOTTOM, TOP, TRACK_MM, VIA_DRILL_MM, VIA_MM, Board, Pad

MASK_MM = 0.05
"""Distance of the solder mask's opening from a pad [mm]."""
LINE_MM = 0.15
"""Width of printed lines [mm]."""
EDGE_LINE_MM = 0.1
TURNED = "%AMTURNED*21,1,$1,$2,0,0,$3*%"
"""Aperture of a turned rectangle: width, height, angle."""

FUNCTIONS = {
    "F_Cu.gtl": "Copper,L1,Top",
    "B_Cu.gbl": "Copper,L2,Bot",
    "F_Mask.gts": "Soldermask,Top",
    "B_Mask.gbs": "Soldermask,Bot",
    "F_Paste.gtp": "Paste,Top",
    "F_Silkscreen.gto": "Legend,Top",
    "Edge_Cuts.gm1": "Profile,NP",
}


class _Layer:
    """Text of one Gerber file."""

    def __init__(self, board: Board) -> None:
        self.origin = board.box[0], board.box[1]
        self.apertures: dict[str, int] = {}
        self.lines: list[str] = []
        self.chosen = -1

    def _at(self, point: Point) -> str:
        x, y = (round((value - zero) * 1e6) for value, zero in zip(point, self.origin, strict=True))
        return f"X{x}Y{y}"

    def _use(self, aperture: str) -> None:
        number = self.apertures.setdefault(aperture, 10 + len(self.apertures))
        if number != self.chosen:
            self.lines.append(f"D{number}*")
            self.chosen = number

    def flash(self, pad: Pad, grow_mm: float = 0.0) -> None:
        """A pad, larger by a distance on all sides."""
        width, height = pad.width + 2 * grow_mm, pad.height + 2 * grow_mm
        if pad.is_round:
            self._use(f"C,{width:.4f}")
        elif pad.angle_deg % 90.0 == 0.0:
            wide, high = (width, height) if pad.angle_deg % 180.0 == 0.0 else (height, width)
            self._use(f"R,{wide:.4f}X{high:.4f}")
        else:
            self._use(f"TURNED,{width:.4f}X{height:.4f}X{pad.angle_deg:.4f}")
        self.lines.append(f"{self._at((pad.x, pad.y))}D03*")

    def disc(self, at: Point, diameter_mm: float) -> None:
        """A round spot."""
        self._use(f"C,{diameter_mm:.4f}")
        self.lines.append(f"{self._at(at)}D03*")

    def draw(self, points: Sequence[Point], width_mm: float) -> None:
        """A line through points."""
        self._use(f"C,{width_mm:.4f}")
        self.lines.append(f"{self._at(points[0])}D02*")
        self.lines += [f"{self._at(point)}D01*" for point in points[1:]]

    def fill(self, corners: Sequence[Point]) -> None:
        """A filled polygon."""
        self.lines += ["G36*", f"{self._at(corners[0])}D02*", "G01*"]
        self.lines += [f"{self._at(point)}D01*" for point in (*corners[1:], corners[0])]
        self.lines.append("G37*")

    def text(self, function: str) -> str:
        """The file's text."""
        head = [
            "%TF.GenerationSoftware,optopad*%",
            f"%TF.FileFunction,{function}*%",
            "%TF.FilePolarity,Positive*%",
        ]
        head += ["%FSLAX46Y46*%", "%MOMM*%", TURNED, "%LPD*%", "G01*"]
        head += [f"%ADD{number}{aperture}*%" for aperture, number in self.apertures.items()]
        return "\n".join([*head, *self.lines, "M02*", ""])


def gerber_texts(board: Board) -> dict[str, str]:
    """Texts of all layers and drill files, by the end of the file's name."""
    draw: dict[str, Callable[[_Layer], None]] = {
        "F_Cu.gtl": lambda layer: _copper(layer, board, TOP),
        "B_Cu.gbl": lambda layer: _copper(layer, board, BOTTOM),
        "F_Mask.gts": lambda layer: _openings(layer, board, TOP),
        "B_Mask.gbs": lambda layer: _openings(layer, board, BOTTOM),
        "F_Paste.gtp": lambda layer: _paste(layer, board),
        "F_Silkscreen.gto": lambda layer: _printed(layer, board),
        "Edge_Cuts.gm1": lambda layer: layer.draw(corners(board), EDGE_LINE_MM),
    }
    found = {}
    for name, function in FUNCTIONS.items():
        layer = _Layer(board)
        draw[name](layer)
        found[name] = layer.text(function)
    plated = [(pad.drill_mm, pad.x, pad.y) for _, pad in board.pads if pad.drill_mm]
    plated += [(VIA_DRILL_MM, via.x, via.y) for via in board.vias]
    found["PTH.drl"] = _drill(board, plated)
    found["NPTH.drl"] = _drill(board, [(hole.diameter_mm, hole.x, hole.y) for hole in board.holes])
    return found


def corners(board: Board) -> tuple[Point, ...]:
    """The closed outline of a board."""
    x0, y0, x1, y1 = board.box
    return (x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)


def _copper(layer: _Layer, board: Board, number: int) -> None:
    for corners in board.pours[number]:
        layer.fill(corners)
    for _, pad in board.pads:
        if number in pad.layers:
            layer.flash(pad)
    for track in board.tracks:
        if track.layer == number:
            layer.draw((track.start, track.end), TRACK_MM)
    for via in board.vias:
        layer.disc((via.x, via.y), VIA_MM)


def _openings(layer: _Layer, board: Board, number: int) -> None:
    for _, pad in board.pads:
        if number in pad.layers:
            layer.flash(pad, MASK_MM)
    for hole in board.holes:
        layer.disc((hole.x, hole.y), hole.diameter_mm + 2 * MASK_MM)


def _paste(layer: _Layer, board: Board) -> None:
    for _, pad in board.pads:
        if not pad.drill_mm:
            layer.flash(pad)


def _printed(layer: _Layer, board: Board) -> None:
    for line in board.lines:
        layer.draw(line, LINE_MM)
    for label in board.labels:
        for one in strokes(label):
            layer.fill(((one.x0, one.y0), (one.x1, one.y0), (one.x1, one.y1), (one.x0, one.y1)))


def _drill(board: Board, holes: Iterable[tuple[float, float, float]]) -> str:
    by_size: dict[float, list[Point]] = {}
    for size, x, y in holes:
        by_size.setdefault(round(size, 3), []).append((x - board.box[0], y - board.box[1]))
    return "\n".join([*_drill_lines(by_size), ""])


def _drill_lines(by_size: dict[float, list[Point]]) -> Iterator[str]:
    sizes = sorted(by_size)
    yield from (
        "M48",
        "METRIC",
        *(f"T{k}C{size:.3f}" for k, size in enumerate(sizes, start=1)),
        "%",
        "G90",
        "G05",
    )
    for k, size in enumerate(sizes, start=1):
        yield f"T{k}"
        yield from (f"X{x:.3f}Y{y:.3f}" for x, y in sorted(by_size[size]))
    yield "M30"
