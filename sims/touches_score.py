"""How near two equal touches may be before one frame no longer tells them from a single one.

Two-point discrimination
------------------------
Two tips of the design are pressed to the same depth, at equal distances to both sides of a location, in four
directions. Their frame is compared with the frames of all single touches, of any place and depth: the distance is

    D = min over (x, y, depth) of the root of Σ (u(two touches) - u(single touch))²,      u in noise deviations,

over all pairs; readings beyond full scale count as full scale. Two touches are told apart where D is at least 3. The
least separation for this is searched from tips that touch each other upward, to the largest one that has room, and
interpolated between those that are computed, D as a power of the separation. Nearer than that, tips overlap.

Light and its error
-------------------
The frame of two touches has the light of `optopad.sims.touches`, that of single ones the signal map's. Both are traced
twice, with different seeds, and D² is the product of both differences, so the light model's error does not count as a
difference. Where twice the error that is left does not leave D on one side of 3, the state counts as not told apart.
Left out: the error of the map between its nodes, which both traces share.

Bounds
------
Unknown are x, y and depth of both touches. Their changes of the readings are those of single touches by the map, times
the other touch's ratio of light. The bounds are from `optopad.sims.bounds.fisher`, with both maps as its halves, and
compared with those of each touch alone. Left out: how what both touches change together depends on them.

Of states that are symmetric to each other only one is computed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray, plain_numbers
from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.progress import OnStep
from optopad.sims.bounds.fisher import SEED_GAP, Sensitivity, least_variances, rooted
from optopad.sims.contact.held.tips import deepest_mm, require_apart
from optopad.sims.contact.scope import contact_of
from optopad.sims.held import require_traced
from optopad.sims.learning.inference.signal_map import (
    Box,
    CoarseTable,
    TensorSpline,
    found_presses,
    table_presses_mm,
    whitening,
)
from optopad.sims.learning.traced_map import QUICK_DEPTH_NODES, QUICK_PITCH_MM, SignalMap, traced_map
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import StateClasses, state_classes
from optopad.sims.readings.protocol import untouched_readout
from optopad.sims.readings.readout import Readout
from optopad.sims.touches import changes_together
from optopad.sims.verdict.depth_curve import noise_units, sigma_counts
from optopad.sims.verdict.presses import untouched_flux

TOUCHES = "touches.json"
"""File of a bundle with the data of `TouchesScore.to_json`, in its folder `sims`."""
TOLD_APART = 3.0
"""Least distance of two frames that are told apart [noise deviations]."""
UNSURE = 2.0
"""Errors of D² within which it counts as not above the limit [-]."""
DIRECTIONS_DEG = (0.0, 45.0, 90.0, 135.0)
DEPTHS = (1.0 / 30.0, 0.1, 1.0 / 3.0, 2.0 / 3.0)
"""Depths of the touches [tip radii]."""
WIDER, CLEAR = 1.35, 1.001
"""Ratio of separations that are computed one after another, and room between tips that touch each other [-]."""
HALVINGS = 12
"""Steps of the search for the largest separation that has room."""
STEPS, FEWEST_STEPS, MOST_CLASSES = 5, 2, 20
"""Locations along the longer side, at first and at least, and the most states of equal depth that are computed."""


@dataclass(frozen=True, kw_only=True)
class TouchesScore:
    """How near two equal touches may be; arrays are (place, direction, depth), NaN where there is no room for two tips.

    Attributes
    ----------
    radius_of_tip_mm : radius of each tip [mm]
    places_mm : (place, 2) locations between the touches [mm]
    directions_deg : directions from one touch to the other, from the x axis towards y [degrees]
    depth_mm : (depth,) depths [mm]
    least_mm : least separation at which they are told apart, not less than that of tips that touch each other; infinite
        where there is none [mm]
    distance : D of tips that touch each other [noise deviations]
    is_open : whether the light model's error leaves open if such tips are told apart
    location_mm, bound_depth_mm : bounds of the worse of both touches [mm]; infinite if not resolved
    location_times, depth_times : largest ratio of the bounds to those of a touch alone [-]
    """

    radius_of_tip_mm: float
    places_mm: FloatArray
    directions_deg: tuple[float, ...]
    depth_mm: FloatArray
    least_mm: FloatArray
    distance: FloatArray
    is_open: BoolArray
    location_mm: FloatArray
    bound_depth_mm: FloatArray
    location_times: FloatArray
    depth_times: FloatArray

    @property
    def two_point_mm(self) -> dict[str, Any]:
        """Median and worst least separation [mm], at all depths and by depth; None where there is none."""
        each: list[dict[str, Any]] = []
        for number, depth_mm in enumerate(self.depth_mm):
            each.append({"depth_mm": float(depth_mm), **_middle(self.least_mm[..., number])})
        return {**_middle(self.least_mm), "by_depth": each}

    def to_json(self) -> dict[str, Any]:
        """The figures as plain data for JSON: None where there is no room for two tips, and for what does not exist."""
        arrays = ("distance", "location_mm", "bound_depth_mm", "location_times", "depth_times")
        return {
            "two_point_mm": self.two_point_mm,
            "radius_of_tip_mm": self.radius_of_tip_mm,
            "touching_mm": 2.0 * self.radius_of_tip_mm,
            "places_mm": self.places_mm.tolist(),
            "directions_deg": list(self.directions_deg),
            "depth_mm": self.depth_mm.tolist(),
            "has_room": (~np.isnan(self.least_mm)).tolist(),
            "least_mm": plain_numbers(self.least_mm),
            "is_open": self.is_open.tolist(),
            **{name: plain_numbers(getattr(self, name)) for name in arrays},
        }


def _middle(values: FloatArray) -> dict[str, float | None]:
    known = values[~np.isnan(values)]
    found = {"median": float(np.median(known)), "worst": float(known.max())}
    return {name: one if np.isfinite(one) else None for name, one in found.items()}


def require_touches(draft: Draft) -> None:
    """Refuse a pad on which two touches are not modelled, before any work.

    Raises
    ------
    ModelScopeError : the light on grids is not modelled, tips are no hemispheres, or two have no room.
    """
    require_traced(draft, "touches")
    _states(draft)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Pad:
    """Single touches of a pad, from two traces.

    Attributes
    ----------
    draft : the pad
    is_bright : mask of the pairs that are used, all but those with hardly any light
    maps : √ratio of light of both traces, of these pairs
    box : range of single touches
    counts : (pair,) their untouched readings, not limited [counts]
    readout : gains, full scale and noise
    """

    draft: Draft
    is_bright: BoolArray
    maps: tuple[TensorSpline, TensorSpline]
    box: Box
    counts: FloatArray
    readout: Readout

    def ratios(self, press_mm: FloatArray) -> FloatArray:
        """Light over untouched light (2, ..., pair) of presses (..., 3), by each trace."""
        flat = press_mm.reshape(-1, 3)
        return np.stack([one.values(flat) ** 2 for one in self.maps]).reshape(2, *press_mm.shape[:-1], -1)

    def answers(self, press_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean readings (n, pair) of both traces [counts] and their slopes (n, 3, pair) [counts/mm], limited."""
        each = [one.with_gradient(press_mm) for one in self.maps]
        mean = self.counts * np.mean([root**2 for root, _ in each], axis=0)
        slope = self.counts * np.mean([2.0 * root[:, None] * slopes for root, slopes in each], axis=0)
        is_clipped = mean >= self.readout.full_scale_counts
        return np.where(is_clipped, self.readout.full_scale_counts, mean), np.where(
            is_clipped[:, None], 0.0, slope
        )

    def units(self, ratio: FloatArray) -> FloatArray:
        """Readings of ratios (..., pair), limited at full scale [noise units]."""
        counts = np.minimum(ratio * self.counts, self.readout.full_scale_counts)
        return np.asarray(noise_units(counts, **self.readout.noise))


def score_touches(draft: Draft, *, seed: int = 0, on_step: OnStep | None = None) -> TouchesScore:
    """Compute how near two equal touches may be on a pad.

    Raises
    ------
    ModelScopeError : the models do not cover two touches on this pad.
    """
    tell = on_step or (lambda _stage, _share: None)
    places, depth_mm, has_room = _states(draft)
    pad = _pad(draft, seed, tell)
    radius = draft.design.indenter.tip_radius_mm
    shape = (len(places), len(DIRECTIONS_DEG), len(depth_mm))
    asked = np.argwhere(np.broadcast_to(has_room[..., None], shape))
    arrays = {name: np.full(shape, np.nan) for name in ("least_mm", "distance", *BOUNDS)}
    is_open = np.zeros(shape, np.bool_)
    touching, before = 2.0 * radius * CLEAR, np.full(len(asked), np.nan)
    left, apart = np.arange(len(asked)), np.full(len(asked), touching)
    most = _largest(draft, places, asked, touching)
    while len(left):
        tips = _tips(places, depth_mm, asked[left], apart[left])
        classes = _classes(draft, tips)
        square, error = _squares(pad, tips[classes.first], seed, tell)
        square, error = square[classes.member], error[classes.member]
        now, at = np.sqrt(np.maximum(square, 0.0)), tuple(asked[left].T)
        told = square - UNSURE * error >= TOLD_APART**2
        if np.isnan(before).all():
            arrays["distance"][at] = now
            is_open[at] = np.abs(square - TOLD_APART**2) < UNSURE * error
            for name, values in _bounds(pad, tips[classes.first]).items():
                arrays[name][at] = values[classes.member]
        nearer = np.where(np.isnan(before[left]), apart[left], np.maximum(apart[left] / WIDER, touching))
        arrays["least_mm"][at] = np.where(
            told, _between(nearer, apart[left], before[left], now) / CLEAR, np.inf
        )
        before[left] = now
        left = left[~told & (apart[left] < most[left])]
        apart[left] = np.minimum(WIDER * apart[left], most[left])
    tell("two touches", 1.0)
    return TouchesScore(
        radius_of_tip_mm=radius,
        places_mm=places,
        directions_deg=DIRECTIONS_DEG,
        depth_mm=depth_mm,
        is_open=is_open,
        **arrays,
    )


BOUNDS = ("location_mm", "bound_depth_mm", "location_times", "depth_times")


def _between(nearer: FloatArray, apart: FloatArray, before: FloatArray, now: FloatArray) -> FloatArray:
    """Separations (n,) at which D is at the limit, from D at two separations; it is the first one if that has none."""
    share = np.zeros(len(now))
    known = (now > TOLD_APART) & (before > 0.0) & (before < TOLD_APART)
    share[known] = np.log(now[known] / TOLD_APART) / np.log(now[known] / before[known])
    return np.asarray(apart * (nearer / apart) ** np.clip(share, 0.0, 1.0))


def _largest(draft: Draft, places: FloatArray, asked: IntArray, least_mm: float) -> FloatArray:
    """Largest separations (n,) of tips in the workspace, for states (n, 3) that have room for the least [mm]."""
    x0, y0, x1, y1 = draft.workspace.box_mm
    low, high = np.full(len(asked), least_mm), np.full(len(asked), float(np.hypot(x1 - x0, y1 - y0)))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        fits = _inside(draft, _tips(places, np.zeros(1), np.where([True, True, False], asked, 0), middle))
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    return low


def _states(draft: Draft) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Locations (place, 2), depths (depth,), and whether tips that touch have room (place, direction)."""
    radius, space = draft.design.indenter.tip_radius_mm, draft.workspace
    contact, deepest = contact_of(draft.design), 0.9 * draft.design.operating.max_depth_mm
    for steps in range(STEPS, FEWEST_STEPS - 1, -1):
        places = _places(draft, steps)
        room = np.zeros((len(places), len(DIRECTIONS_DEG)), np.bool_)
        asked = np.argwhere(~room)
        if len(asked):
            tips = _tips(places, np.zeros(1), np.column_stack([asked, 0 * asked[:, 0]]), 2.0 * radius * CLEAR)
            room[tuple(asked.T)] = _inside(draft, tips)
            places, room = places[room.any(axis=1)], room[room.any(axis=1)]
        if not room.any():
            raise ModelScopeError(
                f"touches: two tips of {radius:g} mm have no room side by side in the workspace, {space.words}; take a "
                "smaller tip (indenter.tip_radius_mm) or lower operating.workspace_margin_mm"
            )
        tips = _tips(
            places,
            np.ones(1),
            np.column_stack([np.argwhere(room), 0 * np.flatnonzero(room)]),
            2.0 * radius * CLEAR,
        )
        if len(_classes(draft, tips).first) <= MOST_CLASSES:
            break
    require_apart(draft, tips[0])
    for place in tips[:, :, :2].reshape(-1, 2).tolist():
        deepest = min(deepest, deepest_mm(contact, (place[0], place[1])))
    shares = np.array(DEPTHS)
    return places, np.minimum(shares * radius, deepest * shares / shares[-1]), room


def _places(draft: Draft, steps: int) -> FloatArray:
    """Locations (place, 2) a tip radius within the workspace's box, in equal steps along both sides."""
    x0, y0, x1, y1 = draft.workspace.box_mm
    radius, longer = draft.design.indenter.tip_radius_mm, max(x1 - x0, y1 - y0)
    axes = []
    for low, high in ((x0, x1), (y0, y1)):
        count = max(round((steps - 1) * (high - low) / longer), 1) + 1
        inner = max(0.5 * (high - low) - radius * CLEAR, 0.0)
        axes.append(np.unique(np.round(0.5 * (low + high) + inner * np.linspace(-1.0, 1.0, count), 9)))
    x, y = np.meshgrid(*axes, indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    return np.asarray(places[draft.workspace.contains(*places.T)])


def _tips(
    places: FloatArray, depth_mm: FloatArray, asked: IntArray, apart_mm: FloatArray | float
) -> FloatArray:
    """Presses (n, 2, 3) of states, given the numbers (n, 3) of location, direction and depth, and separations (n,)."""
    angle = np.radians(DIRECTIONS_DEG)[asked[:, 1]]
    half = 0.5 * np.reshape(apart_mm, (-1, 1)) * np.column_stack([np.cos(angle), np.sin(angle)])
    middle, depth = places[asked[:, 0]], depth_mm[asked[:, 2], None]
    return np.stack([np.concatenate([middle + sign * half, depth], axis=1) for sign in (-1.0, 1.0)], axis=1)


def _inside(draft: Draft, tips: FloatArray) -> BoolArray:
    """Whether both tips (n, 2, 3) are in the workspace (n,)."""
    x, y = np.round(tips[..., 0], 9), np.round(tips[..., 1], 9)
    found = np.asarray(draft.workspace.contains(x.ravel(), y.ravel())).reshape(x.shape)
    return np.asarray(found.all(axis=1))


def _classes(draft: Draft, tips: FloatArray) -> StateClasses:
    return state_classes(scene_of(draft.design), tips[..., :2], [list(one) for one in tips[..., 2].tolist()])


def _pad(draft: Draft, seed: int, tell: OnStep) -> _Pad:
    """The single touches of a pad, traced twice."""
    design, found = draft.design, list[SignalMap]()
    for half in range(2):

        def step(_stage: str, share: float, half: int = half) -> None:
            tell("single touches", 0.5 * (half + share))

        found.append(
            traced_map(
                design,
                pitch_mm=QUICK_PITCH_MM,
                depth_nodes=QUICK_DEPTH_NODES,
                seed=seed + SEED_GAP * half,
                on_step=step,
            )
        )
    readout = untouched_readout(design, untouched_flux(draft, seed=seed))
    space, bright = draft.workspace, found[0].is_bright & found[1].is_bright
    counts = np.mean([one.flux[0, 0, 0] for one in found], axis=0) * readout.gains
    return _Pad(
        draft=draft,
        is_bright=bright,
        maps=(_of_pairs(found[0], bright), _of_pairs(found[1], bright)),
        box=Box(
            low=np.array([space.x0_mm, space.y0_mm, 0.0]),
            high=np.array([space.x1_mm, space.y1_mm, found[0].root_depth[-1] ** 2]),
        ),
        counts=counts.ravel()[bright],
        readout=readout,
    )


def _of_pairs(found: SignalMap, chosen: BoolArray) -> TensorSpline:
    spline = found.ratio_root
    return replace(spline, coefficients=spline.coefficients[..., chosen])


def _squares(pad: _Pad, tips: FloatArray, seed: int, tell: OnStep) -> tuple[FloatArray, FloatArray]:
    """D² (n,) of two touches (n, 2, 3), and its standard error [noise deviations squared]."""
    change = changes_together(
        pad.draft,
        tips,
        seeds=(seed, seed + SEED_GAP),
        on_step=lambda done, total: tell("two touches", done / total),
    )
    ratio = np.maximum(pad.ratios(tips).prod(axis=2) + change[..., pad.is_bright], 0.0)
    counts = np.minimum(ratio.mean(axis=0) * pad.counts, pad.readout.full_scale_counts)
    weight = sigma_counts(counts, **pad.readout.noise) ** -2.0
    table = table_presses_mm(pad.box)
    alone = found_presses(
        pad.answers,
        CoarseTable(press_mm=table, signals=pad.answers(table)[0]),
        pad.box,
        counts,
        np.minimum(pad.counts, pad.readout.full_scale_counts),
        whitening(weight, np.zeros((len(counts), 1, counts.shape[1]))),
    ).press_mm
    first, second = pad.units(ratio) - pad.units(pad.ratios(alone))
    variance, slope = 0.5 * (first - second) ** 2, 0.25 * (first + second) ** 2
    error = np.sqrt((2.0 * slope * variance + variance**2).sum(axis=1))
    return (first * second).sum(axis=1), error


def _bounds(pad: _Pad, tips: FloatArray) -> dict[str, FloatArray]:
    """Bounds (n,) with two touches (n, 2, 3), by the names of `TouchesScore`."""
    count = len(tips)
    ratio = pad.ratios(tips)
    slopes = []
    for one in pad.maps:
        root, slope = one.with_gradient(tips.reshape(-1, 3))
        slopes.append((2.0 * root[:, None] * slope * pad.counts).reshape(count, 2, 3, -1))
    both = [
        np.moveaxis((slope * of[:, ::-1, None]).reshape(count, 6, -1), 1, 2)
        for slope, of in zip(slopes, ratio, strict=True)
    ]
    together = _weighted(pad, ratio.mean(axis=0).prod(axis=1))
    location, depth = _rooted(Sensitivity(first=both[0], second=both[1], weight=together), (0, 3))
    single = [np.moveaxis(one, 2, 3) for one in slopes]
    alone = Sensitivity(first=single[0], second=single[1], weight=_weighted(pad, ratio.mean(axis=0)))
    own_location, own_depth = (one[..., 0] for one in _rooted(alone, (0,)))
    with np.errstate(invalid="ignore"):
        return {
            "location_mm": location.max(axis=1),
            "bound_depth_mm": depth.max(axis=1),
            "location_times": (location / own_location).max(axis=1),
            "depth_times": (depth / own_depth).max(axis=1),
        }


def _weighted(pad: _Pad, ratio: FloatArray) -> FloatArray:
    """One over the variance of readings (..., pair) [1/counts²]; 0 at full scale."""
    counts = ratio * pad.counts
    sigma = sigma_counts(counts, **pad.readout.noise)
    return np.where(counts >= pad.readout.full_scale_counts, 0.0, sigma**-2.0)


def _rooted(answers: Sensitivity, starts: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Bounds of location and depth (..., touch) of the touches whose x has these numbers [mm]."""
    variance, slips, is_seen = least_variances(answers)
    location, depth = [], []
    for x in starts:
        of = variance[..., x] + variance[..., x + 1], np.hypot(slips[..., x], slips[..., x + 1])
        location.append(rooted(*of, is_seen)[0])
        depth.append(rooted(variance[..., x + 2], slips[..., x + 2], is_seen)[0])
    return np.stack(location, axis=-1), np.stack(depth, axis=-1)
