"""The plots of a report as SVG, by file name, and the cards that show them in the page."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from markupsafe import Markup, escape

from optopad.design.press_protocol import load_protocol
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import modulus
from optopad.report.scenes.cause_drawing import plot_cause
from optopad.report.scenes.layout_drawing import plot_layout
from optopad.report.scenes.map_scene import MapScene, plot_by_depth
from optopad.report.words import governing, ranked
from optopad.screen.verdict_sentences import spans, unit_of
from optopad.sims.contact.force_curve import ForceCurve, published_load
from optopad.sims.contact.load_protocol import load_history, solid_of
from optopad.sims.plots.builds import plot_builds
from optopad.sims.plots.contact import (
    plot_contact_radius,
    plot_force,
    plot_force_near,
    plot_load_over_time,
    plot_load_protocol,
)
from optopad.sims.plots.maps import plot_deadband_map, plot_margin_map, plot_usable_map
from optopad.sims.plots.rays import BLACK
from optopad.sims.plots.signal import plot_signal
from optopad.sims.plots.style import (
    BLUE,
    GREEN,
    GREY,
    GRID,
    INK,
    MUTED,
    PALE_BLUE,
    PALE_ORANGE,
    VERMILLION,
    plain_style,
    plot_spans,
    svg_text,
)
from optopad.sims.plots.tolerance import (
    plot_field_steps,
    plot_gap_tolerance,
    plot_margin_tolerance,
    plot_tolerance,
)
from optopad.sims.score.result import ContinuityScore, JudgedPair
from optopad.sims.verdict.causes import Cause

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PREFIX = "plot-"
PROTOCOL = "piacenza2017"
"""The load protocol that a page shows for a pad with a relaxing load."""
THEMED = {
    "#ffffff": "var(--plot-ground)",
    INK: "var(--plot-ink)",
    MUTED: "var(--plot-muted)",
    GRID: "var(--plot-grid)",
    BLUE: "var(--plot-blue)",
    VERMILLION: "var(--plot-vermillion)",
    GREEN: "var(--plot-green)",
    GREY: "var(--plot-grey)",
    BLACK: "var(--plot-black)",
    PALE_BLUE: "var(--plot-pale-blue)",
    PALE_ORANGE: "var(--plot-pale-orange)",
}
"""The page's names for the plots' colours, by colour."""
MOST_CAUSES = 3
"""Largest number of causes that are drawn."""
MOST_FACING = 8
"""Largest number of facing pairs that are plotted; the others are only in the table."""


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """A plot as a file: its stem, a sentence about its content, and its SVG text."""

    stem: str
    shows: str
    svg: str

    @property
    def file_name(self) -> str:
        """Name of the plot's SVG file in the bundle's ``sims`` folder."""
        return f"{self.stem}.svg"

    @property
    def card(self) -> str:
        """CSS class of the plot's card: maps keep their colours; others follow the page's light or dark colours."""
        return "card" if self.stem.startswith(f"{PREFIX}map-") else "card themed"

    @property
    def inline(self) -> Markup:
        """The SVG for use inside a page: its prologue, style, size and names of groups are removed."""
        body = self.svg[self.svg.index("<svg") :]
        body = re.sub(r"<defs>\s*<style[^>]*>.*?</style>\s*</defs>", "", body, flags=re.DOTALL)
        opening, rest = _themed(re.sub(r'<g id="[^"]*"', "<g", body)).split(">", 1)
        view = re.search(r'viewBox="[^"]*"', opening)
        assert view is not None
        return Markup(
            f'<svg class="plot" role="img" {view[0]} xmlns="http://www.w3.org/2000/svg" '
            f'xmlns:xlink="http://www.w3.org/1999/xlink"><title>{escape(self.shows)}</title>{rest.strip()}'
        )


def shown_pairs(score: ContinuityScore) -> list[tuple[JudgedPair, str]]:
    """Pairs to plot, each with its role: the facing pairs or, for a pad, the governing, worst, median and best pair."""
    if not score.pairs:
        return []
    if score.is_facing_rows:
        roles = ["middle facing pair", *["facing pair"] * (len(score.pairs) - 1)]
        return list(zip(score.pairs, roles, strict=True))[:MOST_FACING]
    order = ranked(score)
    wanted = (
        (governing(score), "longest deadband of the pairs that never clip"),
        (order[0], "worst pair"),
        (order[len(order) // 2], "median pair"),
        (order[-1], "best pair"),
    )
    found: dict[str, list[str]] = {}
    for pair, role in wanted:
        found.setdefault(pair.name, []).append(role)
    by_name = {pair.name: pair for pair in score.pairs}
    return [(by_name[name], ", ".join(as_what)) for name, as_what in found.items()]


Plots = dict[str, tuple["Callable[[], Axes | None]", str]]
"""By name, a function that draws a plot, and a sentence about its content."""


def drawings_of(
    design: SensorDesign, score: ContinuityScore, maps: MapScene | None = None
) -> dict[str, Drawing]:
    """All plots that a score has data for; the key is the file's stem without the prefix.

    Parameters
    ----------
    maps : maps by depth; if None, they are left out
    """
    return drawings_without_tolerance(design, score, maps) | tolerance_drawings(score)


def drawings_without_tolerance(
    design: SensorDesign, score: ContinuityScore, maps: MapScene | None, done: Mapping[str, str] | None = None
) -> dict[str, Drawing]:
    """The plots of `drawings_of` that can be drawn before the tolerance is computed.

    Parameters
    ----------
    done : SVG texts of plots that are there already, by name
    """
    plots: Plots = {
        "layout": (
            lambda: plot_layout(design),
            f"Layout of {design.name} with its dimensions in millimetres",
        ),
        **_cause_plots(design, score),
        **_pair_plots(score),
        **_map_plots(design, score),
        **_depth_plots(maps),
        **_press_plots(design, score),
    }
    return _all_drawn(plots, done or {})


def tolerance_drawings(score: ContinuityScore) -> dict[str, Drawing]:
    """The plots of `drawings_of` that show a score's tolerance, manufactured units and field steps."""
    return _all_drawn({**_tolerance_plots(score), **_build_plots(score), **_step_plots(score)}, {})


def _all_drawn(plots: Plots, done: Mapping[str, str]) -> dict[str, Drawing]:
    with plain_style():
        return {
            name: Drawing(stem=PREFIX + name, shows=shows, svg=done[name])
            if name in done
            else drawn(name, plot(), shows)
            for name, (plot, shows) in plots.items()
        }


def drawn(name: str, axes: Axes | None, shows: str) -> Drawing:
    """Convert a plot to SVG text; must be called inside `plain_style`."""
    figure = None if axes is None else axes.get_figure(root=True)
    assert figure is not None
    return Drawing(stem=PREFIX + name, shows=shows, svg=svg_text(figure, name))


def _pair_plots(score: ContinuityScore) -> Plots:
    found: Plots = {
        f"signal-{pair.name}": (
            partial(plot_signal, pair),
            f"Signal of {pair.name} against depth by path; deadband {spans(pair.score.deadbands_mm)}",
        )
        for pair, _ in shown_pairs(score)
    }
    if score.pairs:
        found["pairs"] = (
            partial(plot_spans, score.pairs),
            f"Depths of mode 1, mode 2 and deadbands of {len(score.pairs)} judged pairs",
        )
    return found


def shown_causes(score: ContinuityScore) -> list[Cause]:
    """Causes to draw: the worst one of each kind and reason, at most `MOST_CAUSES`, the worst first."""
    found: dict[tuple[str, str], Cause] = {}
    for cause in score.causes:
        found.setdefault((cause.kind, cause.lack), cause)
    return list(found.values())[:MOST_CAUSES]


def _cause_plots(design: SensorDesign, score: ContinuityScore) -> Plots:
    found: Plots = {}
    for number, cause in enumerate(shown_causes(score), 1):
        if cause.typical is not None:
            shows = f"Section through {cause.typical.pair} under the press, with its remaining light"
            found[f"cause-{number}"] = partial(plot_cause, design, cause), shows
    return found


def _map_plots(design: SensorDesign, score: ContinuityScore) -> Plots:
    if score.pad_map is None:
        return {}
    cavity = cavity_of(design)
    found: Plots = {
        "map-margin": (
            partial(plot_margin_map, score.pad_map, cavity),
            "Map of the margin to a deadband over the pad",
        )
    }
    if score.pad_map.dead_share > 0:
        found["map-deadband"] = (
            partial(plot_deadband_map, score.pad_map, cavity),
            "Map of the deadband over the pad",
        )
    if score.pad_map.usable_depth_mm < design.operating.max_depth_mm:
        found["map-usable"] = (
            partial(plot_usable_map, score.pad_map, cavity),
            "Map of the usable depth over the pad",
        )
    return found


def _depth_plots(maps: MapScene | None) -> Plots:
    """Plots of all maps by depth; the map of dead zones is left out if there are none."""
    if maps is None:
        return {}
    told = [one for one in maps.maps if not one.names or one.is_hatched.any()]
    return {
        f"map-by-depth-{one.key}": (
            partial(plot_by_depth, maps, one),
            f"{one.title} over the pad at several depths",
        )
        for one in told
    }


def _press_plots(design: SensorDesign, score: ContinuityScore) -> Plots:
    if score.force is None:
        return {}
    stated = published_load(design)
    measured = [stated.point] if stated else []
    found: Plots = {
        "force": (
            partial(plot_force, score.force, modulus(design), measured=measured),
            "Load against depth",
        ),
        "contact-radius": (partial(plot_contact_radius, score.force), "Contact radius against depth"),
    }
    if stated is not None:
        near = partial(plot_force_near, score.force, modulus(design), stated.point)
        found["force-near"] = (near, "Load against depth around the published point")
    return found | _protocol_plots(design, score.force)


def _protocol_plots(design: SensorDesign, force: ForceCurve) -> Plots:
    """Plot of the paper's load protocol, if the design's load relaxes and its deepest press is deep enough."""
    solid, protocol = solid_of(design), load_protocol(PROTOCOL)
    if solid is None or protocol.deepest_mm.value > force.depth_mm[-1]:
        return {}
    history = load_history(protocol, lambda depth_mm: force.at(depth_mm)[0], solid)
    return {
        "load-protocol": (partial(plot_load_protocol, history), "Load against depth over the load protocol"),
        "load-time": (partial(plot_load_over_time, history), "Load against time over the load protocol"),
    }


def _tolerance_plots(score: ContinuityScore) -> Plots:
    band = score.tolerance
    if band is None or not band.rows:
        return {}
    ends = f"of {band.judged} at both ends of every unmeasured parameter"
    found: Plots = {"tolerance-deadband": (partial(plot_tolerance, band), f"Deadband {ends}")}
    if any(gap is not None for row in band.rows for gap in row.gap_mm):
        found["tolerance-gap"] = (partial(plot_gap_tolerance, band), f"Mode gap {ends}")
    found["tolerance-margin"] = (partial(plot_margin_tolerance, band), f"Margin to a deadband {ends}")
    return found


def _build_plots(score: ContinuityScore) -> Plots:
    if score.builds is None or score.tolerance is None:
        return {}
    builds, band = score.builds, score.tolerance
    return {
        "builds": (
            lambda: plot_builds(builds, band).axes[0],
            "Each value alone at both ends, and its rank correlation over the manufactured units",
        )
    }


def _step_plots(score: ContinuityScore) -> Plots:
    if score.steps is None or not score.steps.rows:
        return {}
    steps = score.steps
    return {
        "field-steps": (
            lambda: plot_field_steps(steps, unit_of).axes[0],
            f"Effect of a step of each parameter, by {steps.judged}",
        )
    }


def _themed(svg: str) -> str:
    """Replace a plot's colours by those of the page, in the style attributes that matplotlib writes."""
    return re.sub(
        r'(?:style|fill)="[^"]*"',
        lambda found: re.sub(r"#[0-9a-f]{6}", lambda colour: THEMED.get(colour[0], colour[0]), found[0]),
        svg,
    )
