"""Readings of a sensor under presses of known location and depth, on which learners are trained and tested.

One sample is one frame: every state (each emitter alone, then all off) read by every receiver, and the position of the
tip by the stage. Samples belong to presses (one approach and retraction at one location), presses to sets (one session
of one pattern). Splits keep presses whole: samples of one press are too similar to be on both sides.

numpy only; files are read and written by `sims.readings.dataset`.

Light against depth at fixed locations, traced at a few depths and interpolated between them.

A press runs through depth at one location, so a data set of thousands of samples needs only one curve per location.
The interpolation is modified Akima (makima, Hermite pieces with local slopes) in the square root of depth, with which
the contact's radius grows. It was chosen by measurement (`python -m tests.validation.learning.press_curve_table`; six
locations of the paper's pad, 73 depths, a median pair of 300 counts): with these knots makima, pchip and a cubic
spline are all 0.35 counts (rms) off light traced at "standard", 0.16 to 0.18 below 1 mm, and 0.46 off "draft", where
half is the numerical error of the light. Makima rings less near a kink than the spline and bends less at knots than
pchip. The worst errors, 15 counts, are kinks beyond 2 mm, where the tip enters or leaves a direct path.
`interpolation_error` measures any design.

Depth 0 or less is the untouched pad. Deeper than the last knot the last piece's end slope continues for `BEYOND_MM` at
most: a press of full depth overshoots by its zero offset.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.arrays import BoolArray, FloatArray, IntArray
from design.errors import InputError, ModelScopeError
from design.recordings import OFF, ROLES, SetEntry, signals_of
from design.spec import SensorDesign
from sims.optics.accuracy import Accuracy
from sims.readings.label_checks import require_finite

CONVERTED = "converted"
"""Attribute of data with the conversion of the unit of their readings."""


@dataclass(frozen=True, kw_only=True)
class PressData:
    """Samples of one or several sets, in the order in which they were taken.

    Attributes
    ----------
    counts : (sample, state, receiver) float32 readings; the last state is ``off`` [ADC counts]
    press_mm : (sample, 3) x, y, depth as the stage reports them; depth 0 or less is untouched [mm]
    time_s : (sample,) time of each frame within its set [s]
    set_number : (sample,) index into `sets`
    place_number : (sample,) number of the press in its set
    sets : the sessions
    state_names, receiver_names : in the order of the axes
    full_scale_counts : reading at which the converter clips; None where the file does not have it [counts]
    design_digest : digest of the design that was built or simulated; None where the file does not have it
    attributes : further data: protocol, parameters of the signal chain, seed
    true_press_mm : (sample, 3) true position of the tip; simulated sets only [mm]
    """

    counts: NDArray[np.float32]
    press_mm: FloatArray
    time_s: FloatArray
    set_number: IntArray
    place_number: IntArray
    sets: tuple[SetEntry, ...]
    state_names: tuple[str, ...]
    receiver_names: tuple[str, ...]
    full_scale_counts: float | None = None
    design_digest: str | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)
    true_press_mm: FloatArray | None = None

    def __post_init__(self) -> None:
        _require_shapes(self)
        arrays = {name: getattr(self, name) for name in ("counts", "press_mm", "time_s", "true_press_mm")}
        require_finite(arrays, where="data", row="sample")

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def emitter_names(self) -> tuple[str, ...]:
        """Names of the states but ``off``."""
        return self.state_names[:-1]

    @property
    def pair_names(self) -> tuple[str, ...]:
        """Names of the features, emitter outermost: ``E1-R1``, ``E1-R2``, ..."""
        return tuple(f"{e}-{r}" for e in self.emitter_names for r in self.receiver_names)

    def signals(self) -> NDArray[np.float32]:
        """(sample, emitter, receiver) readings less those of the off state [counts]."""
        return signals_of(self.counts)

    def features(self) -> NDArray[np.float32]:
        """(sample, pair) the same, emitter outermost [counts]."""
        return self.signals().reshape(len(self), -1)

    def only(self, mask: BoolArray | IntArray) -> PressData:
        """The samples that a mask (sample,) selects, or those with the given numbers (n,)."""
        picked = {
            name: getattr(self, name)[mask]
            for name in ("counts", "press_mm", "time_s", "set_number", "place_number")
        }
        truth = None if self.true_press_mm is None else self.true_press_mm[mask]
        return replace(self, **picked, true_press_mm=truth)

    def role(self, name: str) -> PressData:
        """Samples of all sets with a role, ``train`` or ``test``.

        Raises
        ------
        InputError : there is no such role.
        """
        if name not in ROLES:
            raise InputError(f"role: {name!r} is refused: give {' or '.join(ROLES)}")
        wanted = np.array([one.role == name for one in self.sets], dtype=np.bool_)
        return self.only(wanted[self.set_number])

    def press_numbers(self) -> IntArray:
        """(sample,) one number per press over all sets, rising from 0 without gaps; splits keep presses whole."""
        presses = np.stack([self.set_number, self.place_number], axis=1)
        return np.asarray(np.unique(presses, axis=0, return_inverse=True)[1], dtype=np.int64).reshape(-1)

    def clipped_share(self) -> FloatArray:
        """(state, receiver) share of the readings at full scale [-]; zeros where that is not known."""
        if self.full_scale_counts is None or len(self) == 0:
            return np.zeros(self.counts.shape[1:])
        return np.asarray((self.counts >= self.full_scale_counts).mean(axis=0), dtype=np.float64)


def joined(parts: Sequence[PressData]) -> PressData:
    """Sets of several files as one; set numbers continue.

    Raises
    ------
    InputError : there is no part, or parts have other designs, states, receivers or converters.
    """
    if not parts:
        raise InputError("data: none given; name at least one file")
    first = parts[0]
    for number, part in enumerate(parts[1:], start=2):
        for name in ("state_names", "receiver_names", "full_scale_counts", "design_digest"):
            if getattr(part, name) != getattr(first, name):
                raise InputError(
                    f"data: {name} of file {number} is {getattr(part, name)}, of the first {getattr(first, name)}; "
                    "join recordings of one sensor only"
                )
    starts = np.cumsum([0, *(len(part.sets) for part in parts)])
    truths = [part.true_press_mm for part in parts]
    return replace(
        first,
        counts=np.concatenate([part.counts for part in parts]),
        press_mm=np.concatenate([part.press_mm for part in parts]),
        time_s=np.concatenate([part.time_s for part in parts]),
        set_number=np.concatenate(
            [part.set_number + start for part, start in zip(parts, starts, strict=False)]
        ),
        place_number=np.concatenate([part.place_number for part in parts]),
        sets=tuple(one for part in parts for one in part.sets),
        true_press_mm=np.concatenate([one for one in truths if one is not None])
        if all(one is not None for one in truths)
        else None,
    )


def data_notes(data: PressData) -> tuple[str, ...]:
    """Notes of a result about its data, as sentences: simulated, converted, clipped."""
    simulated = "the data are simulated, not recorded" if data.true_press_mm is not None else None
    notes = (simulated, data.attributes.get(CONVERTED), clipped_note(data))
    return tuple(str(note) for note in notes if note is not None)


def clipped_note(data: PressData) -> str | None:
    """The clipped channels, in a sentence; None where there are none.

    The off state's readings are named as ``off-R1``; a clipped pair has less, or no, information on a press.
    """
    share = data.clipped_share()
    at = np.argwhere(share > 0)
    if not len(at):
        return None
    worst = sorted(at.tolist(), key=lambda place: -share[tuple(place)])
    named = ", ".join(
        f"{data.state_names[s]}-{data.receiver_names[r]} ({_percent(share[s, r])})" for s, r in worst[:6]
    )
    more = f" and {len(worst) - 6} more" if len(worst) > 6 else ""
    return f"{len(worst)} of {share.size} channels clip at {data.full_scale_counts:g} counts: {named}{more}"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.01 else "< 1 %"


def _require_shapes(data: PressData) -> None:
    samples, states, receivers = len(data.counts), len(data.state_names), len(data.receiver_names)
    wanted = {
        "counts": (samples, states, receivers),
        "press_mm": (samples, 3),
        "time_s": (samples,),
        "set_number": (samples,),
        "place_number": (samples,),
        "true_press_mm": (samples, 3),
    }
    for one in fields(data):
        values = getattr(data, one.name)
        if one.name in wanted and values is not None and values.shape != wanted[one.name]:
            raise InputError(f"data: {one.name} has shape {values.shape}, needs {wanted[one.name]}")
    if states < 2 or data.state_names[-1] != OFF:
        raise InputError(
            f"data: the states are {', '.join(data.state_names)}; needs emitters and last {OFF!r}, the "
            "reading with every emitter dark, which is subtracted from the others"
        )
    if samples and not (data.set_number.min() >= 0 and data.set_number.max() < len(data.sets)):
        raise InputError(
            f"data: set_number runs from {data.set_number.min()} to {data.set_number.max()}, "
            f"there are {len(data.sets)} sets"
        )


OnStep = Callable[[int, int], None]

KNOTS_MM = (
    0.0, 0.06, 0.14, 0.26, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.4, 2.8, 3.2, 3.7, 4.1, 4.6, 5.1,
)  # fmt: skip
"""Depths of the paper's tip, 3 mm in radius, pressed to 5 mm: dense where the surface starts to tilt [mm]."""
COARSE_KNOTS_MM = (0.0, 0.1, 0.26, 0.45, 0.7, 1.0, 1.5, 2.1, 2.8, 3.6, 4.3, 5.1)
"""Knots for a first look, two thirds of the light; 0.73 counts rms off "draft", 0.62 off "standard", as above [mm]."""
KNOTS_TIP_MM = 3.0
"""Tip radius of `KNOTS_MM`; contact and dimple scale with it [mm]."""
SPARE_MM = 0.1
"""Extent of the knots beyond a design's deepest press: offsets of the reference depth [mm]."""
BEYOND_MM = 0.25
"""Extent of a curve beyond the last knot [mm]."""
CHUNK = 4096
"""Number of depths processed at a time: 2 MB for a pad of 8 + 8 parts."""


@dataclass(frozen=True, kw_only=True)
class PressCurves:
    """Flux against depth at some locations.

    Attributes
    ----------
    places_mm : (place, 2) press axes [mm]
    depth_mm : (knot,) rising from 0 [mm]
    flux : (place, knot, emitter, receiver) share of the emitted power [-]
    """

    places_mm: FloatArray
    depth_mm: FloatArray
    flux: FloatArray

    def __post_init__(self) -> None:
        places, knots = len(self.places_mm), len(self.depth_mm)
        if self.flux.ndim != 4 or self.flux.shape[:2] != (places, knots):
            raise InputError(
                f"curves: flux has shape {self.flux.shape}, needs ({places}, {knots}, emitter, receiver)"
            )
        if knots < 2 or self.depth_mm[0] != 0.0 or not (np.diff(self.depth_mm) > 0).all():
            raise InputError(f"curves: depths {self.depth_mm.tolist()} must rise from 0, two at least")

    @property
    def untouched(self) -> FloatArray:
        """(emitter, receiver) flux of the untouched pad [-]."""
        return np.asarray(self.flux[0, 0])

    @property
    def deepest_mm(self) -> float:
        """Deepest press that `at` accepts [mm]."""
        return float(self.depth_mm[-1]) + BEYOND_MM

    def at(self, place_number: IntArray, depth_mm: FloatArray) -> FloatArray:
        """Flux of presses.

        Parameters
        ----------
        place_number : (n,) index into `places_mm`
        depth_mm : (n,) 0 or less is untouched [mm]

        Returns
        -------
        (n, emitter, receiver) [-]

        Raises
        ------
        ModelScopeError : a depth is deeper than the curves.
        """
        number, depth = np.broadcast_arrays(np.asarray(place_number), np.asarray(depth_mm, dtype=np.float64))
        if depth.size and not depth.max() <= self.deepest_mm:
            raise ModelScopeError(
                f"press: {depth.max():g} mm is deeper than the curves, {self.deepest_mm:g} mm; lower "
                "noise.zero_offset_set_mm and zero_offset_place_mm, or press less deep"
            )
        found = np.empty((len(depth), *self.flux.shape[2:]))
        for start in range(0, len(depth), CHUNK):
            part = slice(start, start + CHUNK)
            found[part] = self._at(number[part], depth[part])
        return found

    def only(self, place_number: IntArray) -> PressCurves:
        """The curves of some of the locations."""
        return PressCurves(
            places_mm=self.places_mm[place_number], depth_mm=self.depth_mm, flux=self.flux[place_number]
        )

    def _at(self, number: IntArray, depth_mm: FloatArray) -> FloatArray:
        depth = np.maximum(depth_mm, 0.0)
        last = len(self.depth_mm) - 2
        piece = np.clip(np.searchsorted(self.depth_mm, depth, side="right") - 1, 0, last)
        step = np.sqrt(np.minimum(depth, self.depth_mm[-1])) - np.sqrt(self.depth_mm[piece])
        cubic = self._cubics[number, piece]
        x = step[:, None, None]
        value = ((cubic[:, 0] * x + cubic[:, 1]) * x + cubic[:, 2]) * x + cubic[:, 3]
        over = np.flatnonzero(depth > self.depth_mm[-1])
        if over.size:
            end = self._end_slope[number[over]]
            value[over] += end * (depth[over] - self.depth_mm[-1])[:, None, None]
        return np.asarray(np.maximum(value, 0.0))

    @cached_property
    def _cubics(self) -> FloatArray:
        """(place, piece, power 3 to 0, emitter, receiver) in the square root of depth."""
        from scipy.interpolate import Akima1DInterpolator, PchipInterpolator

        root = np.sqrt(self.depth_mm)
        few = len(root) < 4
        found = (
            PchipInterpolator(root, self.flux, axis=1).c
            if few
            else Akima1DInterpolator(root, self.flux, axis=1, method="makima").c
        )
        return np.ascontiguousarray(np.moveaxis(found, 2, 0).swapaxes(1, 2))

    @cached_property
    def _end_slope(self) -> FloatArray:
        """(place, emitter, receiver) change of flux with depth over the last piece, a straight line [1/mm]."""
        span = self.depth_mm[-1] - self.depth_mm[-2]
        return np.asarray((self.flux[:, -1] - self.flux[:, -2]) / span)


def knots_mm(design: SensorDesign, *, is_coarse: bool = False, deepest_mm: float | None = None) -> FloatArray:
    """Depths at which a design's curves are traced.

    They are `KNOTS_MM` scaled with the tip, to a little beyond the deepest press where the contact model covers it.

    Parameters
    ----------
    is_coarse : whether to use `COARSE_KNOTS_MM` instead
    deepest_mm : deepest press required; by default that of the design's usable range [mm]

    Returns
    -------
    (knot,) rising from 0 [mm]
    """
    from sims.contact.scope import depth_limit_mm

    scale = design.indenter.tip_radius_mm / KNOTS_TIP_MM
    wanted = design.operating.max_depth_mm if deepest_mm is None else deepest_mm
    end = max(min(wanted + _spare_mm(design), depth_limit_mm(design)), wanted)
    knots = [one * scale for one in (COARSE_KNOTS_MM if is_coarse else KNOTS_MM)]
    kept = [one for one in knots if one < end - 0.25 * scale * (one > scale)]
    return np.round([*kept, end], 6)


def _spare_mm(design: SensorDesign) -> float:
    """Overshoot of presses of full depth, five deviations, less the extent of the curves' last slope [mm]."""
    noise = design.noise
    offset = float(np.hypot(noise.zero_offset_set_mm, noise.zero_offset_place_mm))
    return max(SPARE_MM, 5.0 * offset + noise.retract_lag_mm - BEYOND_MM)


def traced_curves(
    design: SensorDesign,
    places_mm: FloatArray,
    *,
    depth_mm: FloatArray | tuple[float, ...] | None = None,
    accuracy: str | Accuracy = "draft",
    seed: int = 0,
    on_step: OnStep | None = None,
) -> PressCurves:
    """Trace curves; locations that a symmetry of the layout carries onto each other are traced once.

    Parameters
    ----------
    places_mm : (place, 2) [mm]
    depth_mm : (knot,) rising from 0; by default `knots_mm` of the design [mm]
    accuracy, seed : accuracy setting and random seed of the light model
    on_step : called with (states done, states)

    Raises
    ------
    InputError : locations have another shape or are not finite, or depths do not rise from 0.
    ModelScopeError : the contact or light model does not cover a depth or location.
    """
    from sims.optics.tracing import trace

    places = np.asarray(places_mm, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 2 or not len(places) or not np.isfinite(places).all():
        raise InputError(f"places: shape {places.shape}, needs (location, 2) of finite x, y, one at least")
    knots = knots_mm(design) if depth_mm is None else np.asarray(depth_mm, dtype=np.float64)
    states = np.array([[x, y, depth] for x, y in places for depth in knots])
    light = trace(design, states, accuracy=accuracy, seed=seed, on_step=on_step)
    flux = light.flux.reshape(len(places), len(knots), *light.flux.shape[1:])
    return PressCurves(places_mm=places, depth_mm=knots, flux=flux)


@dataclass(frozen=True, kw_only=True)
class InterpolationError:
    """Difference of interpolated and traced flux halfway between the knots.

    Attributes
    ----------
    depth_mm : (between,) [mm]
    flux : (place, between, emitter, receiver) interpolated less traced, both with the light's own error [-]
    """

    depth_mm: FloatArray
    flux: FloatArray

    def rms_counts(self, gains: FloatArray) -> float:
        """Root mean square over locations, depths and pairs, with gains that multiply (emitter, receiver) [counts]."""
        return float(np.sqrt(((self.flux * gains) ** 2).mean()))

    def worst_counts(self, gains: FloatArray) -> float:
        """The largest difference [counts]."""
        return float(np.abs(self.flux * gains).max())


def interpolation_error(
    design: SensorDesign,
    places_mm: FloatArray,
    *,
    accuracy: str = "draft",
    checked_with: str = "draft",
    seed: int = 0,
) -> InterpolationError:
    """Trace curves at some locations and compare them with light traced halfway between the knots.

    Parameters
    ----------
    accuracy, checked_with : settings of the curves, and of the light between the knots
    """
    curves = traced_curves(design, places_mm, accuracy=accuracy, seed=seed)
    between = (curves.depth_mm[1:] + curves.depth_mm[:-1]) / 2
    truth = traced_curves(
        design, places_mm, depth_mm=np.concatenate([[0.0], between]), accuracy=checked_with, seed=seed
    )
    number = np.repeat(np.arange(len(curves.places_mm)), len(between))
    found = curves.at(number, np.tile(between, len(curves.places_mm)))
    return InterpolationError(
        depth_mm=between, flux=found.reshape(truth.flux[:, 1:].shape) - truth.flux[:, 1:]
    )
