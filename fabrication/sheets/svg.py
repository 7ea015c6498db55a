"""Makes shapes of technical drawings as SVG elements.

Lengths are in drawing units (px), with y downward. Text is escaped and stripped of control characters.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree

from optopad.fabrication.sheets.template import one_line

Element = ElementTree.Element
Point = tuple[float, float]

ARROW_PX = 8.0
ARROW_HALF_PX = 3.0


def drawing(width: float, height: float, title: str, description: str) -> Element:
    """An empty white sheet, with a title and a description for screen readers."""
    root = Element(
        "svg",
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {_px(width)} {_px(height)}",
        width=_px(width),
        height=_px(height),
        role="img",
    )
    root.set("font-family", "Helvetica, Arial, 'Liberation Sans', sans-serif")
    ElementTree.SubElement(root, "title").text = one_line(title)
    ElementTree.SubElement(root, "desc").text = one_line(description)
    root.append(rectangle((0, 0), (width, height), fill="#ffffff"))
    return root


def to_text(root: Element) -> str:
    """The text of an SVG file with a drawing."""
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def group(label: str = "") -> Element:
    """A group of shapes; its label appears when the mouse pointer is over it."""
    element = Element("g")
    if label:
        ElementTree.SubElement(element, "title").text = one_line(label)
    return element


def rectangle(corner: Point, opposite: Point, **style: str) -> Element:
    """A rectangle between two corners."""
    (xa, ya), (xb, yb) = corner, opposite
    return _shape(
        "rect",
        style,
        x=_px(min(xa, xb)),
        y=_px(min(ya, yb)),
        width=_px(abs(xb - xa)),
        height=_px(abs(yb - ya)),
    )


def circle(centre: Point, radius: float, **style: str) -> Element:
    """A circle."""
    return _shape("circle", style, cx=_px(centre[0]), cy=_px(centre[1]), r=_px(radius))


def polygon(points: list[Point], **style: str) -> Element:
    """A closed outline."""
    return _shape("polygon", style, points=_points(points))


def outline(corners: list[Point], **style: str) -> Element:
    """A closed outline; if it is a rectangle parallel to the axes, the element is a rectangle."""
    if len(corners) == 4 and {corners[0], corners[2]} <= {
        (x, y) for x, _ in corners[1::2] for _, y in corners[1::2]
    }:
        return rectangle(corners[0], corners[2], **style)
    return polygon(corners, **style)


def polyline(points: list[Point], **style: str) -> Element:
    """A line through points."""
    return _shape("polyline", {"fill": "none", **style}, points=_points(points))


def text(at: Point, content: str, size: float, **style: str) -> Element:
    """A line of text. The style `anchor` says which part of the text is at `at`: start, middle or end."""
    element = _shape("text", style, x=_px(at[0]), y=_px(at[1]))
    element.set("font-size", _px(size))
    element.text = one_line(content)
    return element


def arrow(tail: Point, head: Point, colour: str) -> list[Element]:
    """A line with an arrowhead at its end."""
    angle = math.atan2(head[1] - tail[1], head[0] - tail[0])
    back = (head[0] - ARROW_PX * math.cos(angle), head[1] - ARROW_PX * math.sin(angle))
    across = (-ARROW_HALF_PX * math.sin(angle), ARROW_HALF_PX * math.cos(angle))
    wings = [(back[0] + sign * across[0], back[1] + sign * across[1]) for sign in (1, -1)]
    return [polyline([tail, back], stroke=colour), polygon([head, *wings], fill=colour)]


def triangle(centre: Point, toward: Point, radius: float, **style: str) -> Element:
    """An equilateral triangle whose tip points along `toward`; `radius` is that of its circumscribed circle."""
    angle = math.atan2(toward[1], toward[0])
    corners = [angle + k * math.tau / 3 for k in range(3)]
    points = [(centre[0] + radius * math.cos(a), centre[1] + radius * math.sin(a)) for a in corners]
    return polygon(points, **style)


def _shape(tag: str, style: dict[str, str], **geometry: str) -> Element:
    element = Element(tag, geometry)
    for name, value in style.items():
        element.set("text-anchor" if name == "anchor" else name.replace("_", "-"), value)
    return element


def _points(points: list[Point]) -> str:
    return " ".join(f"{_px(x)},{_px(y)}" for x, y in points)


def _px(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")
