"""The sentences of a verdict: result, cause, fix, confidence, resolution, and the tool that measures a parameter.

The tools are listed by kind of quantity, coarsest first, each with its resolution. A calliper has a resolution of 0.01
or 0.02 mm, but errs by 0.05 mm on small or soft bodies. A measuring microscope is accurate to 0.01 mm. The resolution
of a calibration is the error of fitted values in ten simulated calibrations with thirty presses each
(docs/validation/calibration.md), rounded up; on a manufactured unit the error may be larger. The other tools are common
in optics laboratories; their resolutions are given to an order of magnitude.

Numbers have the same form as on the report page: depths to 0.01 mm, undecided limits as words.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from optopad.design.fields.base import get_at
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import used_values
from optopad.screen.answer import counted
from optopad.sims.bounds.observability import PadBounds
from optopad.sims.score.result import ContinuityScore, headline
from optopad.sims.score.trials import ENOUGH_MARGIN
from optopad.sims.verdict.builds import pair_margin
from optopad.sims.verdict.causes import Cause
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD
from optopad.sims.verdict.tolerance import ToleranceBand, ToleranceRow
from optopad.sims.verdict.trial import Move, Trial

DASH = "\N{EN DASH}"
Interval = tuple[float, float]


def depth(value_mm: float | None, absent: str = "open") -> str:
    """A depth [mm] as text without unit; `absent` for None."""
    return absent if value_mm is None else f"{value_mm:.2f}"


def signed(value_mm: float | None, absent: str = "open") -> str:
    """A length with a sign [mm], such as the gap between two modes, as text without unit; `absent` for None."""
    return absent if value_mm is None else f"{value_mm:+.2f}".replace("-", "\N{MINUS SIGN}")


def spans(intervals_mm: Iterable[Interval], absent: str = "none", between: str = " to ") -> str:
    """Depth intervals [mm] as text without unit; `absent` if there are none."""
    return ", ".join(f"{start:.2f}{between}{end:.2f}" for start, end in intervals_mm) or absent


def ends(low: float, high: float) -> str:
    """Both ends of an uncertainty band as text."""
    return f"{low:.3g} to {high:.3g}"


USABLE_DOUBT_MM = 0.2
"""Width of the usable depth's uncertainty range at and above which the range is reported [mm]."""
LEAST_SHARE = 0.01
"""Least fraction that is reported as a number [-]; smaller ones are reported as "less than" this."""
UNITS = (
    ("_mm", " mm"),
    ("_deg", "°"),
    ("_db_per_cm", " dB/cm"),
    ("_mw", " mW"),
    ("_nm", " nm"),
    ("_mpa", " MPa"),
    ("_counts", " counts"),
    ("_ohm", " Ω"),
)
NAMES = {
    "emitters.height_mm": "emitters",
    "receivers.height_mm": "receivers",
    "cavity.clear_thickness_mm": "clear layer",
}


@dataclass(frozen=True, kw_only=True)
class VerdictSentences:
    """A verdict in sentences; a sentence that does not apply is empty.

    Attributes
    ----------
    verdict : the verdict, with the location and the depths that decide it
    why : the mechanism of the worst deadband, or of the end of the usable depth; empty if there is neither
    margin : the least margin of a design without a deadband
    fix : changes of the design that help according to a trial computation, and the verdict with them
    confidence : the confidence: whether an unmeasured parameter or the numerical error of the light model changes the
        verdict, and how accurately to measure which parameter
    resolution : the resolution: the Cramér-Rao bound for one frame, due to noise alone
    """

    verdict: str
    why: str
    margin: str
    fix: str
    confidence: str
    resolution: str


def sentences_of(design: SensorDesign, score: ContinuityScore) -> VerdictSentences:
    """The sentences that report a design's score: verdict, cause, fix, confidence and resolution."""
    if score.verdict == "OUT_OF_MODEL_SCOPE":
        return VerdictSentences(
            verdict=f"OUT_OF_MODEL_SCOPE: {score.reason}",
            why="",
            margin="",
            fix="",
            confidence="",
            resolution="",
        )
    return VerdictSentences(
        verdict=_verdict(design, score),
        why=_why(score),
        margin=_margin(score),
        fix=fix_words(score.trial),
        confidence=_confidence(design, score),
        resolution=_resolution(score),
    )


def verdict_words(score: ContinuityScore) -> str:
    """The headline of a score: verdict and usable depth.

    The usable depth has an uncertainty range, due to the numerical error of the light model.
    """
    asked = None if score.force is None else float(score.force.depth_mm[-1])
    depth = score.usable_depth_mm
    words = headline(score.verdict, is_open=score.is_open, usable_mm=depth, asked_mm=asked)
    if depth is None or asked is None or depth >= asked:
        return words
    low, high = score.usable_range_mm or (depth, depth)
    doubt = f" ({low:.1f} to {high:.1f} mm by numerical error)" if high - low > USABLE_DOUBT_MM else ""
    return f"{words}{doubt}"


def _verdict(design: SensorDesign, score: ContinuityScore) -> str:
    words, deepest = verdict_words(score), f"{design.operating.max_depth_mm:g} mm"
    if score.is_facing_rows:
        blind = [pair for pair in score.pairs if pair.score.deadbands_mm]
        if not blind:
            if " to " in words:
                return f"{words}, where the shallowest facing pair ends"
            return f"{words}: every facing pair resolves depth from contact to {deepest}"
        first = next((pair for pair in blind if pair.name == score.governing), blind[0])
        return (
            f"{words}: {first.name} does not resolve {spans(first.score.deadbands_mm)} mm"
            f"{_other_pairs(len(blind) - 1, len(score.pairs))}"
        )
    if score.pad_map is None:
        return words
    places = score.pad_map.places
    if score.deadbands_mm:
        worst, dead = score.pad_map.worst, sum(bool(place.deadbands_mm) for place in places)
        return (
            f"{words}: at {dead} of {len(places)} locations depth is not resolved; worst "
            f"{spans(worst.deadbands_mm)} mm at {at_mm(worst.x_mm, worst.y_mm)}"
        )
    faded = sum(place.usable_mm < design.operating.max_depth_mm - 1e-9 for place in places)
    if faded:
        least = min(places, key=lambda place: place.usable_mm)
        return (
            f"{words}: at {faded} of {len(places)} locations depth is not resolved to {deepest}; the "
            f"least depth is at {at_mm(least.x_mm, least.y_mm)}"
        )
    return (
        f"{words}: depth is resolved from contact to {deepest} at all {len(places)} locations, x and y known"
    )


def _other_pairs(count: int, every: int) -> str:
    if not count:
        return ""
    others = (
        f"{count} of the {every - 1}" if count < every - 1 else "the other" if count == 1 else f"the {count}"
    )
    which = "pair" if others == "the other" else "other pairs"
    return f"; {others} {which} {'has a deadband' if count == 1 else 'have deadbands'}, too"


def _margin(score: ContinuityScore) -> str:
    """The least margin, with its location and depths or its facing pair; empty for a design with a deadband."""
    if score.deadbands_mm or score.margin is None:
        return ""
    limit = f"a deadband is below {DEADBAND_THRESHOLD:g} sigma"
    if score.is_facing_rows:
        margins = {
            pair.name: pair_margin(score.readout, pair.curves, pair.score)[0]
            for pair in score.pairs
            if score.readout is not None
        }
        named = min(margins, key=lambda name: margins[name], default=score.governing)
        return f"{score.margin:.1f} sigma for {named}, the least of the facing pairs; {limit}"
    if score.pad_map is None:
        return ""
    weakest = min(score.pad_map.places, key=lambda place: place.margin)
    start, end = weakest.depths.margin_mm
    at = at_mm(weakest.x_mm, weakest.y_mm)
    return f"{weakest.margin:.1f} sigma at {at}, {start:.1f} to {end:.1f} mm deep; {limit}"


def _why(score: ContinuityScore) -> str:
    return cause_sentence(score.causes[0]) if score.causes else ""


def cause_sentence(cause: Cause) -> str:
    """Sentence with the mechanism of a deadband, and how much light or change of signal is missing."""
    typical = cause.typical
    if typical is None:
        return "no pair near: no line from an emitter to a receiver passes under the tip"
    several = f"{len(cause.witnesses)} pairs under the tip"
    under = several if len(cause.witnesses) > 1 else typical.pair
    match cause.lack:
        case "apart":
            onset = typical.mode2_onset_mm
            reaches, at = ("never reaches", "") if onset is None else ("reaches", f" only at {onset:.2f} mm")
            return (
                f"the modes are too far apart: under this press the reflected light of {typical.pair} (mode 1) is gone "
                f"by {typical.mode1_end_mm:.2f} mm, and the tip {reaches} its direct path (mode 2){at}"
            )
        case "used up":
            blocked = f"by {cause.depth_mm[0]:.2f} mm the tip has blocked the direct light of {under}"
            return f"the signal no longer changes: {blocked}"
        case "clipped":
            reads = "read" if len(cause.witnesses) > 1 else "reads"
            return f"clipped: {under} {reads} full scale there; lower gain.target_counts"
        case "dim":
            most = max(one.untouched_counts for one in cause.witnesses)
            return f"too little light: the baseline of {under} is {most:.1f} counts at most"
        case "cancel":
            return f"the modes cancel: as the reflected light of {typical.pair} falls, its direct light grows"
        case _:
            change = max(one.change for one in cause.witnesses)
            return f"too little change: the signal of {under} changes by {change:.1f} sigma there at most"


def _confidence(design: SensorDesign, score: ContinuityScore) -> str:
    if score.is_open:
        does = "cause the deadband" if score.verdict == "DEADBAND" else "hide a deadband"
        return f"undecided: the numerical error of the light model may {does} {_doubtful(score)}; use --fine"
    band = score.tolerance
    if band is None:
        return ""
    values = {used.path: used.quantity.value for used in used_values(design)}
    turning = sorted(
        (turn for row in band.rows if (turn := _turn(band, row, values))), key=lambda turn: turn[1]
    )
    if not turning:
        return f"robust: {_none_changes(len(band.rows))}{_without_band(len(band.unbanded))}"
    path, apart = turning[0]
    more = f"; {counted(len(turning) - 1, 'more parameter')} can change it, too" if len(turning) > 1 else ""
    measure = f"measure it to within {apart:.2g}{unit_of(path)}{tool_words(path, apart)}"
    return f"undecided: {path} changes the verdict; {measure}{more}"


def _none_changes(count: int) -> str:
    match count:
        case 0:
            return "no unmeasured parameter has an uncertainty band"
        case 1:
            return "the one unmeasured parameter does not change the verdict"
        case _:
            return f"none of the {count} unmeasured parameters changes the verdict on its own"


def _without_band(count: int) -> str:
    if not count:
        return ""
    return f"; {counted(count, 'parameter has', 'parameters have')} no uncertainty band"


def _doubtful(score: ContinuityScore) -> str:
    if score.is_facing_rows or score.pad_map is None:
        named = next((pair.name for pair in score.pairs if pair.score.possible_deadbands_mm), score.governing)
        return f"of {named}"
    place = next((one for one in score.pad_map.places if one.depths.most.deadbands_mm), score.pad_map.weakest)
    return f"at {at_mm(place.x_mm, place.y_mm)}"


def at_mm(x_mm: float, y_mm: float) -> str:
    """A location of the pad as text, such as "(11, 16) mm"."""
    return f"({x_mm:g}, {y_mm:g}) mm"


def _turn(band: ToleranceBand, row: ToleranceRow, values: dict[str, float]) -> tuple[str, float] | None:
    """Path of a parameter, and the least change of it that changes the verdict [unit of the field].

    The change is interpolated linearly in the margin between the ends of the parameter's uncertainty band. None if
    neither end changes the verdict.
    """
    if not row.flips or row.path not in values:
        return None
    found = []
    for end, dead, margin in zip(row.values, row.deadband_mm, row.margin, strict=True):
        if (dead > 0.0) != (band.deadband_mm > 0.0) and end != values[row.path]:
            share = (
                (band.margin - DEADBAND_THRESHOLD) / (band.margin - margin) if band.margin != margin else 1.0
            )
            found.append(min(max(share, 0.05), 1.0) * abs(end - values[row.path]))
    return (row.path, min(found)) if found else None


def unit_of(path: str) -> str:
    """Unit of a field as text with a leading space, from the ending of the field's name; empty for pure numbers."""
    return next((unit for ending, unit in UNITS if path.endswith(ending)), "")


def changes_words(design: SensorDesign, changes: Mapping[str, Any]) -> str:
    """The changed fields by dotted path, each with its old and new value, as text."""
    was = design.model_dump(mode="json")
    told = (
        f"{path} {_plain(get_at(was, path))} to {_plain(value)}{unit_of(path)}"
        for path, value in changes.items()
    )
    return ", ".join(told) or "as it is"


def _plain(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def _resolution(score: ContinuityScore) -> str:
    bounds = score.bounds
    if bounds is None:
        return ""
    share, location, depth = unresolved_share(bounds), bounds.median_location_mm, bounds.median_depth_mm
    if math.isinf(max(location.value, depth.value)):
        found = f"one frame does not resolve x, y and depth together in {share} of the volume"
    else:
        of = "one frame of all pairs" if score.is_facing_rows else "one frame"
        found = f"{of}: location {location.value:.3f} mm, depth {depth.value:.3f} mm (median)"
        found += f"; unresolved in {share} of the volume" if share else ""
    detection = bounds.detection
    is_late = detection is not None and math.isinf(float(detection.force_n[detection.worst]))
    return found + ("; no contact is detected at some locations" * is_late)


def unresolved_share(bounds: PadBounds) -> str:
    """Share of the pressed volume where one frame does not resolve x, y and depth together; empty if there is none."""
    share = bounds.blind_share
    if not share > 0.0:
        return ""
    return "less than 1 %" if share < LEAST_SHARE else f"{100 * share:.0f} %"


def fix_words(trial: Trial | None) -> str:
    """Changes of the design that improve the verdict, and the verdict with them; empty if no change helps."""
    if trial is None or trial.found == "none":
        return ""
    moved = ", ".join(_moved(one) for one in trial.moves)
    verdict = f"{moved}: {trial_words(trial)} (traced: {trial.judged})"
    return f"too few components: with {verdict}" if trial.found == "more parts" else verdict


def trial_words(trial: Trial) -> str:
    """Text with verdict, usable depth and margin of a design after a trial's changes."""
    depth = "" if trial.usable_mm is None else f" to {trial.usable_mm:.3g} mm"
    margin = "" if trial.margin is None else f", margin {trial.margin:.1f} sigma"
    return f"{trial.verdict}{depth}{margin}"


def command_words(trial: Trial) -> str:
    """Effect of the suggested next command: which components it moves, and the verdict after the move."""
    parts = " and ".join(one.parts for one in trial.moves if one.parts)
    moves = f"moves {parts}; " if parts else ""
    return f"{moves}trial: {trial_words(trial)}"


def no_fix_words(trial: Trial | None) -> str:
    """Sentence that no change helps, with the changes that were tried; empty if a change helps or none was tried."""
    if trial is None or trial.found == "move" or not trial.tried:
        return ""
    helps = "reaches deeper" if trial.kind == "fade" else "fixes it at every location"
    more = ", nor does one more component a side" if trial.found == "none" and trial.more_parts_tried else ""
    within = (
        f"of {counted(len(trial.tried), 'move')} of heights and thickness by up to {trial.farthest_mm:g} mm"
    )
    return f"none {within} {helps} with a margin of {ENOUGH_MARGIN:g} sigma{more}"


def _moved(move: Move) -> str:
    if move.path not in NAMES:
        field = move.path.rpartition(".")[2].replace("_", " ")
        return f"{field} {move.to:g}" + ("" if move.was is None else f" instead of {move.was:g}")
    assert move.was is not None
    named = f"{NAMES[move.path]} {move.parts}".strip()
    return f"{named} from {move.was:g} to {move.to:g} mm"


PRESSES = 30
"""Number of presses in each of the simulated calibrations that gave the resolutions in `CALIBRATED`."""
CALIBRATED = {
    "height_mm": 0.015,
    "clear_thickness_mm": 0.015,
    "active_width_mm": 0.025,
    "active_height_mm": 0.025,
    "half_angle_deg": 0.02,
    "refractive_index": 0.008,
    "absorption_db_per_cm": 0.002,
    "reflectance": 0.0015,
}
"""Error of values fitted by `optopad calibrate` [unit of the field]; a key is the ending of a field's dotted path."""


@dataclass(frozen=True, kw_only=True)
class _Tool:
    """Name of a measuring tool, and its resolution [unit of the field]."""

    name: str
    resolves: float


_CALLIPER = _Tool(name="a calliper", resolves=0.05)
_MICROSCOPE = _Tool(name="a measuring microscope", resolves=0.01)
TOOLS: dict[str, tuple[_Tool, ...]] = {
    "active_width_mm": (_MICROSCOPE,),
    "active_height_mm": (_MICROSCOPE,),
    "_mm": (_CALLIPER, _MICROSCOPE),
    "half_angle_deg": (_Tool(name="a photodiode rotated around the LED", resolves=1.0),),
    "_deg": (_Tool(name="a protractor", resolves=1.0),),
    "refractive_index": (_Tool(name="an Abbe refractometer", resolves=0.0005),),
    "absorption_db_per_cm": (
        _Tool(name="a lamp and a photodiode through two lengths of silicone", resolves=0.1),
    ),
    "reflectance": (_Tool(name="a lamp and a photodiode against a white standard", resolves=0.01),),
    "_ohm": (_Tool(name="a multimeter", resolves=1.0),),
}
"""Measuring tools for each kind of design field, the coarsest tool first.

A key is the ending of a field's dotted path; the first key that matches is used."""


def tool_words(path: str, within: float) -> str:
    """Text with the tool for a measurement, as the end of a sentence "measure it to within ..."; empty if unknown.

    Parameters
    ----------
    path : dotted path of the field
    within : required resolution [unit of the field]
    """
    tools = next((found for end, found in TOOLS.items() if path.endswith(end)), ())
    reach = next((value for end, value in CALIBRATED.items() if path.endswith(end)), None)
    if not tools:
        return ""
    fine = next((one for one in tools if one.resolves <= within), None)
    by = [] if fine is None else [f"with {fine.name}"]
    if reach is not None and reach <= within and fine is not tools[0]:
        by.append(f"by optopad calibrate with {PRESSES} presses")
    if not by:
        return f"; {tools[-1].name} does not resolve that, so the design needs more margin"
    coarse = f"; {tools[0].name} is too coarse" if fine is not tools[0] else ""
    return f" {' or '.join(by)}{coarse}"
