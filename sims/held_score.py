"""How a pad distinguishes the objects that a gripper holds: distances, angles and radii, and false locations.

The objects
-----------
A ball, a cylinder on its side, an edge, a face and a corner of a box (`standard_objects`), as large as the design's own
tip. All press with the same force at the same locations. The force is that of the ball, pressed a third of its radius
deep, or less if another object would then go beyond the contact model. All but the ball are turned by `TURNED_DEG`, so
that no axis of the pad is special.

Distinct objects
----------------
Two objects are distinct if no press of one gives the frame of the other. With frames u in noise units, and the change
of u with location, depth and turn, J, the least squared distance of one object from all presses of the other is

    D² = Δᵀ (1 - J (JᵀJ)⁻¹ Jᵀ) Δ,    Δ = u(one) - u(other),

to first order in these motions. Of D² from either side, the smaller one counts. Light is traced twice, with two seeds,
and products of both traces replace squares, so the light model's noise does not add to distances.

Least errors
------------
The Cramér-Rao bounds of an edge's turn and of a cylinder's radius follow from the Fisher information JᵀJ of one frame,
with location and depth (and the cylinder's turn) unknown (Kay, Fundamentals of Statistical Signal Processing, 1993,
section 3.7). They are local: they leave out that an edge turned by 180 degrees is the same edge.

In place of the ball
--------------------
A signal map knows the ball alone (`optopad.sims.learning.traced_map`). At each location, the ball's frames are traced
on a grid around it, and the press of the ball that is nearest to the frame of another object is found by least
squares. This is the location and depth that such a map reports of the object. The ball itself is the control: what it
is moved by is the error of this method.

Pairs that reach full scale under any of the presses are left out of distances and bounds.

The model leaves out friction, the weight of the object, several objects at once, and the gains' drift in the search for
the nearest press.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from optopad.design.arrays import BoolArray, FloatArray, plain_numbers
from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.held_object import Cylinder, HeldObject, Sphere, held_of
from optopad.design.pad import Pad
from optopad.design.progress import OnStep
from optopad.design.rules.shape import NEAREST_WALL
from optopad.sims.bounds.fisher import SEED_GAP, Sensitivity, least_variances, rooted
from optopad.sims.contact.held.press import HeldPress
from optopad.sims.contact.scope import contact_of
from optopad.sims.held import AskedPress, HeldLight, Place, all_pressed, held_light, pressed, require_asked
from optopad.sims.learning.traced_map import SignalMap
from optopad.sims.optics.tracing import trace
from optopad.sims.readings.readout import Readout
from optopad.sims.verdict.depth_curve import noise_units

Motion = tuple[float, int, int]
"""Step between two presses, and their numbers."""
TURNED_DEG = 20.0
NAMES = ("ball", "cylinder", "edge", "face", "corner")
LENGTH, EDGE = 3.0, 0.2
"""Length of cylinder and edge, and radius of edges, in tip radii."""
DEEP = 1.0 / 3.0
"""Depth of the ball that determines the force [tip radii]."""
LESS_FORCE, LEAST_FORCE_N = 0.7, 0.01
STEP_MM, TURN_STEP_DEG, RADIUS_STEP = 0.25, 5.0, 0.1
"""Steps of location and depth [mm], of the turn [deg], and of the radius over itself [-], each way."""
ACCURACY = "score"
OBJECTS = "objects.json"
"""File of a bundle with the data of `ObjectScore.to_json`, in its folder `sims`."""
AROUND, PITCH, DEPTHS = 2, 0.5, 9
"""Grid of the ball's frames: locations each way, their distance in tip radii, and number of depths from 0."""
SPLINE_STEP = 1e-3
"""Relative step of differences, as the spline has single precision."""
STARTS = 3
"""Number of presses, the nearest on the grid, from which the nearest press is searched."""


@dataclass(frozen=True, kw_only=True)
class Mistaken:
    """The press of the ball that is nearest to the frame of an object.

    Attributes
    ----------
    moved_mm : (place,) distance of its location from the object's [mm]
    deeper_mm : (place,) its depth less the object's [mm]
    apart : (place,) distance of both frames [noise units]
    is_beyond : (place,) whether it is at the border of the searched presses, so that it may be farther away
    """

    moved_mm: FloatArray
    deeper_mm: FloatArray
    apart: FloatArray
    is_beyond: BoolArray


@dataclass(frozen=True, kw_only=True)
class ObjectScore:
    """How a pad distinguishes objects.

    Attributes
    ----------
    words : the objects in words, by name
    places_mm : (place, 2) locations [mm]
    force_n : force of every press [N]
    depth_mm : (place, object) depth of each object [mm]
    apart : (place, object, object) distance of frames, whatever location, depth and turn [noise units]
    apart_known : the same for known location, depth and turn
    turn_deg : (place,) least standard deviation of an edge's turn [deg]; infinite if not resolved
    radius_mm : (place,) least standard deviation of a cylinder's radius [mm]
    turn_error_deg, radius_error_mm : standard errors of both by the light model
    mistaken : what a signal map of the ball reports of each object
    changes : (emitter, receiver) change of the readings by each object at the first location [noise units]
    radius_of_tip_mm : radius of ball and cylinder [mm]
    """

    words: dict[str, str]
    places_mm: FloatArray
    force_n: float
    depth_mm: FloatArray
    apart: FloatArray
    apart_known: FloatArray
    turn_deg: FloatArray
    turn_error_deg: FloatArray
    radius_mm: FloatArray
    radius_error_mm: FloatArray
    mistaken: dict[str, Mistaken]
    changes: dict[str, FloatArray]
    radius_of_tip_mm: float

    def to_json(self) -> dict[str, Any]:
        """The figures as plain data for JSON; unresolved ones are None."""
        return {
            "objects": self.words,
            "force_n": self.force_n,
            "radius_of_tip_mm": self.radius_of_tip_mm,
            "places_mm": self.places_mm.tolist(),
            "depth_mm": self.depth_mm.tolist(),
            "apart_sigma": self.apart.tolist(),
            "apart_sigma_place_known": self.apart_known.tolist(),
            "edge_turn_deg": plain_numbers(self.turn_deg),
            "edge_turn_error_deg": plain_numbers(self.turn_error_deg),
            "cylinder_radius_mm": plain_numbers(self.radius_mm),
            "cylinder_radius_error_mm": plain_numbers(self.radius_error_mm),
            "changes_sigma": {name: np.round(one, 3).tolist() for name, one in self.changes.items()},
            "as_ball": {
                name: {
                    "moved_mm": one.moved_mm.tolist(),
                    "deeper_mm": one.deeper_mm.tolist(),
                    "apart_sigma": one.apart.tolist(),
                    "is_beyond": one.is_beyond.tolist(),
                }
                for name, one in self.mistaken.items()
            },
        }


def standard_objects(tip_radius_mm: float) -> dict[str, HeldObject]:
    """The objects by name, as large as a tip."""
    size, edge = f"{tip_radius_mm:.6g}", f"edge={EDGE * tip_radius_mm:.6g}"
    long, wide, turn = f"{LENGTH * tip_radius_mm:.6g}", f"{2.0 * tip_radius_mm:.6g}", f"yaw={TURNED_DEG:g}"
    cube = f"length={wide},width={wide},height={wide}"
    texts = (
        f"sphere,radius={size}",
        f"cylinder,radius={size},length={long},{edge},{turn}",
        f"box,pose=edge,length={long},width={wide},height={wide},{edge},{turn}",
        f"box,pose=face,{cube},{edge},{turn}",
        f"box,pose=corner,{cube},{edge},{turn}",
    )
    return dict(zip(NAMES, map(held_of, texts), strict=True))


def places_of(draft: Draft) -> tuple[Place, ...]:
    """The locations: the middle of the workspace, and half way to its corner and to the middle of a longer side."""
    space = draft.workspace
    x, y = draft.plan.centre_mm
    corner, side = space.clamped(space.x1_mm, space.y1_mm), (space.x1_mm, y)
    if space.x1_mm - space.x0_mm < space.y1_mm - space.y0_mm:
        side = (x, space.y1_mm)
    ends = ((x, y), corner, space.clamped(*side))
    return tuple((0.5 * (x + end[0]), 0.5 * (y + end[1])) for end in ends)


def score_objects(draft: Draft, *, seed: int = 0, on_step: OnStep | None = None) -> ObjectScore:
    """Compute how a pad distinguishes the standard objects.

    Raises
    ------
    ModelScopeError : the models do not cover the objects on this pad.
    """
    tell = on_step or (lambda _stage, _share: None)
    objects = standard_objects(draft.design.indenter.tip_radius_mm)
    places = places_of(draft)
    force_n, base, asked, motions, solved = _solved(draft, objects, places, tell)

    def traced(half: int) -> HeldLight:
        return held_light(
            draft,
            solved,
            accuracy=ACCURACY,
            seed=seed + SEED_GAP * half,
            on_step=lambda done, total: tell("light of objects", 0.5 * (half + done / total)),
        )

    halves = [traced(half) for half in range(2)]
    frames = np.stack([one.units.reshape(len(asked), -1) for one in halves])
    is_clipped = np.stack([_is_clipped(one) for one in halves]).any(axis=(0, 1))
    frames[:, :, is_clipped] = 0.0  # a pair that reaches full scale under any press is left out
    count, slopes = len(objects), [_slopes(frames, one) for one in motions]
    apart, known = np.zeros((2, len(places), count, count))
    for number, a, b in np.ndindex(*apart.shape):
        one, other = number * count + a, number * count + b
        apart[number, a, b], known[number, a, b] = _apart(frames[:, one], frames[:, other], slopes[other])
    turn = [_bound(one, 3) for one in slopes[NAMES.index("edge") :: count]]
    radius = [_bound(one, 4) for one in slopes[NAMES.index("cylinder") :: count]]
    mistaken = _mistaken(draft, places, base, halves[0], seed, tell)
    return ObjectScore(
        words={name: one.words for name, one in objects.items()},
        places_mm=np.array(places),
        force_n=force_n,
        depth_mm=base,
        apart=np.minimum(apart, apart.transpose(0, 2, 1)),
        apart_known=known,
        turn_deg=np.array([one for one, _ in turn]),
        turn_error_deg=np.array([error for _, error in turn]),
        radius_mm=np.array([one for one, _ in radius]),
        radius_error_mm=np.array([error for _, error in radius]),
        mistaken=mistaken,
        changes=dict(zip(NAMES, halves[0].changes, strict=False)),
        radius_of_tip_mm=draft.design.indenter.tip_radius_mm,
    )


def require_objects(draft: Draft) -> None:
    """Refuse a pad whose light under objects is not modelled, before any work; errors are those of `require_asked`."""
    ball = standard_objects(draft.design.indenter.tip_radius_mm)["ball"]
    for x, y in places_of(draft):
        for at in ((x - STEP_MM, y), (x + STEP_MM, y), (x, y - STEP_MM), (x, y + STEP_MM)):
            require_asked(draft, AskedPress(held=(ball,), at_mm=at, depth_mm=0.0))


def _solved(
    draft: Draft, objects: dict[str, HeldObject], places: Sequence[Place], tell: OnStep
) -> tuple[float, FloatArray, list[AskedPress], list[list[Motion]], list[HeldPress]]:
    """The force of all presses [N], the (place, object) depths that need it [mm], and the contacts of all presses.

    The presses are the objects, then those beside each of them. The force is lowered until the models cover all.
    """
    ball, deep_mm = objects["ball"], DEEP * draft.design.indenter.tip_radius_mm
    deep_mm = min(deep_mm, 0.5 * draft.design.operating.max_depth_mm)
    force_n = pressed(draft, AskedPress(held=(ball,), at_mm=places[0], depth_mm=deep_mm)).force_n
    each = [(at, held) for at in places for held in objects.values()]
    while True:
        try:
            equal = [AskedPress(held=(held,), at_mm=at, force_n=force_n) for at, held in each]
            found = all_pressed(draft, equal, lambda done, total: tell("objects", 0.2 * done / total))
            depth_mm = [one.depth_mm for one in found]
            asked = [
                AskedPress(held=(held,), at_mm=at, depth_mm=deep)
                for (at, held), deep in zip(each, depth_mm, strict=True)
            ]
            motions = [
                _motions(asked, held, at, deep) for (at, held), deep in zip(each, depth_mm, strict=True)
            ]
            solved = all_pressed(draft, asked, lambda done, total: tell("objects", 0.2 + 0.8 * done / total))
        except ModelScopeError:
            force_n *= LESS_FORCE
            if force_n < LEAST_FORCE_N:
                raise
            continue
        return force_n, np.array(depth_mm).reshape(len(places), -1), asked, motions, solved


def _motions(asked: list[AskedPress], held: HeldObject, at: Place, depth_mm: float) -> list[Motion]:
    """Append the presses beside one, and return the step between each two and their numbers.

    Steps are along x, y and depth; then the turn, if the object is not a ball; then the radius of a cylinder.
    """
    (x, y), rows = at, []

    def add(step: float, low: tuple[HeldObject, Place, float], high: tuple[HeldObject, Place, float]) -> None:
        rows.append((step, len(asked), len(asked) + 1))
        for one, place, depth in (low, high):
            asked.append(AskedPress(held=(one,), at_mm=place, depth_mm=depth))

    step = STEP_MM
    down = min(step, 0.5 * depth_mm)
    add(2.0 * step, (held, (x - step, y), depth_mm), (held, (x + step, y), depth_mm))
    add(2.0 * step, (held, (x, y - step), depth_mm), (held, (x, y + step), depth_mm))
    add(2.0 * down, (held, at, depth_mm - down), (held, at, depth_mm + down))
    if isinstance(held, Sphere):
        return rows
    turned = [held.model_copy(update={"yaw": held.yaw + sign * TURN_STEP_DEG}) for sign in (-1.0, 1.0)]
    add(2.0 * TURN_STEP_DEG, (turned[0], at, depth_mm), (turned[1], at, depth_mm))
    if isinstance(held, Cylinder):
        radius = held.radius
        wider = [
            held.model_copy(update={"radius": radius * (1.0 + sign * RADIUS_STEP)}) for sign in (-1.0, 1.0)
        ]
        add(2.0 * RADIUS_STEP * radius, (wider[0], at, depth_mm), (wider[1], at, depth_mm))
    return rows


def _is_clipped(light: HeldLight) -> BoolArray:
    counts = light.readout.counts(light.flux)
    return np.asarray((counts >= light.readout.full_scale_counts).reshape(len(counts), -1))


def _slopes(frames: FloatArray, motions: Sequence[Motion]) -> FloatArray:
    """(2, pair, motion) change of both traces' frames with each motion [noise units per mm or deg]."""
    return np.stack([(frames[:, high] - frames[:, low]) / step for step, low, high in motions], axis=-1)


def _apart(one: FloatArray, other: FloatArray, slopes: FloatArray) -> tuple[float, float]:
    """Distance of two frames (2, pair), at the other's best location, depth and turn, and at the given ones."""
    first, second = one - other
    known = max(float(first @ second), 0.0)
    middle = slopes.mean(axis=0)
    motion = middle @ np.linalg.pinv(middle, rcond=1e-3)
    free = float(first @ second - first @ motion @ second)
    return float(np.sqrt(max(free, 0.0))), float(np.sqrt(known))


def _bound(slopes: FloatArray, number: int) -> tuple[float, float]:
    """Least standard deviation of one motion if all are unknown, and its standard error; infinite if not resolved."""
    scale = np.abs(slopes).max(axis=(0, 1)) + 1e-300
    answers = Sensitivity(first=slopes[0] / scale, second=slopes[1] / scale, weight=np.ones(slopes.shape[1]))
    deviation, error = rooted(*least_variances(answers))
    return float(deviation[number] / scale[number]), float(error[number] / scale[number])


def _mistaken(
    draft: Draft, places: Sequence[Place], depth_mm: FloatArray, light: HeldLight, seed: int, tell: OnStep
) -> dict[str, Mistaken]:
    """What a signal map of the ball reports of each object at each location."""
    frames = light.units[: len(places) * len(NAMES)].reshape(len(places), len(NAMES), -1)
    rows = np.zeros((len(NAMES), len(places), 4))
    for number, at in enumerate(places):
        known = _map_around(
            draft, at, seed, lambda share, number=number: tell("ball", (number + share) / len(places))
        )
        for k in range(len(NAMES)):
            x, y, depth, apart, beyond = _nearest_press(known, frames[number, k], light.readout)
            rows[k, number] = np.hypot(x - at[0], y - at[1]), depth - depth_mm[number, k], apart, beyond
    return {
        name: Mistaken(moved_mm=one[:, 0], deeper_mm=one[:, 1], apart=one[:, 2], is_beyond=one[:, 3] > 0.0)
        for name, one in zip(NAMES, rows, strict=True)
    }


def _map_around(draft: Draft, at: Place, seed: int, on_share: Any) -> SignalMap:
    """Light of the ball on a grid around a location, at all depths of the design."""
    design, tip = draft.design, draft.design.indenter.tip_radius_mm
    plan, contact = draft.plan, contact_of(design)
    room = float(plan.outline.gap_mm(*at)) - 1.01 * NEAREST_WALL * tip
    pitch = min(PITCH * tip, max(room, 0.1 * tip) / (np.sqrt(2.0) * AROUND))
    x_mm, y_mm = (middle + pitch * np.arange(-AROUND, AROUND + 1.0) for middle in at)
    deepest = min(design.operating.max_depth_mm, contact.depth_limit_mm)
    root = np.linspace(0.0, np.sqrt(deepest), DEPTHS)
    nodes = np.stack(np.meshgrid(x_mm, y_mm, root**2, indexing="ij"), axis=-1)
    light = trace(
        Pad.of(design),
        nodes.reshape(-1, 3),
        accuracy="score",
        seed=seed,
        on_step=lambda done, total: on_share(done / total),
    )
    flux = light.flux.reshape(*nodes.shape[:3], *light.flux.shape[1:])
    return SignalMap(
        x_mm=x_mm, y_mm=y_mm, root_depth=root, flux=flux, workspace=draft.workspace, digest=design.digest,
        accuracy="score", seed=seed,
    )  # fmt: skip


def _nearest_press(
    known: SignalMap, frame: FloatArray, readout: Readout
) -> tuple[float, float, float, float, float]:
    """x, y and depth of the ball's press nearest to a frame; the distance; and 1 at the border of the map, else 0."""
    spline, untouched = known.ratio_root, known.untouched

    def units(place: FloatArray) -> FloatArray:
        press = np.array([[place[0], place[1], place[2] ** 2]])
        flux = (spline.values(press) ** 2 * untouched).reshape(known.flux.shape[3:])
        return np.asarray(noise_units(readout.counts(flux), **readout.noise)).ravel()

    low = np.array([known.x_mm[0], known.y_mm[0], 0.0])
    high = np.array([known.x_mm[-1], known.y_mm[-1], known.root_depth[-1]])
    nodes = np.stack(
        np.meshgrid(known.x_mm, known.y_mm, known.root_depth[1:], indexing="ij"), axis=-1
    ).reshape(-1, 3)
    off = [float(np.linalg.norm(units(node) - frame)) for node in nodes]
    best = None
    for start in nodes[np.argsort(off)[:STARTS]]:
        inside = np.clip(start, low + 1e-6, high - 1e-6)
        found = least_squares(
            lambda place: units(place) - frame,
            inside,
            bounds=(low, high),
            x_scale=high - low,
            diff_step=SPLINE_STEP,
        )
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    beyond = float(((best.x - low)[:2] < 1e-3).any() or ((high - best.x) < 1e-3).any())
    return best.x[0], best.x[1], best.x[2] ** 2, float(np.sqrt(2.0 * best.cost)), beyond
