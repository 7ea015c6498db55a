"""What a search asks of a design: the score's figures, cheapest first, and no more of them than are wanted.

    rules ──► parts and height ──► untouched light ──► pairs ──► map of the pad ──► bounds
      each step ends the judging when a limit can no longer be met: the reason is kept

The stages are those of a score (`sims.continuity.judge`), with the settings of a search, or of a score. The figures
are those of the score's headline: of facing rows the governing pair's, of a pad the medians over judged pairs. Left
out: the tolerance of unmeasured parameters.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np

from design.errors import DesignError, ModelScopeError
from design.rules.check import check
from design.search.figures import BOUND_FIGURES
from design.search.judged import Judged, Limit
from design.shape.cavity import CavityGeometry
from design.spec import SensorDesign
from sims.continuity.judge import Judge, governing_pair, usable_of_pairs
from sims.continuity.map_judging import CLOSE_UNITS
from sims.continuity.result import JudgedPair
from sims.verdict.builds import pair_margin
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD

MAP_FIGURES = frozenset({"verdict", "deadband_mm", "usable_depth_mm", "margin"})
PAIR_FIGURES = frozenset({"evenness", "continuity", "swing", "resolvable_steps"})

_ONE_AT_A_TIME = threading.Lock()
"""The compiled kernels must not be entered by two threads of a process at once, as workers of a cluster have."""


class _HopelessError(Exception):
    """Ends the judging of a design; its text is the reason."""


def judge(
    design: SensorDesign,
    limits: tuple[Limit, ...],
    *,
    wanted: Sequence[str],
    accuracy: str = "search",
    also_mm: Sequence[tuple[float, float]] = (),
    seed: int = 0,
) -> Judged:
    """Judge a design for a search.

    Parameters
    ----------
    limits : what it must keep; the judging stops at the first step that breaks one
    wanted : figures to work out, those of the limits besides (`design.search.figures`; "verdict" as well)
    accuracy : a row of `sims.continuity.settings.SETTINGS` by name
    also_mm : (x, y) of further places of a pad's map, such as one that is known to decide; left out where they are
        not in a design's workspace [mm]
    seed : of the light's offsets
    """
    needed = {*wanted, *(limit.figure for limit in limits)}
    with _ONE_AT_A_TIME:
        return _Search(Judge(design, accuracy, seed=seed, also_mm=also_mm), limits, needed).outcome()


class _Search:
    """One design on its way through the steps; `figures` fills up."""

    def __init__(self, stages: Judge, limits: tuple[Limit, ...], needed: set[str]) -> None:
        self.stages, self.limits, self.needed = stages, limits, needed
        self.figures: dict[str, float | None] = {}
        self.verdict, self.may_be = "", False

    def outcome(self) -> Judged:
        """Go through the steps until the end or until one shows that the design is hopeless."""
        reason = ""
        try:
            self._steps()
        except (_HopelessError, ModelScopeError) as err:
            reason = str(err)
        return Judged(figures=self.figures, verdict=self.verdict, reason=reason, may_be=self.may_be)

    def _steps(self) -> None:
        broken = [str(finding) for finding in check(self.stages.design) if finding.severity == "error"]
        if broken:
            raise _HopelessError(f"breaks a rule: {broken[0]}")
        self._count(self.stages.cavity)
        self._stop_if_hopeless()
        self._untouched()
        self._stop_if_hopeless()
        if self.stages.is_facing:
            self._facing()
        else:
            self._pad()
        self._stop_if_hopeless()

    def _stop_if_hopeless(self) -> None:
        so_far = Judged(figures=self.figures, verdict=self.verdict)
        for limit in self.limits:
            if (limit.violation(so_far) or 0.0) > 0.0:
                value = self.verdict if limit.equals else f"{self.figures[limit.figure]:.4g}"
                raise _HopelessError(f"{limit.figure} {value}, wanted {limit}")

    def _count(self, cavity: CavityGeometry) -> None:
        self.figures["part_count"] = float(len(cavity.parts))
        self.figures["pad_height_mm"] = cavity.clear_mm + cavity.black_mm
        if "cost" in self.needed:
            self.figures["cost"] = price_of(cavity)

    def _untouched(self) -> None:
        flux, names = self.stages.untouched, self.stages.names
        # The common gain hides how much light there is, so strength is light: a share of the emitted power.
        chosen = names[:1] if self.stages.is_facing else names
        self.figures["strength"] = float(np.median([flux[pair] for pair in chosen])) if chosen else 0.0

    def _facing(self) -> None:
        """The middle pair first: most designs fall with it. The others only where it has no deadband."""
        names = self.stages.names
        judged = self.stages.judged(names[:1])
        self._headline(judged)
        self._stop_if_hopeless()
        if not self.figures["deadband_mm"] and len(names) > 1:
            judged += self.stages.judged(names[1:])
            self._headline(judged)
        self._bounds()

    def _headline(self, judged: tuple[JudgedPair, ...]) -> None:
        """The governing pair's figures; of usable depth and margin the least of any."""
        design, score = self.stages.design, governing_pair(judged, True).score
        margins = [pair_margin(design, self.stages.readout, pair.curves, pair.score) for pair in judged]
        self.may_be = min(margin + error for margin, error in margins) >= DEADBAND_THRESHOLD
        self.figures |= {
            "evenness": score.evenness,
            "continuity": score.continuity,
            "swing": score.strength.swing,
            "resolvable_steps": score.strength.resolvable_steps,
            "deadband_mm": score.deadband_total_mm,
            "usable_depth_mm": usable_of_pairs(design, judged),
            "margin": min(margin for margin, _ in margins),
        }
        self.verdict = "DEADBAND" if score.deadbands_mm else "CONTIGUOUS"

    def _pad(self) -> None:
        if self.needed & PAIR_FIGURES:
            self._medians(self.stages.pairs)
            self._stop_if_hopeless()
        if self.needed & MAP_FIGURES:
            places = self.stages.places
            self.figures |= {
                "deadband_mm": max(place.deadband_total_mm for place in places),
                "usable_depth_mm": self.stages.usable_depth_mm,
                "margin": min(place.margin for place in places),
            }
            self.verdict = self.stages.verdict
            self.may_be = min(place.margin for place in places) >= DEADBAND_THRESHOLD - CLOSE_UNITS
            self._stop_if_hopeless()
        self._bounds()

    def _medians(self, judged: tuple[JudgedPair, ...]) -> None:
        scores = [pair.score for pair in judged]
        self.figures |= {
            "evenness": float(np.median([score.evenness for score in scores])),
            "continuity": float(np.median([score.continuity for score in scores])),
            "swing": float(np.median([score.strength.swing for score in scores])),
            "resolvable_steps": float(np.median([score.strength.resolvable_steps for score in scores])),
        }

    def _bounds(self) -> None:
        if not self.needed & BOUND_FIGURES:
            return
        bounds = self.stages.bounds
        for name, value in (
            ("location_bound_mm", bounds.median_location_mm.value),
            ("depth_bound_mm", bounds.median_depth_mm.value),
            ("dead_share", bounds.dead_share.value),
        ):
            self.figures[name] = float(value) if np.isfinite(value) else None


def price_of(cavity: CavityGeometry) -> float:
    """Price of all emitters and receivers, in the one currency of the catalogue's prices.

    Raises
    ------
    DesignError : a part without a price, or prices in two currencies.
    """
    costs = {part.part_id: part.part.cost for part in cavity.parts}
    missing = sorted(name for name, cost in costs.items() if cost is None)
    if missing:
        raise DesignError(
            f"cost: the catalogue has no price for {', '.join(missing)}; give the part a cost in your own catalogue "
            "(docs/how-to/own-parts.md, section A price), or leave cost out"
        )
    currencies = {cost.currency for cost in costs.values() if cost is not None}
    if len(currencies) > 1:
        raise DesignError(
            f"cost: prices in {' and '.join(sorted(currencies))} cannot be added; give one currency"
        )
    return sum(cost.value for part in cavity.parts if (cost := part.part.cost) is not None)
