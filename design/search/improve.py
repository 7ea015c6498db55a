"""From a layout to better ones: what may change, and which of the designs tried are worth having.

    base design ──► fields that cost little to change, around their values ──► `design.search.points`, then the sampler
        ──► of the designs without a deadband: fewest changes, most robust, most depth, best accuracy

A search space like any other (`design.search.space`), so it resumes, is seeded and knows nothing of light. Wanted of a
design, in this order: no deadband; the usable depth; margin to a deadband; accuracy; few changes.

What an objective says of one design, and what a search holds it to: the words between the search and the physics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from design.errors import DesignError, InputError
from design.fields.base import get_at, known_paths, nearest, unknown_path
from design.search.figures import BOUND_FIGURES, FIGURES
from design.search.space import ROUND_DIGITS, SearchSpace, Value, space_from
from design.spec import SensorDesign
from design.spec.cheap_fields import ALONG, CLEAR, HEIGHTS, TARGET, cheap_fields

UNUSABLE = 10.0
"""Violation of a design that breaks a rule or leaves the models: worse than any missed limit in practice."""


@dataclass(frozen=True, kw_only=True)
class Limit:
    """One figure held to a number, or the verdict.

    Attributes
    ----------
    figure : name of a figure, or "verdict"
    at_least, at_most : ends of the allowed range; None is open
    equals : the verdict wanted; of other figures None
    """

    figure: str
    at_least: float | None = None
    at_most: float | None = None
    equals: str | None = None

    def violation(self, judged: Judged) -> float | None:
        """How far a design misses it, as a share of the limit; 0 or less is met; None when the figure is unknown."""
        if self.equals is not None:
            if not judged.verdict:
                return None
            # A deadband shrinks before it goes, so its length shows the sampler the way out.
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
    """A design as far as it was judged.

    Attributes
    ----------
    figures : by name; None where the figure could not be resolved
    verdict : CONTIGUOUS, DEADBAND or OUT_OF_MODEL_SCOPE; empty when the judging stopped before
    reason : why the judging stopped early; empty when it did not
    may_be : whether the error of the light that judged it leaves it possible that it has no deadband
    """

    figures: dict[str, float | None] = field(default_factory=dict)
    verdict: str = ""
    reason: str = ""
    may_be: bool = False

    def violations(self, limits: Sequence[Limit]) -> dict[str, float]:
        """Violation of every limit whose figure is known; `usable` besides when something else stopped the judging."""
        found = {str(limit): value for limit in limits if (value := limit.violation(self)) is not None}
        if self.reason and all(value <= 0.0 for value in found.values()):
            found["usable"] = UNUSABLE
        return found


@dataclass(frozen=True, kw_only=True)
class Tried:
    """One design of a search.

    Attributes
    ----------
    number : of the study's trial
    parameters : point of the space; choices by their labels
    digest : of the design; empty when the schema refused it
    judged : what the objective said
    is_feasible : judged to the end, and within all limits
    seconds : spent on it [s]
    """

    number: int
    parameters: dict[str, Value]
    digest: str
    judged: Judged
    is_feasible: bool
    seconds: float


Objective = Callable[[SensorDesign, tuple[Limit, ...]], Judged]
"""Judges a design; may stop early, with the reason, once a limit cannot be met any more."""

FanOut = Callable[[Objective, Sequence[SensorDesign], tuple[Limit, ...]], Iterable[tuple[int, Judged]]]
"""Judges several designs and yields their positions and what was said, in any order."""


def one_by_one(
    objective: Objective, designs: Sequence[SensorDesign], limits: tuple[Limit, ...]
) -> Iterable[tuple[int, Judged]]:
    """Judge designs here, one after the other."""
    for number, design in enumerate(designs):
        yield number, objective(design, limits)


def limits_of(space: SearchSpace, base: Judged) -> tuple[Limit, ...]:
    """The space's constraints as numbers.

    Raises
    ------
    DesignError : a limit is a multiple of a figure that the base design does not have.
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


Kind = Literal["fewest changes", "most robust", "most depth", "best accuracy"]
Range = tuple[float, float]
KINDS: tuple[Kind, ...] = ("fewest changes", "most robust", "most depth", "best accuracy")
STEPS = {**dict.fromkeys(HEIGHTS, 0.1), CLEAR: 0.25, TARGET: 25.0}
"""Step of each field that varies by default; of others a fiftieth of the range [unit of the field]."""
REACH = {**dict.fromkeys(HEIGHTS, 3.0), CLEAR: 4.0, TARGET: 200.0}
"""How far from its value a field varies by default [unit of the field]."""
ALONG_REACH_MM, ALONG_STEP_MM = 2.0, 0.25
"""The same of pitch and shift of parts along a wall."""
SAFE_MARGIN = 4.5
"""Margin at search accuracy from which a design is taken to have no deadband at score accuracy either [noise units]."""
AMPLE_MARGIN = 2.0 * SAFE_MARGIN
"""Margin from which more is worth nothing [noise units]."""
NEAR_BEST_MM = 0.5
"""Usable depths that differ by less are as good [mm]."""
WORTH_MARGIN, WORTH_ACCURACY = 0.2, 0.05
"""Gains of margin and of accuracy, over the base's, from which a change of a sound design is worth it [-]."""
NEAR_SHARE = 0.08
"""Share of a field's range over which designs are alike [-]."""
ENOUGH_SHARE = 0.6
"""Share of the deepest usable depth that an alternative keeps at least [-]."""


@dataclass(frozen=True, kw_only=True)
class Pick:
    """A design worth having: why, and the point of the space."""

    kind: Kind
    tried: Tried


def improvement_space(
    design: SensorDesign,
    *,
    vary: Mapping[str, Range | None],
    keep: Sequence[str],
    more_parts: bool,
    trials: int,
    seed: int,
    figures: Sequence[str],
) -> SearchSpace:
    """The space around a design.

    Parameters
    ----------
    vary : fields to vary besides, with their range; None for the usual one
    keep : fields to leave as they are
    more_parts : whether layouts may have more parts a side
    figures : objectives, the most wanted first

    Raises
    ------
    InputError : fields that nothing varies, or that are kept and varied at once; nothing left to vary.
    DesignError : fields that a design does not have, or ranges that it does not take.
    """
    fields = {field["path"]: field for field in _usual_fields(design, more_parts=more_parts)}
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
            "name": f"improve-{design.name}"[:63].rstrip("."),
            "base": design.model_dump(mode="json"),
            "fields": list(fields.values()),
            "objectives": [{"figure": figure} for figure in figures],
            "constraints": [{"figure": "verdict", "equals": "CONTIGUOUS"}],
            "accuracy": "draft",
            "search": {"sampler": "tpe", "trials": trials, "seed": seed, "batch": 4},
        },
        where="--vary",
    )


def _usual_fields(design: SensorDesign, *, more_parts: bool) -> list[dict[str, Any]]:
    found = [_field(design, path, None) for path in cheap_fields(design)]
    for number, pattern in enumerate(design.layout):
        if pattern.pattern in ("alternating_ring", "disc_ring"):
            found.append({"path": f"layout.{number}.first", "choices": ["emitter", "receiver"]})
        if pattern.pattern == "alternating_ring" and more_parts and isinstance(pattern.parts_per_side, int):
            counts = [pattern.parts_per_side + more for more in (0, 1, 2, 3)]
            found.append({"path": f"layout.{number}.parts_per_side", "choices": counts})
        if pattern.pattern in ("facing_rows", "disc_ring") and more_parts:
            found.append(
                {"path": f"layout.{number}.count", "choices": [pattern.count + more for more in (0, 1, 2)]}
            )
    return found


def _field(design: SensorDesign, path: str, given: Range | None) -> dict[str, Any]:
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
    along = path.endswith(ALONG)
    reach = ALONG_REACH_MM if along else REACH.get(path, 0.25 * abs(value) or 1.0)
    step = ALONG_STEP_MM if along else STEPS.get(path, reach / 25.0)
    if isinstance(value, int):
        reach, step = max(round(reach), 1), 1.0
    down = reach if path.endswith("shift_mm") else min(reach, 0.8 * value)
    steps_down = int(down / step + 1e-6)
    low, high = value - steps_down * step, value + int(reach / step + 1e-6) * step
    return {"path": path, "low": round(low, ROUND_DIGITS), "high": round(high, ROUND_DIGITS), "step": step}


def _step_within(path: str, value: float, low: float, high: float) -> float | None:
    """The usual step of a field where both the range and the base's value in it are whole numbers of them."""
    if isinstance(value, int):
        return 1.0
    usual = ALONG_STEP_MM if path.endswith(ALONG) else STEPS.get(path)
    if usual is None:
        return None
    counts = [(high - low) / usual, (value - low) / usual]
    return usual if all(abs(count - round(count)) < 1e-6 for count in counts) else None


def changes_of(space: SearchSpace, parameters: Mapping[str, Value]) -> dict[str, Any]:
    """What differs from the base design, by path."""
    changed = space.changed(parameters).model_dump(mode="json")
    base = space.base.model_dump(mode="json")
    return {
        field.path: get_at(changed, field.path)
        for field in space.fields
        if get_at(changed, field.path) != get_at(base, field.path)
    }


def worth(judged: Judged) -> tuple[bool, float, float, float]:
    """An order of designs, better ones larger: no deadband, a short one, the usable depth, the margin."""
    return (
        is_possible(judged),
        -float(judged.figures.get("deadband_mm") or 0.0) if judged.figures else -math.inf,
        round(usable_of(judged) / NEAR_BEST_MM),
        min(margin_of(judged), AMPLE_MARGIN),
    )


def picks(
    space: SearchSpace, base: Judged, tried: Sequence[Tried], accuracy: str, most_mm: float = math.inf
) -> list[Pick]:
    """Designs worth having, as far as their light and its error tell, each kind's best first.

    Parameters
    ----------
    accuracy : figure that the most accurate is best in; none is picked for it that is not of the pad
    most_mm : the deepest usable depth that is believed [mm]
    """
    possible = [one for one in tried if is_possible(one.judged) and changes_of(space, one.parameters)]
    if not possible:
        return []
    most = min(max(usable_of(one.judged) for one in possible), most_mm)
    changed = [one for one in possible if betters(base, one.judged, accuracy)]
    fine = [
        one for one in changed if accuracy in BOUND_FIGURES and math.isfinite(_accuracy(one.judged, accuracy))
    ]
    deep = [one for one in changed if usable_of(one.judged) >= most - NEAR_BEST_MM]
    enough = [one for one in changed if usable_of(one.judged) >= ENOUGH_SHARE * most]
    orders = {
        "fewest changes": lambda one: (cost_of(space, one), -margin_of(one.judged)),
        "most robust": lambda one: (-min(margin_of(one.judged), AMPLE_MARGIN), -usable_of(one.judged)),
        "most depth": lambda one: (-round(usable_of(one.judged) / NEAR_BEST_MM), -margin_of(one.judged)),
        "best accuracy": lambda one: (_accuracy(one.judged, accuracy), cost_of(space, one)),
    }
    chosen = {
        "fewest changes": enough,
        "most robust": enough,
        "most depth": changed,
        "best accuracy": [one for one in fine if one in deep],
    }
    if is_sound(base) and enough:  # nothing needs mending: the second must beat what is offered first
        first = min(enough, key=orders["fewest changes"]).judged
        chosen["most robust"] = [one for one in enough if _is_stronger(one.judged, first)]
        chosen["best accuracy"] = [
            one for one in chosen["best accuracy"] if _is_finer(one.judged, first, accuracy)
        ]
    return [Pick(kind=kind, tried=one) for kind in KINDS for one in sorted(chosen[kind], key=orders[kind])]


def is_possible(judged: Judged) -> bool:
    """Whether a design may have no deadband, by the light that judged it and its error."""
    return is_sound(judged) or judged.may_be


def is_sound(judged: Judged, safe: float = SAFE_MARGIN) -> bool:
    """Whether a design has no deadband, with a margin beyond the error of quick light."""
    return not judged.reason and judged.verdict == "CONTIGUOUS" and margin_of(judged) >= safe


def betters(base: Judged, judged: Judged, accuracy: str, safe: float = SAFE_MARGIN) -> bool:
    """Whether a design is better: than a base without a deadband in depth, accuracy or a scarce margin, else by none.

    Parameters
    ----------
    safe : margin from which a base has none, by the light that judged it [noise units]
    """
    if not is_sound(base, safe):
        return is_possible(judged)
    deeper = usable_of(judged) - usable_of(base)
    if deeper > NEAR_BEST_MM:
        return True
    keeps = margin_of(judged) >= min(margin_of(base), AMPLE_MARGIN)
    finer = keeps and _is_finer(judged, base, accuracy)
    return deeper > -NEAR_BEST_MM and (finer or _is_stronger(judged, base))


def _is_stronger(judged: Judged, other: Judged) -> bool:
    """Whether the margin is larger by enough, as far as more of it is worth anything."""
    return min(margin_of(judged), AMPLE_MARGIN) > (1.0 + WORTH_MARGIN) * margin_of(other)


def _is_finer(judged: Judged, other: Judged, accuracy: str) -> bool:
    """Whether the accuracy is better by enough."""
    was = _accuracy(other, accuracy)
    if math.isinf(was):
        return math.isfinite(_accuracy(judged, accuracy))
    return was - _accuracy(judged, accuracy) > WORTH_ACCURACY * abs(was)


def is_near(space: SearchSpace, one: Tried, other: Tried) -> bool:
    """Whether two designs differ little in every field."""
    return all(
        one.parameters[field.path] == other.parameters[field.path]
        if field.low is None or field.high is None
        else abs(float(one.parameters[field.path]) - float(other.parameters[field.path]))
        <= NEAR_SHARE * (field.high - field.low)
        for field in space.fields
    )


def margin_of(judged: Judged) -> float:
    """Margin, 0 where it is not known [noise units]."""
    return float(judged.figures.get("margin") or 0.0)


def usable_of(judged: Judged) -> float:
    """Usable depth, 0 where it is not known [mm]."""
    return float(judged.figures.get("usable_depth_mm") or 0.0)


def _accuracy(judged: Judged, figure: str) -> float:
    """Smaller is better."""
    value = judged.figures.get(figure)
    if value is None:
        return float("inf")
    return value if FIGURES[figure].better == "minimize" else -value


def cost_of(space: SearchSpace, one: Tried) -> tuple[int, float]:
    """Fields changed, and by how much of their ranges together."""
    changes, base = changes_of(space, one.parameters), space.base.model_dump(mode="json")
    changed = [field for field in space.fields if field.path in changes]
    size = 0.0
    for each in changed:
        if each.low is None or each.high is None:
            size += 0.5
        else:
            by = float(one.parameters[each.path]) - float(get_at(base, each.path))
            size += abs(by) / (each.high - each.low)
    return len(changed), size
