"""What a search asks of a design: the score's figures, cheapest first, and no more of them than are wanted.

    rules ──► parts and height ──► untouched light ──► pairs ──► map of the pad ──► bounds
      each step ends the judging when a limit can no longer be met: the reason is kept

The same functions as `optopad score`, with coarser light, depths and grids (`SETTINGS["search"]`). How far its figures
are from those of the score's own settings (`SETTINGS["score"]`) is measured in docs/validation/search.md. Designs are
judged alike, the base too, so their order suffers less than the figures do; still, score what a search has found.

The figures are those of the score's headline: of facing rows the governing pair's, of a pad the medians over judged
pairs. Left out: the tolerance of open values.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from design.errors import DesignError, ModelScopeError
from design.geometry.cavity import CavityGeometry, cavity_of
from design.geometry.pairs import is_facing_rows, judged_pairs, mask_of, pair_name
from design.rules.check import check
from design.search.figures import BOUND_FIGURES
from design.search.judged import Judged, Limit
from design.spec import SensorDesign
from sims.bounds.defaults import COARSE_DEPTHS_MM
from sims.bounds.observability import BOUND_ACCURACIES, pad_bounds
from sims.continuity.map_judging import places_judged
from sims.continuity.result import JudgedPair
from sims.continuity.scoring import governing_pair, require_judgeable_depth, usable_of_pairs
from sims.optics.accuracy import ACCURACIES, Accuracy
from sims.optics.light_signals import LightSignals
from sims.optics.tracing import trace
from sims.press.depths import COARSE_STEP_MM, STEP_MM, depth_schedule_mm
from sims.readings.readout import Readout, readout_of
from sims.verdict.builds import pair_margin, score_curves
from sims.verdict.pad_map import COARSE_PLACES, grid_places_mm, map_grid_mm
from sims.verdict.presses import (
    MAP_ACCURACY,
    NEAR_ACCURACY,
    PAIR_ACCURACY,
    PairCurves,
    map_depths_mm,
    map_light,
    pad_light,
    pair_curves,
)

FloatArray = NDArray[np.float64]

MAP_FIGURES = frozenset({"verdict", "deadband_mm", "usable_depth_mm", "margin"})
PAIR_FIGURES = frozenset({"evenness", "continuity", "swing", "resolvable_steps"})


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How finely designs are judged.

    Attributes
    ----------
    untouched, pairs, map, bounds : settings of the light
    near : settings of the map's light near contact, where the map then has all depths; None: as the rest of it
    step_mm, map_step_mm : of the depths of pairs and of the map [mm]
    map_places, bound_places : places along the longer side of the workspace [-]
    bound_depths_mm : depths of the bounds; the end of the range of use is added [mm]
    """

    untouched: Accuracy
    pairs: Accuracy
    map: Accuracy
    near: Accuracy | None
    bounds: tuple[Accuracy | str, ...]
    step_mm: float
    map_step_mm: float
    map_places: int
    bound_places: int
    bound_depths_mm: tuple[float, ...]


_QUICK = replace(ACCURACIES["draft"], reference_rays=4096)

_DRAFT_MAP = replace(
    ACCURACIES["score"],
    reference_rays=4096,
    rings=12,
    columns=30,
    top_rings=8,
    top_columns=20,
    repeat_share=0.2,
    image_step=0.7,
    ray_share=1.0,
)
"""A third of the time a state of a search's; 1 % rms of the untouched signal, most of it common to all depths."""

SETTINGS = {
    "draft": Settings(  # for what is being moved about by hand
        untouched=_QUICK,
        pairs=replace(_QUICK, rings=16, columns=40, image_step=0.2, top_rings=14, top_columns=32),
        map=_DRAFT_MAP,
        near=None,
        bounds=(ACCURACIES["score"],),  # coarser light leaves voxels open, which then pass for blind
        step_mm=COARSE_STEP_MM,
        map_step_mm=2 * COARSE_STEP_MM,
        map_places=COARSE_PLACES,
        bound_places=3,
        bound_depths_mm=(1.5,),
    ),
    "search": Settings(
        untouched=_QUICK,
        pairs=replace(_QUICK, image_step=0.1, top_rings=14, top_columns=32, repeat_share=1e-3),
        map=_QUICK,
        near=None,
        bounds=(_QUICK,),
        step_mm=COARSE_STEP_MM,
        map_step_mm=2 * COARSE_STEP_MM,
        map_places=3,
        bound_places=3,
        bound_depths_mm=(0.7, 2.5),
    ),
    "score": Settings(
        untouched=ACCURACIES["standard"],
        pairs=PAIR_ACCURACY,
        map=MAP_ACCURACY,
        near=NEAR_ACCURACY,
        bounds=BOUND_ACCURACIES,
        step_mm=STEP_MM,
        map_step_mm=COARSE_STEP_MM,
        map_places=COARSE_PLACES,
        bound_places=COARSE_PLACES,
        bound_depths_mm=COARSE_DEPTHS_MM,
    ),
}

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
    accuracy : a name of `SETTINGS`
    also_mm : (x, y) of further places of a pad's map, such as one that is known to decide; left out where they are
        not in a design's workspace [mm]
    seed : of the light's offsets
    """
    needed = {*wanted, *(limit.figure for limit in limits)}
    with _ONE_AT_A_TIME:
        return _Judging(design, limits, needed, SETTINGS[accuracy], also_mm, seed).outcome()


class _Judging:
    """One design on its way through the steps; `figures` fills up."""

    def __init__(
        self,
        design: SensorDesign,
        limits: tuple[Limit, ...],
        needed: set[str],
        settings: Settings,
        also_mm: Sequence[tuple[float, float]],
        seed: int,
    ) -> None:
        self.design, self.limits, self.needed = design, limits, needed
        self.settings, self.also_mm, self.seed = settings, also_mm, seed
        self.figures: dict[str, float | None] = {}
        self.verdict = ""

    def outcome(self) -> Judged:
        """Go through the steps until the end or until one shows that the design is hopeless."""
        reason = ""
        try:
            self._steps()
        except (_HopelessError, ModelScopeError) as err:
            reason = str(err)
        return Judged(figures=self.figures, verdict=self.verdict, reason=reason)

    def _steps(self) -> None:
        broken = [str(finding) for finding in check(self.design) if finding.severity == "error"]
        if broken:
            raise _HopelessError(f"breaks a rule: {broken[0]}")
        cavity = cavity_of(self.design)
        self._count(cavity)
        self._stop_if_hopeless()
        readout = self._untouched(cavity)
        self._stop_if_hopeless()
        if is_facing_rows(cavity):
            self._facing(cavity, readout)
        else:
            self._pad(cavity, readout)
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

    def _untouched(self, cavity: CavityGeometry) -> Readout:
        flux = untouched_of(self.design, cavity, self.settings, self.seed)
        judged = judged_pairs(cavity)
        # The common gain hides how much light there is, so strength is light: a share of the emitted power.
        chosen = judged[:1] if is_facing_rows(cavity) else judged
        self.figures["strength"] = float(np.median([flux[pair] for pair in chosen])) if chosen else 0.0
        return readout_of(self.design, flux, mask_of(judged, cavity))

    def _facing(self, cavity: CavityGeometry, readout: Readout) -> None:
        """The middle pair first: most designs fall with it. The others only where it has no deadband."""
        pairs = judged_pairs(cavity)
        judged = self._pairs(cavity, pairs[:1], readout)
        self._headline(judged[0])
        self._stop_if_hopeless()
        if not self.figures["deadband_mm"] and len(pairs) > 1:
            judged += self._pairs(cavity, pairs[1:], readout)
            self._headline(governing_pair(judged, True))
        if self.needed & {"usable_depth_mm", "margin"}:
            self._depths(judged, readout)
        if self.needed & BOUND_FIGURES:
            self._bounds(readout)

    def _depths(self, judged: tuple[JudgedPair, ...], readout: Readout) -> None:
        """Usable depth and margin of facing pairs, the least of each."""
        self.figures["usable_depth_mm"] = usable_of_pairs(self.design, judged)
        self.figures["margin"] = min(
            pair_margin(self.design, readout, pair.curves, pair.score)[0] for pair in judged
        )

    def _headline(self, pair: JudgedPair) -> None:
        score = pair.score
        self.figures |= {
            "evenness": score.evenness,
            "continuity": score.continuity,
            "swing": score.strength.swing,
            "resolvable_steps": score.strength.resolvable_steps,
            "deadband_mm": score.deadband_total_mm,
        }
        self.verdict = "DEADBAND" if score.deadbands_mm else "CONTIGUOUS"

    def _pad(self, cavity: CavityGeometry, readout: Readout) -> None:
        if self.needed & PAIR_FIGURES:
            self._medians(self._pairs(cavity, judged_pairs(cavity), readout))
            self._stop_if_hopeless()
        if self.needed & MAP_FIGURES:
            self._map(cavity, readout)
            self._stop_if_hopeless()
        if self.needed & BOUND_FIGURES:
            self._bounds(readout)

    def _medians(self, judged: tuple[JudgedPair, ...]) -> None:
        scores = [pair.score for pair in judged]
        self.figures |= {
            "evenness": float(np.median([score.evenness for score in scores])),
            "continuity": float(np.median([score.continuity for score in scores])),
            "swing": float(np.median([score.strength.swing for score in scores])),
            "resolvable_steps": float(np.median([score.strength.resolvable_steps for score in scores])),
        }

    def _pairs(
        self, cavity: CavityGeometry, pairs: tuple[tuple[int, int], ...], readout: Readout
    ) -> tuple[JudgedPair, ...]:
        depth_mm = depth_schedule_mm(self._max_depth_mm(), self.settings.step_mm)
        curves = pair_curves(
            self.design, cavity, pairs, depth_mm, accuracy=self.settings.pairs, seed=self.seed
        )
        return judged_alone(self.design, cavity, curves, readout)

    def _map(self, cavity: CavityGeometry, readout: Readout) -> None:
        x_mm, y_mm = map_grid_mm(cavity, self.settings.map_places)
        places_mm = grid_places_mm(cavity.workspace, x_mm, y_mm)
        further = [place for place in self.also_mm if _is_further(cavity, places_mm, place)]
        if further:
            places_mm = np.concatenate([places_mm, further])
        depth_mm, light = self._map_light(places_mm)
        places = places_judged(self.design, cavity, readout, places_mm, depth_mm, light)
        self.figures |= {
            "deadband_mm": max(place.deadband_total_mm for place in places),
            "usable_depth_mm": min(place.usable_mm for place in places),
            "margin": min(place.margin for place in places),
        }
        self.verdict = "DEADBAND" if any(place.deadbands_mm for place in places) else "CONTIGUOUS"

    def _map_light(self, places_mm: FloatArray) -> tuple[FloatArray, LightSignals]:
        """Depths of the map, and its light."""
        settings, end_mm = self.settings, self._max_depth_mm()
        if settings.near is None:
            depth_mm = depth_schedule_mm(end_mm, settings.map_step_mm)
            return depth_mm, pad_light(
                self.design, places_mm, depth_mm, accuracy=settings.map, seed=self.seed
            )
        depth_mm = map_depths_mm(end_mm, settings.map_step_mm)
        return depth_mm, map_light(
            self.design, places_mm, depth_mm, accuracy=settings.map, near=settings.near, seed=self.seed
        )

    def _bounds(self, readout: Readout) -> None:
        bounds = pad_bounds(
            self.design,
            places=self.settings.bound_places,
            depths_mm=self.settings.bound_depths_mm,
            accuracies=self.settings.bounds,
            seed=self.seed,
            readout=readout,
            with_losses=False,
        )
        for name, value in (
            ("location_bound_mm", bounds.median_location_mm.value),
            ("depth_bound_mm", bounds.median_depth_mm.value),
            ("dead_share", bounds.dead_share.value),
        ):
            self.figures[name] = float(value) if np.isfinite(value) else None

    def _max_depth_mm(self) -> float:
        require_judgeable_depth(self.design)
        return self.design.operating.max_depth_mm


def untouched_of(design: SensorDesign, cavity: CavityGeometry, settings: Settings, seed: int) -> FloatArray:
    """(emitter, receiver) flux of the untouched pad [-]."""
    presses = np.array([[cavity.length_mm / 2, cavity.width_mm / 2, 0.0]])
    return np.asarray(trace(design, presses, accuracy=settings.untouched, seed=seed).flux[0])


def judged_alone(
    design: SensorDesign, cavity: CavityGeometry, curves: Sequence[PairCurves], readout: Readout
) -> tuple[JudgedPair, ...]:
    """Pairs judged by their curves, without loads and errors."""
    return tuple(
        JudgedPair(name=pair_name(cavity, one.pair), curves=one, score=score_curves(design, one, readout))
        for one in curves
    )


def _is_further(cavity: CavityGeometry, places_mm: FloatArray, place_mm: tuple[float, float]) -> bool:
    """Whether a place is in this design's workspace, and not among those already."""
    return (
        cavity.workspace.contains(*place_mm, 0.0)
        and not (np.abs(places_mm - place_mm).max(axis=1) < 1e-9).any()
    )


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
