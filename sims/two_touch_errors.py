"""Errors of a model that knows two touches, by the distance between them; from data, or from simulated frames.

A frame of two touches counts as found if the model reports two. Its touches are then matched to the true ones: of both
assignments, the one with the smaller sum of distances. A frame of one touch counts as right if the model reports one.
Frames with a touch of less than `LEAST_MM` are left out, because such a touch may not be detected alone either.

Simulated states are single touches at random places and depths, and random pairs of these, equally many in every row of
the table. Their light is

    ratio of both = ratio(A) ratio(B) + what both change together

with the ratios of single touches traced one by one, and the rest by the method for grids (`optopad.sims.touches`). The
signal map has its own light of another seed, so its errors are in the result. Noise and drift are those of the signal
chain, drawn for each test set of the protocol. Left out: errors of the stage, as the true places are those of the tips;
loose walls, and the memory of a pad.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.progress import OnStep, silent
from optopad.design.recordings import signals_of
from optopad.sims import touches_score
from optopad.sims.contact.held.tips import MOST_TIPS, deepest_mm
from optopad.sims.contact.scope import contact_of
from optopad.sims.learning.inference.signal_map import FRAMES_AT_ONCE
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.inference.two_touches import (
    Touches,
    found_touches,
    joined_touches,
    require_one_or_two,
    require_two_touches,
)
from optopad.sims.learning.together_fit import matched_to
from optopad.sims.optics.tracing import trace
from optopad.sims.readings.press_data import PressData
from optopad.sims.readings.protocol import ProtocolCurves
from optopad.sims.readings.signal_chain import chain_of
from optopad.sims.touches import changes_together

LEAST_MM = 0.5
"""Least depth of a touch in the tables [mm]."""
ROWS_RADII = (2.0, 2.5, 3.0, 4.0, 6.0, np.inf)
"""Limits of the tables' rows: distances between the touches over the tip radius [-]. The first row has nearer ones as
well: tips of unequal depth need a little less in the plane than two radii."""
STATES, QUICK_STATES = (100, 40), (40, 8)
"""Simulated single touches, and pairs of these in each row."""
DRAWS = 3
"""Draws of drift for each test set, with a frame of each state."""
SEED = 860_011
"""Number added to the seed, so that the states' light and noise are none of the training."""


def require_touches(touches: int, draft: Draft | None = None) -> None:
    """Check the number of touches that a model is to know.

    Raises
    ------
    InputError : it is not 1 or 2.
    ModelScopeError : two touches are asked for on a design for which they are not modelled.
    """
    require_one_or_two(touches)
    if touches == MOST_TIPS and draft is not None:
        touches_score.require_touches(draft)


def require_deep(draft: Draft) -> None:
    """Refuse a pad whose touches are all too light to be judged; raises `ModelScopeError`."""
    deepest = min(draft.design.operating.max_depth_mm, deepest_mm(contact_of(draft.design)))
    if deepest < 2.0 * LEAST_MM:
        raise ModelScopeError(
            f"touches: two are judged from {LEAST_MM:g} mm deep, and are modelled to {deepest:.2g} mm on this pad; "
            f"needs {2.0 * LEAST_MM:g} mm: raise operating.max_depth_mm, or take a thicker layer or a larger tip"
        )


def knows_two(model: TouchModel) -> bool:
    """Whether a model was trained for two touches."""
    return getattr(model, "together", None) is not None


@dataclass(frozen=True, kw_only=True)
class PairRow:
    """Frames of two touches at distances within a range.

    Attributes
    ----------
    from_mm, to_mm : least and largest distance in x and y [mm]; the last row has no largest
    frames : number of frames
    found : share in which the model reports two touches [-]
    location_mm, depth_mm : median and 95th percentile of both touches' errors in frames that are found [mm]; None if
        there are none
    """

    from_mm: float
    to_mm: float
    frames: int
    found: float
    location_mm: tuple[float, float] | None
    depth_mm: tuple[float, float] | None

    def radii(self, radius_mm: float) -> tuple[float, float]:
        """Least and largest distance over the tip radius [-]."""
        return self.from_mm / radius_mm, self.to_mm / radius_mm


@dataclass(frozen=True, kw_only=True)
class TwoTouchErrors:
    """How well a model tells two touches from one.

    Attributes
    ----------
    learner : name of the model
    radius_mm : tip radius of the rows [mm]
    rows : frames of two touches by their distance
    single_frames : number of frames of one touch
    called : shares of these in which the model reports none, one and two touches [-]; None if there are no such frames
    """

    learner: str
    radius_mm: float
    rows: tuple[PairRow, ...]
    single_frames: int
    called: tuple[float, float, float] | None

    def to_json(self) -> dict[str, Any]:
        """The table as plain data; the open end of the last row is null."""
        called = None if self.called is None else dict(zip(("none", "one", "two"), self.called, strict=True))
        return {
            "learner": self.learner,
            "tip_radius_mm": self.radius_mm,
            "least_depth_mm": LEAST_MM,
            "separations": [
                {
                    "from_mm": row.from_mm,
                    "to_mm": row.to_mm if np.isfinite(row.to_mm) else None,
                    "from_radii": row.from_mm / self.radius_mm,
                    "to_radii": row.to_mm / self.radius_mm if np.isfinite(row.to_mm) else None,
                    "frames": row.frames,
                    "second_found": row.found,
                    "location_mm": _spread_json(row.location_mm),
                    "depth_error_mm": _spread_json(row.depth_mm),
                }
                for row in self.rows
            ],
            "single": {"frames": self.single_frames, "called": called},
        }


def _spread_json(spread: tuple[float, float] | None) -> dict[str, float] | None:
    return None if spread is None else {"median": spread[0], "p95": spread[1]}


def two_touch_errors(
    learner: str, found: Touches, touches_mm: FloatArray, radius_mm: float
) -> TwoTouchErrors:
    """Compare what a model reports with the true touches.

    Parameters
    ----------
    found : what the model reports of n frames
    touches_mm : (n, 2, 3) x, y, depth of the true touches [mm]; one with a depth of 0 or less, or NaN, is absent
    """
    is_touch = touches_mm[..., 2] > 0.0
    is_judged = _is_judged(touches_mm)
    single, pair = (np.flatnonzero(is_judged & (is_touch.sum(axis=1) == count)) for count in (1, 2))
    rows = []
    apart_mm = np.hypot(*(touches_mm[pair, 0] - touches_mm[pair, 1])[:, :2].T)
    off = found.press_mm[pair] - matched_to(touches_mm[pair], found.press_mm[pair])
    location_mm, depth_mm = np.hypot(off[..., 0], off[..., 1]), np.abs(off[..., 2])
    is_found = found.count[pair] == MOST_TIPS
    for low, high in pairwise(ROWS_RADII):
        least = 0.0 if low == ROWS_RADII[0] else low * radius_mm
        within = (apart_mm >= least) & (apart_mm < high * radius_mm)
        if within.any():
            rows.append(
                PairRow(
                    from_mm=low * radius_mm,
                    to_mm=high * radius_mm,
                    frames=int(within.sum()),
                    found=float(is_found[within].mean()),
                    location_mm=_spread(location_mm[within & is_found]),
                    depth_mm=_spread(depth_mm[within & is_found]),
                )
            )
    counts = found.count[single]
    none, one, two = (float((counts == count).mean()) if len(single) else 0.0 for count in range(3))
    return TwoTouchErrors(
        learner=learner,
        radius_mm=radius_mm,
        rows=tuple(rows),
        single_frames=len(single),
        called=(none, one, two) if len(single) else None,
    )


def _spread(errors_mm: FloatArray) -> tuple[float, float] | None:
    if not errors_mm.size:
        return None
    return float(np.median(errors_mm)), float(np.percentile(errors_mm, 95.0))


def errors_on_data(
    learner: str, model: TouchModel, data: PressData, on_step: OnStep = silent
) -> TwoTouchErrors:
    """Errors of a model of two touches on frames of a data set; the rows are in radii of the model's tip.

    Raises
    ------
    InputError : more than two tips touch in a frame, or the model knows one touch.
    """
    together = require_two_touches(model).together
    assert together is not None
    if (many := data.touch_count > MOST_TIPS).any():
        raise InputError(
            f"data: {many.sum()} of {len(many)} frames have {data.touch_count.max()} touches, first in sample "
            f"{int(many.argmax()) + 1}; the models know one or two; drop these frames"
        )
    tips = np.concatenate([data.press_mm[:, None], data.others_mm], axis=1)
    tips = np.where(tips[..., 2:] > 0.0, tips, np.nan)
    first = np.argsort(np.isnan(tips[..., 2]), axis=1, kind="stable")[:, :MOST_TIPS]
    touches_mm = np.take_along_axis(tips, first[..., None], axis=1)
    if touches_mm.shape[1] < MOST_TIPS:
        touches_mm = np.pad(touches_mm, ((0, 0), (0, 1), (0, 0)), constant_values=np.nan)
    judged = np.flatnonzero(_is_judged(touches_mm) & (touches_mm[..., 2] > 0.0).any(axis=1))
    signals, parts = data.features().astype(np.float64)[judged], []
    for start in range(0, max(len(judged), 1), FRAMES_AT_ONCE):
        parts.append(found_touches(model, signals[start : start + FRAMES_AT_ONCE]))
        on_step("evaluation of two touches", min(start + FRAMES_AT_ONCE, len(judged)) / max(len(judged), 1))
    return two_touch_errors(learner, joined_touches(parts), touches_mm[judged], together.radius_mm)


def _is_judged(touches_mm: FloatArray) -> BoolArray:
    """Whether no touch of a frame (n, 2, 3) is so light that it may not be found alone."""
    is_light = (touches_mm[..., 2] > 0.0) & (touches_mm[..., 2] < LEAST_MM)
    return np.asarray(~is_light.any(axis=1))


def predicted_errors(
    learner: str,
    model: TouchModel,
    curves: ProtocolCurves,
    *,
    quick: bool,
    seed: int,
    on_step: OnStep,
) -> TwoTouchErrors:
    """Errors of a model of two touches on simulated frames of random single touches and pairs.

    Parameters
    ----------
    curves : light of the protocol, whose test sets have the noise and drift

    Raises
    ------
    ModelScopeError : the contact or light model does not cover two touches on the design.
    """
    draft, rng = Draft.of(curves.design), np.random.default_rng(seed + SEED)
    touches_mm = drawn_touches(draft, *(QUICK_STATES if quick else STATES), rng)
    signals = frames_of(touches_mm, curves, rng, seed=seed + SEED, on_step=on_step)
    found = found_touches(model, np.concatenate(signals))
    on_step("evaluation of two touches", 1.0)
    radius_mm = draft.design.indenter.tip_radius_mm
    return two_touch_errors(learner, found, np.tile(touches_mm, (len(signals), 1, 1)), radius_mm)


def frames_of(
    touches_mm: FloatArray, curves: ProtocolCurves, rng: np.random.Generator, *, seed: int, on_step: OnStep
) -> list[FloatArray]:
    """Simulated frames (n, pair) of touches (n, 2, 3), once for each test set and draw of its drift [counts]."""
    chain, untouched = chain_of(curves.design, curves.readout), curves.curves.untouched
    ratios = _ratios(Draft.of(curves.design), touches_mm, seed, on_step)
    flux = ratios.reshape(-1, *untouched.shape) * untouched
    signals, sets = list[FloatArray](), [one for one in curves.protocol.sets if one.role == "test"]
    for one in sets * DRAWS:
        drawn = chain.draw_set(rng, is_ambient=one.is_ambient)
        counts = chain.counts(flux, rng.uniform(0.0, 1.0, len(flux)), rng, drawn=drawn)
        signals.append(signals_of(counts).reshape(len(flux), -1).astype(np.float64))
        on_step("evaluation of two touches", 0.5 + 0.1 * len(signals) / (DRAWS * len(sets)))
    return signals


def drawn_touches(draft: Draft, singles: int, pairs: int, rng: np.random.Generator) -> FloatArray:
    """Random single touches, then pairs of these, at most `pairs` in each row of the table (n, 2, 3) [mm]."""
    places = draft.workspace.spread(rng.uniform(size=(singles, 2)))
    contact, most_mm = contact_of(draft.design), draft.design.operating.max_depth_mm
    deepest = [min(most_mm, deepest_mm(contact, (x, y))) for x, y in places.tolist()]
    touches = np.column_stack([places, rng.uniform(LEAST_MM, deepest)])
    first, second = np.triu_indices(singles, 1)
    apart = np.hypot(*(places[first] - places[second]).T) / draft.design.indenter.tip_radius_mm
    chosen = [
        rng.permutation(np.flatnonzero((apart >= low) & (apart < high)))[:pairs]
        for low, high in pairwise(ROWS_RADII)
    ]
    both = np.stack([touches[first], touches[second]], axis=1)[np.concatenate(chosen)]
    alone = np.stack([touches, np.full_like(touches, np.nan)], axis=1)
    return np.concatenate([alone, both])


def _ratios(draft: Draft, touches_mm: FloatArray, seed: int, on_step: OnStep) -> FloatArray:
    """Light over untouched light (n, pair) of touches (n, 2, 3)."""
    is_touch = touches_mm[..., 2] > 0.0
    presses, number = np.unique(touches_mm[is_touch], axis=0, return_inverse=True)
    light = trace(
        draft,
        np.concatenate([[[*draft.plan.centre_mm, 0.0]], presses]),
        accuracy="draft",
        seed=seed,
        on_step=lambda done, total: on_step("evaluation of two touches", 0.2 * done / total),
    )
    flux = light.flux.reshape(len(light.flux), -1)
    ratio = np.where(flux[0] > 0.0, flux[1:] / np.where(flux[0] > 0.0, flux[0], 1.0), 1.0)
    single = np.ones((*is_touch.shape, flux.shape[1]))
    single[is_touch] = ratio[number.reshape(-1)]
    ratios = single.prod(axis=1)
    both = np.flatnonzero(is_touch.all(axis=1))
    if len(both):
        (more,) = changes_together(
            draft,
            touches_mm[both],
            seeds=(seed,),
            on_step=lambda done, total: on_step("evaluation of two touches", 0.2 + 0.3 * done / total),
        )
        ratios[both] += more
    return np.asarray(np.maximum(ratios, 0.0))
