"""What becomes of light, for people: kinds of path, the mode that each belongs to, its words and its colours.

The light models tell more classes and losses apart than a picture can; this is the one table that says which
of them are drawn alike. A class that is not in it is drawn as `other`, under its own name.

Colours are those of the signal plots (Okabe and Ito 2008) and pale versions of them for a dark ground; dash
and mark differ too, so that nothing rests on colour alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Mark = Literal["none", "mirror", "scatter", "end"]


@dataclass(frozen=True, kw_only=True)
class LightKind:
    """Light that is drawn alike.

    Attributes
    ----------
    key : short name, in files and in the page
    title : for a legend
    words : what it is, in a sentence
    mode : 1, 2, or None for light that is part of neither
    classes : names of path classes and losses of the light models
    colour, night_colour : on a light and on a dark ground
    dash : lengths of strokes and gaps over the line's width; empty for a solid line
    mark : what is marked along a path: places where it is mirrored or scattered, or its end
    """

    key: str
    title: str
    words: str
    mode: int | None
    classes: tuple[str, ...]
    colour: str
    night_colour: str
    dash: tuple[float, ...]
    mark: Mark


DIRECT = LightKind(
    key="direct",
    title="mode 2: direct",
    words="straight from emitter to receiver, until the dimple or the tip is in the way",
    mode=2,
    classes=("direct",),
    colour="#0072b2",
    night_colour="#5cb8f0",
    dash=(),
    mark="none",
)
MIRRORED = LightKind(
    key="top",
    title="mode 1: mirrored by the top",
    words="mirrored by the top; a press tilts the mirror",
    mode=1,
    classes=("top", "skirt"),
    colour="#c24e00",
    night_colour="#ff9f5f",
    dash=(),
    mark="mirror",
)
WALL = LightKind(
    key="wall",
    title="mirrored by a wall",
    words="mirrored by a smooth wall at least once, never scattered",
    mode=None,
    classes=("wall",),
    colour="#93387a",
    night_colour="#eb9fd2",
    dash=(7.0, 2.0),
    mark="mirror",
)
CROSSING = LightKind(
    key="crossing",
    title="across the crater",
    words="left through the top and came back in across the crater",
    mode=None,
    classes=("crossing",),
    colour="#7a5c00",
    night_colour="#e3c75a",
    dash=(4.0, 1.5, 1.0, 1.5),
    mark="mirror",
)
SCATTERED = LightKind(
    key="diffuse",
    title="scattered",
    words="scattered at least once by a wall, the bottom or the tip",
    mode=None,
    classes=("diffuse",),
    colour="#00785a",
    night_colour="#57cfa9",
    dash=(5.0, 1.5, 1.0, 1.5),
    mark="scatter",
)
LOST = LightKind(
    key="lost",
    title="lost",
    words="absorbed by walls, bottom or tip, or gone through the top",
    mode=None,
    classes=("walls", "bottom", "tip", "volume", "escaped", "uncounted", "unsubmerged", "unresolved"),
    colour="#5b6470",
    night_colour="#98a1ac",
    dash=(1.0, 2.0),
    mark="end",
)
KINDS = (DIRECT, MIRRORED, WALL, CROSSING, SCATTERED, LOST)
"""All kinds, in the order of a legend; `LOST` last."""

_BY_CLASS = {name: kind for kind in KINDS for name in kind.classes}


def kind_of(class_name: str) -> LightKind:
    """The kind of a path class or loss; one that is not in the table becomes a kind of its own."""
    if class_name in _BY_CLASS:
        return _BY_CLASS[class_name]
    return LightKind(
        key="other",
        title=f"other: {class_name}",
        words=f"the light model's class {class_name!r}",
        mode=None,
        classes=(class_name,),
        colour="#444c57",
        night_colour="#c3cad2",
        dash=(3.0, 1.0),
        mark="none",
    )
