"""The search space: fields of a base design that vary, objectives, constraints, and settings of the sampler.

A file is TOML:

    name = "my-search"
    base = "piacenza2017-pad"             # a preset, or a design file next to this one

    [[fields]]
    path = "cavity.clear_thickness_mm"    # any field of a design by its dotted path
    low = 6.0
    high = 12.0
    step = 0.25

    [[fields]]
    path = "layout.0.parts_per_side"
    choices = [2, 3, 4]                   # or whole patterns: path = "layout"

    [[objectives]]
    figure = "evenness"                   # see optopad.design.search.figures

    [[constraints]]
    figure = "strength"
    at_least_base = 1.0                   # times the base design's

A point of the space has one value for each field. Choices are represented by their labels, which are JSON texts. The
digest identifies the base design, fields, objectives, constraints and accuracy. Searches with equal digests may use the
same study, even if sampler, seed and number of trials differ.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, ValidationError, model_validator

from optopad.design.errors import DesignError, shown
from optopad.design.fields.base import FileName, Model, get_at, known_paths, nearest, set_at, unknown_path
from optopad.design.fields.packaged import packaged_or_own
from optopad.design.fields.validation import design_error
from optopad.design.io import load_design, read_toml
from optopad.design.preset import PRESETS, preset
from optopad.design.search.figures import FIGURES, NO_OBJECTIVE_ALONE, Direction
from optopad.design.spec import SensorDesign, canonical_json
from optopad.design.spec.layout import Pattern

Sampler = Literal["tpe", "nsga2", "gp", "grid", "qmc", "random"]
Value = bool | int | float | str
ROUND_DIGITS = 9
"""Number of decimals to which a sampled value is rounded, so that steps of 0.1 give exact decimals."""

SPACES = ("pair-heights", "pad-layout")
"""Names of the packaged search spaces."""

_PATTERNS = {
    get_args(model.model_fields["pattern"].annotation)[0]: tuple(model.model_fields)
    for model in get_args(get_args(Pattern)[0])
}
"""Names of the fields of each layout pattern."""
_FIXED = frozenset({"schema_version", "name", "description", "measured", "catalog", "part_measurements"})


MOST_STEPS = 100_000
"""Largest number of steps in a range, whose values are listed one by one."""


class SpaceField(Model):
    """One field that varies over a range, or between choices."""

    path: Annotated[str, Field(min_length=1, description="dotted path of a field of the design")]
    low: Annotated[float | None, Field(description="smallest value")] = None
    high: Annotated[float | None, Field(description="largest value")] = None
    step: Annotated[float | None, Field(gt=0.0, description="distance between values; absent: any")] = None
    log: Annotated[bool, Field(description="sample the logarithm evenly")] = False
    choices: Annotated[
        tuple[Any, ...] | None, Field(min_length=1, max_length=64, description="values, or whole patterns")
    ] = None

    @model_validator(mode="after")
    def _range_or_choices(self) -> Self:
        if self.choices is not None:
            if any(value is not None for value in (self.low, self.high, self.step)) or self.log:
                raise ValueError(f"{self.path}: has choices and a range; keep one of the two")
            labels = [canonical_json(choice) for choice in self.choices]
            if len(set(labels)) < len(labels):
                raise ValueError(f"{self.path}: choices has a value twice; remove one")
            return self
        if self.low is None or self.high is None:
            raise ValueError(f"{self.path}: needs low and high, or choices")
        if not self.low < self.high:
            raise ValueError(
                f"{self.path}: the range from {self.low:g} to {self.high:g} is empty; low must be below high"
            )
        if self.log and (self.low <= 0.0 or self.step is not None):
            raise ValueError(f"{self.path}: log needs low above 0 and no step")
        if self.step is not None and not _divides(self.step, self.high - self.low):
            raise ValueError(
                f"{self.path}: steps of {self.step:g} from {self.low:g} do not reach {self.high:g}; change high or step"
            )
        if self.step is not None and (self.high - self.low) / self.step > MOST_STEPS:
            raise ValueError(
                f"{self.path}: {(self.high - self.low) / self.step:.3g} steps of {self.step:g} are refused: at most "
                f"{MOST_STEPS}; raise step, or leave it out for any value"
            )
        return self

    @property
    def labels(self) -> tuple[str, ...]:
        """Label of each choice, its JSON text; empty for a range."""
        return tuple(canonical_json(choice) for choice in self.choices or ())


class SpaceObjective(Model):
    """A figure of merit to improve."""

    figure: str
    direction: Annotated[Direction | None, Field(description="default: the direction that is better")] = None

    @model_validator(mode="after")
    def _figure_is_known(self) -> Self:
        _require_figure(self.figure, tuple(FIGURES))
        return self

    @property
    def sense(self) -> Direction:
        """Direction of improvement: the given one, or else the figure's default."""
        return self.direction or FIGURES[self.figure].better


class SpaceConstraint(Model):
    """Limit of one figure: a number, a multiple of the base design's figure, or a required verdict."""

    figure: str
    equals: Annotated[Literal["CONTIGUOUS", "DEADBAND"] | None, Field(description="for `verdict` only")] = (
        None
    )
    at_least: float | None = None
    at_most: float | None = None
    at_least_base: Annotated[float | None, Field(gt=0.0, description="times the base design's")] = None
    at_most_base: Annotated[float | None, Field(gt=0.0, description="times the base design's")] = None

    @model_validator(mode="after")
    def _says_one_thing(self) -> Self:
        _require_figure(self.figure, ("verdict", *FIGURES))
        bounds = (self.at_least, self.at_most, self.at_least_base, self.at_most_base)
        if self.figure == "verdict":
            if self.equals is None or any(bound is not None for bound in bounds):
                raise ValueError('verdict: write equals = "CONTIGUOUS", and no other limit')
        elif self.equals is not None or all(bound is None for bound in bounds):
            raise ValueError(
                f"{self.figure}: needs at_least, at_most, at_least_base or at_most_base; equals is for verdict"
            )
        return self


class SearchSettings(Model):
    """Settings of the sampler, which do not change the objectives."""

    sampler: Sampler = "tpe"
    trials: Annotated[int, Field(ge=1, le=1_000_000, description="designs to judge")] = 200
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 0
    batch: Annotated[
        int, Field(ge=1, le=256, description="designs proposed at once, before the sampler learns from them")
    ] = 4


class SearchSpace(Model):
    """A complete search space, including its base design."""

    name: FileName
    description: str = ""
    base: SensorDesign
    fields: Annotated[tuple[SpaceField, ...], Field(min_length=1, max_length=64)]
    objectives: Annotated[tuple[SpaceObjective, ...], Field(min_length=1, max_length=6)]
    constraints: tuple[SpaceConstraint, ...] = ()
    accuracy: Annotated[
        Literal["draft", "search", "score"],
        Field(description="of the light: draft is the quickest, search quick, score that of `optopad score`"),
    ] = "search"
    search: SearchSettings = SearchSettings()

    @model_validator(mode="after")
    def _is_sensible(self) -> Self:
        for what, names in (
            ("fields", [field.path for field in self.fields]),
            ("objectives", [objective.figure for objective in self.objectives]),
        ):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ValueError(f"{what}: {', '.join(twice)} is given twice; remove one")
        _require_no_overlap([field.path for field in self.fields])
        wanted = {objective.figure for objective in self.objectives}
        if wanted <= NO_OBJECTIVE_ALONE:
            raise ValueError(
                f"objectives: {', '.join(sorted(wanted))} alone favours thin pads with half the signal; "
                "add strength, resolvable_steps, evenness or a bound"
            )
        _require_consistent(self.constraints)
        if self.search.sampler == "grid":
            for field in self.fields:
                if field.choices is None and field.step is None:
                    raise ValueError(f"{field.path}: the grid sampler needs a step or choices")
        for field in self.fields:
            self._require_usable(field)
        return self

    def _require_usable(self, field: SpaceField) -> None:
        """Raise ValueError if a field does not exist, or if its range or choices have values that are not valid."""
        document = self.base.model_dump(mode="json")
        _require_path(document, field.path)
        values = (
            field.choices
            if field.choices is not None
            else (self._typed(field, field.low), self._typed(field, field.high))
        )
        for value in values:
            try:
                self.base.with_(**{field.path: value})
            except DesignError as err:
                raise ValueError(f"{field.path}: {_shown(value)}: {_last_line(err)}") from None

    def is_whole(self, field: SpaceField) -> bool:
        """Whether a range has integers only: its ends and step are integers, and the design accepts no other values."""
        numbers = [value for value in (field.low, field.high, field.step) if value is not None]
        if field.choices is not None or any(value != round(value) for value in numbers):
            return False
        assert field.low is not None
        try:
            self.base.with_(**{field.path: field.low + 0.5})
        except DesignError:
            return True
        return False

    def _typed(self, field: SpaceField, value: float | None) -> Value:
        assert value is not None
        return round(value) if self.is_whole(field) else value

    def values_of(self, field: SpaceField) -> list[Value] | None:
        """All values of a field in order, choices as labels; None for a range without steps."""
        if field.choices is not None:
            return list(field.labels)
        assert field.low is not None
        assert field.high is not None
        if self.is_whole(field):
            return list(range(round(field.low), round(field.high) + 1, round(field.step or 1.0)))
        if field.step is None:
            return None
        count = math.floor((field.high - field.low) / field.step + 1e-6) + 1
        return [round(field.low + number * field.step, ROUND_DIGITS) for number in range(count)]

    def changed(self, parameters: Mapping[str, Value]) -> SensorDesign:
        """The base design with the values of a point.

        Parameters
        ----------
        parameters : value of each field by dotted path; choices as labels

        Raises
        ------
        DesignError : the values are not compatible with each other.
        """
        changes: dict[str, Any] = {}
        for field in self.fields:
            value = parameters[field.path]
            if field.choices is not None:
                changes[field.path] = field.choices[field.labels.index(str(value))]
            else:
                changes[field.path] = round(value, ROUND_DIGITS) if isinstance(value, float) else value
        return self.base.with_(**dict(sorted(changes.items(), key=lambda item: item[0].count("."))))

    def design_at(self, parameters: Mapping[str, Value]) -> SensorDesign:
        """The base design with the values of a point, named after the search.

        Raises
        ------
        DesignError : the values are not compatible with each other.
        """
        return self.changed(parameters).with_(name=self.name, description=f"found by the search {self.name}")

    def base_parameters(self) -> dict[str, Value] | None:
        """The base design as a point of the space; None if it is outside the space."""
        found = dict[str, Value]()
        for field in self.fields:
            value = self.base_value(field)
            if value is None:
                return None
            found[field.path] = value
        return found

    def base_value(self, field: SpaceField) -> Value | None:
        """The base design's value of a field, as a label for choices; None if the field does not permit it."""
        if field.choices is not None:
            same = (label for label in field.labels if _is_same(self.base, field.path, json.loads(label)))
            return next(same, None)
        value = get_at(self.base.model_dump(mode="json"), field.path)
        return self._typed(field, float(value)) if _is_in(field, value) else None

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the space, apart from name, description and the sampler's settings, as 64 hexadecimal digits."""
        document = self.model_dump(mode="json", exclude={"name", "description", "search", "base"})
        return hashlib.sha256(canonical_json(document | {"base": self.base.digest}).encode()).hexdigest()


def load_space(path: str | Path) -> SearchSpace:
    """Load a search space from a file, or a packaged one by its name.

    In the file, `base` names a preset, or a design file in the same folder.

    Raises
    ------
    DesignError : the file is missing or has invalid fields; the message lists them with a remedy.
    """
    file = packaged_or_own(
        path, "optopad.design.search.spaces", SPACES, kind="search space", listed_as="packaged spaces"
    )
    document = read_toml(file)
    base = document.get("base")
    if not isinstance(base, str):
        raise DesignError(
            f"{file}: base: {base!r} is refused: name a preset ({', '.join(PRESETS)}) or a design file"
        )
    return space_from(document | {"base": _base(base, file).model_dump(mode="json")}, where=str(file))


def space_from(document: dict[str, Any], *, where: str) -> SearchSpace:
    """Make a search space from nested plain data, in which `base` is a complete design.

    Parameters
    ----------
    where : origin of the data, for messages

    Raises
    ------
    DesignError : invalid fields; the message lists each with its limit and a remedy.
    """
    try:
        return SearchSpace.model_validate_json(json.dumps(document, default=str))
    except ValidationError as err:
        refused = design_error(err, where)
        text = str(refused).replace("not a usable design", "not a usable search space", 1)
        raise DesignError(
            text.replace("is not a field of a design", "is not a field of a search space")
        ) from None


def _base(name: str, file: Path) -> SensorDesign:
    beside = file.parent / name
    try:
        is_file = beside.is_file()
    except OSError as err:  # name too long, or folder without access
        raise DesignError(f"{file}: base: {shown(name)}: {err.strerror}; correct the name") from None
    if name in PRESETS and not is_file:
        return preset(name)
    if not is_file:
        near = nearest(name, PRESETS)
        hint = f"did you mean {near[0]}?" if near else f"presets: {', '.join(PRESETS)}"
        raise DesignError(f"{file}: base: {name!r} is neither a preset nor a design file next to it; {hint}")
    return load_design(beside)


def _require_figure(name: str, known: tuple[str, ...]) -> None:
    if name not in known:
        near = nearest(name, known)
        hint = f"did you mean {', '.join(near)}?" if near else f"there are {', '.join(known)}"
        raise ValueError(f"figure: {name!r} is no figure of a design; {hint}")


def _require_path(document: dict[str, Any], path: str) -> None:
    """Raise ValueError for a dotted path that does not exist in a design or that must not vary."""
    top = path.split(".", 1)[0]
    if top in _FIXED and top != "part_measurements":
        raise ValueError(f"{path}: cannot vary; vary fields of parts, layers, materials or the layout")
    keys = path.split(".")
    if top == "layout" and len(keys) == 3 and keys[1].isdigit() and int(keys[1]) < len(document["layout"]):
        pattern = _PATTERNS[document["layout"][int(keys[1])]["pattern"]]
        known = tuple(f"layout.{keys[1]}.{name}" for name in pattern)
        if path not in known:
            raise ValueError(str(unknown_path(path, known)))
        return
    try:
        set_at(json.loads(json.dumps(document)), path, None, known=known_paths(SensorDesign))
    except DesignError as err:
        raise ValueError(str(err)) from None


def _require_no_overlap(paths: list[str]) -> None:
    for path in paths:
        inner = [other for other in paths if other.startswith(f"{path}.")]
        if inner:
            raise ValueError(
                f"fields: {inner[0]} is part of {path}, which varies as a whole; keep one of the two"
            )


def _require_consistent(constraints: tuple[SpaceConstraint, ...]) -> None:
    """Raise ValueError if limits of one figure contradict each other, so that no design can satisfy them."""
    for figure in dict.fromkeys(constraint.figure for constraint in constraints):
        said = [constraint for constraint in constraints if constraint.figure == figure]
        if len({one.equals for one in said}) > 1:
            raise ValueError("constraints: verdict cannot equal two things at once; remove one")
        for low_name, high_name, unit in (
            ("at_least", "at_most", ""),
            ("at_least_base", "at_most_base", " times the base's"),
        ):
            lows = [value for one in said if (value := getattr(one, low_name)) is not None]
            highs = [value for one in said if (value := getattr(one, high_name)) is not None]
            if lows and highs and max(lows) > min(highs):
                raise ValueError(
                    f"constraints: {figure} cannot be at least {max(lows):g} and at most {min(highs):g}{unit}; "
                    "they contradict each other"
                )


def _divides(step: float, span: float) -> bool:
    return abs(span / step - round(span / step)) < 1e-6 and round(span / step) >= 1


def _is_in(field: SpaceField, value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    assert field.low is not None
    assert field.high is not None
    if not field.low <= value <= field.high:
        return False
    return field.step is None or value == field.low or _divides(field.step, value - field.low)


def _is_same(base: SensorDesign, path: str, choice: Any) -> bool:
    return base.with_(**{path: choice}).digest == base.digest


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _last_line(err: DesignError) -> str:
    return str(err).splitlines()[-1].strip()
