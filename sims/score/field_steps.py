"""Sensitivity to each field of a design: how verdict and accuracy bounds change if the field changes by a small step.

One field at a time is stepped down and up; a gain that follows from a rule is determined again for each step. Each
design gets a short verdict, like manufactured units (`optopad.sims.verdict.builds`): facing rows are judged by their
governing pair, a pad at its location of least margin. The Cramér-Rao bounds of one frame (`optopad.sims.bounds`) are
computed for the same location, at half the deepest press.

Two simplifications: the location of least margin is taken as fixed, and fields are never stepped together. The light is
as coarse as for manufactured units, so changes of the margin have errors of some tenths of a noise unit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from optopad.design.draft import Draft
from optopad.design.errors import OptopadError
from optopad.design.fields.base import get_at
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.shape.cavity import cavity_of, is_facing_rows
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import CLEAR, HEIGHTS, TARGET, cheap_fields
from optopad.sims.bounds.fisher import Steps, bounds_of, sensitivity
from optopad.sims.bounds.observability import own_readout
from optopad.sims.score.build_tolerance import governing_judge
from optopad.sims.score.result import ContinuityScore
from optopad.sims.verdict.builds import BuildJudge, accuracy_of_builds
from optopad.sims.verdict.tolerance import Effect, FieldStep, FieldSteps

STEPS = {**dict.fromkeys(HEIGHTS, 0.1), CLEAR: 0.5, TARGET: 25.0}
"""Step of each field by its name, in the field's own unit."""
ALONG_STEP_MM = 0.5
"""Step of a pitch, or of a shift of components along a wall [mm]."""
DIGITS = 9


def stepped_fields(design: SensorDesign) -> Iterator[tuple[str, float]]:
    """Paths of the fields that cost little to change (`cheap_fields`), each with its step in the field's unit."""
    for path in cheap_fields(design):
        yield path, STEPS.get(path, ALONG_STEP_MM)


def with_field_steps(
    design: SensorDesign, score: ContinuityScore, *, seed: int = 0, on_step: OnStep | None = None
) -> ContinuityScore:
    """A score with its sensitivity to a small step of each field.

    Parameters
    ----------
    score : score of that design, with the map if the design is a pad. If it is out of the models' scope, it is returned
        unchanged
    on_step : called with the name of the running stage and the share of it that is done, 0 to 1
    """
    if score.readout is None:
        return score
    tell = on_step or (lambda _stage, _share: None)
    name, judge, place_mm = governing_judge(design, score, seed)
    as_designed = _effect(design, judge, place_mm, seed, is_facing=score.is_facing_rows)
    fields = list(stepped_fields(design))
    rows = []
    for done, (path, step) in enumerate(fields):
        sides = [_stepped(design, path, side * step) for side in (-1.0, 1.0)]
        found = [
            None if build is None else _tried(build, judge, place_mm, seed, is_facing=score.is_facing_rows)
            for build in sides
        ]
        rows.append(FieldStep(path=path, step=step, lower=found[0], higher=found[1]))
        tell("what matters", (done + 1) / len(fields))
    at_mm = (*place_mm, 0.5 * design.operating.max_depth_mm)
    return replace(
        score, steps=FieldSteps(judged=name, bounds_at_mm=at_mm, as_designed=as_designed, rows=tuple(rows))
    )


def _stepped(design: SensorDesign, path: str, by: float) -> SensorDesign | None:
    """The design with one field changed by a step; None if the result breaks a rule or is judged by other pairs."""
    value = round(float(get_at(design.model_dump(mode="json"), path)) + by, DIGITS)
    try:
        build = design.with_(**{path: value})
        require_valid(build)
    except OptopadError:
        return None
    kinds = {is_facing_rows(cavity_of(one)) for one in (design, build)}
    return build if len(kinds) == 1 else None  # else the two would be judged by different pairs or locations


def _tried(
    build: SensorDesign, judge: BuildJudge, place_mm: tuple[float, float], seed: int, *, is_facing: bool
) -> Effect | None:
    """Usable depth, deadband, margin and bounds of a stepped design; None if the models do not cover it."""
    try:
        return _effect(build, judge, place_mm, seed, is_facing=is_facing)
    except OptopadError:
        return None


def _effect(
    build: SensorDesign, judge: BuildJudge, place_mm: tuple[float, float], seed: int, *, is_facing: bool
) -> Effect:
    draft = Draft.of(build)
    brief = judge(draft)
    location_mm, depth_mm = _bounds_mm(draft, place_mm, seed, is_facing=is_facing)
    return Effect(
        usable_mm=build.operating.max_depth_mm if brief.usable_mm is None else brief.usable_mm,
        deadband_mm=brief.deadband_mm,
        margin=brief.margin,
        location_mm=location_mm,
        depth_mm=depth_mm,
    )


def _bounds_mm(
    draft: Draft, place_mm: tuple[float, float], seed: int, *, is_facing: bool
) -> tuple[float | None, float | None]:
    """Bounds on location and on depth at half the deepest press [mm]; each is None if not resolved.

    For facing rows the bound on location is None, and the bound on depth takes the location as known.
    """
    settings = accuracy_of_builds(draft)
    readout = own_readout(draft, seed=seed, accuracy=settings)  # traced with these settings already
    voxel = np.array([[*place_mm, 0.5 * draft.design.operating.max_depth_mm]])
    found = bounds_of(sensitivity(draft, voxel, readout, accuracy=settings, seed=seed, steps=Steps()))
    told = (np.inf, found.depth_alone_mm[0]) if is_facing else (found.location_mm[0], found.depth_mm[0])
    location_mm, depth_mm = (float(value) if np.isfinite(value) else None for value in told)
    return location_mm, depth_mm
