"""The section on the pad by location and depth, and maps of the best possible resolution and of the load."""

from __future__ import annotations

import math

import numpy as np
from markupsafe import Markup

from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.report.scenes.map_scene import DepthMap, MapScene, depth_maps
from optopad.report.sections.drawings import Drawing
from optopad.report.words import part
from optopad.sims.bounds.detection_threshold import DetectionThreshold
from optopad.sims.bounds.fisher import BAND
from optopad.sims.bounds.observability import BoundFigure, PadBounds
from optopad.sims.contact.scope import contact_of
from optopad.sims.score.result import ContinuityScore
from optopad.sims.verdict.figure_errors import place_force
from optopad.sims.verdict.pad_map import PadMap, pad_profile

Drawings = dict[str, Drawing]


def map_scene(design: SensorDesign, score: ContinuityScore) -> MapScene | None:
    """All maps that a score has data for; None if the score has no map of the pad."""
    pad_map = score.pad_map
    if pad_map is None or not score.pairs:
        return None
    depth_mm = score.pairs[0].curves.depth_mm
    profile = pad_profile(cavity_of(design), pad_map, score.pad_signals, score.readout, depth_mm)
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


def map_section(score: ContinuityScore, drawings: Drawings, scene: MapScene | None) -> Markup:
    """The section on the pad: maps by depth with a slider, and the verdict's own maps over all depths."""
    pad_map, bounds = score.pad_map, score.bounds
    if pad_map is None:
        return Markup()
    losses = [] if bounds is None or score.is_facing_rows else [(one.part, one) for one in bounds.losses]
    return part(
        "map",
        score=score,
        pad_map=pad_map,
        drawings=drawings,
        scene=scene,
        last_depth=0 if scene is None else max(len(one.depth_mm) for one in scene.maps) - 1,
        bounds=bounds_words(score),
        losses=[("none", bounds), *losses] if losses else [],
        worst_loss=None if bounds is None else bounds.worst_loss,
        span=_span,
    )


def bounds_words(score: ContinuityScore) -> Markup:
    """Sentences that summarise the bounds; empty if they were not computed."""
    if score.bounds is None:
        return Markup()
    return part(
        "bounds",
        bounds=score.bounds,
        is_facing_rows=score.is_facing_rows,
        span=_span,
        digits=_digits,
        inf=math.inf,
    ).strip()


def _span(figure: BoundFigure) -> str:
    if math.isinf(figure.value):
        return "not resolved"
    high = "open" if math.isinf(figure.high) else _digits(figure.high)
    return f"{_digits(figure.value)} mm ({_digits(figure.low)} to {high})"


def _digits(value: float) -> str:
    return f"{value:#.2g}" if value < 0.1 else f"{value:.2f}"


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
    contact = contact_of(design)
    curves = [place_force(contact, (place.x_mm, place.y_mm)) for place in pad_map.places]
    depths = depth_mm[depth_mm > 0.0]
    loads = np.array([[curve.at(float(depth)) for curve, _ in curves] for depth in depths])
    young = contact.draft.modulus
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
