"""Circuit symbols as SVG elements, on a grid of drawing units; y downward (IEC 60617 shapes, simplified)."""

from __future__ import annotations

from fabrication.sheets.formats import svg
from fabrication.sheets.formats.svg import Element, Point

LINE = "#222222"
WIRE = {"stroke": LINE, "stroke_width": "1.6"}
BOX = {"fill": "#ffffff", "stroke": LINE, "stroke_width": "1.6"}
LONG, SHORT = 34.0, 11.0
"""A resistor's length and width."""


def wire(*points: Point) -> Element:
    """A wire through points."""
    return svg.polyline(list(points), **WIRE)


def dot(at: Point) -> Element:
    """A joint of wires."""
    return svg.circle(at, 2.6, fill=LINE)


def resistor(centre: Point, *, upright: bool) -> Element:
    """A resistor; wires end at half its length from the centre."""
    half = (SHORT / 2, LONG / 2) if upright else (LONG / 2, SHORT / 2)
    low = centre[0] - half[0], centre[1] - half[1]
    return svg.rectangle(low, (centre[0] + half[0], centre[1] + half[1]), **BOX)


def capacitor(centre: Point) -> list[Element]:
    """A capacitor between wires from left and right, which end 3 units from its centre."""
    x, y = centre
    return [wire((x + side, y - 9), (x + side, y + 9)) for side in (-3.0, 3.0)]


def ground(at: Point) -> list[Element]:
    """Ground below a wire that ends here."""
    x, y = at
    return [wire((x - half, y + k * 4), (x + half, y + k * 4)) for k, half in enumerate((9.0, 6.0, 3.0))]


def diode(centre: Point, *, emits: bool) -> list[Element]:
    """An LED, current downward, or a photodiode with its cathode up; 10 units to each end."""
    x, y = centre
    way = 1.0 if emits else -1.0
    triangle = [(x - 9, y - 8 * way), (x + 9, y - 8 * way), (x, y + 8 * way)]
    bar = wire((x - 9, y + 8 * way), (x + 9, y + 8 * way))
    rays = []
    for shift in (-5.0, 5.0):
        inner, outer = (x + 12, y + shift), (x + 24, y + shift - 7)
        rays += svg.arrow(inner, outer, LINE) if emits else svg.arrow(outer, inner, LINE)
    return [svg.polygon(triangle, **BOX), bar, *rays]


def npn(base: Point) -> list[Element]:
    """An NPN transistor: base at the left, collector 24 right and 22 up, emitter 24 right and 22 down."""
    x, y = base
    bar = x + 8
    return [
        wire((x, y), (bar, y)),
        svg.polyline([(bar, y - 13), (bar, y + 13)], stroke=LINE, stroke_width="3"),
        wire((bar, y - 6), (x + 24, y - 14), (x + 24, y - 22)),
        *svg.arrow((bar, y + 6), (x + 24, y + 14), LINE),
        wire((x + 24, y + 14), (x + 24, y + 22)),
    ]


def amplifier(tip: Point) -> list[Element]:
    """An operational amplifier, its output at the tip; inputs 46 left of it, - 12 up and + 12 down."""
    x, y = tip
    body = svg.polygon([(x - 46, y - 25), (x - 46, y + 25), (x, y)], **BOX)
    signs = [svg.text((x - 41, y - 8), "−", 14), svg.text((x - 41, y + 16), "+", 14)]
    return [body, *signs]


def terminal(at: Point) -> Element:
    """An end where a cable goes on."""
    return svg.circle(at, 4.0, **BOX)
