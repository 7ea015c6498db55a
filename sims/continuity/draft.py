"""A verdict in seconds, for a layout that is being moved about: coarse light, depths and bounds (`SETTINGS["draft"]`).

    curves_under   pairs whose chord runs under one press, judged by themselves      a third of a second
    draft_score    verdict and map of the pad, or of all facing pairs                one to six seconds
    with_draft_bounds   place and depth at best, at two depths                       two to ten more

On a pad of 48 pairs and two cores; the longer times where no symmetry helps. Places of a pad that are nearly blind, or
nearly not, are traced again, finely. Left out: tolerance, what matters, single pairs of a pad.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from design.progress import OnStep
from design.rules.check import require_valid
from design.shape.cavity import CavityGeometry
from design.shape.pairs import beside_chord, judged_pairs, mask_of, pair_name
from design.spec import SensorDesign
from sims.contact.indentation import round_press
from sims.continuity.judge import Judge
from sims.continuity.result import ContinuityScore, JudgedPair
from sims.continuity.scoring import verdict_of
from sims.optics.tracing import trace
from sims.press.depths import depth_schedule_mm
from sims.readings.readout import Readout
from sims.verdict.builds import score_curves
from sims.verdict.presses import accuracy_of_pairs, curves_of, states_of

Pair = tuple[int, int]

MOST_PAIRS = 8
"""Pairs under a press that are traced at most, the nearest first."""
FEWEST_PAIRS = 3
"""Where no chord runs under the tip, so many of the nearest."""


@dataclass(frozen=True, kw_only=True)
class PlaceCurves:
    """Pairs under one press, each judged by itself.

    Attributes
    ----------
    place_mm : (x, y) of the press [mm]
    readout : gains of the receivers
    pairs : the nearest chord first
    is_draft : whether by a draft's light, not a score's
    """

    place_mm: tuple[float, float]
    readout: Readout
    pairs: tuple[JudgedPair, ...]
    is_draft: bool


def pairs_under(cavity: CavityGeometry, place_mm: tuple[float, float]) -> tuple[Pair, ...]:
    """Judged pairs whose chord runs under the tip at a place, the nearest first; the nearest few where none does."""
    distances = {pair: beside_chord(cavity, pair, place_mm)[0] for pair in judged_pairs(cavity)}
    nearest = sorted(distances, key=lambda pair: round(distances[pair], 6))
    under = [pair for pair in nearest if distances[pair] <= cavity.tip_radius_mm]
    return tuple(under[:MOST_PAIRS] or nearest[:FEWEST_PAIRS])


def curves_under(
    design: SensorDesign,
    place_mm: tuple[float, float],
    *,
    is_draft: bool = True,
    seed: int = 0,
    on_step: OnStep | None = None,
) -> PlaceCurves:
    """Light of the pairs under a press against its depth, and what each tells.

    Parameters
    ----------
    place_mm : (x, y) in the cavity frame [mm]
    is_draft : a draft's light and depths, on a round pad's surface; else those of a score's single pairs

    Raises
    ------
    DesignError, ModelScopeError : a design that breaks a rule, a press that the models do not cover.
    """
    require_valid(design)
    judge = Judge(design, "draft" if is_draft else "score", seed=seed)
    depth_mm = depth_schedule_mm(judge.deepest_mm, judge.settings.step_mm)
    pairs = pairs_under(judge.cavity, place_mm)
    press = round_press(design, at_mm=place_mm) if is_draft else None
    light = trace(
        design,
        states_of(np.array([place_mm]), depth_mm),
        profile=None if press is None else [press.at(depth) for depth in depth_mm.tolist()],
        accuracy=accuracy_of_pairs(design, judge.settings.pairs),
        seed=seed,
        pairs=mask_of(pairs, judge.cavity),
        on_step=None if on_step is None else lambda done, total: on_step("curves", done / total),
    )
    curves = [curves_of(light, pair, place_mm, slice(None), depth_mm) for pair in pairs]
    return PlaceCurves(
        place_mm=place_mm,
        readout=judge.readout,
        pairs=tuple(
            JudgedPair(
                name=pair_name(judge.cavity, one.pair),
                curves=one,
                score=score_curves(design, one, judge.readout),
            )
            for one in curves
        ),
        is_draft=is_draft,
    )


def draft_score(design: SensorDesign, *, seed: int = 0, on_step: OnStep | None = None) -> ContinuityScore:
    """Verdict and map in seconds; bounds come with `with_draft_bounds`.

    Raises
    ------
    DesignError : the design breaks a rule.
    """
    return verdict_of(design, "draft", seed=seed, on_step=on_step)


def with_draft_bounds(
    design: SensorDesign, draft: ContinuityScore, *, on_step: OnStep | None = None
) -> ContinuityScore:
    """The same with what one frame tells of place and depth at best, and the lightest press felt; pads only."""
    if draft.pad_map is None or draft.readout is None or draft.pad_signals is None:
        return draft
    judge = Judge(design, "draft", seed=draft.seed, on_step=on_step)
    judge.take(draft.readout, draft.pad_map, draft.pad_signals)
    return replace(draft, bounds=judge.bounds)
