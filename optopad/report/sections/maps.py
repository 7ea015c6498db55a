"""The section on the pad by location and depth, and maps of the best possible resolution and of the load."""

from __future__ import annotations

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import modulus
from optopad.report.scenes.map_scene import DepthMap, MapScene, depth_maps
from optopad.report.sections.drawings import Drawing, figure_of
from optopad.report.words import Html, bounds_words, data_element, element, losses_table, radios, section
from optopad.screen.answer import counted
from optopad.screen.verdict_sentences import spans
from optopad.sims.bounds.detection_threshold import DetectionThreshold
from optopad.sims.bounds.fisher import BAND
from optopad.sims.bounds.observability import PadBounds
from optopad.sims.score.result import ContinuityScore
from optopad.sims.verdict.depth_curve import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD
from optopad.sims.verdict.figure_errors import place_force
from optopad.sims.verdict.pad_map import PadMap, pad_profile

Drawings = dict[str, Drawing]


def map_scene(design: SensorDesign, score: ContinuityScore) -> MapScene | None:
    """All maps that a score has data for; None if the score has no map of the pad."""
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
    """The section on the pad: maps by depth with a slider, and the verdict's own maps over all depths."""
    pad_map = score.pad_map
    if pad_map is None:
        return Html("")
    lead = f"{counted(len(pad_map.places), 'location')} pressed; {pad_map.dead_share:.0%} have a deadband."
    if score.is_facing_rows:
        lead += (
            " It pools every pair with a direct path; facing rows are judged by their facing pairs instead."
        )
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
            "Dots on the walls: emitters; squares: receivers. Dashed: the workspace. A cell is the press "
            "at its centre; between locations no value was computed. In brackets: two standard errors of "
            "the light model, or the band of the modulus.",
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
                "Summed deadband, all readings of a frame together. Framed: the worst location, "
                f"{spans(score.pad_map.worst.deadbands_mm)} mm.",
            )
        )
    if "map-usable" in drawings:
        figures.append(
            figure_of(
                drawings["map-usable"],
                "Usable depth: one frame of all readings resolves depth down to it; deeper the readings "
                f"no longer change. Framed: the location of least margin, to {weakest.usable_mm:.2f} mm.",
            )
        )
    figures.append(
        figure_of(
            drawings["map-margin"],
            f"Margin: least change of all readings over {DEADBAND_MIN_LENGTH_MM:g} mm of depth; below "
            f"{DEADBAND_THRESHOLD:g} sigma depth is not resolved. Framed: the least margin, "
            f"{weakest.margin:.1f} sigma (± {weakest.depths.margin_error:.1f} by numerical error); "
            f"{counted(weakest.answering_pairs, 'pair')} respond there.",
        )
    )
    return figures


def _by_depth(scene: MapScene | None, drawings: Drawings) -> list[Html]:
    """Still pictures of the maps that the script steps through, at a few depths each."""
    maps = () if scene is None else scene.maps
    named = ((drawings.get(f"map-by-depth-{one.key}"), one) for one in maps)
    return [figure_of(drawing, f"{one.title}. {one.tells}") for drawing, one in named if drawing is not None]


def _view(scene: MapScene) -> Html:
    """The empty view with its controls, which the page's script fills with a map."""
    last = max(len(one.depth_mm) for one in scene.maps) - 1
    slider = element("input", type="range", min="0", max=str(last), step="1", value="0", id="maps-depth")
    which = radios("maps-which", (one.title for one in scene.maps))
    name = "Map of the pad. Arrow keys move from location to location."
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


FINE_TO_POOR = ("#00343f", "#00785a", "#8fc7a2", "#f6f2d8", "#f2b98a", "#a33f00")
LOAD = ("#f7f4ef", "#f2b98a", "#c24e00", "#5c2200")
NOT_RESOLVED = "not resolved"
TRACE = "by numerical error of the light model"
ONE_FRAME = (
    "Cramér-Rao bound: the least standard deviation of any unbiased estimator from one frame of all "
    "readings. It is local and includes noise only; a learner starts without a location and does not "
    "know gains and ambient light: `optopad predict` reports its errors."
)


def bound_maps(score: ContinuityScore) -> list[DepthMap]:
    """Maps of the resolution of location and depth, and of the detection threshold.

    For facing rows, the only resolution is that of the depth at a known location.
    """
    bounds = score.bounds
    if bounds is None:
        return []
    found = [_depth_alone(bounds)] if score.is_facing_rows else [_location(bounds), _depth(bounds)]
    return found if bounds.detection is None else [*found, _detection(bounds.detection)]


def _location(bounds: PadBounds) -> DepthMap:
    return _bound(
        "location",
        "Resolution of location",
        f"Least standard deviation of the press's location, x and y together. {ONE_FRAME}",
        bounds,
        (bounds.location_mm, bounds.location_error_mm),
        bounds.limits.dead_location_mm,
    )


def _depth(bounds: PadBounds) -> DepthMap:
    return _bound(
        "depth",
        "Resolution of depth",
        f"Least standard deviation of the press's depth, with unknown location. {ONE_FRAME}",
        bounds,
        (bounds.depth_bound_mm, bounds.depth_error_mm),
        bounds.limits.dead_depth_mm,
    )


def _depth_alone(bounds: PadBounds) -> DepthMap:
    return _bound(
        "depth-alone",
        "Resolution of depth",
        f"Least standard deviation of the press's depth at a known location. {ONE_FRAME}",
        bounds,
        (bounds.depth_alone_mm, bounds.depth_alone_error_mm),
        bounds.limits.dead_depth_mm,
    )


def _bound(
    key: str,
    title: str,
    tells: str,
    bounds: PadBounds,
    found: tuple[FloatArray, FloatArray],
    limit_mm: float,
) -> DepthMap:
    values, errors = (values[bounds.inside].T for values in found)
    finite = values[np.isfinite(values)]
    low = float(finite.min()) if finite.size else 0.1 * limit_mm
    moved = BAND * np.where(np.isfinite(values), errors, np.nan)
    return DepthMap(
        key=key,
        title=title,
        unit="mm",
        tells=tells,
        depth_mm=np.array(bounds.depth_mm),
        values=np.where(np.isfinite(values), values, np.nan),
        is_hatched=~(values <= limit_mm),
        hatched=f"dead, above {limit_mm:g} mm or not resolved",
        absent=NOT_RESOLVED,
        colours=FINE_TO_POOR,
        low=low,
        high=max(float(finite.max()) if finite.size else limit_mm, limit_mm),
        is_logarithmic=True,
        digits=4,
        limit=f"above {limit_mm:g} mm is dead",
        ends=np.stack([np.maximum(values - moved, 0.0), values + moved], axis=-1),
        ends_of=f"mm {TRACE}",
    )


def _detection(detection: DetectionThreshold) -> DepthMap:
    inside = ~np.isnan(detection.depth_mm)
    force = detection.force_n[inside][None]
    finite = force[np.isfinite(force)]
    high = float(finite.max()) if finite.size else 1.0
    return DepthMap(
        key="felt",
        title="Detection threshold",
        unit="N",
        tells=(
            f"Least load at which the reading of one pair differs from its baseline by {detection.threshold:g} "
            "sigma in one frame."
        ),
        depth_mm=np.array([np.nan]),
        values=np.where(np.isfinite(force), force, np.nan),
        is_hatched=~np.isfinite(force),
        hatched="no press within the range of use is detected",
        absent="none within the range of use",
        colours=LOAD,
        low=0.0,
        high=high,
        digits=3,
        ends=np.stack([detection.low_n[inside], detection.high_n[inside]], axis=-1)[None],
        ends_of="N over the band of the modulus",
    )


def load_map(design: SensorDesign, pad_map: PadMap, depth_mm: FloatArray) -> DepthMap:
    """Map of a press's load at each location, with the effect of near walls, for depths above 0."""
    curves = [place_force(design, (place.x_mm, place.y_mm)) for place in pad_map.places]
    depths = depth_mm[depth_mm > 0.0]
    loads = np.array([[curve.at(float(depth)) for curve, _ in curves] for depth in depths])
    young = modulus(design)
    return DepthMap(
        key="load",
        title="Load",
        unit="N",
        tells=(
            "Load of a press to this depth, with the effect of near walls; it is proportional to Young's "
            f"modulus, {young.value:.3g} MPa ({young.confidence})."
        ),
        depth_mm=depths,
        values=loads[..., 0],
        is_hatched=np.tile([not is_there for _, is_there in curves], (len(depths), 1)),
        hatched="too near to a wall: load of the centred press",
        absent="not computed",
        colours=LOAD,
        low=0.0,
        high=float(loads[..., 0].max()),
        ends=loads[..., 1:],
        ends_of="N over the band of the modulus",
    )
