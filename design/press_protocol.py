"""Press protocols for data collection: sets of press locations and a schedule of depths, in ambient light or darkness.

A protocol file is TOML (docs/how-to/simulate-data-set.md). The protocols `piacenza2017` and `piacenza2017-quick` are
packaged. Depth is positive into the pad; 0 or less means no contact. Locations are in the workspace of the design, or
in the smaller `workspace_mm` if given. Grids are centred in this area. The order of locations is shuffled when data are
simulated. Random locations depend only on their set's `place_seed`, so the signals without noise do not depend on the
seed for noise and order.

Load protocols define the motion of a tip while its load is measured: steps to a depth and back, with pauses. Their
values and sources are in `data/load_protocols.toml`. The contact model computes the load.
"""

from __future__ import annotations

import hashlib
import json
import math
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, ValidationError, model_validator

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import DesignError, InputError, ModelScopeError
from optopad.design.fields.base import FileName, Model, nearest
from optopad.design.fields.packaged import data_table, packaged_or_own
from optopad.design.fields.quantity import Quantity, Text
from optopad.design.fields.validation import design_error
from optopad.design.io import read_toml
from optopad.design.recordings import SetEntry
from optopad.design.shape.cavity import workspace_of
from optopad.design.shape.outline import Outline, rectangle
from optopad.design.spec import SensorDesign, canonical_json

QUICK_PROTOCOL = "piacenza2017-quick"
"""Name of the packaged protocol of a quick prediction."""


class LoadProtocol(Model):
    """Motion of a tip while its load is measured: equal steps to the deepest press and back, with pauses."""

    title: Text
    step_mm: Quantity
    deepest_mm: Quantity
    pause_s: Quantity
    speed_mm_per_s: Quantity

    @model_validator(mode="after")
    def _can_be_driven(self) -> Self:
        for name in ("step_mm", "speed_mm_per_s"):
            if not getattr(self, name).value > 0.0:
                raise ValueError(f"{name}: {getattr(self, name).value:g} must be above 0")
        if self.pause_s.value < 0.0:
            raise ValueError(f"pause_s: {self.pause_s.value:g} must be at least 0")
        count = self.deepest_mm.value / self.step_mm.value
        if round(count) < 1 or abs(count - round(count)) > 1e-9:
            raise ValueError(
                f"deepest_mm: {self.deepest_mm.value:g} must be a whole number of steps of {self.step_mm.value:g}"
            )
        return self

    @property
    def steps(self) -> int:
        """Number of steps from contact to the deepest press."""
        return round(self.deepest_mm.value / self.step_mm.value)


@cache
def _packaged() -> dict[str, LoadProtocol]:
    return {name: LoadProtocol.model_validate(row) for name, row in data_table("load_protocols.toml").items()}


def load_protocol(name: str) -> LoadProtocol:
    """A packaged load protocol by its name.

    Raises
    ------
    InputError : no load protocol has this name; the message names a similar one, or all.
    """
    known = _packaged()
    if name not in known:
        near = nearest(name, tuple(known))
        hint = f"did you mean {near[0]}?" if near else f"there are: {', '.join(sorted(known))}"
        raise InputError(f"load protocol: {name!r} is not known; {hint}")
    return known[name]


PROTOCOLS = ("piacenza2017", "piacenza2017-quick")
"""Names of the packaged press protocols."""
MOST_PLACES = 20_000
MOST_DEPTHS = 20_000
MOST_SAMPLES = 5_000_000
SLACK_MM = 1e-9
ROUND_DIGITS = 6
"""Number of decimals to which a depth or location [mm] is rounded."""

Length = Annotated[float, Field(ge=-100.0, le=100.0)]


class DepthSegment(Model):
    """Range of depths in equal steps, with samples at both ends."""

    from_mm: Length
    to_mm: Length
    step_mm: Annotated[float, Field(gt=0.0, le=100.0)]

    @model_validator(mode="after")
    def _reaches_its_end(self) -> Self:
        steps = (self.to_mm - self.from_mm) / self.step_mm
        if steps < -1e-6 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"steps of {self.step_mm:g} from {self.from_mm:g} do not reach {self.to_mm:g} mm; change one of them"
            )
        if steps > MOST_DEPTHS:
            raise ValueError(f"{steps:.0f} steps; give at most {MOST_DEPTHS}")
        return self

    @property
    def depths_mm(self) -> tuple[float, ...]:
        """All depths of the segment, increasing [mm]."""
        count = round((self.to_mm - self.from_mm) / self.step_mm) + 1
        return tuple(round(self.from_mm + k * self.step_mm, ROUND_DIGITS) for k in range(count))


class PressSet(Model):
    """A set of presses: grid or random locations, in ambient light or darkness, for training or test."""

    name: FileName
    role: Literal["train", "test"]
    is_ambient: bool
    grid_mm: Annotated[float | None, Field(gt=0.0, le=200.0, description="spacing of a grid")] = None
    random_places: Annotated[
        int | None,
        Field(ge=1, le=MOST_PLACES, description="number of random locations, uniformly distributed"),
    ] = None
    place_seed: Annotated[
        int,
        Field(ge=0, lt=2**31, description="seed of the random locations; equal seeds give equal locations"),
    ] = 0

    @model_validator(mode="after")
    def _has_one_pattern(self) -> Self:
        if (self.grid_mm is None) == (self.random_places is None):
            raise ValueError(f"{self.name}: give grid_mm or random_places, one of the two")
        return self

    @property
    def info(self) -> SetEntry:
        """The set's entry in a recording of presses."""
        return SetEntry(name=self.name, role=self.role, pattern=self.pattern, is_ambient=self.is_ambient)

    @property
    def pattern(self) -> str:
        """Pattern of the locations: ``grid`` or ``random``."""
        return "random" if self.grid_mm is None else "grid"


def _require_apart(sets: tuple[PressSet, ...]) -> None:
    """Raise ValueError if a training and a test set share random locations, which would make test errors too small."""
    trained = {one.place_seed: one.name for one in sets if one.random_places and one.role == "train"}
    for one in sets:
        if one.random_places and one.role == "test" and one.place_seed in trained:
            raise ValueError(
                f"sets: {one.name} tests at the locations of {trained[one.place_seed]}, which is trained "
                "on; give it another place_seed"
            )


class PressProtocol(Model):
    """Plan of a data collection: the depths of one press, and the sets of locations.

    A file has the same fields (docs/how-to/simulate-data-set.md).
    """

    name: FileName
    description: str = ""
    approach: Annotated[tuple[DepthSegment, ...], Field(min_length=1, max_length=64)]
    retract: Annotated[
        Literal["mirrored", "none"], Field(description="mirrored: the same depths in retraction")
    ] = "mirrored"
    turn: Annotated[
        Literal["once", "twice"],
        Field(description="number of measurements at the deepest point, if mirrored"),
    ] = "twice"
    dwell_s: Annotated[float, Field(gt=0.0, le=3600.0, description="time per sample")] = 0.5
    travel_s: Annotated[float, Field(ge=0.0, le=3600.0, description="time to the next location")] = 2.0
    workspace_mm: Annotated[
        tuple[float, float, float, float] | None,
        Field(description="x0, y0, x1, y1 of the locations; the design's workspace if left out"),
    ] = None
    curves: Annotated[
        Literal["fine", "coarse"],
        Field(
            description="number of depths that a simulation traces: coarse traces two thirds of them, for a first look"
        ),
    ] = "fine"
    sets: Annotated[tuple[PressSet, ...], Field(min_length=1, max_length=64)]

    @model_validator(mode="after")
    def _can_be_run(self) -> Self:
        depths = self.approach_mm
        if not all(a < b for a, b in pairwise(depths)):
            raise ValueError("approach: its depths must rise from segment to segment")
        if depths[-1] <= 0.0:
            raise ValueError(
                f"approach: ends at {depths[-1]:g} mm and touches nothing; go below 0 into the pad"
            )
        names = [one.name for one in self.sets]
        if len(set(names)) < len(names):
            raise ValueError(f"sets: a name is given twice: {', '.join(names)}")
        _require_apart(self.sets)
        box = self.workspace_mm
        if box is not None and not (box[0] <= box[2] and box[1] <= box[3]):
            raise ValueError(f"workspace_mm: {list(box)} is empty; write x0, y0, x1, y1")
        return self

    @property
    def approach_mm(self) -> tuple[float, ...]:
        """Depths of the approach, increasing [mm]."""
        return tuple(depth for segment in self.approach for depth in segment.depths_mm)

    @property
    def deepest_mm(self) -> float:
        """Deepest press [mm]."""
        return self.approach_mm[-1]

    @cached_property
    def depth_mm(self) -> FloatArray:
        """Depth of each sample of one press [mm], shape (sample,): first the approach, then the retraction."""
        down = self.approach_mm
        back = down[::-1][int(self.turn == "once") :] if self.retract == "mirrored" else ()
        return np.array([*down, *back])

    @cached_property
    def is_retracting(self) -> BoolArray:
        """Whether each sample of one press belongs to the retraction, shape (sample,)."""
        return np.arange(len(self.depth_mm)) >= len(self.approach_mm)

    @property
    def press_s(self) -> float:
        """Time of one press, including the travel to the next location [s]."""
        return len(self.depth_mm) * self.dwell_s + self.travel_s

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the content, as 64 hexadecimal digits."""
        return hashlib.sha256(canonical_json(self.model_dump(mode="json")).encode()).hexdigest()

    def places_mm(self, design: SensorDesign) -> tuple[FloatArray, ...]:
        """Press locations of each set in unshuffled order, (location, 2): x, y in the cavity's coordinate system [mm].

        Raises
        ------
        ModelScopeError : the design has no workspace, the protocol presses too deep, or the protocol's workspace
            exceeds the design's.
        InputError : the protocol has too many locations or samples.
        """
        space = self._workspace(design)
        found = tuple(_places_mm(one, number, space) for number, one in enumerate(self.sets))
        samples = sum(map(len, found)) * len(self.depth_mm)
        if samples > MOST_SAMPLES:
            raise InputError(
                f"protocol {self.name}: {samples} samples, at most {MOST_SAMPLES}; widen grid_mm or drop depths"
            )
        return found

    def summary(self, design: SensorDesign) -> dict[str, Any]:
        """Size of the protocol on a design: samples per press, presses per set, total samples and hours."""
        places = self.places_mm(design)
        return {
            "name": self.name,
            "digest": self.digest,
            "points_per_press": len(self.depth_mm),
            "touched_per_press": int((self.depth_mm >= 0.0).sum()),
            "presses": [len(one) for one in places],
            "samples": sum(map(len, places)) * len(self.depth_mm),
            "hours": sum(map(len, places)) * self.press_s / 3600.0,
        }

    def fitted_to(self, design: SensorDesign) -> PressProtocol:
        """The protocol without depths beyond the design's `max_depth_mm`; the same object if it has none."""
        limit = design.operating.max_depth_mm
        if self.deepest_mm <= limit + SLACK_MM:
            return self
        kept = []
        for segment in self.approach:
            depths = [depth for depth in segment.depths_mm if depth <= limit + SLACK_MM]
            if depths:
                kept.append(segment.model_copy(update={"to_mm": depths[-1]}))
        return protocol_from(
            self.model_dump(mode="json") | {"approach": [one.model_dump(mode="json") for one in kept]},
            where=self.name,
        )

    def _workspace(self, design: SensorDesign) -> Outline:
        whole = workspace_of(design)
        if whole.is_empty:
            raise ModelScopeError(
                f"protocol {self.name}: the design has no workspace; lower operating.workspace_margin_mm"
            )
        if self.deepest_mm > design.operating.max_depth_mm + SLACK_MM:
            raise ModelScopeError(
                f"protocol {self.name}: presses to {self.deepest_mm:g} mm, the design is for "
                f"{design.operating.max_depth_mm:g}; raise operating.max_depth_mm, or leave deeper points out (--fit)"
            )
        if self.workspace_mm is None:
            return whole
        x0, y0, x1, y1 = self.workspace_mm
        if not all(whole.contains(x, y) for x in (x0, x1) for y in (y0, y1)):
            raise ModelScopeError(
                f"protocol {self.name}: workspace_mm {list(self.workspace_mm)} leaves the design's, "
                f"{whole.words}; narrow it, or lower operating.workspace_margin_mm"
            )
        return rectangle((x0, y0, x1, y1))


def load_protocol_file(where: str | Path) -> PressProtocol:
    """Load a packaged press protocol by its name, or a protocol file by its path.

    Raises
    ------
    DesignError : the protocol does not exist or has invalid fields; the message lists them with a remedy.
    """
    file = packaged_or_own(
        where, "optopad.design.protocols", PROTOCOLS, kind="protocol", listed_as="packaged"
    )
    return protocol_from(read_toml(file), where=str(file))


def protocol_from(document: dict[str, Any], *, where: str) -> PressProtocol:
    """Make a press protocol from nested plain data; `where` names their origin in error messages.

    Raises
    ------
    DesignError : invalid fields; the message lists each with its limit and a remedy.
    """
    try:
        return PressProtocol.model_validate_json(json.dumps(document, default=str), strict=True)
    except ValidationError as err:
        text = str(design_error(err, where)).replace("not a usable design", "not a usable protocol", 1)
        raise DesignError(
            text.replace("is not a field of a design", "is not a field of a protocol").replace(
                "(see `optopad schema`", "(see docs/how-to/simulate-data-set.md"
            )
        ) from None


def _places_mm(one: PressSet, number: int, space: Outline) -> FloatArray:
    if one.grid_mm is not None:
        x_mm, y_mm = (
            _grid_line_mm(low, high, one.grid_mm)
            for low, high in ((space.x0_mm, space.x1_mm), (space.y0_mm, space.y1_mm))
        )
        if len(x_mm) * len(y_mm) > MOST_PLACES:
            raise InputError(
                f"sets.{number}.grid_mm: {one.grid_mm:g} makes {len(x_mm) * len(y_mm)} locations, at most "
                f"{MOST_PLACES}; widen it"
            )
        return np.array([(x, y) for x in x_mm for y in y_mm if space.contains(x, y, 10.0**-ROUND_DIGITS)])
    rng = np.random.default_rng(one.place_seed)
    return np.round(space.spread(rng.random((one.random_places or 0, 2))), ROUND_DIGITS)


def _grid_line_mm(low_mm: float, high_mm: float, step_mm: float) -> FloatArray:
    steps = math.floor((high_mm - low_mm) / step_mm + 1e-9)
    first = (low_mm + high_mm - steps * step_mm) / 2
    return np.round(first + step_mm * np.arange(steps + 1), ROUND_DIGITS)
