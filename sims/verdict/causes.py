"""Why depth is not resolved: the pairs that should have responded over an interval, and the reason why each did not.

    interval at a location ──► pairs whose chord runs under the tip ──► reason for each pair ──► the cause

T is the pair's light mirrored by the top under the press (skirt included), D the direct light. Over the interval:

    clipped   the reading is at full scale over at least half of the interval
    dim       the untouched reading is less than 6 noise units: too little to resolve three depths
    cancel    T and D each change by 3 noise units or more, their sum by less
    apart     D is still complete (over 90 % of D(0)): mode 1 has ended, mode 2 has not begun
    used up   D is gone (below 10 % of D(0))
    slight    none of these: the light changes by less than 3 noise units

The cause is the reason that holds for most pairs, weighted by their untouched light; it is `none near` where no chord
is under the tip. `short_mm` is the missing depth. For `apart` it runs from the end of mode 1 to the depth at which the
tip reaches the direct light; if no press is that deep, the depth is computed from the components' upper edges. For
`used up` it runs from the depth at which D is gone to the deepest press. The components are too low (`apart`) or too
high (`used up`) by about this length.

Left out: pairs whose mirrored light alone passes near the tip, and the combination of pairs, since each is judged
alone.

The module also finds light that rises under a press: the pair, its reading relative to untouched, and the path.

A press can only reduce direct light. Light that rises is mirrored: around the tip the press tilts the top, which may
then mirror more light from an emitter into a receiver than the untouched top does. Under a dome most of a pair's light
is mirrored. Its reading rises first, and falls when the tip removes the mirroring surface.

Left out: pairs that are nearly dark untouched, since any added light is a large share of theirs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import CavityGeometry, beside_chord, cavity_of, direct_path_pairs, pair_name
from optopad.design.spec import SensorDesign
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.readings.readout import Readout
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD, between, noise_units, sigma_counts
from optopad.sims.verdict.pad_map import Interval, PadMap, Place
from optopad.sims.verdict.pair_score import PairScore, find_modes
from optopad.sims.verdict.presses import PairCurves, curves_of

Part = Literal["smooth top", "flank of the dimple", "other light"]
LEAST_RISE = 0.05
"""Smallest rise that is reported, as a share of the untouched light [-]: at a relative noise of 0.3 %, 5 % are about 15
noise units."""
ERRORS = 2.0
"""A rise of at most this many standard errors of the light is not reported."""
DARK = 0.05
"""A pair counts as dark if its untouched light is below this share of the median over all pairs [-]."""


@dataclass(frozen=True, kw_only=True)
class Rise:
    """The pair whose light rises most, relative to its untouched light.

    Attributes
    ----------
    pair : name of the pair, such as E1-R3
    share : its light under the press, divided by its untouched light [-]
    place_mm, depth_mm : (x, y) and depth of that press [mm]
    part : path class of the light that increases most
    pairs, judged : number of pairs whose light rises under any press of the map, and of pairs that are not dark
    """

    pair: str
    share: float
    place_mm: tuple[float, float]
    depth_mm: float
    part: Part
    pairs: int
    judged: int

    @property
    def sentence(self) -> str:
        """One sentence that describes the rise."""
        x_mm, y_mm = self.place_mm
        why = (
            "the press tilts the top towards the receiver, which then gets more of its light"
            if self.part != "other light"
            else "light other than the mirrored one increases"
        )
        return (
            f"{self.pairs} of {self.judged} pairs read more than untouched under some press; the largest "
            f"is {self.pair} with {self.share:.0%} of its untouched light at x = {x_mm:g}, y = {y_mm:g} "
            f"mm, {self.depth_mm:g} mm deep: {why} ({self.part})"
        )

    def to_json(self) -> dict[str, Any]:
        """The rise as plain data for JSON."""
        return {
            "pair": self.pair,
            "share": round(self.share, 4),
            "place_mm": [round(value, 4) for value in self.place_mm],
            "depth_mm": round(self.depth_mm, 4),
            "part": self.part,
            "pairs": self.pairs,
            "judged": self.judged,
            "sentence": self.sentence,
        }


def rise_of(light: LightSignals, pairs: Mapping[str, tuple[int, int]]) -> Rise | None:
    """The largest rise of light over all presses; None if no pair's light rises.

    Parameters
    ----------
    light : light of single presses, the untouched pad included
    pairs : (emitter, receiver) indices by the pair's name
    """
    untouched = light.presses[:, 2] <= 0.0
    if not pairs or not untouched.any():
        return None
    first = int(np.argmax(untouched))
    emitters, receivers = np.array(list(pairs.values())).T
    flux, error = (of[:, emitters, receivers] for of in (light.flux, light.error_of_changes))
    flat = flux[first]
    bright = flat > DARK * np.median(flat)
    per = 1.0 / np.where(bright, flat, 1.0)
    share = flux * per
    rises = bright & (share > 1.0 + LEAST_RISE) & (share - 1.0 > ERRORS * error * per)
    if not rises.any():
        return None
    state, column = (int(k) for k in np.unravel_index(np.argmax(np.where(rises, share, 0.0)), share.shape))
    at = (emitters[column], receivers[column])
    grown = {name: float(of[(state, *at)] - of[(first, *at)]) for name, of in light.by_class.items()}
    named: dict[str, Part] = {"top": "smooth top", "skirt": "flank of the dimple"}
    x_mm, y_mm, depth_mm = (float(value) for value in light.presses[state])
    return Rise(
        pair=list(pairs)[column],
        share=float(share[state, column]),
        place_mm=(x_mm, y_mm),
        depth_mm=depth_mm,
        part=named.get(max(grown, key=lambda name: grown[name]), "other light"),
        pairs=int(rises.any(axis=0).sum()),
        judged=int(bright.sum()),
    )


Lack = Literal["clipped", "dim", "cancel", "apart", "used up", "slight", "none near"]
Kind = Literal["deadband", "fade"]

WHOLE, GONE = 0.9, 0.1
"""A pair's direct light is complete at or above the first share of its untouched value, gone at or below the second."""
ANSWERS_TWICE = 2.0 * DEADBAND_THRESHOLD
"""A pair whose untouched reading is below this cannot resolve three depths [noise units]."""
MOST_WITNESSES = 12
"""Largest number of pairs under the tip that are examined, the brightest first."""


@dataclass(frozen=True, kw_only=True)
class Witness:
    """A pair that should have responded.

    Attributes
    ----------
    pair : name of the pair, such as E1-R3
    lack : reason why it does not respond over the interval, one of the module's list
    mirrored, straight : its mirrored and direct light at the interval's start, as shares of the untouched light [-]
    untouched_counts, change : reading of the untouched pad [counts], change over the interval [noise units]
    mode1_end_mm, mode2_onset_mm, mode2_end_mm : depths at which mode 1 ends, and mode 2 starts and ends, at this
        location [mm]; None where no press is deep enough
    reach_mm : depth at which the tip meets the direct path's upper edge, from the components' heights [mm]
    """

    pair: str
    lack: Lack
    mirrored: float
    straight: float
    untouched_counts: float
    change: float
    mode1_end_mm: float
    mode2_onset_mm: float | None
    mode2_end_mm: float | None
    reach_mm: float


@dataclass(frozen=True, kw_only=True)
class Cause:
    """Why depth is not resolved over an interval.

    Attributes
    ----------
    kind : "deadband" if deeper presses are resolved again, otherwise "fade"
    place_mm : (x, y) of the press [mm]
    depth_mm : (from, to) of the interval [mm]
    lack : the reason that holds for most pairs under the tip
    short_mm : missing depth (see the module) [mm]; None except for "apart" and "used up"
    witnesses : the pairs under the tip, the brightest first
    """

    kind: Kind
    place_mm: tuple[float, float]
    depth_mm: Interval
    lack: Lack
    short_mm: float | None
    witnesses: tuple[Witness, ...]

    @property
    def typical(self) -> Witness | None:
        """Of the pairs with this reason, the one with the median gap between its modes; None if no pair has it."""
        lacking = [one for one in self.witnesses if one.lack == self.lack]
        order = sorted(lacking, key=lambda one: _or(one.mode2_onset_mm, np.inf) - one.mode1_end_mm)
        return order[(len(order) - 1) // 2] if order else None

    def to_json(self) -> dict[str, Any]:
        """The cause as plain data for JSON."""
        return {
            "kind": self.kind,
            "place_mm": [round(value, 4) for value in self.place_mm],
            "depth_mm": [round(value, 4) for value in self.depth_mm],
            "lack": self.lack,
            "short_mm": None if self.short_mm is None else round(self.short_mm, 3),
            "pairs": [_witness_json(one) for one in self.witnesses],
        }


def causes_of_pad(
    design: SensorDesign, pad_map: PadMap, light: LightSignals, readout: Readout
) -> tuple[Cause, ...]:
    """The cause of every interval without resolution at every location, the location with most deadband first.

    Parameters
    ----------
    light : light of the map's presses: all depths of the first location, then the next
    """
    cavity = cavity_of(design)
    depth_mm = np.asarray(light.presses).reshape(len(pad_map.places), -1, 3)[0, :, 2]
    found = []
    for number, place in enumerate(pad_map.places):
        states = slice(number * len(depth_mm), (number + 1) * len(depth_mm))
        blind = list(_blind_of_place(place, float(depth_mm[-1])))
        if blind:
            place_mm = (place.x_mm, place.y_mm)
            curves = _curves_under(cavity, light, states, place_mm, depth_mm)
            found += [_cause(design, cavity, kind, span, place_mm, curves, readout) for kind, span in blind]
    worst = (pad_map.worst.x_mm, pad_map.worst.y_mm)
    return tuple(sorted(found, key=lambda one: (one.kind != "deadband", one.place_mm != worst, _length(one))))


def causes_of_pairs(
    design: SensorDesign, judged: Sequence[tuple[PairCurves, PairScore]], readout: Readout, governing: str
) -> tuple[Cause, ...]:
    """The cause of every interval of depth that a facing pair does not resolve under its own press.

    Deadbands come first, those of the pair `governing`, which the verdict names, before others, then the longest.
    """
    cavity, found = cavity_of(design), []
    for curves, score in judged:
        blind: list[tuple[Kind, Interval]] = [("deadband", span) for span in score.deadbands_mm]
        if score.saturation_mm is not None:
            blind.append(("fade", score.saturation_mm))
        found += [
            _cause(design, cavity, kind, span, curves.press_mm, [curves], readout) for kind, span in blind
        ]

    def rank(cause: Cause) -> tuple[bool, bool, float]:
        is_deadband = cause.kind == "deadband"
        return not is_deadband, is_deadband and cause.witnesses[0].pair != governing, _length(cause)

    return tuple(sorted(found, key=rank))


def _length(cause: Cause) -> float:
    """Sort key with which the longest interval comes first."""
    return cause.depth_mm[0] - cause.depth_mm[1]


def _blind_of_place(place: Place, deepest_mm: float) -> Iterator[tuple[Kind, Interval]]:
    for span in place.deadbands_mm:
        yield "deadband", span
    if place.usable_mm < deepest_mm - 1e-9:
        yield "fade", (place.usable_mm, deepest_mm)


def _curves_under(
    cavity: CavityGeometry,
    light: LightSignals,
    states: slice,
    place_mm: tuple[float, float],
    depth_mm: FloatArray,
) -> list[PairCurves]:
    """Light against depth of the pairs whose chord runs within a tip radius of the location, the brightest first."""
    under = [
        curves_of(light, (int(e), int(r)), place_mm, states, depth_mm)
        for e, r in np.argwhere(direct_path_pairs(cavity))
        if beside_chord(cavity, (int(e), int(r)), place_mm)[0] <= cavity.tip_radius_mm
    ]
    lit = [one for one in under if one.total[0] > 0.0]
    return sorted(lit, key=lambda one: -float(one.total[0]))[:MOST_WITNESSES]


def _cause(
    design: SensorDesign,
    cavity: CavityGeometry,
    kind: Kind,
    span: Interval,
    place_mm: tuple[float, float],
    curves: Sequence[PairCurves],
    readout: Readout,
) -> Cause:
    witnesses = tuple(_witness(cavity, one, span, readout) for one in curves)
    lack: Lack = "none near"
    if witnesses:
        weight: dict[Lack, float] = {}
        for one in witnesses:
            weight[one.lack] = weight.get(one.lack, 0.0) + one.untouched_counts
        lack = max(weight, key=lambda name: weight[name])
    return Cause(
        kind=kind,
        place_mm=place_mm,
        depth_mm=span,
        lack=lack,
        short_mm=_short_mm(lack, witnesses, design.operating.max_depth_mm),
        witnesses=witnesses,
    )


def _short_mm(lack: Lack, witnesses: Sequence[Witness], deepest_mm: float) -> float | None:
    """Median missing depth over the pairs with this reason [mm]; None if there are none."""
    lacking = [one for one in witnesses if one.lack == lack]
    if lack == "apart":
        lengths = [
            _or(one.mode2_onset_mm, max(one.reach_mm, deepest_mm)) - one.mode1_end_mm for one in lacking
        ]
    elif lack == "used up":
        lengths = [deepest_mm - one.mode2_end_mm for one in lacking if one.mode2_end_mm is not None]
    else:
        return None
    return float(np.median(lengths)) if lengths else None


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value


def _witness(cavity: CavityGeometry, curves: PairCurves, span: Interval, readout: Readout) -> Witness:
    gain, full_scale = readout.of_receiver(curves.pair[1]), readout.full_scale_counts
    _, part = between(
        curves.depth_mm, np.stack([curves.total, curves.top, curves.direct], axis=1), span[0], span[1]
    )
    counts = gain * part
    noise = readout.noise
    limited = np.minimum(counts[:, 0], full_scale)
    change = float(np.ptp(noise_units(limited, **noise)))
    whole = gain * float(curves.total[0])
    modes = find_modes(curves.depth_mm, curves.top, curves.direct)
    straight = float(part[0, 2] / curves.direct[0]) if curves.direct[0] > 0.0 else None
    return Witness(
        pair=pair_name(cavity, curves.pair),
        lack=_lack(counts, limited, whole, straight, full_scale, noise),
        mirrored=float(part[0, 1] / curves.top[0]) if curves.top[0] > 0.0 else 0.0,
        straight=0.0 if straight is None else straight,
        untouched_counts=min(whole, full_scale),
        change=change,
        mode1_end_mm=modes.mode1_mm[1],
        mode2_onset_mm=modes.mode2_mm[0],
        mode2_end_mm=modes.mode2_mm[1],
        reach_mm=_reach_mm(cavity, curves),
    )


def _lack(
    counts: FloatArray,
    limited: FloatArray,
    whole: float,
    straight: float | None,
    full_scale: float,
    noise: dict[str, float],
) -> Lack:
    """Why a pair does not respond over an interval, from its (depth, 3) counts there: total, mirrored and direct."""
    if (limited >= full_scale).mean() >= 0.5:
        return "clipped"
    if float(noise_units(min(whole, full_scale), **noise)) < ANSWERS_TWICE:
        return "dim"
    sigma = float(sigma_counts(whole, **noise))
    mirrored_change, straight_change = (float(np.ptp(counts[:, column])) / sigma for column in (1, 2))
    if min(mirrored_change, straight_change) >= DEADBAND_THRESHOLD:
        return "cancel"
    if straight is None:
        return "slight"
    if straight >= WHOLE:
        return "apart"
    return "used up" if straight <= GONE else "slight"


def _reach_mm(cavity: CavityGeometry, curves: PairCurves) -> float:
    """Depth at which the tip meets the direct path's upper edge [mm]; the layer's thickness if there is no path."""
    ends = (cavity.emitters[curves.pair[0]], cavity.receivers[curves.pair[1]])
    _, share = beside_chord(cavity, curves.pair, curves.press_mm)
    upper = [min(one.height_mm + one.rise_mm, cavity.clear_mm) for one in ends]
    return cavity.clear_mm - ((1.0 - share) * upper[0] + share * upper[1])


def _witness_json(one: Witness) -> dict[str, Any]:
    return {
        "pair": one.pair,
        "lack": one.lack,
        "mirrored_left": round(one.mirrored, 4),
        "straight_left": round(one.straight, 4),
        "untouched_counts": round(one.untouched_counts, 3),
        "change_noise_units": round(one.change, 3),
        "mode1_end_mm": round(one.mode1_end_mm, 4),
        "mode2_mm": [
            None if value is None else round(value, 4) for value in (one.mode2_onset_mm, one.mode2_end_mm)
        ],
        "tip_reaches_mm": round(one.reach_mm, 4),
    }
