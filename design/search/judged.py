"""What an objective says of one design, and what a search holds it to: the words between the search and the physics."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from design.errors import DesignError
from design.search.space import SearchSpace, Value
from design.spec import SensorDesign

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
