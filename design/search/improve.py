"""Improvement of a design: the search space around it, comparison of judged designs, and recommendations.

    base design ──► fields that are cheap to change, around their values ──► `optopad.design.search.points`, then the
    sampler
        ──► of the designs without a deadband: fewest changes, most robust, most depth, best accuracy

A deadband is a range of depth in which the signals change too little to resolve the depth. Depth can be resolved down
to the usable depth. The margin is the smallest signal change between two depths 0.3 mm apart, in units of its noise
(sigma); below 3 sigma there is a deadband. Designs are compared by these criteria, in this order: no deadband, usable
depth, margin, accuracy, few changes.

The module also defines the limits of a search and the result of its objective.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from optopad.design.errors import DesignError, InputError
from optopad.design.fields.base import get_at, known_paths, nearest, unknown_path
from optopad.design.rules.check import check
from optopad.design.search.figures import FIGURES
from optopad.design.search.space import ROUND_DIGITS, SearchSpace, Value, space_from
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import ALONG, CLEAR, HEIGHTS, TARGET, cheap_fields

LOCATION = "location_bound_mm"
UNUSABLE = 10.0
"""Violation of a design that breaks a rule or is outside the models; in practice, no missed limit has more."""


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Limit of a figure of merit, or the required verdict.

    Attributes
    ----------
    figure : name of the figure, or "verdict"
    at_least, at_most : ends of the permitted range; None means no limit on that side
    equals : the required verdict; None if the limit is on a figure of merit
    """

    figure: str
    at_least: float | None = None
    at_most: float | None = None
    equals: str | None = None

    def violation(self, judged: Judged) -> float | None:
        """How far a design violates the limit, relative to the limit; 0 or less if it is met, None if unknown."""
        if self.equals is not None:
            if not judged.verdict:
                return None
            # A deadband becomes shorter before it vanishes; its length therefore guides the sampler.
            length = judged.figures.get("deadband_mm") or 0.0
            return 0.0 if judged.verdict == self.equals else 0.1 + length
        value = judged.figures.get(self.figure)
        if value is None:
            return None
        misses = []
        if self.at_least is not None:
            misses.append((self.at_least - value) / (abs(self.at_least) or 1.0))
        if self.at_most is not None:
            misses.append((value - self.at_most) / (abs(self.at_most) or 1.0))
        return max(misses)

    def __str__(self) -> str:
        parts = [f"= {self.equals}"] if self.equals is not None else []
        parts += [f">= {self.at_least:.4g}"] if self.at_least is not None else []
        parts += [f"<= {self.at_most:.4g}"] if self.at_most is not None else []
        return f"{self.figure} {' and '.join(parts)}"


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Result of the objective for a design; it may be incomplete if the judgement stopped early.

    Attributes
    ----------
    figures : figures of merit by name; None if a figure could not be computed
    verdict : CONTIGUOUS, DEADBAND or OUT_OF_MODEL_SCOPE; empty if the judgement stopped before the verdict
    reason : why the judgement stopped early; empty if it is complete
    may_be : whether the design may have no deadband, given the numerical error of the light model
    """

    figures: dict[str, float | None] = field(default_factory=dict)
    verdict: str = ""
    reason: str = ""
    may_be: bool = False

    def violations(self, limits: Sequence[Limit]) -> dict[str, float]:
        """Violation of every limit whose figure is known, keyed by the limit's text.

        The entry `usable` is added if the judgement stopped early for another reason.
        """
        found = {str(limit): value for limit in limits if (value := limit.violation(self)) is not None}
        if self.reason and all(value <= 0.0 for value in found.values()):
            found["usable"] = UNUSABLE
        return found


@dataclass(frozen=True, kw_only=True)
class Tried:
    """One design of a search with its result.

    Attributes
    ----------
    number : number of the design in the study
    parameters : value of each field by dotted path; choices as labels
    digest : digest of the design; empty if its values are not compatible with each other
    judged : result of the objective
    is_feasible : whether the design was judged completely and satisfies all limits
    seconds : computing time [s]
    also : new values of fields outside the space that follow from the design, such as a smaller mold
    """

    number: int
    parameters: dict[str, Value]
    digest: str
    judged: Judged
    is_feasible: bool
    seconds: float
    also: Mapping[str, Any] = field(default_factory=dict)


Objective = Callable[[SensorDesign, tuple[Limit, ...]], Judged]
"""Function that judges a design under given limits; it may stop early with a reason if a limit cannot be satisfied."""

FanOut = Callable[[Objective, Sequence[SensorDesign], tuple[Limit, ...]], Iterable[tuple[int, Judged]]]
"""Function that judges several designs; it yields the index and the result of each, in any order."""


def one_by_one(
    objective: Objective, designs: Sequence[SensorDesign], limits: tuple[Limit, ...]
) -> Iterable[tuple[int, Judged]]:
    """Judge designs in this process one after another; yield the index and the result of each."""
    for number, design in enumerate(designs):
        yield number, objective(design, limits)


def limits_of(space: SearchSpace, base: Judged) -> tuple[Limit, ...]:
    """Limits of a search as numbers, computed from the constraints of its space and the base design's figures.

    Raises
    ------
    DesignError : a limit is a multiple of a figure that the base design does not have, or limits contradict each other.
    """
    return tuple(_limit(constraint.figure, constraint, base) for constraint in space.constraints)


def _limit(figure: str, constraint: object, base: Judged) -> Limit:
    said = {name: getattr(constraint, name) for name in ("at_least", "at_most")}
    for name in said:
        share = getattr(constraint, f"{name}_base")
        if share is None:
            continue
        value = base.figures.get(figure)
        if value is None:
            raise DesignError(
                f"constraints: {figure}: the base design has none ({base.reason or 'not resolved'}), so no multiple of "
                f"it is a limit; write {name} with a number"
            )
        given = said[name]
        pick = max if name == "at_least" else min
        said[name] = share * value if given is None else pick(given, share * value)
    low, high = said["at_least"], said["at_most"]
    if low is not None and high is not None and low > high:
        raise DesignError(
            f"constraints: {figure} cannot be at least {low:.4g} and at most {high:.4g}; they contradict each other"
        )
    return Limit(figure=figure, equals=getattr(constraint, "equals"), **said)  # noqa: B009


Kind = str
Range = tuple[float, float]
KINDS: tuple[Kind, ...] = ("fewest changes", "most robust", "most depth", "best accuracy")
AIMS: dict[Kind, str] = {
    "margin": "margin",
    "location": "location_bound_mm",
    "contact": "detection_force_n",
    "size": "outer_volume_cm3",
    "flush": "above_surface_mm",
}
"""What a user may aim for, each with the figure that says which design is better."""
STEPS = {**dict.fromkeys(HEIGHTS, 0.1), CLEAR: 0.25}
"""Step of each field that varies by default, in the field's unit; the step of other fields is a 50th of their range."""
CLEAR_REACH_MM = 4.0
"""How far the thickness of the clear layer varies by default on each side of its value [mm]."""
ALONG_REACH_MM, ALONG_STEP_MM = 2.0, 0.25
"""How far the pitch and shift of parts along a wall vary by default on each side of their value, and their step."""
COUNT_STEPS, ROUND_STEPS = 30.0, (1.0, 2.0, 2.5, 5.0, 10.0)
"""Smallest number of steps in the range of the gain's target, and leading digits of a step."""
SAFE_MARGIN = 4.5
"""Margin [sigma] in a quick search above which an accurate score is assumed to find no deadband either."""
AMPLE_MARGIN = 2.0 * SAFE_MARGIN
"""Margin above which an even larger margin is no benefit [sigma]."""
NEAR_BEST_MM = 0.5
"""Largest difference between two usable depths that count as equal [mm]."""
WORTH_MARGIN, WORTH_ACCURACY = 0.2, 0.05
"""Least relative improvements in margin and in accuracy that justify changing a design without a deadband [-]."""
NEAR_SHARE = 0.08
"""Largest difference between two values that count as similar, as a share of the field's range [-]."""
ENOUGH_SHARE = 0.6
"""Least usable depth of the recommendations "fewest changes" and "most robust", as a share of the deepest one [-]."""


@dataclass(frozen=True, kw_only=True)
class Pick:
    """A recommended design and the reason for the recommendation."""

    kind: Kind
    tried: Tried


def improvement_space(
    design: SensorDesign,
    *,
    vary: Mapping[str, Range | None],
    keep: Sequence[str],
    more_parts: bool,
    most_counts: float = math.inf,
    aim: Kind | None = None,
    trials: int,
    seed: int,
    figures: Sequence[str],
) -> SearchSpace:
    """Make the search space around a design.

    Parameters
    ----------
    vary : additional fields to vary: range (low, high) by dotted path, or None for the field's default range
    keep : dotted paths of fields that must not change
    more_parts : whether layouts may have more parts per side
    most_counts : largest useful `gain.target_counts`
    aim : what better means (`AIMS`), a part of the search's name; None for the usual kinds
    figures : objectives, the most important first

    Raises
    ------
    InputError : a field cannot vary or is both in `vary` and `keep`, or no field remains to vary.
    DesignError : a field does not exist, or its range has values that are not valid.
    """
    fields = {
        field["path"]: field
        for field in _usual_fields(design, more_parts=more_parts, most_counts=most_counts)
    }
    both = sorted(set(vary) & set(keep))
    if both:
        raise InputError(f"--vary and --keep: {', '.join(both)} is given to both; keep one of the two")
    for path in keep:
        if path not in fields:
            near = nearest(path, tuple(fields))
            hint = f"did you mean {near[0]}?" if near else f"fields that vary: {', '.join(fields)}"
            raise InputError(f"--keep: {path} does not vary by default; {hint}")
        del fields[path]
    for path, given in vary.items():
        fields[path] = _field(design, path, given)
    if not fields:
        raise InputError("--keep: nothing is left to vary; keep fewer fields, or name one with --vary")
    return space_from(
        {
            "name": "-".join(filter(None, ("improve", aim, design.name)))[:63].rstrip("."),
            "base": design.model_dump(mode="json"),
            "fields": list(fields.values()),
            "objectives": [{"figure": figure} for figure in figures],
            "constraints": [{"figure": "verdict", "equals": "CONTIGUOUS"}],
            "accuracy": "draft",
            "search": {"sampler": "tpe", "trials": trials, "seed": seed, "batch": 4},
        },
        where="--vary",
    )


def _usual_fields(design: SensorDesign, *, more_parts: bool, most_counts: float) -> list[dict[str, Any]]:
    found = [_field(design, path, None, most_counts=most_counts) for path in cheap_fields(design)]
    found = [one for one in found if one["low"] < one["high"]]
    for number, pattern in enumerate(design.layout):
        if pattern.pattern in ("alternating_ring", "disc_ring", "checkerboard"):
            found.append({"path": f"layout.{number}.first", "choices": ["emitter", "receiver"]})
        if pattern.pattern == "alternating_ring" and more_parts and isinstance(pattern.parts_per_side, int):
            counts = [pattern.parts_per_side + more for more in (0, 1, 2, 3)]
            found.append({"path": f"layout.{number}.parts_per_side", "choices": counts})
        if pattern.pattern in ("facing_rows", "disc_ring") and more_parts:
            found.append(
                {"path": f"layout.{number}.count", "choices": [pattern.count + more for more in (0, 1, 2)]}
            )
    return found


def _field(
    design: SensorDesign, path: str, given: Range | None, *, most_counts: float = math.inf
) -> dict[str, Any]:
    try:
        value = get_at(design.model_dump(mode="json"), path)
    except (KeyError, IndexError, TypeError, ValueError):
        raise unknown_path(path, known_paths(SensorDesign)) from None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"--vary: {path} is no number that could vary; name a length, an angle or a count")
    if given is not None:
        low, high = given
        if not low < high:
            raise InputError(
                f"--vary: {path}={low:g}:{high:g} is an empty range; give a lower and a higher end"
            )
        return {"path": path, "low": low, "high": high, "step": _step_within(path, value, low, high)}
    low, high, step = _usual_range(design, path, value, most_counts)
    steps_down, steps_up = (int(max(reach, 0.0) / step + 1e-6) for reach in (value - low, high - value))
    low, high = value - steps_down * step, value + steps_up * step
    return {"path": path, "low": round(low, ROUND_DIGITS), "high": round(high, ROUND_DIGITS), "step": step}


def _usual_range(
    design: SensorDesign, path: str, value: float, most_counts: float
) -> tuple[float, float, float]:
    """Lowest and highest value of a field by default, and its step.

    Heights and thickness end where a rule of parts and mold refuses them; the thickest layer decides on the heights.
    """
    if path == TARGET:
        high = max(min(most_counts, 2.0 * 65535.0 / 3.0), value)
        step = _round_step(high / COUNT_STEPS)
        return 0.2 * value, high, step
    if path == CLEAR:
        step = STEPS[CLEAR]
        reach = max(min(CLEAR_REACH_MM, 0.8 * value), step)
        return (
            _last_allowed(design, path, value, -step, value - reach),
            _last_allowed(design, path, value, step, value + reach),
            step,
        )
    if path in HEIGHTS:
        thick = _usual_range(design, CLEAR, design.cavity.clear_thickness_mm, most_counts)[1]
        tall = design.with_(**{CLEAR: thick})
        base = tall if not _broken(tall) else design
        step = STEPS[path]
        return (
            _last_allowed(design, path, value, -step, 0.0),
            _last_allowed(base, path, value, step, base.cavity.clear_thickness_mm),
            step,
        )
    along = path.endswith(ALONG)
    reach = ALONG_REACH_MM if along else 0.25 * abs(value) or 1.0
    step = ALONG_STEP_MM if along else reach / 25.0
    if isinstance(value, int):
        reach, step = max(round(reach), 1), 1.0
    down = reach if path.endswith("shift_mm") else min(reach, 0.8 * value)
    return value - down, value + reach, step


def _round_step(about: float) -> float:
    """The step of one to two leading digits that is nearest to a number."""
    power = 10.0 ** math.floor(math.log10(about))
    return power * min(ROUND_STEPS, key=lambda digit: abs(digit * power - about))


def _last_allowed(design: SensorDesign, path: str, value: float, step: float, end: float) -> float:
    """The last value before `end`, in steps from the field's value, that no rule refuses (found by bisection)."""
    good, bad = 0, int(abs(end - value) / abs(step) + 1e-6) + 1
    while bad - good > 1:
        middle = (good + bad) // 2
        try:
            is_bad = _broken(design.with_(**{path: round(value + middle * step, ROUND_DIGITS)}))
        except DesignError:
            is_bad = True
        good, bad = (good, middle) if is_bad else (middle, bad)
    return value + good * step


def _broken(design: SensorDesign) -> bool:
    return any(one.severity == "error" for one in check(design))


def is_allowed(space: SearchSpace, point: Mapping[str, Value]) -> bool:
    """Whether the design at a point exists and breaks no rule, so that light is worth tracing for it."""
    try:
        return not _broken(space.changed(point))
    except DesignError:
        return False


def _step_within(path: str, value: float, low: float, high: float) -> float | None:
    """Default step of a field in a given range.

    None if the field has no default step, or if the range, or the base design's distance from its lower end, is not a
    whole number of steps.
    """
    if isinstance(value, int):
        return 1.0
    usual = ALONG_STEP_MM if path.endswith(ALONG) else STEPS.get(path)
    if usual is None:
        return None
    counts = [(high - low) / usual, (value - low) / usual]
    return usual if all(abs(count - round(count)) < 1e-6 for count in counts) else None


def changes_of(space: SearchSpace, parameters: Mapping[str, Value]) -> dict[str, Any]:
    """Values of the fields that differ from the base design, by dotted path."""
    return dict(_difference(space, parameters)[0])


def _difference(space: SearchSpace, parameters: Mapping[str, Value]) -> tuple[dict[str, Any], float]:
    """Changed values by dotted path, and the sum of the changes, each as a share of its field's range; kept."""
    key = (space.digest, tuple(sorted(parameters.items())))
    if key not in _KNOWN:
        changed, base = (one.model_dump(mode="json") for one in (space.changed(parameters), space.base))
        changes, size = dict[str, Any](), 0.0
        for each in space.fields:
            now, was = get_at(changed, each.path), get_at(base, each.path)
            if now == was:
                continue
            changes[each.path] = now
            if each.path == TARGET:
                continue  # another resistor costs nothing, so that its best value counts and not the nearest
            if each.low is None or each.high is None:
                size += 0.5
            else:
                size += abs(float(now) - float(was)) / (each.high - each.low)
        _KNOWN[key] = changes, size
    return _KNOWN[key]


_KNOWN: dict[tuple[str, tuple[tuple[str, Value], ...]], tuple[dict[str, Any], float]] = {}
"""Changes of points, since designs are compared many times."""


def worth(judged: Judged) -> tuple[bool, float, float, float]:
    """Sort key of a result, larger for better designs: no deadband, a short deadband, usable depth, margin."""
    return (
        is_possible(judged),
        -float(judged.figures.get("deadband_mm") or 0.0) if judged.figures else -math.inf,
        round(usable_of(judged) / NEAR_BEST_MM),
        min(margin_of(judged), AMPLE_MARGIN),
    )


Order = Callable[[SearchSpace, Tried, str], tuple[float, ...]]


def _by_figure(figure: str) -> Order:
    return lambda _, one, __: (_smaller(one.judged, figure), -margin_of(one.judged))


ORDERS: dict[Kind, Order] = {
    "fewest changes": lambda space, one, _: (*cost_of(space, one), -margin_of(one.judged)),
    "most robust": lambda _, one, __: (-margin_of(one.judged), -usable_of(one.judged)),
    "most depth": lambda _, one, __: (-round(usable_of(one.judged) / NEAR_BEST_MM), -margin_of(one.judged)),
    "best accuracy": lambda space, one, figure: (_smaller(one.judged, figure), *cost_of(space, one)),
    "margin": lambda _, one, __: (-margin_of(one.judged), -usable_of(one.judged)),
    **{aim: _by_figure(figure) for aim, figure in AIMS.items() if aim != "margin"},
}
"""Sort key of each kind of recommendation; smaller is better. It receives the space, a design, and the figure that
measures accuracy."""


def picks(
    space: SearchSpace,
    base: Judged,
    tried: Sequence[Tried],
    accuracy: str,
    most_mm: float = math.inf,
    *,
    kinds: Sequence[Kind] = KINDS,
    safe: float = SAFE_MARGIN,
) -> list[Pick]:
    """Recommended designs of each kind ("fewest changes", "most robust", ...), the best of each kind first.

    Parameters
    ----------
    accuracy : figure that measures accuracy; "best accuracy" needs the location bound, a figure of the whole pad
    most_mm : upper limit of the greatest usable depth [mm], with which the other designs are compared
    kinds : the kinds that are wanted; of an aim, designs count that have no less depth than the base design
    safe : margin at which a design counts as free of deadbands [sigma]
    """
    possible = [
        one for one in tried if is_possible(one.judged) and (one.also or changes_of(space, one.parameters))
    ]
    if not possible:
        return []
    most = min(max(usable_of(one.judged) for one in possible), most_mm)
    changed = [one for one in possible if betters(base, one.judged, accuracy, safe)]
    deep = [one for one in changed if usable_of(one.judged) >= most - NEAR_BEST_MM]
    enough = [one for one in changed if usable_of(one.judged) >= ENOUGH_SHARE * most]
    chosen = {
        "fewest changes": enough,
        "most robust": enough,
        "most depth": changed,
        "best accuracy": [one for one in deep if accuracy == LOCATION and _is_known(one.judged, accuracy)],
    }
    if is_sound(base, safe) and enough:  # no need to fix: others must beat the first pick
        first = min(enough, key=lambda one: ORDERS["fewest changes"](space, one, accuracy)).judged
        more = (1.0 + WORTH_MARGIN) * margin_of(first)
        chosen["most robust"] = [one for one in enough if margin_of(one.judged) > more]
        chosen["best accuracy"] = [
            one for one in chosen["best accuracy"] if _is_finer(one.judged, first, accuracy)
        ]
    least = usable_of(base) - NEAR_BEST_MM if is_sound(base, safe) else ENOUGH_SHARE * most
    for aim, figure in AIMS.items():
        chosen[aim] = [
            one
            for one in possible
            if usable_of(one.judged) >= least
            and _is_known(one.judged, figure)
            and (not is_sound(base, safe) or _smaller(one.judged, figure) < _smaller(base, figure))
        ]
    return [
        Pick(kind=kind, tried=one)
        for kind in kinds
        for one in sorted(chosen[kind], key=lambda one: ORDERS[kind](space, one, accuracy))
    ]


def _is_known(judged: Judged, figure: str) -> bool:
    return math.isfinite(_smaller(judged, figure))


def _ample(judged: Judged) -> float:
    return min(margin_of(judged), AMPLE_MARGIN)


def is_possible(judged: Judged) -> bool:
    """Whether a design has no deadband, or may have none given the numerical error of the light model."""
    return is_sound(judged) or judged.may_be


def is_sound(judged: Judged, safe: float = SAFE_MARGIN) -> bool:
    """Whether a design has no deadband, with a margin of at least `safe` [sigma]."""
    return not judged.reason and judged.verdict == "CONTIGUOUS" and margin_of(judged) >= safe


def betters(base: Judged, judged: Judged, accuracy: str, safe: float = SAFE_MARGIN) -> bool:
    """Whether a design is enough of an improvement on the base design to be recommended.

    If the base design has a deadband, any design without one is enough. Otherwise the design must have a larger usable
    depth, or better accuracy or margin at about the same depth.

    Parameters
    ----------
    safe : margin at which the base design counts as free of deadbands [sigma]
    """
    if not is_sound(base, safe):
        return is_possible(judged)
    deeper = usable_of(judged) - usable_of(base)
    if deeper > NEAR_BEST_MM:
        return True
    keeps = margin_of(judged) >= _ample(base)
    finer = keeps and _is_finer(judged, base, accuracy)
    return deeper > -NEAR_BEST_MM and (finer or _is_stronger(judged, base))


def _is_stronger(judged: Judged, other: Judged) -> bool:
    """Whether the margin of `judged`, capped at `AMPLE_MARGIN`, exceeds that of `other` by the share `WORTH_MARGIN`."""
    return _ample(judged) > (1.0 + WORTH_MARGIN) * margin_of(other)


def _is_finer(judged: Judged, other: Judged, accuracy: str) -> bool:
    """Whether `judged` is more accurate than `other` by more than the share `WORTH_ACCURACY`."""
    was = _smaller(other, accuracy)
    if math.isinf(was):
        return math.isfinite(_smaller(judged, accuracy))
    return was - _smaller(judged, accuracy) > WORTH_ACCURACY * abs(was)


def is_near(space: SearchSpace, one: Tried, other: Tried, *, apart_from: Sequence[str] = ()) -> bool:
    """Whether two designs differ little in every field, apart from the fields in `apart_from`."""
    return all(
        field.path in apart_from or one.parameters[field.path] == other.parameters[field.path]
        if field.low is None or field.high is None
        else abs(float(one.parameters[field.path]) - float(other.parameters[field.path]))
        <= NEAR_SHARE * (field.high - field.low)
        for field in space.fields
    )


def margin_of(judged: Judged) -> float:
    """Margin of a result [sigma]; 0 if unknown."""
    return float(judged.figures.get("margin") or 0.0)


def usable_of(judged: Judged) -> float:
    """Usable depth of a result [mm]; 0 if unknown."""
    return float(judged.figures.get("usable_depth_mm") or 0.0)


def _smaller(judged: Judged, figure: str) -> float:
    """Figure of a result, with its sign chosen so that smaller is better; infinite if unknown."""
    value = judged.figures.get(figure)
    if value is None:
        return float("inf")
    return value if FIGURES[figure].better == "minimize" else -value


def cost_of(space: SearchSpace, one: Tried) -> tuple[int, float]:
    """Number of changed fields, and the sum of the changes, each as a share of its field's range."""
    changes, size = _difference(space, one.parameters)
    return len(changes), size
