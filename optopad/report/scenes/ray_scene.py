"""The light that the page shows in three dimensions: pairs, presses, and the data for the page's script.

For a pad, the presses are at the location of least margin, and the pairs are those nearest to it. For facing rows, the
presses are at the middle of the governing pair. The depths include the ends of the longest deadband there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import (
    CavityGeometry,
    beside_chord,
    cavity_of,
    edge_mm,
    judged_pairs,
    pair_name,
)
from optopad.design.spec import SensorDesign
from optopad.report.words import governing
from optopad.sims.contact.tip import tip_points_mm
from optopad.sims.optics.paths import LightPath
from optopad.sims.plots.contact import press_frame
from optopad.sims.rays import KINDS, LOST, LightKind, Pair, Press, RayChoice, RayState, kind_of, ray_states
from optopad.sims.score.result import ContinuityScore

Interval = tuple[float, float]

MOST_PAIRS = 8
PATHS_A_PAIR = 12
POOL_PER_PATH = 4
MOST_RAYS = 20_000
"""Largest number of rays tried per emitter and press; six presses and eight emitters take about a second at most."""
DEPTH_SHARES = (0.1, 0.2, 0.4, 0.6, 1.0)
"""Depths shown, as shares of the deepest press [-]."""
NEAR_MM = 0.2
"""Distance from an end of the deadband within which other depths are left out [mm]."""
CURVE_TOLERANCE_MM = 0.01
"""Largest distance of the drawn surface from the computed one [mm]."""
TIP_LENGTH = 2.4
"""Length of the drawn tip [tip radii]."""


@dataclass(frozen=True, kw_only=True)
class RayScene:
    """Content of the three-dimensional view of the light.

    Attributes
    ----------
    design, cavity : the sensor
    pairs : (emitter, receiver) numbers of each pair
    place_mm : (x, y) of the presses [mm]
    is_middle : whether `place_mm` is the middle of the middle facing pair; otherwise it is the location of least margin
    labels : label of each entry of `states`
    states : light paths on the untouched pad, then under each press
    """

    design: SensorDesign
    cavity: CavityGeometry
    pairs: tuple[Pair, ...]
    place_mm: tuple[float, float]
    is_middle: bool
    labels: tuple[str, ...]
    states: tuple[RayState, ...]

    @property
    def pair_names(self) -> list[str]:
        """Names of the pairs, such as E1-R5."""
        return [pair_name(self.cavity, pair) for pair in self.pairs]

    @property
    def kinds(self) -> list[LightKind]:
        """Kinds of light that are drawn or carry power, in the order of the legend."""
        present = {
            kind_of(path.fate).key: kind_of(path.fate) for state in self.states for path in state.paths
        }
        if any(state.lost for state in self.states):
            present[LOST.key] = LOST
        for state in self.states:
            present.update(
                {kind_of(name).key: kind_of(name) for name, flux in state.power.items() if flux.any()}
            )
        order = [kind.key for kind in KINDS]
        return sorted(
            present.values(), key=lambda kind: order.index(kind.key) if kind.key in order else len(order)
        )

    def share(self, state: int, kind: LightKind, pair: int | None = None) -> float | None:
        """Power of one kind of light, as a share of the untouched light of all pairs or of one pair [-].

        None if this kind is not modelled, or the untouched light is zero.
        """
        chosen = slice(None) if pair is None else slice(pair, pair + 1)
        untouched = sum(float(flux[chosen].sum()) for flux in self.states[0].power.values())
        found = [flux for name, flux in self.states[state].power.items() if kind_of(name).key == kind.key]
        if not found or untouched <= 0.0:
            return None
        return sum(float(flux[chosen].sum()) for flux in found) / untouched


def ray_scene(design: SensorDesign, score: ContinuityScore, *, seed: int) -> RayScene | None:
    """The light paths that illustrate a design's verdict; None if there is no verdict.

    Parameters
    ----------
    seed : seed of the random paths
    """
    if not score.pairs or (score.pad_map is None and not score.is_facing_rows):
        return None
    cavity = cavity_of(design)
    place, dead = _weakest(score)
    marked = _marked_depths(dead, design.operating.max_depth_mm)
    presses: list[Press] = [(*place, depth) for depth in sorted(marked)]
    pairs = _nearest_pairs(cavity, place)
    choice = RayChoice(
        pairs=pairs,
        count=PATHS_A_PAIR,
        draws_each_pair=True,
        pool_per_path=POOL_PER_PATH,
        most_rays=MOST_RAYS,
        accuracy="standard",
        seed=seed,
    )
    return RayScene(
        design=design,
        cavity=cavity,
        pairs=pairs,
        place_mm=place,
        is_middle=score.is_facing_rows,
        labels=("untouched", *(f"{depth:.2f} mm{marked[depth]}" for depth in sorted(marked))),
        states=ray_states(design, choice, presses),
    )


def _weakest(score: ContinuityScore) -> tuple[tuple[float, float], tuple[Interval, ...]]:
    if score.is_facing_rows or score.pad_map is None:
        pair = governing(score)
        return pair.curves.press_mm, pair.score.deadbands_mm
    weakest = score.pad_map.weakest
    return (weakest.x_mm, weakest.y_mm), weakest.deadbands_mm


def _marked_depths(dead_mm: tuple[Interval, ...], deepest_mm: float) -> dict[float, str]:
    """Depths to show [mm], each with a note; the note is empty unless a deadband begins or ends there."""
    found: dict[float, str] = {}
    if dead_mm:
        start, end = max(dead_mm, key=lambda span: span[1] - span[0])
        found = {round(start, 3): ", the deadband begins", round(end, 3): ", the deadband ends"}
    found = {depth: words for depth, words in found.items() if 0.0 < depth <= deepest_mm}
    for share in DEPTH_SHARES:
        depth = round(share * deepest_mm, 3)
        if all(abs(depth - other) > NEAR_MM for other in found):
            found[depth] = ""
    return found


def _nearest_pairs(cavity: CavityGeometry, place_mm: tuple[float, float]) -> tuple[Pair, ...]:
    pairs = judged_pairs(cavity)
    return tuple(
        sorted(pairs, key=lambda pair: round(beside_chord(cavity, pair, place_mm)[0], 6))[:MOST_PAIRS]
    )


def scene_json(scene: RayScene) -> dict[str, Any]:
    """All data that the page's script draws: lengths in mm, points of light paths in hundredths of a millimetre."""
    cavity, kinds = scene.cavity, scene.kinds
    keys = [kind.key for kind in kinds]
    return {
        "box": [cavity.length_mm, cavity.width_mm, cavity.clear_mm, cavity.black_mm],
        "round": bool(cavity.plan.outline.bare.arcs),
        "edge": edge_mm(cavity.plan).round(3).tolist(),
        "press": _frame(scene),
        "parts": [
            {
                "name": part.name,
                "kind": part.kind,
                "at": list(part.position_mm),
                "face": part.face_mm.round(3).tolist(),
                "body": [[x, y, max(z, 0.0)] for x, y, z in part.body_mm.round(3).tolist()]
                if part.is_on_floor
                else None,
                "outward": None if part.is_on_floor else list(part.line.outward),
                "label": list(part.label_way),
            }
            for part in cavity.parts
        ],
        "kinds": [
            {
                "key": k.key,
                "title": k.title,
                "day": k.colour,
                "night": k.night_colour,
                "dash": k.dash,
                "mark": k.mark,
            }
            for k in kinds
        ],
        "pairs": scene.pair_names,
        "tip": _tip(scene),
        "states": [
            {
                "label": label,
                "depth": state.press_mm[2],
                "curve": _curve(state),
                "rays": _rays(state, keys, scene.pairs),
                "shares": [_shares(scene, number, pair) for pair in (None, *range(len(scene.pairs)))],
            }
            for number, (label, state) in enumerate(zip(scene.labels, scene.states, strict=True))
        ],
    }


def _frame(scene: RayScene) -> dict[str, Any]:
    """Coordinate system of the presses (origin and axes), and the radius of the crown, which is None for a flat top."""
    frame = press_frame(scene.design, scene.place_mm)
    return {
        "origin": frame.origin_mm.tolist(),
        "axes": frame.axes.tolist(),
        "crown": None if frame.top.is_flat else frame.top.radius_mm,
        "along": 1.0 if frame.top.straight is None else 0.0,
    }


def _shares(scene: RayScene, number: int, pair: int | None) -> list[float | None]:
    """Share of each kind of light, then of all kinds together [-]; see `RayScene.share`."""
    shares = [scene.share(number, kind, pair) for kind in scene.kinds]
    return [_rounded(share) for share in (*shares, sum(share or 0.0 for share in shares))]


def _rounded(share: float | None) -> float | None:
    return None if share is None else float(f"{share:.6g}")


def _rays(state: RayState, keys: list[str], pairs: tuple[Pair, ...]) -> list[list[Any]]:
    """Kind number, pair number and points of each light path; lost light has the pair that it reached untouched."""
    numbers = {pair: number for number, pair in enumerate(pairs)}
    arriving = [
        _ray(path, keys.index(kind_of(path.fate).key), numbers[path.emitter, path.receiver])
        for path in state.paths
    ]
    lost = [
        _ray(path, keys.index(LOST.key), numbers[path.emitter, former])
        for path, former in zip(state.lost, state.lost_by, strict=True)
    ]
    return arriving + lost


def _ray(path: LightPath, kind: int, pair: int) -> list[Any]:
    return [kind, pair, [round(100 * float(value)) for value in path.places_mm.ravel()]]


def _curve(state: RayState) -> list[list[float]]:
    """Pressed surface from the axis outward: radius, and height above the untouched top [mm]; empty if untouched."""
    press = state.indentation
    if press is None:
        return []
    points = _thinned(np.column_stack([press.radius_mm, press.height_mm]), CURVE_TOLERANCE_MM)
    return [[round(float(r), 2), round(float(z), 3)] for r, z in points]


def _tip(scene: RayScene) -> list[list[float]]:
    """Outline of the tip: distance from the axis and height above the apex [mm]."""
    points = _thinned(tip_points_mm(scene.design.indenter, TIP_LENGTH, 200), 0.02)
    return [[round(float(r), 2), round(float(z), 3)] for r, z in points]


def _thinned(points: FloatArray, tolerance: float) -> FloatArray:
    """Remove points of a curve that the rest follows within a tolerance (Douglas and Peucker 1973)."""
    if len(points) < 3:
        return points
    chord, aside = points[-1] - points[0], points - points[0]
    length = float(np.hypot(*chord))
    if length > 0.0:
        away = np.abs(aside[:, 0] * chord[1] - aside[:, 1] * chord[0]) / length
    else:
        away = np.hypot(aside[:, 0], aside[:, 1])
    farthest = int(away.argmax())
    if away[farthest] <= tolerance:
        return points[[0, -1]]
    left, right = _thinned(points[: farthest + 1], tolerance), _thinned(points[farthest:], tolerance)
    return np.concatenate([left[:-1], right])
