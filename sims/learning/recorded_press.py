"""Compare a measured press with the simulated press at a location, pair by pair, both relative to the untouched signal.

    recording ──► readings at one location ► over the mean of its untouched readings ─┐
    design ─────► light under a press there ──► over the untouched total ─────────────┴──► curves, difference

Only these ratios are compared, so gain and absolute signal have no effect. Nothing is fitted, neither the zero of depth
nor the shape. The difference is computed while the tip moves in; the retraction is only plotted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.shape.cavity import cavity_of, chord_midpoint_mm, judged_pairs, mask_of, pair_name
from optopad.design.spec import SensorDesign
from optopad.sims.optics.tracing import trace
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import readout_of
from optopad.sims.readings.recording import SIGNAL, Recording
from optopad.sims.score.result import JudgedPair
from optopad.sims.verdict.builds import score_curves
from optopad.sims.verdict.presses import PAIR_ACCURACY, Pair, curves_of, states_of

SAME_PLACE_MM = 0.25
"""Readings within this distance of a press's location belong to the press [mm]; a stage's step is a tenth of it."""
FEWEST_READINGS = 5
MOST_PAIRS = 6


@dataclass(frozen=True, kw_only=True)
class RecordedPair:
    """Measured and simulated signal of one pair against depth.

    Attributes
    ----------
    simulated : simulated light and verdict of the pair under a press at the recording's location
    depth_mm, ratio : (n,) depths of the readings [mm], and readings divided by their untouched mean [-]
    deepest : index of the deepest reading; later readings belong to the retraction
    untouched_counts : mean reading without contact [counts]
    rms, worst : root mean square and largest difference from the simulated ratio, while the tip moves in [-]
    """

    simulated: JudgedPair
    depth_mm: FloatArray
    ratio: FloatArray
    deepest: int
    untouched_counts: float
    rms: float
    worst: float


@dataclass(frozen=True, kw_only=True)
class RecordedPress:
    """A measured and a simulated press at one location; `notes` are sentences on the processing and the assumptions."""

    place_mm: tuple[float, float]
    pairs: tuple[RecordedPair, ...]
    notes: tuple[str, ...]


def recorded_press(
    design: SensorDesign,
    recording: Recording,
    *,
    pairs: tuple[str, ...] = (),
    at_mm: tuple[float, float] | None = None,
    seed: int = 0,
) -> RecordedPress:
    """Compare a recording with the simulated press on a design.

    Parameters
    ----------
    pairs : names of the pairs to compare. If empty, these are the pairs of the verdict whose readings change most. A
        recording with one unnamed signal is compared with one pair
    at_mm : (x, y) of the press in the cavity's coordinate system [mm]. If None, it is the recording's location, or the
        middle of the first pair's chord if the recording has none

    Raises
    ------
    InputError : the design differs, a pair is unknown, there are several locations or too few readings, or none without
        contact.
    """
    notes = [*recording.notes, *_of_this_design(design, recording)]
    chosen = _chosen(design, recording, pairs)
    place, rows, told = _place(design, recording, chosen, at_mm)
    notes += told
    depth_mm = recording.depth_mm[rows]
    if len(depth_mm) < FEWEST_READINGS:
        has_places = recording.place_mm is not None
        raise InputError(
            f"{recording.file}: {len(depth_mm)} readings at ({place[0]:g}, {place[1]:g}) mm, needs {FEWEST_READINGS}; "
            + ("name another location with --at X,Y" if has_places else "record the press in finer steps")
        )
    deepest_mm = design.operating.max_depth_mm
    if depth_mm.max() > deepest_mm:
        notes.append(
            f"readings deeper than operating.max_depth_mm = {deepest_mm:g} mm are plotted, but not compared"
        )
    simulated = _simulated(design, place, tuple(chosen.values()), seed)
    found = tuple(
        _laid_over(pair, depth_mm, recording.counts[name][rows], recording)
        for (name, _), pair in zip(chosen.items(), simulated, strict=True)
    )
    notes.append(
        "both are divided by their own untouched signal: gain and absolute signal are not compared, and "
        "no value is fitted"
    )
    return RecordedPress(place_mm=place, pairs=found, notes=tuple(notes))


def _of_this_design(design: SensorDesign, recording: Recording) -> list[str]:
    digest = recording.design_digest
    if digest is None:
        return ["the recording names no design; it is taken as a recording of this design"]
    if not design.digest.startswith(digest):
        raise InputError(
            f"{recording.file}: a recording of another design (digest {digest[:8]}, not {design.digest[:8]}); "
            "give the design.toml of the bundle that was built"
        )
    return []


def _chosen(design: SensorDesign, recording: Recording, names: tuple[str, ...]) -> dict[str, Pair]:
    """The pairs to compare by the names of their columns in the recording, in the order of display."""
    cavity = cavity_of(design)
    judged = {pair_name(cavity, pair): pair for pair in judged_pairs(cavity)}
    if list(recording.counts) == [SIGNAL]:
        if len(names) > 1:
            raise InputError(f"{recording.file}: has one signal; name one pair with --pair")
        name = names[0] if names else next(iter(judged))
        _require_known([name], judged, "the design judges")
        return {SIGNAL: judged[name]}
    shared = {name: judged[name] for name in judged if name in recording.counts}
    if not shared:
        raise InputError(
            f"{recording.file}: none of its pairs ({', '.join(list(recording.counts)[:6])}) is judged in this design "
            f"({', '.join(list(judged)[:6])})"
        )
    if names:
        _require_known(list(names), shared, f"{recording.file} and the design share")
        return {name: shared[name] for name in names}
    ranked = sorted(shared, key=lambda name: -float(np.ptp(recording.counts[name])))
    return {name: shared[name] for name in ranked[:MOST_PAIRS]}


def _require_known(names: list[str], known: dict[str, Pair], where: str) -> None:
    for name in names:
        if name not in known:
            raise InputError(f"--pair: {name!r} is no pair here; {where} {', '.join(list(known)[:12])}")


def _place(
    design: SensorDesign, recording: Recording, chosen: dict[str, Pair], at_mm: tuple[float, float] | None
) -> tuple[tuple[float, float], NDArray[np.intp], list[str]]:
    """Location of the press, indices of the readings there, and sentences on what was assumed."""
    every = np.arange(len(recording.depth_mm))
    if recording.place_mm is None:
        place = at_mm or chord_midpoint_mm(cavity_of(design), next(iter(chosen.values())))
        told = (
            ""
            if at_mm
            else ("the recording has no location of the press; the middle of the first pair's chord is taken")
        )
        return (float(place[0]), float(place[1])), every, [told] if told else []
    wanted = np.asarray(recording.place_mm[0] if at_mm is None else at_mm, dtype=np.float64)
    near = np.hypot(*(recording.place_mm - wanted).T) <= SAME_PLACE_MM
    if at_mm is None and not near.all():
        places = np.unique(np.round(recording.place_mm, 2), axis=0)
        raise InputError(
            f"{recording.file}: presses at {len(places)} locations, one is shown at a time; name it with "
            f"--at X,Y, as --at {places[0][0]:g},{places[0][1]:g}"
        )
    x_mm, y_mm = recording.place_mm[near].mean(axis=0) if near.any() else wanted
    return (float(x_mm), float(y_mm)), np.flatnonzero(near), []


def _simulated(
    design: SensorDesign, place_mm: tuple[float, float], pairs: tuple[Pair, ...], seed: int
) -> tuple[JudgedPair, ...]:
    draft = Draft.of(design)
    cavity = draft.cavity
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm)
    states = states_of(np.array([place_mm]), np.concatenate([[0.0], depth_mm]))
    masks = np.repeat(mask_of(pairs, cavity)[np.newaxis], len(states), axis=0)
    masks[0] = True
    light = trace(draft, states, accuracy=PAIR_ACCURACY, seed=seed, pairs=masks)
    readout = readout_of(draft, light.flux[0], mask_of(judged_pairs(cavity), cavity))
    found = []
    for pair in pairs:
        curves = curves_of(light, pair, place_mm, slice(1, None), depth_mm)
        name = pair_name(cavity, pair)
        found.append(JudgedPair(name=name, curves=curves, score=score_curves(curves, readout)))
    return tuple(found)


def _laid_over(
    pair: JudgedPair, depth_mm: FloatArray, counts: FloatArray, recording: Recording
) -> RecordedPair:
    deepest = int(depth_mm.argmax())
    before = depth_mm[: deepest + 1] <= 0.0
    if not before.any():
        raise InputError(
            f"{recording.file}: has no untouched reading (depth 0 or less) before the press of "
            f"{pair.name}, so there is no baseline; record from above the surface"
        )
    untouched = float(counts[: deepest + 1][before].mean())
    if untouched <= 0.0:
        raise InputError(
            f"{recording.file}: {pair.name} reads {untouched:g} untouched, needs more than 0; is it wired?"
        )
    ratio, curves = counts / untouched, pair.curves
    compared = (depth_mm[: deepest + 1] >= 0.0) & (depth_mm[: deepest + 1] <= curves.depth_mm[-1])
    if not (compared & (depth_mm[: deepest + 1] > 0.0)).any():
        raise InputError(
            f"{recording.file}: no pressed reading is above 0 and within {curves.depth_mm[-1]:g} mm, so "
            f"there is nothing to compare; its depths reach from {depth_mm.min():g} to "
            f"{depth_mm.max():g}: are they in millimetres?"
        )
    expected = np.interp(depth_mm[: deepest + 1], curves.depth_mm, curves.total / curves.total[0])
    difference = (ratio[: deepest + 1] - expected)[compared]
    return RecordedPair(
        simulated=pair,
        depth_mm=depth_mm,
        ratio=ratio,
        deepest=deepest,
        untouched_counts=untouched,
        rms=float(np.sqrt(np.mean(difference**2))),
        worst=float(np.abs(difference).max()),
    )
