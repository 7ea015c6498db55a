"""The section on the pad, place by place and depth by depth."""

from __future__ import annotations

from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from optopad.report.scenes.map_scene import MapScene, depth_maps
from optopad.report.sections.bound_maps import bound_maps, load_map
from optopad.report.sections.drawings import Drawing, figure_of
from optopad.report.text.assets import data_element
from optopad.report.text.markup import Html, element, radios, section
from optopad.report.text.words import bounds_words, losses_table
from optopad.screen.numbers import counted, spans
from sims.continuity.result import ContinuityScore
from sims.verdict.pad_profile import pad_profile
from sims.verdict.pair.defaults import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD

Drawings = dict[str, Drawing]


def map_scene(design: SensorDesign, score: ContinuityScore) -> MapScene | None:
    """The maps that a score has data for; None without a pad map."""
    pad_map = score.pad_map
    if pad_map is None or not score.pairs:
        return None
    depth_mm = score.pairs[0].curves.depth_mm
    profile = pad_profile(design, pad_map, score.pad_signals, score.readout, depth_mm)
    return MapScene(
        cavity=cavity_of(design),
        tip_mm=design.indenter.tip_radius_mm,
        pad_map=pad_map,
        profile=profile,
        maps=(
            *depth_maps(profile),
            *bound_maps(score),
            load_map(design, pad_map, profile.depth_mm),
        ),
    )


def map_section(score: ContinuityScore, drawings: Drawings, scene: MapScene | None) -> Html:
    """The pad: maps by depth to slide through, and the verdict's own maps over all depths."""
    pad_map = score.pad_map
    if pad_map is None:
        return Html("")
    lead = f"{counted(len(pad_map.places), 'place')} pressed; {pad_map.dead_share:.0%} have a deadband."
    if score.is_facing_rows:
        lead += " It pools every pair with a direct path, and is not what facing rows are judged by."
    parts = [] if scene is None else [_view(scene), data_element("maps-data", scene.data())]
    return section(
        "map",
        "Map of the pad",
        element("p", lead),
        *bounds_words(score),
        *([element("p", f"{rise.sentence}.")] if (rise := score.rise) else []),
        *parts,
        element("div", *_still(score, drawings), *_by_depth(scene, drawings), class_="grid", id="maps-still"),
        element(
            "p",
            "Dots on the walls: emitters; squares: receivers. Dashed: the workspace. A cell is the press at its "
            "centre; what lies between places was not computed. Ends in brackets: two standard errors of the light "
            "trace, or the band of the modulus.",
            class_="note",
        ),
        losses_table(score),
    )


def _still(score: ContinuityScore, drawings: Drawings) -> list[Html]:
    assert score.pad_map is not None
    weakest, figures = score.pad_map.weakest, []
    if "map-deadband" in drawings:
        figures.append(
            figure_of(
                drawings["map-deadband"],
                "Summed deadband, all readings of a frame together. Framed: the worst place, "
                f"{spans(score.pad_map.worst.deadbands_mm)} mm.",
            )
        )
    if "map-usable" in drawings:
        figures.append(
            figure_of(
                drawings["map-usable"],
                "Depth to which one frame of all readings tells depth; deeper it does not change any more. Framed: the "
                f"weakest place, to {weakest.usable_mm:.2f} mm.",
            )
        )
    figures.append(
        figure_of(
            drawings["map-margin"],
            f"How far apart frames of all readings are over the least told {DEADBAND_MIN_LENGTH_MM:g} mm of depth; "
            f"below {DEADBAND_THRESHOLD:g} noise units depth is not told there. Framed: the weakest place, "
            f"{weakest.margin:.1f} noise units (the light trace's own error may add "
            f"{weakest.depths.margin_error:.1f}); "
            f"{counted(weakest.answering_pairs, 'pair')} answer there.",
        )
    )
    return figures


def _by_depth(scene: MapScene | None, drawings: Drawings) -> list[Html]:
    """The maps that the script slides through, at a few depths each."""
    maps = () if scene is None else scene.maps
    named = ((drawings.get(f"map-by-depth-{one.key}"), one) for one in maps)
    return [figure_of(drawing, f"{one.title}. {one.tells}") for drawing, one in named if drawing is not None]


def _view(scene: MapScene) -> Html:
    """The view that the page's script fills."""
    last = max(len(one.depth_mm) for one in scene.maps) - 1
    slider = element("input", type="range", min="0", max=str(last), step="1", value="0", id="maps-depth")
    which = radios("maps-which", (one.title for one in scene.maps))
    name = "Map of the pad. Arrow keys move from place to place."
    return element(
        "div",
        element("fieldset", element("legend", "Shown"), *which, class_="choices"),
        element(
            "div",
            element("label", "Depth ", slider),
            element("output", "", for_="maps-depth"),
            element("button", "play", type="button", data_play="", aria_pressed="false"),
            class_="controls",
        ),
        element("p", "", data_about="", class_="note"),
        element(
            "div",
            element(
                "div",
                Html(f'<svg data-map="" role="img" tabindex="0" class="live" aria-label="{name}"></svg>'),
                element("p", "", data_scale="", class_="legend scale"),
            ),
            element(
                "div",
                element("p", "", data_reading="", class_="reading", aria_live="polite"),
                Html('<svg data-profile="" role="img" class="live"></svg>'),
                element("p", "", data_summary="", class_="note"),
            ),
            class_="beside even",
        ),
        id="maps-view",
        hidden="",
    )
