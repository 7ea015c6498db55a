"""Sample paths of light in a vertical cross-section and in plan view, with the power of each kind of light.

The cross-section is along a line between two walls: the chord of a pair, the line straight across from a component, or
a line through a point. Paths are projected onto its plane. A path outside the plane may therefore seem to end at a wall
that it does not touch; the plan view shows its true course. Tip and pressed top are drawn where the plane cuts them
(`optopad.sims.plots.contact`). If the tip's axis is not in the plane, the tip's projected outline is added as a dotted
line.

The drawn paths are samples (`optopad.sims.rays`). The powers in the legend come from the light model.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon, Rectangle

from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, cavity_of, outline_mm
from optopad.design.spec import SensorDesign
from optopad.sims.optics.paths import LightPath
from optopad.sims.plots.contact import (
    CutPlane,
    PressFrame,
    cut_tip_mm,
    cut_top_mm,
    press_frame,
    seen_tip_mm,
)
from optopad.sims.plots.maps import draw_part, outline_patch
from optopad.sims.plots.style import BLUE, GREY, INK, MUTED, PALE_BLUE, axes_or_new
from optopad.sims.press import Indentation
from optopad.sims.rays import KINDS, LOST, LightKind, RayState, kind_of

SILHOUETTE_POINTS = 60


@dataclass(frozen=True, kw_only=True)
class Cut:
    """The horizontal line of a vertical cross-section from wall to wall; its start is drawn on the left.

    Attributes
    ----------
    start_mm, end_mm : (x, y) of the line's ends [mm]
    name : description for the axis label
    """

    start_mm: tuple[float, float]
    end_mm: tuple[float, float]
    name: str

    @property
    def length_mm(self) -> float:
        """Length of the line [mm]."""
        return float(np.hypot(*np.subtract(self.end_mm, self.start_mm)))

    @property
    def direction(self) -> FloatArray:
        """Unit vector (2,) from start to end [-]."""
        return np.subtract(self.end_mm, self.start_mm) / self.length_mm

    def plane(self, ceiling_mm: float) -> CutPlane:
        """The vertical plane through the line, up to a height [mm]."""
        right, up = self.direction.tolist()
        reach = 0.0, self.length_mm
        return CutPlane(start_mm=self.start_mm, direction=(right, up), reach_mm=reach, ceiling_mm=ceiling_mm)

    def reach_mm(self, cavity: CavityGeometry) -> tuple[float, float]:
        """Smallest and largest distance along the line for the whole pad, projected onto the cross-section [mm]."""
        along = self.along_mm(outline_mm(cavity.plan))
        return float(along.min()), float(along.max())

    def along_mm(self, places_mm: FloatArray) -> FloatArray:
        """Distance (...) along the line from its start [mm], for points (..., 2) or (..., 3) in cavity coordinates."""
        return np.asarray((places_mm[..., :2] - np.array(self.start_mm)) @ self.direction)

    def silhouette_mm(self, cavity: CavityGeometry, reach: tuple[float, float]) -> FloatArray:
        """Distance and height (n, 2) of the clear layer's outline, projected onto the cross-section [mm]."""
        along = np.linspace(*reach, SILHOUETTE_POINTS)
        size = cavity.plan.radius_mm
        aside = np.linspace(-2.0 * size, 2.0 * size, 4 * SILHOUETTE_POINTS)
        across = self.direction[::-1] * [-1.0, 1.0]
        tops = []
        for distance in along:
            places = np.array(self.start_mm) + distance * self.direction + aside[:, None] * across
            inside = [(x, y) for x, y in places.tolist() if cavity.plan.contains(x, y)]
            tops.append(max((cavity.plan.top_mm(x, y) for x, y in inside), default=0.0))
        return np.column_stack([[reach[0], *along, reach[1]], [0.0, *tops, 0.0]])

    def beside_mm(self, place_mm: tuple[float, float]) -> float:
        """Distance of a point (x, y) from the line [mm]."""
        ahead, aside = np.subtract(place_mm, self.start_mm), self.direction[::-1] * [-1.0, 1.0]
        return float(abs(ahead @ aside))


def cut_of_pair(cavity: CavityGeometry, pair: tuple[int, int]) -> Cut:
    """The cross-section along a pair's chord, from emitter to receiver."""
    ends = cavity.emitters[pair[0]], cavity.receivers[pair[1]]
    start, end = (part.position_mm[:2] for part in ends)
    return Cut(start_mm=start, end_mm=end, name=f"along the chord from {ends[0].name} to {ends[1].name}")


def cut_across(cavity: CavityGeometry, part: PlacedPart) -> Cut:
    """The cross-section from a component straight across to the opposite wall; on the floor, through the component."""
    x, y, _ = part.position_mm
    if part.is_on_floor:
        return cut_through(cavity, x, y)
    right, up = part.line.outward
    far = cavity.plan.outline.way_out_mm((x, y), (-right, -up))
    end = (x - far * right, y - far * up)
    return Cut(start_mm=(x, y), end_mm=end, name=f"from {part.name} straight across")


def cut_through(cavity: CavityGeometry, x_mm: float, y_mm: float) -> Cut:
    """The cross-section through a point, from wall to wall along the pad's longer side; along x if they are equal."""
    outline, place = cavity.plan.outline, (x_mm, y_mm)
    if cavity.length_mm >= cavity.width_mm:
        back, far = (outline.way_out_mm(place, (way, 0.0)) for way in (-1.0, 1.0))
        return Cut(
            start_mm=(x_mm - back, y_mm), end_mm=(x_mm + far, y_mm), name=f"along x at y = {y_mm:g} mm"
        )
    back, far = (outline.way_out_mm(place, (0.0, way)) for way in (-1.0, 1.0))
    return Cut(start_mm=(x_mm, y_mm - back), end_mm=(x_mm, y_mm + far), name=f"along y at x = {x_mm:g} mm")


SECTION_IN = (6.6, 2.3)
PLAN_IN = (3.6, 3.2)
BLACK = "#33383f"
"""Colour of the black layer, slightly lighter than black so that marks on it are visible."""
RAY_WIDTH, LOST_WIDTH = 0.55, 0.8
HEAD_ROOM = 0.95
"""Height above the undisturbed surface up to which a cross-section is drawn [tip radii]."""
SECTION_ROOM, PLAN_ROOM = 0.07, 0.11
"""Margins around the pad in cross-section and in plan view, as a share of its drawn length [-]."""
ON_AXIS_MM = 0.05
"""Distance from the plane of the cross-section below which a press axis or a component counts as in the plane [mm]."""
CUT_FACE_MM = 0.15
"""Half the drawn thickness of a component's face where the plane of the cross-section cuts it [mm]."""
RING_POINTS = 72
MOST_LABELS, MOST_LABELS_IN_SECTION = 32, 2
"""Largest number of components for which all names are shown, in plan view and in cross-section."""


def plot_ray_section(
    state: RayState,
    design: SensorDesign,
    ax: Axes | None = None,
    *,
    cut: Cut,
    untouched: float | None = None,
) -> Axes:
    """Light paths in vertical cross-section: height above the clear layer's bottom against distance along a line [mm].

    Parameters
    ----------
    state : the press, the paths and their powers
    cut : line of the cross-section
    untouched : power that counts as 100 % in the legend, as a share of the emitters' power [-]; None is the emitters'
        power itself
    """
    ax = axes_or_new(ax, SECTION_IN[1], SECTION_IN[0])
    cavity = cavity_of(design)
    draw_cut_pad(ax, design, cut, cut.reach_mm(cavity), state.press_mm[:2], state.indentation)
    _draw_paths(ax, state, lambda places: np.column_stack([cut.along_mm(places), places[:, 2]]))
    draw_cut_faces(ax, cavity, cut, _shown_parts(state, cavity))
    ax.set_xlabel(f"distance {cut.name} [mm]")
    ax.set_ylabel("height [mm]")
    ax.legend(
        handles=legend_handles(state, untouched),
        loc="lower left",
        bbox_to_anchor=(-0.01, 1.0),
        ncols=2,
        handlelength=2.8,
    )
    return ax


def draw_cut_pad(
    ax: Axes,
    design: SensorDesign,
    cut: Cut,
    reach_mm: tuple[float, float],
    place_mm: tuple[float, float],
    press: Indentation | None,
) -> None:
    """Draw layers, pressed top and tip where the plane of a cross-section cuts them, and set the limits of the axes.

    Parameters
    ----------
    reach_mm : smallest and largest drawn distance along the line of the cross-section [mm]. Beyond the ends of this
        line, the pad is drawn pale
    place_mm : (x, y) of the press [mm]
    press : the deformed top; None for the untouched pad
    """
    cavity = cavity_of(design)
    plane = cut.plane(ceiling_mm(design))
    _draw_block(ax, cavity, cut, reach_mm)
    top = untouched = plane.untouched_mm(cavity.plan)
    if press is not None:
        frame = press_frame(design, place_mm)
        ax.plot(*untouched.T, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1.5)
        _draw_tip(ax, design, cut, frame, press.depth_mm)
        top = cut_top_mm(frame, press, plane)
    outline = np.concatenate([[(0.0, 0.0)], top, [(cut.length_mm, 0.0)]])
    ax.add_patch(Polygon(outline, facecolor=PALE_BLUE, alpha=0.6, linewidth=0, zorder=0.9))
    (surface,) = ax.plot(*top.T, color=INK, linewidth=1.4, zorder=2.6)
    surface.set_gid("surface")
    margin = SECTION_ROOM * (reach_mm[1] - reach_mm[0])
    ax.set_xlim(reach_mm[0] - margin, reach_mm[1] + margin)
    ax.set_ylim(-cavity.black_mm, plane.ceiling_mm)
    ax.set_aspect("equal")


def ceiling_mm(design: SensorDesign) -> float:
    """Height above the clear layer's bottom up to which a cross-section is drawn [mm]."""
    return design.cavity.clear_thickness_mm + HEAD_ROOM * design.indenter.tip_radius_mm


def plot_ray_plan(
    state: RayState, design: SensorDesign, ax: Axes | None = None, *, cut: Cut | None = None
) -> Axes:
    """Plan view of the light paths: y [mm] against x [mm], with contact circle; the line `cut`, if given, is dashed."""
    ax = axes_or_new(ax, PLAN_IN[1], PLAN_IN[0])
    cavity = cavity_of(design)
    size = cavity.length_mm, cavity.width_mm
    ax.add_patch(outline_patch(cavity.plan, facecolor=PALE_BLUE, alpha=0.45, linewidth=0))
    ax.add_patch(outline_patch(cavity.plan, fill=False, edgecolor=INK, linewidth=1.2, zorder=4))
    _draw_dimple(ax, state, design)
    if cut is not None:
        ends = np.array([cut.start_mm, cut.end_mm]).T
        ax.plot(*ends, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1.5)
    _draw_paths(ax, state, lambda places: places[:, :2])
    shown = _shown_parts(state, cavity)
    for part in cavity.parts:
        is_shown = part.name in shown
        named = is_shown or len(cavity.parts) <= MOST_LABELS
        draw_part(ax, part, INK if is_shown else GREY, size=5.0, is_named=named)
    room = PLAN_ROOM * max(size)
    ax.set_xlim(-room, size[0] + room)
    ax.set_ylim(-room, size[1] + room)
    ax.set_aspect("equal")
    ax.set_xticks([tick for tick in ax.get_xticks() if 0.0 <= tick <= size[0]])
    ax.set_yticks([tick for tick in ax.get_yticks() if 0.0 <= tick <= size[1]])
    ax.spines[["left", "bottom"]].set_visible(False)
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    return ax


def _draw_block(ax: Axes, cavity: CavityGeometry, cut: Cut, reach: tuple[float, float]) -> None:
    """Draw the clear and the black layer: darker where the cross-section cuts them, and pale beyond its ends."""
    for (start, end), alpha in ((reach, 0.25), ((0.0, cut.length_mm), 0.45)):
        corner = (start, -cavity.black_mm)
        ax.add_patch(Rectangle(corner, end - start, cavity.black_mm, color=BLACK, alpha=alpha + 0.4, lw=0))
    look: dict[str, Any] = {"color": PALE_BLUE, "alpha": 0.25, "lw": 0}
    ax.add_patch(
        Rectangle((reach[0], 0.0), reach[1] - reach[0], cavity.clear_mm, **look)
        if cavity.plan.top.is_flat
        else Polygon(cut.silhouette_mm(cavity, reach), **look)
    )
    ax.text(
        cut.length_mm / 2,
        -cavity.black_mm / 2,
        "black layer",
        ha="center",
        va="center",
        color="white",
        fontsize=6,
    )
    for along, place in ((0.0, cut.start_mm), (cut.length_mm, cut.end_mm)):
        ax.plot([along, along], [-cavity.black_mm, cavity.plan.top_mm(*place)], color=INK, linewidth=1.2)


def _draw_tip(ax: Axes, design: SensorDesign, cut: Cut, frame: PressFrame, depth_mm: float) -> None:
    """Draw the tip where the plane cuts it, and if its axis is not in the plane, also its projected outline, dotted."""
    plane = cut.plane(ceiling_mm(design))
    outline = cut_tip_mm(design, frame, depth_mm, plane)
    if len(outline):
        look: dict[str, Any] = {"facecolor": "white", "edgecolor": GREY, "hatch": "////", "linewidth": 0}
        tip = ax.add_patch(Polygon(outline, closed=False, zorder=1.2, **look))
        tip.set_gid("tip")
        ax.plot(*outline.T, color=MUTED, linewidth=1.0, zorder=1.3)
    x, y, _ = frame.origin_mm.tolist()
    if cut.beside_mm((x, y)) > ON_AXIS_MM:
        beside = seen_tip_mm(design, frame, depth_mm, plane)
        ax.plot(*beside.T, color=MUTED, linewidth=0.8, linestyle=(0, (1, 1.5)), zorder=1.4)


def _draw_paths(ax: Axes, state: RayState, projected: Any) -> None:
    _draw_kind(ax, LOST, state.lost, projected, zorder=2.0)
    for kind, paths in paths_by_kind(state.paths):
        _draw_kind(ax, kind, paths, projected, zorder=2.2)


def paths_by_kind(paths: Sequence[LightPath]) -> list[tuple[LightKind, list[LightPath]]]:
    """Paths grouped by kind of light, in the order of the legend."""
    found: dict[str, tuple[LightKind, list[LightPath]]] = {}
    for path in paths:
        kind = kind_of(path.fate)
        found.setdefault(kind.title, (kind, []))[1].append(path)
    order = [kind.title for kind in KINDS]
    return [
        found[title] for title in sorted(found, key=lambda t: order.index(t) if t in order else len(order))
    ]


def _draw_kind(ax: Axes, kind: LightKind, paths: Sequence[LightPath], projected: Any, zorder: float) -> None:
    if not paths:
        return
    legs = [projected(path.places_mm) for path in paths]
    width = LOST_WIDTH if kind is LOST else RAY_WIDTH
    lines = LineCollection(legs, colors=kind.colour, linewidths=width, linestyles=_dash(kind), alpha=0.8)
    lines.set_zorder(zorder)
    lines.set_gid(f"rays-{kind.key}")
    ax.add_collection(lines)
    marks = {"mirror": slice(1, -1), "scatter": slice(1, -1), "end": slice(-1, None)}
    if kind.mark != "none":
        places = np.concatenate([leg[marks[kind.mark]] for leg in legs])
        look = {"color": kind.colour, "linestyle": "none", "zorder": zorder + 0.1, **_mark(kind)}
        ax.plot(*places.T, **look)


def _dash(kind: LightKind) -> Any:
    return (0, kind.dash) if kind.dash else "solid"


def _mark(kind: LightKind) -> dict[str, Any]:
    return {
        "mirror": {"marker": "^", "markersize": 2.6, "markeredgewidth": 0},
        "scatter": {"marker": "o", "markersize": 1.8, "markeredgewidth": 0},
        "end": {"marker": "x", "markersize": 3.0, "markeredgewidth": 0.7},
        "none": {},
    }[kind.mark]


def legend_handles(state: RayState, untouched: float | None) -> list[Line2D]:
    """Legend entries for every kind of light that is drawn or has power, each with its share of the power.

    Parameters
    ----------
    untouched : power that counts as 100 %, as a share of the emitters' power [-]; None is the emitters' power itself
    """
    unit, power = untouched or 1.0, state.power_by_kind
    drawn = {kind.key: kind for kind, _ in paths_by_kind(state.paths)}
    handles = []
    for kind in (*KINDS[:-1], *(kind for kind in drawn.values() if kind.key == "other")):
        share = power.get(kind.key)
        if kind.key in drawn or (share is not None and share > 0.0):
            known = "not in the light model" if share is None else percent(share / unit)
            handles.append(_handle(kind, f"{kind.title}, {known}"))
    if state.lost:
        title = "lost under the press" if untouched else f"lost, {percent(1.0 - state.total)}"
        handles.append(_handle(LOST, title))
    return handles


def _handle(kind: LightKind, label: str) -> Line2D:
    look = {"linestyle": _dash(kind), "linewidth": 1.2, **_mark(kind)}
    return Line2D([], [], color=kind.colour, label=label, **look)


def percent(share: float) -> str:
    """A share as text in per cent; a share that would round to zero becomes "under 0.05 %"."""
    if 0.0 < share < 0.0005:
        return "under 0.05 %"
    return f"{100 * share:.1f} %"


def _shown_parts(state: RayState, cavity: CavityGeometry) -> set[str]:
    paths = (*state.paths, *state.lost)
    return {cavity.emitters[path.emitter].name for path in paths} | {
        cavity.receivers[path.receiver].name for path in state.paths
    }


def draw_cut_faces(ax: Axes, cavity: CavityGeometry, cut: Cut, names: Collection[str]) -> None:
    """Draw the active faces of the named components: filled if the cross-section cuts them, otherwise as outlines."""
    for part in cavity.parts:
        if part.name not in names:
            continue
        if part.is_on_floor:
            _draw_standing(ax, part, cut, is_named=len(names) <= MOST_LABELS_IN_SECTION)
            continue
        x, y, height = part.position_mm
        along = float(cut.along_mm(np.array([x, y])))
        is_cut = min(np.hypot(x - end[0], y - end[1]) for end in (cut.start_mm, cut.end_mm)) < ON_AXIS_MM
        wall = np.array(part.line.tangent)
        half = CUT_FACE_MM if is_cut else part.half_width_mm * abs(float(wall @ cut.direction))
        face = Rectangle(
            (along - half, height - part.half_height_mm), 2 * half, 2 * part.half_height_mm, edgecolor=INK
        )
        filled = INK if part.kind == "emitter" else "white"
        face.set(
            facecolor=filled if is_cut else "none",
            linewidth=0.9 if is_cut else 0.6,
            zorder=3 if is_cut else 1.6,
        )
        ax.add_patch(face)
        if is_cut or len(names) <= MOST_LABELS_IN_SECTION:
            _name_face(ax, part.name, along, half, height, cut)


def _draw_standing(ax: Axes, part: PlacedPart, cut: Cut, *, is_named: bool) -> None:
    """Draw a component on the floor: what its body shows above the floor, and its active face."""
    is_cut = cut.beside_mm(part.position_mm[:2]) < ON_AXIS_MM
    body, face = part.body_mm, part.face_mm
    along, high = cut.along_mm(body), np.maximum(body[:, 2], 0.0)
    colour = INK if part.kind == "emitter" else BLUE
    low, tall = float(along.min()), float(high.max())
    ax.add_patch(
        Rectangle(
            (low, 0.0),
            float(np.ptp(along)),
            tall,
            facecolor="white",
            edgecolor=GREY,
            linewidth=0.6,
            zorder=1.5,
        )
    )
    ax.plot(
        cut.along_mm(face)[[0, 2]],
        face[[0, 2], 2],
        color=colour,
        linewidth=2.2 if is_cut else 1.2,
        solid_capstyle="butt",
        zorder=3,
    )
    if is_named:
        ax.annotate(
            part.name,
            (low + float(np.ptp(along)) / 2, 0.0),
            xytext=(0, -3),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=7,
            color="white" if part.body_base_mm < 0.0 else INK,
        )


def _name_face(ax: Axes, name: str, along: float, half: float, height: float, cut: Cut) -> None:
    is_left = along < cut.length_mm / 2
    ax.annotate(
        name,
        (along - half if is_left else along + half, height),
        xytext=(-3 if is_left else 3, 0),
        textcoords="offset points",
        ha="right" if is_left else "left",
        va="center",
        fontsize=8,
    )


def _draw_dimple(ax: Axes, state: RayState, design: SensorDesign) -> None:
    press = state.indentation
    if press is None:
        return
    frame = press_frame(design, state.press_mm[:2])
    heights = press.tip_radius_mm - press.depth_mm, 0.0
    look: dict[str, Any] = {"facecolor": "white", "alpha": 0.7, "edgecolor": MUTED, "linestyle": (0, (3, 2))}
    tip = _ring(frame, press.tip_radius_mm, heights[0], **look)
    tip.set_linewidth(0.8)
    ax.add_patch(tip)
    look = {"facecolor": "none", "edgecolor": GREY, "hatch": "////", "linewidth": 0.8}
    contact = _ring(frame, press.contact_radius_mm, heights[1], **look)
    contact.set_gid("contact")
    ax.add_patch(contact)


def _ring(frame: PressFrame, radius_mm: float, over_mm: float, **look: Any) -> Patch:
    """A circle about the press's axis, seen from above; on a crown it may be tilted, so it is drawn as an ellipse."""
    turn = np.linspace(0.0, 2.0 * np.pi, RING_POINTS)
    across, aside = radius_mm * np.cos(turn), radius_mm * np.sin(turn)
    return Polygon(frame.places_mm(across, aside, np.full_like(turn, over_mm))[:, :2], **look)
