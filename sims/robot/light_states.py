"""Traced states of objects on a pad, from which the map of light is fitted.

Each state has a number, which decides all of it: kind, size, pose, place and depth. Objects stay off the walls as far
as the contact model needs; those it does not cover are drawn anew.

Sizes are spread evenly over their logarithms: balls from half the tip's radius to five times it, cylinders from half to
six times, sides of boxes from 3 mm to the pad. Depths are denser near 0, and end at a third of the elastic layer, or a
sixth for sharp edges, where the contact model ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.held_object import Box, Cylinder, Ellipsoid, HeldObject, Punch, Sphere
from optopad.design.progress import OnShare
from optopad.design.rules.touch import LARGEST_HELD_SHARE, NEAREST_HELD
from optopad.sims.contact.held.bottoms import bottom_mm
from optopad.sims.contact.held.press import COARSE, SHARP_SHARE, grid_of, held_press
from optopad.sims.contact.scope import contact_of
from optopad.sims.held import light_of_tops
from optopad.sims.optics.accuracy import ACCURACIES, Accuracy
from optopad.sims.optics.engine.threads import run_each
from optopad.sims.press import GridTop
from optopad.sims.robot.fast_light import FastLight, Imprint, together
from optopad.sims.robot.poses import posed

SHARES = {
    "ball": 0.15,
    "two balls": 0.15,
    "cylinder": 0.16,
    "edge": 0.12,
    "face": 0.14,
    "corner": 0.08,
    "ellipsoid": 0.08,
    "capsule": 0.06,
    "punch": 0.06,
}
"""Kinds of states, and their shares of all."""
ROUND = ("ball", "two balls", "cylinder", "ellipsoid", "capsule")
LEAST_MM, SMALLEST_SIDE_MM = 0.03, 3.0
DEPTH_POWER = 1.5
LEAN_DEG = 4.0
"""Standard deviation of pitch and roll [deg]; half of it for faces."""
MOST_TRIES = 200
QUICK_LIGHT = replace(ACCURACIES["score"], replicates=1, image_step=1.0)
"""Accuracy of a state of the fit: its random errors average out over many states."""
SEEDS = 8
"""Seeds of the light that states take in turn, so that their errors differ."""
AT_ONCE = 256


@dataclass(frozen=True, kw_only=True, eq=False)
class Pressed:
    """A state: its kind, objects with places [mm] and depths [mm], the deformed top, and the force on the pad [N]."""

    kind: str
    objects: tuple[tuple[HeldObject, float, float, float], ...]
    top: GridTop
    force_n: float


class StateSource:
    """Draws the states of a design's pad, each by its number.

    Parameters
    ----------
    light : map without weights, which gives the nodes
    """

    def __init__(self, draft: Draft, light: FastLight, seed: int) -> None:
        self._draft, self._light, self._seed = draft, light, seed
        self._plan, self._contact = draft.plan, contact_of(draft.design)
        self._thickness_mm = light.nodes.thickness_mm
        self._tip_mm = draft.design.indenter.tip_radius_mm
        points, nodes = light.nodes.points_mm, light.nodes
        self._wall_mm = np.where(nodes.inside, self._plan.outline.gap_mm(*points[:, :2].T), -np.inf)
        self._nearest_mm = NEAREST_HELD * self._thickness_mm
        own = points[self._wall_mm > self._nearest_mm, :2]
        self._low, self._high = own.min(axis=0), own.max(axis=0)
        self._side_mm = float(min(np.ptp(nodes.x_mm), np.ptp(nodes.y_mm)) + nodes.pitch_mm)

    def state(self, number: int, kind: str | None = None) -> Pressed:
        """The state of a number, of a kind if it is given.

        Raises
        ------
        ModelScopeError : no such state was found that the contact model covers.
        """
        rng = np.random.default_rng([self._seed, number])
        chosen = kind or str(
            rng.choice(list(SHARES), p=np.array(list(SHARES.values())) / sum(SHARES.values()))
        )
        for _ in range(MOST_TRIES):
            objects = self._objects(chosen, rng)
            try:
                imprint = self.imprint([objects])
                touched = imprint.overlap_mm[0] > 0.0
                if (self._wall_mm[touched] > self._nearest_mm).all():
                    top, force_n = self.solved(objects)
                    if force_n > 0.0:
                        return Pressed(kind=chosen, objects=objects, top=top, force_n=force_n)
            except ModelScopeError:
                pass
        raise ModelScopeError(f"robot: no {chosen} was found that the contact model covers on this pad")

    def imprint(self, states: Sequence[tuple[tuple[HeldObject, float, float, float], ...]]) -> Imprint:
        """Imprints of the objects of states."""
        most = max(len(one) for one in states)
        found = [self._imprint(one) for one in states]
        return Imprint(
            overlap_mm=np.concatenate([one.overlap_mm for one in found]),
            balls_mm=np.concatenate([_padded(one.balls_mm, most) for one in found]),
            deepest_mm=np.concatenate([one.deepest_mm for one in found]),
        )

    def _imprint(self, objects: tuple[tuple[HeldObject, float, float, float], ...]) -> Imprint:
        each = []
        for held, x, y, depth in objects:
            shape, centre, turn = posed(held, self._plan.top, (x, y), depth)
            each.append(self._light.imprint(shape, centre[None], turn[None]))
        return together(each)

    def _place(self, rng: np.random.Generator) -> tuple[float, float]:
        while True:
            x, y = rng.uniform(self._low, self._high)
            if float(self._plan.outline.gap_mm(x, y)) > self._nearest_mm:
                return float(x), float(y)

    def _objects(
        self, kind: str, rng: np.random.Generator
    ) -> tuple[tuple[HeldObject, float, float, float], ...]:
        def size(low: float, high: float) -> float:
            return math.exp(float(rng.uniform(math.log(low), math.log(max(high, low)))))

        def depth() -> float:
            share = LARGEST_HELD_SHARE if kind in ROUND else SHARP_SHARE
            deepest = min(share * self._thickness_mm, self._light.deepest_mm)
            share_of_depth: float = rng.uniform() ** DEPTH_POWER
            return LEAST_MM + (deepest - LEAST_MM) * share_of_depth

        tip, side = self._tip_mm, size(SMALLEST_SIDE_MM, self._side_mm)
        yaw, (pitch, roll) = rng.uniform(-180.0, 180.0), rng.normal(0.0, LEAN_DEG, 2)
        held: HeldObject
        if kind in ("ball", "two balls"):
            held = Sphere(radius=size(0.5 * tip, 5.0 * tip))
        elif kind == "cylinder":
            held = Cylinder(radius=size(0.5 * tip, 6.0 * tip), length=side, yaw=yaw, pitch=pitch)
        elif kind == "capsule":
            radius = size(0.5 * tip, 3.0 * tip)
            held = Cylinder(radius=radius, length=2.0 * radius + side, edge=radius, yaw=yaw, pitch=pitch)
        elif kind == "punch":
            radius = size(SMALLEST_SIDE_MM / 2.0, self._side_mm / 3.0)
            held = Punch(radius=radius, yaw=yaw, pitch=pitch / 2.0, roll=roll / 2.0)
        elif kind == "ellipsoid":
            a, b, c = (size(0.5 * tip, 5.0 * tip) for _ in range(3))
            pitch, roll = rng.uniform(-90.0, 90.0, 2)
            held = Ellipsoid(a=a, b=b, c=c, yaw=yaw, pitch=pitch, roll=roll)
        else:
            lean = 0.5 if kind == "face" else 1.0
            held = Box(
                length=side,
                width=size(SMALLEST_SIDE_MM, self._side_mm),
                height=size(SMALLEST_SIDE_MM, self._side_mm),
                pose=kind,
                yaw=yaw,
                pitch=lean * pitch,
                roll=lean * roll,
            )
        first = (held, *self._place(rng), depth())
        return (first, (held, *self._place(rng), depth())) if kind == "two balls" else (first,)

    def solved(self, objects: tuple[tuple[HeldObject, float, float, float], ...]) -> tuple[GridTop, float]:
        """The deformed top, and the force. A flat pad is solved in one frame for all places, which saves time."""
        top = self._plan.top
        at = self._plan.centre_mm if top.is_flat else objects[0][1:3]
        origin, axes = top.press_frame(*at)
        x_mm, y_mm = grid_of(self._contact, at, COARSE)
        deepest, each = max(one[3] for one in objects), []
        for held, x, y, depth in objects:
            foot = axes[:2] @ (np.array([x, y, float(top.height_mm(x, y))]) - origin)
            turned = held.model_copy(update={"yaw": held.yaw - top.frame_turn_deg})
            own = bottom_mm(turned, x_mm - foot[0], y_mm - foot[1])
            if len(objects) > 1 and not top.is_flat:
                own -= float(np.nanmin(own + top.in_frame.sag_mm(*np.meshgrid(x_mm, y_mm, indexing="ij"))))
            each.append(own + deepest - depth)
        found = held_press(self._contact, at, np.minimum.reduce(each), depth_mm=deepest, fineness=COARSE)
        return found.top, found.force_n


def _padded(balls_mm: FloatArray, most: int) -> FloatArray:
    found = np.full((len(balls_mm), most, 3), np.nan)
    found[:, : balls_mm.shape[1]] = balls_mm
    return found


def traced_ratios(
    draft: Draft,
    source: StateSource,
    numbers: Sequence[int],
    of_kinds: Sequence[str] | None = None,
    *,
    accuracy: str | Accuracy = QUICK_LIGHT,
    seed: int = 0,
    on_share: OnShare = lambda _share: None,
) -> tuple[list[str], Imprint, FloatArray]:
    """Kinds, imprints and light over untouched light (n, pair) of the states of some numbers, of given kinds if any."""
    kinds, imprints, ratios = [], [], []
    for start in range(0, len(numbers), AT_ONCE):
        own = range(start, min(start + AT_ONCE, len(numbers)))
        states: dict[int, Pressed] = {}

        def solve(k: int, own: range = own, states: dict[int, Pressed] = states) -> None:
            states[own[k]] = source.state(numbers[own[k]], None if of_kinds is None else of_kinds[own[k]])

        run_each(solve, len(own))
        solved = [states[k] for k in own]
        light = light_of_tops(
            draft, [one.top for one in solved], accuracy=accuracy, seed=seed + (start // AT_ONCE) % SEEDS
        )
        floor = np.maximum(light.untouched, np.finfo(np.float64).tiny)
        kinds += [one.kind for one in solved]
        imprints.append(source.imprint([one.objects for one in solved]))
        ratios.append((light.flux / floor).reshape(len(solved), -1))
        on_share((start + len(own)) / len(numbers))
    most = max(one.balls_mm.shape[1] for one in imprints)
    whole = Imprint(
        overlap_mm=np.concatenate([one.overlap_mm for one in imprints]),
        balls_mm=np.concatenate([_padded(one.balls_mm, most) for one in imprints]),
        deepest_mm=np.concatenate([one.deepest_mm for one in imprints]),
    )
    return kinds, whole, np.concatenate(ratios)
