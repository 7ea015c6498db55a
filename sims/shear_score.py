"""How a pad resolves sideways load, and what such a load does to a model that does not know of it.

The states
----------
The design's tip, as a ball, is pressed to a third and two thirds of its radius at a grid of locations, then moved
sideways by the same distance along +x, -x, +y and -y. The distance is that of the pull `PULL_N` in the middle of the
pad, or of `HELD_SHARE` of the largest pull that friction holds there, if that is less. Depths are lowered until the
models cover all states. The ball starts beside the location and ends at it, on the same nodes: so the change by the
pull contains no motion of the ball, and the grid's errors cancel. The frame under load is

    light of the ball's own model + (light of the loaded grid - light of the unloaded grid),      pair by pair.

Of locations that are symmetric to each other only one is computed.

Least errors
------------
Unknown are x, y, depth and both components of the pull: their change of the readings, J, is that of the verdict's
bounds for x, y and depth (`optopad.sims.bounds.fisher`), and half the difference of opposite pulls for the pull, in
newtons. Where the ball stays between both, a part of the contact's edge slips, so the pull is a secant of the load's
curve. The least standard deviation of the pull is √(var x + var y) of F⁻¹, from two traces with different seeds.
Location and depth are compared with their bounds for three unknowns, without a pull.

Errors of models that do not know of it
---------------------------------------
A signal map and the other learners are trained with simulated presses of the ball (`QUICK_PROTOCOL`), whose light is
that of the map. Each predicts the frame with and without the pull, both free of noise. The difference of both
predictions is the error by the pull: of location, depth, and the force that belongs to the depth. The location is that
of the ball as it is now, not where it was pressed. Where a state has another pull, the change of light is scaled to it.

The map with a pull
-------------------
The same signal map with two more unknowns (`optopad.sims.learning.shear_map`) is compared with it on noisy frames of
random locations, depths and pulls, whose contact and light are computed there, with another seed. Its prior for each
component of the pull has a standard deviation of half the pull of the states, about that of the random ones.

The model leaves out ageing of the contact, the history of a motion with turns, and all that `contact.held.slide` does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray, IntArray, plain_numbers
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.held_object import HeldObject
from optopad.design.press_protocol import QUICK_PROTOCOL, load_protocol_file
from optopad.design.progress import OnStep
from optopad.design.recordings import signals_of
from optopad.design.shape.outline import Outline
from optopad.design.spec import SensorDesign
from optopad.sims.bounds.fisher import SEED_GAP, Steps, bounds_of, least_variances, rooted, sensitivities
from optopad.sims.bounds.observability import BOUND_ACCURACIES
from optopad.sims.contact.held.press import HeldPress
from optopad.sims.held import AskedPress, Place, all_pressed, held_light, require_asked
from optopad.sims.held_score import DEEP, standard_objects
from optopad.sims.learning.inference.signal_map import KIND as SIGNAL_MAP
from optopad.sims.learning.inference.signal_map import SignalMapModel
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.learners import LEARNERS, QUICK
from optopad.sims.learning.map_learner import fit_signal_map, map_header
from optopad.sims.learning.shear_map import ForceLight, ShearMap
from optopad.sims.learning.traced_map import (
    QUICK_DEPTH_NODES,
    QUICK_PITCH_MM,
    SignalMap,
    load_curve,
    traced_map,
)
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import SAME_PLACE_MM, block_motions, symmetries_of
from optopad.sims.readings.protocol import draw, protocol_curves, untouched_readout
from optopad.sims.readings.readout import Readout
from optopad.sims.readings.signal_chain import SignalChain, chain_of
from optopad.sims.verdict.presses import untouched_flux

SHEAR = "shear.json"
"""File of a bundle with the data of `ShearScore.to_json`, in its folder `sims`."""
PULL_N, HELD_SHARE = 0.5, 0.8
"""The pull of the states [N], and its largest share of what friction holds [-]."""
PILOT_MM, BESIDE_MM = 0.05, 0.01
"""Sideways motion that measures the stiffness [mm], and least distance of all locations from the workspace's border."""
DEPTHS = (DEEP, 2.0 * DEEP)
"""Depths of the states [tip radii]."""
SHALLOWER, SHALLOWEST = 0.8, 0.2
"""Factor by which depths are lowered if the models do not cover them, and the least of their product [-]."""
PITCH_MM, WIDER, MOST_READINGS, LEAST_STEPS = 2.2, 1.1, 1050, 2
"""First distance of the locations [mm], the factor by which it grows, the most pairs of all locations, and the least
number of steps from side to side."""
WAYS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""Directions of the pulls; opposite ones follow each other."""
ACCURACY = "score"
TESTS, FRAMES = 24, 8
"""Random presses on which maps are compared, and noisy frames of each."""
AS_MAP = "signal map with shear"


@dataclass(frozen=True, kw_only=True)
class Moved:
    """What a pull changes of the press that a model predicts; arrays are (place, depth, direction).

    Attributes
    ----------
    off_mm : (place, depth) error of the location without a pull, for comparison [mm]
    moved_mm : distance by which the pull moves the location [mm]
    deeper_mm : change of the depth [mm]
    stronger_n : change of the force that belongs to the depth [N]
    """

    off_mm: FloatArray
    moved_mm: FloatArray
    deeper_mm: FloatArray
    stronger_n: FloatArray


@dataclass(frozen=True, kw_only=True)
class ShearScore:
    """How a pad resolves sideways load, and what it does to models that do not know of it.

    Attributes
    ----------
    radius_of_tip_mm : radius of the ball [mm]
    friction : Coulomb's coefficient [-]
    places_mm : (place, 2) locations [mm]
    depth_mm : (depth,) depths [mm]
    force_n : (place, depth) force of the press without a pull [N]
    pull_n : (depth,) pull for which errors of models are given [N]
    shear_mm : (depth,) sideways motion of all states [mm]
    least_pull_n, least_pull_error_n : (place, depth) least standard deviation of the pull, √(var x + var y), and its
        standard error by the light model [N]; infinite if not resolved
    location_mm, bound_depth_mm : (place, depth) bounds of location and depth with an unknown pull [mm]
    location_times, depth_times : (place, depth) their ratios to those without a pull [-]
    moved : what a pull changes of each model's prediction, by the model's name
    map_errors : errors of the signal map without and with a pull as unknowns; see `map_rows`
    """

    radius_of_tip_mm: float
    friction: float
    places_mm: FloatArray
    depth_mm: FloatArray
    force_n: FloatArray
    pull_n: FloatArray
    shear_mm: FloatArray
    least_pull_n: FloatArray
    least_pull_error_n: FloatArray
    location_mm: FloatArray
    bound_depth_mm: FloatArray
    location_times: FloatArray
    depth_times: FloatArray
    moved: dict[str, Moved]
    map_errors: list[dict[str, Any]]

    def to_json(self) -> dict[str, Any]:
        """The figures as plain data for JSON; unresolved ones are None."""
        return {
            "radius_of_tip_mm": self.radius_of_tip_mm,
            "friction": self.friction,
            "places_mm": self.places_mm.tolist(),
            "depth_mm": self.depth_mm.tolist(),
            "force_n": self.force_n.tolist(),
            "pull_n": self.pull_n.tolist(),
            "shear_mm": self.shear_mm.tolist(),
            "least_pull_n": plain_numbers(self.least_pull_n),
            "least_pull_error_n": plain_numbers(self.least_pull_error_n),
            "location_mm": plain_numbers(self.location_mm),
            "bound_depth_mm": plain_numbers(self.bound_depth_mm),
            "location_times": plain_numbers(self.location_times),
            "depth_times": plain_numbers(self.depth_times),
            "unmodelled": {
                name: {
                    "off_mm": one.off_mm.tolist(),
                    "moved_mm": one.moved_mm.tolist(),
                    "deeper_mm": one.deeper_mm.tolist(),
                    "stronger_n": one.stronger_n.tolist(),
                }
                for name, one in self.moved.items()
            },
            "map_errors": self.map_errors,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class _Places:
    """Locations, and which of them are computed.

    Attributes
    ----------
    all_mm : (place, 2) all locations
    computed_mm : (computed, 2) those that are computed
    source : (place,) number of the computed location to which each is symmetric
    ways : (place, 4) number of the computed direction that has the light of each direction
    pairs : (place, pair) number of the computed pair that has the light of each pair
    """

    all_mm: FloatArray
    computed_mm: FloatArray
    source: IntArray
    ways: IntArray
    pairs: IntArray

    def spread(self, values: FloatArray) -> FloatArray:
        """Values (place, depth, 4) at all locations from those (computed, depth, 4) at the computed ones."""
        return np.take_along_axis(values[self.source], self.ways[:, None, :], axis=2)


def _places(draft: Draft, inset_mm: float, pitch_mm: float) -> _Places:
    """Locations about a pitch apart along x and y, an inset within the workspace; fewer if they are too many."""
    inner = _inner(draft, inset_mm)
    x, y = (
        np.linspace(low, high, max(round((high - low) / pitch_mm), LEAST_STEPS) + 1)
        for low, high in zip(inner.box_mm[:2], inner.box_mm[2:], strict=True)
    )
    apart = 0.5 * min(x[1] - x[0], y[1] - y[0])
    found: list[Place] = []
    for node in product(x.tolist(), y.tolist()):
        at = node if inner.contains(*node) else inner.clamped(*node)
        if all(np.hypot(at[0] - one[0], at[1] - one[1]) > apart for one in found):
            found.append(at)
    places = _grouped(draft, np.array(found))
    is_least = len(x) == len(y) == LEAST_STEPS + 1
    if is_least or len(places.computed_mm) * places.pairs.shape[1] <= MOST_READINGS:
        return places
    return _places(draft, inset_mm, WIDER * pitch_mm)


def _inner(draft: Draft, inset_mm: float) -> Outline:
    """The workspace without a border, in which the ball starts to move."""
    space = draft.workspace
    x0, y0, x1, y1 = space.box_mm
    inner = space.in_box((x0 + inset_mm, y0 + inset_mm, x1 - inset_mm, y1 - inset_mm))
    if inner.is_empty:
        raise ModelScopeError(
            "shear: the workspace is too small to move the tip sideways in it; lower operating.workspace_margin_mm"
        )
    return inner


def _grouped(draft: Draft, all_mm: FloatArray) -> _Places:
    """Group locations by the symmetries of the light that bring the axes onto the axes."""
    motions = [
        one
        for one in symmetries_of(scene_of(draft.design))
        if np.allclose(np.abs(one.matrix).max(axis=0), 1.0)
    ]
    count = len(draft.cavity.emitters), len(draft.cavity.receivers)
    computed: list[FloatArray] = []
    source = np.full(len(all_mm), -1)
    ways, pairs = np.zeros((len(all_mm), 4), np.int64), np.zeros((len(all_mm), count[0] * count[1]), np.int64)
    for number, at in enumerate(all_mm):
        if source[number] >= 0:
            continue
        for motion in motions:
            away = np.hypot(*(all_mm - motion.image(at)).T)
            image = int(away.argmin())
            if away[image] > 1e-6 or source[image] >= 0:
                continue
            source[image] = len(computed)
            ways[image] = (WAYS @ motion.matrix @ WAYS.T).argmax(axis=1)
            back = np.argsort(motion.emitters), np.argsort(motion.receivers)
            pairs[image] = (back[0][:, None] * count[1] + back[1]).ravel()
        computed.append(at)
    return _Places(all_mm=all_mm, computed_mm=np.array(computed), source=source, ways=ways, pairs=pairs)


@dataclass(frozen=True, kw_only=True, eq=False)
class _States:
    """Presses at the computed locations, without a pull and with one in each direction.

    Attributes
    ----------
    places : the locations
    depth_mm, pull_n, shear_mm : (depth,) depth, pull and sideways motion
    force_n : (computed, depth) force without a pull [N]
    pulls_n : (computed, depth, 4, 2) pull of each state [N]
    change : (2, computed, depth, 4, pair) change of both traces' light, over untouched light [-]
    """

    places: _Places
    depth_mm: FloatArray
    pull_n: FloatArray
    shear_mm: FloatArray
    force_n: FloatArray
    pulls_n: FloatArray
    change: FloatArray

    @property
    def factors(self) -> FloatArray:
        """(2, computed, depth, 4, pair) change for each newton along x and y, and for each square newton."""
        change, pulls = self.change, self.pulls_n
        linear = np.linalg.inv(_odd(pulls)) @ _odd(change)
        square = _even(change) / _even((pulls**2).sum(axis=-1, keepdims=True))
        return np.concatenate([linear, square], axis=-2)

    @property
    def size_n(self) -> FloatArray:
        """(computed, depth, 4) size of each pull [N]."""
        return np.hypot(self.pulls_n[..., 0], self.pulls_n[..., 1])

    @property
    def scaled(self) -> FloatArray:
        """(computed, depth, 4, pair) change by the pull of `pull_n`, over untouched light [-]."""
        return np.asarray(self.change.mean(axis=0) * (self.pull_n[:, None] / self.size_n)[..., None])

    @property
    def inset_mm(self) -> float:
        """Distance of all locations from the workspace's border [mm]."""
        return _inset_mm(self.shear_mm)

    def light(self) -> ForceLight:
        """The change at all locations, also those that are symmetric to the computed ones."""
        places = self.places
        change = self.change.mean(axis=0)[places.source]
        rows = np.arange(len(places.source))[:, None, None, None]
        depths = np.arange(len(self.depth_mm))[None, :, None, None]
        turned = change[rows, depths, places.ways[:, None, :, None], places.pairs[:, None, None, :]]
        pulls = places.spread(self.size_n)[..., None] * WAYS
        whole = replace(self, change=turned[None], pulls_n=pulls)
        return ForceLight(places_mm=places.all_mm, depth_mm=self.depth_mm, factors=whole.factors[0])


def _odd(values: FloatArray) -> FloatArray:
    """Differences (..., 2, n) of states with opposite pulls (..., 4, n)."""
    return np.asarray(values[..., 0::2, :] - values[..., 1::2, :])


def _even(values: FloatArray) -> FloatArray:
    """Sums (..., 2, n) of states with opposite pulls (..., 4, n)."""
    return np.asarray(values[..., 0::2, :] + values[..., 1::2, :])


def _inset_mm(shear_mm: FloatArray) -> float:
    return float(shear_mm.max()) + BESIDE_MM


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sensor:
    """A pad, the light of its tip as a map, and its readings.

    Attributes
    ----------
    draft : the pad
    design : its design, with bonded walls
    known : map of the light without a pull
    untouched : (emitter, receiver) light without contact [-]
    readout, chain : gains and noise
    """

    draft: Draft
    design: SensorDesign
    known: SignalMap
    untouched: FloatArray
    readout: Readout
    chain: SignalChain

    def ratio(self, press_mm: FloatArray) -> FloatArray:
        """Light (n, pair) of presses (n, 3) over untouched light [-]."""
        return np.asarray(self.known.ratio_root.values(press_mm) ** 2)

    def flux(self, ratio: FloatArray) -> FloatArray:
        """Light (n, emitter, receiver) from ratios (n, pair), which are at least 0."""
        return np.asarray(np.maximum(ratio, 0.0).reshape(-1, *self.untouched.shape) * self.untouched)


def _sensor(draft: Draft, seed: int, tell: OnStep) -> _Sensor:
    design = draft.design.with_(**{"noise.wall_unbonded_share": 0.0})
    known = traced_map(
        design, pitch_mm=QUICK_PITCH_MM, depth_nodes=QUICK_DEPTH_NODES, seed=seed, on_step=tell
    )
    untouched = untouched_flux(draft, seed=seed)
    readout = untouched_readout(draft.design, untouched)
    chain = chain_of(draft.design, readout)
    return _Sensor(draft=draft, design=design, known=known, untouched=untouched, readout=readout, chain=chain)


def require_shear(draft: Draft) -> None:
    """Refuse a pad whose light under objects is not modelled, before any work; errors are those of `require_asked`."""
    ball = standard_objects(draft.design.indenter.tip_radius_mm)["ball"]
    require_asked(draft, AskedPress(held=(ball,), at_mm=draft.plan.centre_mm, depth_mm=0.0))


def score_shear(
    draft: Draft, *, seed: int = 0, friction: float | None = None, on_step: OnStep | None = None
) -> ShearScore:
    """Compute how a pad resolves sideways load, and what it does to models that do not know of it.

    Parameters
    ----------
    friction : Coulomb's coefficient [-]; None is that of the catalogue

    Raises
    ------
    InputError : there is no friction.
    ModelScopeError : the models do not cover the presses on this pad.
    """
    tell = on_step or (lambda _stage, _share: None)
    ball = standard_objects(draft.design.indenter.tip_radius_mm)["ball"].model_copy(
        update={"friction": friction}
    )
    states = _solved(draft, ball, seed, tell)
    sensor = _sensor(draft, seed, tell)
    least = _bounds(sensor, states, seed, tell)
    models = _models(sensor, seed, tell)
    source = states.places.source
    return ShearScore(
        radius_of_tip_mm=draft.design.indenter.tip_radius_mm,
        friction=AskedPress(held=(ball,), at_mm=(0.0, 0.0)).friction,
        places_mm=states.places.all_mm,
        depth_mm=states.depth_mm,
        force_n=states.force_n[source],
        pull_n=states.pull_n,
        shear_mm=states.shear_mm,
        **{name: values[source] for name, values in least.items()},
        moved=_moved(sensor, states, models),
        map_errors=_map_errors(sensor, ball, states, models, seed, tell),
    )


def _solved(draft: Draft, ball: HeldObject, seed: int, tell: OnStep) -> _States:
    """Contact and light of all states; the depths are lowered until the models cover them."""
    radius, share = draft.design.indenter.tip_radius_mm, 1.0
    deepest = 0.9 * draft.design.operating.max_depth_mm
    while True:
        try:
            depth_mm = share * np.minimum(np.array(DEPTHS) * radius, deepest * np.array(DEPTHS) / DEPTHS[-1])
            pull_n, shear_mm = _pulls(draft, ball, depth_mm)
            places = _places(draft, _inset_mm(shear_mm), PITCH_MM)
            found = _contacts(draft, ball, places.computed_mm, depth_mm, shear_mm, tell)
        except ModelScopeError:
            share *= SHALLOWER
            if share < SHALLOWEST:
                raise
            continue
        shape = len(places.computed_mm), len(depth_mm), 1 + len(WAYS)
        change = np.stack(
            [
                _changed(
                    draft,
                    found,
                    seed + SEED_GAP * half,
                    lambda part, half=half: tell("light of shear", 0.5 * (half + part)),
                )
                for half in range(2)
            ]
        ).reshape(2, *shape, -1)
        pulls = np.array([one.pull_n for one in found]).reshape(*shape, 2)
        return _States(
            places=places,
            depth_mm=depth_mm,
            pull_n=pull_n,
            shear_mm=shear_mm,
            force_n=np.array([one.force_n for one in found]).reshape(shape)[..., 0],
            pulls_n=pulls[:, :, 1:],
            change=change[..., 1:, :] - change[..., :1, :],
        )


def _pulls(draft: Draft, ball: HeldObject, depth_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pull [N] of the states at each depth, and the sideways motion [mm] that needs it in the middle of the pad."""
    at = draft.plan.centre_mm
    asked = [
        one
        for depth in depth_mm.tolist()
        for one in _asked(ball, at, depth, PILOT_MM * np.array([[0.0, 0.0], WAYS[0]]))
    ]
    if asked[0].friction <= 0.0:
        raise InputError("friction: 0 holds nothing sideways; give more than 0")
    found = all_pressed(draft, asked)
    holds = asked[0].friction * np.array([one.force_n for one in found[0::2]])
    pull = np.minimum(PULL_N, HELD_SHARE * holds)
    softness = PILOT_MM / np.array([np.hypot(*one.pull_n) for one in found[1::2]])
    slip = 1.0 - (1.0 - pull / holds) ** (2.0 / 3.0)  # Mindlin's partial slip, over its first slope
    return pull, softness * slip * 1.5 * holds


def _contacts(
    draft: Draft,
    ball: HeldObject,
    places_mm: FloatArray,
    depth_mm: FloatArray,
    shear_mm: FloatArray,
    tell: OnStep,
) -> list[HeldPress]:
    """Presses at each location and depth, without a pull and in each direction; symmetric ones are solved once."""
    plan = draft.plan
    motions = block_motions(plan.length_mm, plan.width_mm) if plan.top.is_flat else [(np.eye(2), np.zeros(2))]
    known: dict[tuple[int, ...], int] = {}
    asked: list[AskedPress] = []
    made: list[tuple[int, FloatArray, FloatArray]] = []
    for at, layer, way in product(places_mm, range(len(depth_mm)), np.concatenate([np.zeros((1, 2)), WAYS])):
        for matrix, offset in motions:
            image = np.round([*((matrix @ at + offset) / SAME_PLACE_MM), *(matrix @ way), layer])
            number = known.get(tuple(image.astype(np.int64).tolist()))
            if number is not None:
                made.append((number, matrix.T, -matrix.T @ offset))
                break
        else:
            own = np.round([*(at / SAME_PLACE_MM), *way, layer])
            known[tuple(own.astype(np.int64).tolist())] = len(asked)
            made.append((len(asked), *motions[0]))
            asked += _asked(ball, at.tolist(), float(depth_mm[layer]), shear_mm[layer] * way[None])
    found = all_pressed(draft, asked, lambda done, total: tell("sideways load", done / total))
    return [_image(found[number], matrix, offset) for number, matrix, offset in made]


def _image(press: HeldPress, matrix: FloatArray, offset_mm: FloatArray) -> HeldPress:
    """The image of a press on a flat pad under a motion that brings the axes onto the axes."""
    top = press.top
    lines, arrays = (top.x_mm, top.y_mm), (top.height_mm, top.level)
    if matrix[0, 0] == 0.0:
        lines, arrays = lines[::-1], (top.height_mm.T, top.level.T)
    signs = [int(one) for one in matrix.sum(axis=1)]
    x_mm, y_mm = (sign * one[::sign] for sign, one in zip(signs, lines, strict=True))
    height, level = (np.ascontiguousarray(one[:: signs[0], :: signs[1]]) for one in arrays)
    x, y = (matrix @ top.at_mm + offset_mm).tolist()
    pull = (matrix @ press.pull_n).tolist()
    moved = replace(top, at_mm=(x, y), x_mm=x_mm, y_mm=y_mm, height_mm=height, level=level)
    return replace(press, top=moved, pull_n=(pull[0], pull[1]))


def _asked(
    ball: HeldObject, at_mm: Sequence[float], depth_mm: float, shear_mm: FloatArray
) -> list[AskedPress]:
    """Presses that end at a location, after each of the sideways motions (n, 2)."""
    return [
        AskedPress(
            held=(ball,),
            at_mm=(at_mm[0] - x, at_mm[1] - y),
            depth_mm=depth_mm,
            shear_mm=(x, y) if x or y else None,
        )
        for x, y in shear_mm.tolist()
    ]


def _changed(draft: Draft, presses: Sequence[HeldPress], seed: int, on_share: Any) -> FloatArray:
    """(press, pair) light over untouched light [-]; 0 for pairs without light."""
    light = held_light(
        draft, presses, accuracy=ACCURACY, seed=seed, on_step=lambda done, total: on_share(done / total)
    )
    whole = np.where(light.untouched > 0.0, light.untouched, np.inf)
    return np.asarray((light.flux / whole).reshape(len(presses), -1))


def _bounds(sensor: _Sensor, states: _States, seed: int, tell: OnStep) -> dict[str, FloatArray]:
    """Bounds (computed, depth) with and without an unknown pull, by the names of `ShearScore`."""
    at_rest = sensitivities(
        sensor.draft,
        states.places.computed_mm,
        states.depth_mm,
        sensor.readout,
        accuracies=BOUND_ACCURACIES,
        seed=seed,
        steps=Steps(),
        on_step=lambda share: tell("bounds", share),
    )
    counts = (sensor.untouched * sensor.readout.gains).ravel()
    by_pull = np.moveaxis(states.factors[..., :2, :] * counts, -2, -1)
    answers = replace(
        at_rest,
        first=np.concatenate([at_rest.first, by_pull[0]], axis=-1),
        second=np.concatenate([at_rest.second, by_pull[1]], axis=-1),
    )
    without, both = bounds_of(at_rest), bounds_of(answers)
    variance, slips, is_seen = least_variances(answers)
    pull, error = rooted(variance[..., 3] + variance[..., 4], np.hypot(slips[..., 3], slips[..., 4]), is_seen)
    with np.errstate(invalid="ignore"):
        return {
            "least_pull_n": pull,
            "least_pull_error_n": error,
            "location_mm": both.location_mm,
            "bound_depth_mm": both.depth_mm,
            "location_times": both.location_mm / without.location_mm,
            "depth_times": both.depth_mm / without.depth_mm,
        }


def _models(sensor: _Sensor, seed: int, tell: OnStep) -> dict[str, TouchModel]:
    """The learners, trained with presses whose light is that of the map."""
    design, known = sensor.design, sensor.known
    curves = protocol_curves(
        design,
        load_protocol_file(QUICK_PROTOCOL).fitted_to(design),
        is_coarse=True,
        light=lambda press: sensor.flux(sensor.ratio(press)),
    )
    train = draw(curves, seed=seed).role("train")
    header = map_header(design, train, known, seed)
    models: dict[str, TouchModel] = {SIGNAL_MAP: fit_signal_map(design, known, header, train, seed=seed)}
    for number, (name, fit) in enumerate(LEARNERS.items()):
        tell("learners", number / len(LEARNERS))
        models[name] = fit(train, seed=seed, settings=QUICK)
    tell("learners", 1.0)
    return models


def _moved(sensor: _Sensor, states: _States, models: dict[str, TouchModel]) -> dict[str, Moved]:
    """What the pull changes of each model's prediction, at all locations."""
    computed, depths, spread = states.places.computed_mm, states.depth_mm, states.places.spread
    press = np.column_stack([np.repeat(computed, len(depths), axis=0), np.tile(depths, len(computed))])
    ratio = sensor.ratio(press).reshape(len(computed), len(depths), 1, -1)
    both = np.concatenate([ratio, ratio + states.scaled], axis=2)
    counts = sensor.flux(both) * sensor.chain.gains
    signals = np.minimum(counts, sensor.chain.full_scale_counts).reshape(-1, both.shape[-1])
    curve = load_curve(sensor.design)
    found = {}
    for name, model in models.items():
        press_mm = model.predict(signals).press_mm.reshape(len(computed), len(depths), -1, 3)
        force_n = curve.at(press_mm[..., 2])
        off = press_mm[:, :, 1:] - press_mm[:, :, :1]
        own = press_mm[:, :, 0] - press.reshape(len(computed), -1, 3)
        found[name] = Moved(
            off_mm=np.hypot(own[..., 0], own[..., 1])[states.places.source],
            moved_mm=spread(np.hypot(off[..., 0], off[..., 1])),
            deeper_mm=spread(off[..., 2]),
            stronger_n=spread(force_n[:, :, 1:] - force_n[:, :, :1]),
        )
    return found


def _map_errors(
    sensor: _Sensor, ball: HeldObject, states: _States, models: dict[str, TouchModel], seed: int, tell: OnStep
) -> list[dict[str, Any]]:
    """Median and 95th percentile of the errors of both signal maps on noisy frames, without and with a pull."""
    draft, rng = sensor.draft, np.random.default_rng([seed, TESTS])
    places = _inner(draft, states.inset_mm).spread(rng.uniform(size=(TESTS, 2)))
    depth_mm = rng.uniform(states.depth_mm[0], states.depth_mm[-1], TESTS)
    size = rng.uniform(size=TESTS) * np.interp(depth_mm, states.depth_mm, states.shear_mm)
    angle = rng.uniform(0.0, 2.0 * np.pi, TESTS)
    moves = size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    asked = [
        one
        for at, depth, move in zip(places.tolist(), depth_mm.tolist(), moves, strict=True)
        for one in _asked(ball, at, depth, np.stack([np.zeros(2), move]))
    ]
    found = all_pressed(draft, asked, lambda done, total: tell("test presses", 0.7 * done / total))
    light = _changed(draft, found, seed + 2 * SEED_GAP, lambda part: tell("test presses", 0.7 + 0.3 * part))
    pull_n = np.array([one.pull_n for one in found[1::2]])
    press = np.column_stack([places, depth_mm])
    ratio = sensor.ratio(press)
    plain = models[SIGNAL_MAP]
    assert isinstance(plain, SignalMapModel)
    maps = {
        SIGNAL_MAP: lambda signals: np.pad(plain.found(signals).press_mm, ((0, 0), (0, 2))),
        AS_MAP: ShearMap(ball=plain, light=states.light(), usual_n=0.5 * float(states.pull_n.max())).found,
    }
    rows = []
    for is_pulled in (False, True):
        flux = sensor.flux(ratio + (light[1::2] - light[0::2]) * is_pulled)
        frames = [sensor.chain.counts(flux, np.zeros(len(flux)), rng) for _ in range(FRAMES)]
        signals = signals_of(np.concatenate(frames).astype(np.float64))
        truth = np.tile(np.column_stack([press, pull_n * is_pulled]), (FRAMES, 1))
        for name, search in maps.items():
            off = search(signals.reshape(len(signals), -1)) - truth
            errors = {"location_mm": np.hypot(*off[:, :2].T), "depth_mm": np.abs(off[:, 2])}
            if name == AS_MAP:
                errors["pull_n"] = np.hypot(*off[:, 3:].T)
            rows.append(
                {"map": name, "is_pulled": is_pulled}
                | {key: [float(np.median(one)), float(np.quantile(one, 0.95))] for key, one in errors.items()}
            )
    tell("test presses", 1.0)
    return rows
