"""What the readings can tell at best, and the load, as maps by depth."""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray
from design.spec import SensorDesign
from design.spec.properties import modulus
from optopad.report.scenes.map_scene import DepthMap
from sims.bounds.defaults import BAND
from sims.bounds.felt import FeltForce
from sims.bounds.observability import PadBounds
from sims.continuity.result import ContinuityScore
from sims.verdict.boundary_forces import place_force
from sims.verdict.pad_map import PadMap

FINE_TO_POOR = ("#00343f", "#00785a", "#8fc7a2", "#f6f2d8", "#f2b98a", "#a33f00")
LOAD = ("#f7f4ef", "#f2b98a", "#c24e00", "#5c2200")
BLIND = "blind: this cannot be told at all"
TRACE = "by the light trace's own error"
ONE_FRAME = (
    "Cramér-Rao bound: no estimator that is right on average does better from one frame of all readings. It is "
    "local and of noise alone; a learner must also find the location from nothing and does not know gains and "
    "ambient light: `optopad predict` says what one reaches."
)


def bound_maps(score: ContinuityScore) -> list[DepthMap]:
    """Resolution of place and depth, and the lightest press felt; of facing rows depth alone, their place is known."""
    bounds = score.bounds
    if bounds is None:
        return []
    found = [_depth_alone(bounds)] if score.is_facing_rows else [_location(bounds), _depth(bounds)]
    return found if bounds.felt is None else [*found, _felt(bounds.felt)]


def _location(bounds: PadBounds) -> DepthMap:
    return _bound(
        "location",
        "Resolution of place",
        f"Least standard deviation of the press's place, x and y together. {ONE_FRAME}",
        bounds,
        (bounds.location_mm, bounds.location_error_mm),
        bounds.limits.dead_location_mm,
    )


def _depth(bounds: PadBounds) -> DepthMap:
    return _bound(
        "depth",
        "Resolution of depth",
        f"Least standard deviation of the press's depth, its place unknown too. {ONE_FRAME}",
        bounds,
        (bounds.depth_bound_mm, bounds.depth_error_mm),
        bounds.limits.dead_depth_mm,
    )


def _depth_alone(bounds: PadBounds) -> DepthMap:
    return _bound(
        "depth-alone",
        "Resolution of depth",
        f"Least standard deviation of the press's depth at a known place. {ONE_FRAME}",
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
        hatched=f"dead, above {limit_mm:g} mm or blind",
        absent=BLIND,
        colours=FINE_TO_POOR,
        low=low,
        high=max(float(finite.max()) if finite.size else limit_mm, limit_mm),
        is_logarithmic=True,
        digits=4,
        limit=f"above {limit_mm:g} mm is dead",
        ends=np.stack([np.maximum(values - moved, 0.0), values + moved], axis=-1),
        ends_of=f"mm {TRACE}",
    )


def _felt(felt: FeltForce) -> DepthMap:
    inside = ~np.isnan(felt.depth_mm)
    force = felt.force_n[inside][None]
    finite = force[np.isfinite(force)]
    high = float(finite.max()) if finite.size else 1.0
    return DepthMap(
        key="felt",
        title="Lightest press felt",
        unit="N",
        tells=(
            f"Load from which some pair's reading has left its untouched value by {felt.threshold:g} noise units: one "
            "pair, one frame."
        ),
        depth_mm=np.array([np.nan]),
        values=np.where(np.isfinite(force), force, np.nan),
        is_hatched=~np.isfinite(force),
        hatched="no press within the range of use is felt",
        absent="none within the range of use",
        colours=LOAD,
        low=0.0,
        high=high,
        digits=3,
        ends=np.stack([felt.low_n[inside], felt.high_n[inside]], axis=-1)[None],
        ends_of="N over the band of the modulus",
    )


def load_map(design: SensorDesign, pad_map: PadMap, depth_mm: FloatArray) -> DepthMap:
    """Load of a press at each place, near walls included, at depths beyond contact."""
    curves = [place_force(design, (place.x_mm, place.y_mm)) for place in pad_map.places]
    depths = depth_mm[depth_mm > 0.0]
    loads = np.array([[curve.at(float(depth)) for curve, _ in curves] for depth in depths])
    young = modulus(design)
    return DepthMap(
        key="load",
        title="Load",
        unit="N",
        tells=(
            "Load of a press to this depth, near walls included; it goes with Young's modulus, "
            f"{young.value:.3g} MPa ({young.confidence})."
        ),
        depth_mm=depths,
        values=loads[..., 0],
        is_hatched=np.tile([not is_there for _, is_there in curves], (len(depths), 1)),
        hatched="so near to a wall that the load is that of the centred press",
        absent="not computed",
        colours=LOAD,
        low=0.0,
        high=float(loads[..., 0].max()),
        ends=loads[..., 1:],
        ends_of="N over the band of the modulus",
    )
