"""Readings of a sensor under presses of known location and depth (`PressData`), and curves of light against depth.

A sample is one frame: the readings of every receiver in every state (each emitter alone, then all off), and the
position of the tip as the stage reports it. Further tips may touch
at the same time. Samples belong to presses (one approach and retraction at one location).
Presses belong to sets (one session of one pattern). Splits into training and test data keep presses whole, because
samples of one press are too similar to be on both sides. `optopad.sims.readings.dataset` reads and writes the files.

Light against depth (`PressCurves`)
-----------------------------------
During a press the depth changes at one location. So light is traced at a few depths ("knots") per location and
interpolated between them: thousands of samples need only one curve per location. The interpolation is modified Akima
(makima, Hermite pieces with local slopes) over the square root of depth, because the contact radius grows with that
root.

It was chosen after a comparison (`python -m tests.validation.learning.press_curve_table`: six locations on the paper's
pad, 73 depths, a median pair of 300 counts). With the knots below, makima, pchip and a cubic spline all differ from
light traced at "standard" accuracy by 0.35 counts rms, and by 0.16 to 0.18 at depths of less than 1 mm. From "draft"
accuracy they differ by 0.46, half of which is numerical error of the light. Makima overshoots less near a kink than the
spline and bends less at knots than pchip. The largest errors, 15 counts, are at kinks beyond 2 mm, where the tip enters
or leaves a direct light path.

At depth 0 or less the pad is not touched. Beyond the last knot the curve continues with its last slope, for at most
`BEYOND_MM`, because an error of the reference depth makes some presses deeper than the design's deepest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.recordings import LOSSES, OFF, ROLES, SetEntry, signals_of
from optopad.design.spec import SensorDesign
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.readings.label_checks import require_finite, require_whole_tips

CONVERTED = "converted"
"""Name of the entry in `PressData.attributes` that says how readings were converted from another unit."""


@dataclass(frozen=True, kw_only=True)
class PressData:
    """Samples of one or several sets, in the order in which they were taken.

    Attributes
    ----------
    counts : (sample, state, receiver) float32 readings [ADC counts]; a state is one emitter alone, the last is ``off``
    press_mm : (sample, 3) x, y, depth of the tip as the stage reports them [mm]; depth 0 or less is no contact
    time_s : (sample,) time of each frame within its set [s]
    set_number : (sample,) index of each sample's set in `sets`
    place_number : (sample,) number of each sample's press within its set
    sets : name and role (train or test) of every set
    state_names, receiver_names : names along the axes `state` and `receiver` of `counts`
    full_scale_counts : reading at which the converter clips [counts]; None if unknown
    design_digest : digest of the design that was built or simulated; None if unknown
    attributes : further information, such as protocol, parameters of the signal chain, seed
    true_press_mm : (sample, 3) true x, y, depth of the tip [mm]; only in simulated data, else None
    others_mm : (sample, k, 3) x, y, depth of up to k further tips [mm]; NaN where a sample has none
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
    others_mm: FloatArray = field(default_factory=lambda: np.zeros((0, 0, 3)))

    def __post_init__(self) -> None:
        if self.others_mm.shape[1:] == (0, 3):  # no further tips, for any number of samples
            object.__setattr__(self, "others_mm", np.zeros((len(self.counts), 0, 3)))
        _require_shapes(self)
        arrays = {name: getattr(self, name) for name in ("counts", "press_mm", "time_s", "true_press_mm")}
        require_finite(arrays, where="data", row="sample")
        require_whole_tips(self.others_mm)

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def emitter_names(self) -> tuple[str, ...]:
        """Names of the states without ``off``."""
        return self.state_names[:-1]

    @property
    def pair_names(self) -> tuple[str, ...]:
        """Names of the pairs, in the order of `features`: ``E1-R1``, ``E1-R2``, ..."""
        return tuple(f"{e}-{r}" for e in self.emitter_names for r in self.receiver_names)

    @property
    def touch_count(self) -> IntArray:
        """Number (sample,) of tips that touch: those with a depth above 0."""
        others = (self.others_mm[..., 2] > 0.0).sum(axis=1)
        return np.asarray(others + (self.press_mm[:, 2] > 0.0), dtype=np.int64)

    @property
    def has_more(self) -> BoolArray:
        """Whether a further tip touches (sample,)."""
        return np.asarray((self.others_mm[..., 2] > 0.0).any(axis=1))

    def of_one_tip(self) -> PressData:
        """The samples in which no further tip touches."""
        return self.only(~self.has_more) if self.has_more.any() else self

    def signals(self) -> NDArray[np.float32]:
        """Signals (sample, emitter, receiver): readings minus those of the off state [counts]."""
        return signals_of(self.counts)

    def features(self) -> NDArray[np.float32]:
        """Signals (sample, pair): readings minus those of the off state [counts]; pairs are as in `pair_names`."""
        return self.signals().reshape(len(self), len(self.pair_names))

    def only(self, mask: BoolArray | IntArray) -> PressData:
        """The samples that a mask (sample,) or sample numbers (n,) select."""
        picked = {
            name: getattr(self, name)[mask]
            for name in ("counts", "press_mm", "time_s", "set_number", "place_number", "others_mm")
        }
        truth = None if self.true_press_mm is None else self.true_press_mm[mask]
        return replace(self, **picked, true_press_mm=truth)

    def role(self, name: str) -> PressData:
        """Samples of all sets with the role `name`, ``train`` or ``test``.

        Raises
        ------
        InputError : no set has this role.
        """
        if name not in ROLES:
            raise InputError(f"role: {name!r} is refused: give {' or '.join(ROLES)}")
        wanted = np.array([one.role == name for one in self.sets], dtype=np.bool_)
        return self.only(wanted[self.set_number])

    def press_numbers(self) -> IntArray:
        """Number (sample,) of each sample's press, counted over all sets from 0 without gaps."""
        presses = np.stack([self.set_number, self.place_number], axis=1)
        return np.asarray(np.unique(presses, axis=0, return_inverse=True)[1], dtype=np.int64).reshape(-1)

    def clipped_share(self) -> FloatArray:
        """Share (state, receiver) of the samples whose reading is at full scale [-]; zeros if full scale is unknown."""
        if self.full_scale_counts is None or len(self) == 0:
            return np.zeros(self.counts.shape[1:])
        return np.asarray((self.counts >= self.full_scale_counts).mean(axis=0), dtype=np.float64)


def joined(parts: Sequence[PressData]) -> PressData:
    """Join the data of several files; sets keep their order and are renumbered.

    Raises
    ------
    InputError : there are no parts, or their designs, states, receivers or converters differ.
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
    tips = max(part.others_mm.shape[1] for part in parts)
    others = [
        np.pad(part.others_mm, ((0, 0), (0, tips - part.others_mm.shape[1]), (0, 0)), constant_values=np.nan)
        for part in parts
    ]
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
        others_mm=np.concatenate(others),
        attributes={**first.attributes, **_losses(parts)},
    )


def _losses(parts: Sequence[PressData]) -> dict[str, str]:
    told = [str(part.attributes[LOSSES]) for part in parts if LOSSES in part.attributes]
    return {LOSSES: "; ".join(told)} if told else {}


def data_notes(data: PressData) -> tuple[str, ...]:
    """Sentences for the user about data: whether they are simulated, incomplete, converted, or clipped."""
    simulated = "the data are simulated, not recorded" if data.true_press_mm is not None else None
    notes = (simulated, data.attributes.get(LOSSES), data.attributes.get(CONVERTED), clipped_note(data))
    return tuple(str(note) for note in notes if note is not None)


def left_out_note(is_left_out: BoolArray, why: str) -> str | None:
    """A sentence on the frames of two touches (mask (n,)) that are left out; None if there are none."""
    if not is_left_out.any():
        return None
    return f"{is_left_out.sum()} of {len(is_left_out)} frames have two touches and are left out: {why}"


def clipped_note(data: PressData) -> str | None:
    """A sentence that names the channels with clipped readings; None if there are none.

    A reading of the off state has a name such as ``off-R1``. A clipped pair has little or no information on a press.
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
        "others_mm": (samples, *data.others_mm.shape[1:2], 3),
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
"""Depths at which light is traced [mm], for the paper's tip (radius 3 mm) and presses to 5 mm; dense near 0."""
COARSE_KNOTS_MM = (0.0, 0.1, 0.26, 0.45, 0.7, 1.0, 1.5, 2.1, 2.8, 3.6, 4.3, 5.1)
"""Fewer depths, for two thirds of the tracing time [mm].

In the comparison in the module docstring, they give errors of 0.73 counts rms from "draft" accuracy and 0.62 from
"standard".
"""
KNOTS_TIP_MM = 3.0
"""Tip radius for which `KNOTS_MM` are given [mm]; for other tips they are scaled in proportion, like the dimple."""
SPARE_MM = 0.1
"""Least distance by which traced depths go beyond a design's deepest press [mm], to allow for errors of depth 0."""
BEYOND_MM = 0.25
"""How far a curve may be extrapolated beyond its last knot [mm]."""
CHUNK = 4096
"""Number of depths processed at a time: 2 MB for 8 emitters and 8 receivers."""


@dataclass(frozen=True, kw_only=True)
class PressCurves:
    """Light (flux) of every pair against press depth, at some locations.

    Attributes
    ----------
    places_mm : (place, 2) x, y of the press axes in cavity coordinates [mm]
    depth_mm : (knot,) depths with traced light, increasing from 0 [mm]
    flux : (place, knot, emitter, receiver) received share of the emitted power [-]
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
        """Flux (emitter, receiver) of the pad without contact [-]."""
        return np.asarray(self.flux[0, 0])

    @property
    def deepest_mm(self) -> float:
        """Depth of the deepest press that `at` accepts, including a short extrapolation [mm]."""
        return float(self.depth_mm[-1]) + BEYOND_MM

    def at(self, place_number: IntArray, depth_mm: FloatArray) -> FloatArray:
        """Interpolate the flux of presses.

        Parameters
        ----------
        place_number : (n,) index of each press's location in `places_mm`
        depth_mm : (n,) depth of each press [mm]; 0 or less is no contact

        Returns
        -------
        (n, emitter, receiver) received share of the emitted power [-]

        Raises
        ------
        ModelScopeError : a depth exceeds `deepest_mm`.
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
        """The curves at some locations, selected by their indices (n,) in `places_mm`."""
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
        """Coefficients (place, piece, power 3 to 0, emitter, receiver) of cubics over the square root of depth."""
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
        """Slope (place, emitter, receiver) of the flux between the last two traced depths [1/mm]."""
        span = self.depth_mm[-1] - self.depth_mm[-2]
        return np.asarray((self.flux[:, -1] - self.flux[:, -2]) / span)


def knots_mm(design: SensorDesign, *, is_coarse: bool = False, deepest_mm: float | None = None) -> FloatArray:
    """Depths at which light is traced for a design ("knots").

    They are `KNOTS_MM` scaled with the tip radius. They end slightly beyond the deepest press, if the contact model
    covers that.

    Parameters
    ----------
    is_coarse : whether to use `COARSE_KNOTS_MM` instead
    deepest_mm : depth of the deepest press required [mm]; if None, the design's deepest

    Returns
    -------
    (knot,) depths, increasing from 0 [mm]
    """
    from optopad.sims.contact.scope import contact_of

    scale = design.indenter.tip_radius_mm / KNOTS_TIP_MM
    wanted = design.operating.max_depth_mm if deepest_mm is None else deepest_mm
    end = max(min(wanted + _spare_mm(design), contact_of(design).depth_limit_mm), wanted)
    knots = [one * scale for one in (COARSE_KNOTS_MM if is_coarse else KNOTS_MM)]
    kept = [one for one in knots if one < end - 0.25 * scale * (one > scale)]
    return np.round([*kept, end], 6)


def _spare_mm(design: SensorDesign) -> float:
    """How far the traced depths must go beyond the deepest press [mm].

    It is five standard deviations of the depth's offset plus the backlash, minus the extrapolation `BEYOND_MM`, but at
    least `SPARE_MM`.
    """
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
    """Trace light against depth at given locations; locations that are equal by symmetry of the layout are traced once.

    Parameters
    ----------
    places_mm : (place, 2) x, y in cavity coordinates [mm]
    depth_mm : (knot,) depths to trace, increasing from 0 [mm]; if None, `knots_mm` of the design
    accuracy, seed : accuracy setting and random seed of the light model
    on_step : called with the number of traced presses and their total number

    Raises
    ------
    InputError : locations have the wrong shape or are not finite, or depths do not increase from 0.
    ModelScopeError : the contact or light model does not cover a depth or location.
    """
    from optopad.sims.optics.tracing import trace

    places = np.asarray(places_mm, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 2 or not len(places) or not np.isfinite(places).all():
        raise InputError(f"places: shape {places.shape}, needs (location, 2) of finite x, y, one at least")
    knots = knots_mm(design) if depth_mm is None else np.asarray(depth_mm, dtype=np.float64)
    states = np.array([[x, y, depth] for x, y in places for depth in knots])
    light = trace(Draft.of(design), states, accuracy=accuracy, seed=seed, on_step=on_step)
    flux = light.flux.reshape(len(places), len(knots), *light.flux.shape[1:])
    return PressCurves(places_mm=places, depth_mm=knots, flux=flux)
