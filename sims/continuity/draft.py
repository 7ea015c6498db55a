"""A verdict in seconds, for a layout that is being moved about: coarse light, depths and bounds (`SETTINGS["draft"]`).

    curves_under   pairs whose chord runs under one press, judged by themselves      a third of a second
    draft_score    verdict and map of the pad, or of all facing pairs                one to six seconds
    with_draft_bounds   place and depth at best, at two depths                       two to ten more

On a pad of 48 pairs and two cores; the longer times where no symmetry helps. Places of a pad that are nearly blind, or
nearly not, are traced again, finely. Left out: tolerance, what matters, single pairs of a pad.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from design.errors import ModelScopeError
from design.geometry.cavity import CavityGeometry, cavity_of
from design.geometry.pairs import (
    beside_chord,
    direct_path_pairs,
    is_facing_rows,
    judged_pairs,
    mask_of,
)
from design.rules.check import require_valid
from design.spec import SensorDesign
from sims.bounds.observability import pad_bounds
from sims.contact.indentation import round_press
from sims.continuity.map_bounds import map_felt
from sims.continuity.map_judging import places_judged
from sims.continuity.objective import SETTINGS, judged_alone, untouched_of
from sims.continuity.result import ContinuityScore, JudgedPair
from sims.continuity.scoring import centred_force, governing_pair, require_judgeable_depth, usable_of_pairs
from sims.optics.tracing import trace
from sims.press.depths import COARSE_STEP_MM, STEP_MM, depth_schedule_mm
from sims.readings.readout import Readout, readout_of
from sims.verdict.causes import causes_of_pad, causes_of_pairs
from sims.verdict.pad_map import PadMap, grid_places_mm, map_grid_mm
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD
from sims.verdict.presses import (
    DOUBT_ACCURACIES,
    accuracy_of_pairs,
    curves_of,
    pad_light,
    pair_curves,
    states_of,
    untouched_flux,
)

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Pair = tuple[int, int]
OnStep = Callable[[str, float], None]

MOST_PAIRS = 8
"""Pairs under a press that are traced at most, the nearest first."""
FEWEST_PAIRS = 3
"""Where no chord runs under the tip, so many of the nearest."""
NEAR_TIPS = 4.0
"""Pairs whose chord is farther from a place are left as untouched there [tip radii]: on the paper's pad 28 of 48 are
nearer. Margins of up to 20 noise units then differ by 0.3 from those of all, larger ones by up to 7."""
CLOSE_UNITS = 1.0
"""Places whose margin is this near to the threshold of blindness are traced again [noise units]: a draft's margins were
off by 0.3 there, enough to hide the deadband in the middle of the paper's pad of 10 mm."""
MOST_CLOSE = 3
"""So many of them, the nearest first."""


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
    require_judgeable_depth(design)
    cavity, settings = cavity_of(design), SETTINGS["draft"]
    pairs = pairs_under(cavity, place_mm)
    flux = (
        untouched_of(design, cavity, settings, seed)
        if is_draft
        else untouched_flux(design, cavity, seed=seed)
    )
    readout = readout_of(design, flux, mask_of(judged_pairs(cavity), cavity))
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm, settings.step_mm if is_draft else STEP_MM)
    press = round_press(design, at_mm=place_mm) if is_draft else None
    light = trace(
        design,
        states_of(np.array([place_mm]), depth_mm),
        profile=None if press is None else [press.at(depth) for depth in depth_mm.tolist()],
        accuracy=settings.pairs if is_draft else accuracy_of_pairs(design),
        seed=seed,
        pairs=mask_of(pairs, cavity),
        on_step=None if on_step is None else lambda done, total: on_step("curves", done / total),
    )
    curves = [curves_of(light, pair, place_mm, slice(None), depth_mm) for pair in pairs]
    return PlaceCurves(
        place_mm=place_mm,
        readout=readout,
        pairs=judged_alone(design, cavity, curves, readout),
        is_draft=is_draft,
    )


def draft_score(design: SensorDesign, *, seed: int = 0, on_step: OnStep | None = None) -> ContinuityScore:
    """Verdict and map in seconds; bounds come with `with_draft_bounds`.

    Raises
    ------
    DesignError : the design breaks a rule.
    """
    require_valid(design)
    tell = on_step or (lambda _stage, _share: None)
    base = ContinuityScore(
        verdict="OUT_OF_MODEL_SCOPE",
        reason="",
        digest=design.digest,
        name=design.name,
        seed=seed,
        fine=False,
        is_facing_rows=is_facing_rows(cavity_of(design)),
    )
    try:
        require_judgeable_depth(design)
        return _facing(design, base, tell) if base.is_facing_rows else _pad(design, base, tell)
    except ModelScopeError as err:
        return replace(base, reason=str(err))


def with_draft_bounds(
    design: SensorDesign, draft: ContinuityScore, *, on_step: OnStep | None = None
) -> ContinuityScore:
    """The same with what one frame tells of place and depth at best, and the lightest press felt; pads only."""
    if draft.pad_map is None or draft.readout is None or draft.pad_signals is None:
        return draft
    tell = on_step or (lambda _stage, _share: None)
    felt = map_felt(design, draft.pad_map, draft.pad_signals, draft.readout)
    bounds = pad_bounds(
        design,
        places=SETTINGS["draft"].bound_places,
        depths_mm=tuple(
            min(depth, 0.5 * design.operating.max_depth_mm) for depth in SETTINGS["draft"].bound_depths_mm
        ),
        accuracies=SETTINGS["draft"].bounds,
        seed=draft.seed,
        readout=draft.readout,
        with_losses=False,
        felt=felt,
        on_step=lambda share: tell("bounds", share),
    )
    return replace(draft, bounds=bounds)


def _pad(design: SensorDesign, base: ContinuityScore, tell: OnStep) -> ContinuityScore:
    cavity, settings = cavity_of(design), SETTINGS["draft"]
    force = centred_force(design, lambda share: tell("contact", share))
    flux = untouched_of(design, cavity, settings, base.seed)
    readout = readout_of(design, flux, mask_of(judged_pairs(cavity), cavity))
    x_mm, y_mm = map_grid_mm(cavity, settings.map_places)
    places_mm = grid_places_mm(cavity.workspace, x_mm, y_mm)
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm, settings.map_step_mm)
    near = _pairs_near(cavity, places_mm).repeat(len(depth_mm), axis=0)
    light = trace(
        design,
        states_of(places_mm, depth_mm),
        accuracy=settings.map,
        seed=base.seed,
        pairs=near,
        on_step=lambda done, total: tell("map", done / total),
    )
    light = replace(light, flux=np.where(near, light.flux, flux))
    pad_map = PadMap(
        x_mm=tuple(x_mm.tolist()),
        y_mm=tuple(y_mm.tolist()),
        places=places_judged(design, cavity, readout, places_mm, depth_mm, light),
    )
    pad_map = _settled(design, cavity, pad_map, readout, base.seed, tell)
    dead = pad_map.worst.deadbands_mm
    return replace(
        base,
        verdict="DEADBAND" if dead else "CONTIGUOUS",
        deadbands_mm=dead,
        usable_depth_mm=pad_map.usable_depth_mm,
        usable_range_mm=pad_map.usable_range_mm,
        is_open=pad_map.is_open,
        untouched_flux=flux,
        readout=readout,
        pad_map=pad_map,
        pad_signals=light,
        causes=causes_of_pad(design, pad_map, light, readout),
        force=force,
    )


def _settled(
    design: SensorDesign, cavity: CavityGeometry, pad_map: PadMap, readout: Readout, seed: int, tell: OnStep
) -> PadMap:
    """The map with its closest places judged by finer light."""
    away = [abs(place.margin - DEADBAND_THRESHOLD) for place in pad_map.places]
    close = [number for number in np.argsort(away, kind="stable").tolist() if away[number] <= CLOSE_UNITS]
    close = close[:MOST_CLOSE]
    if not close:
        return pad_map
    places_mm = np.array([[pad_map.places[number].x_mm, pad_map.places[number].y_mm] for number in close])
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm, COARSE_STEP_MM)
    light = pad_light(
        design,
        places_mm,
        depth_mm,
        accuracy=DOUBT_ACCURACIES[0],
        seed=seed,
        on_step=lambda share: tell("open places", share),
    )
    found = places_judged(design, cavity, readout, places_mm, depth_mm, light)
    return pad_map.with_places(dict(zip(close, found, strict=True)))


def _facing(design: SensorDesign, base: ContinuityScore, tell: OnStep) -> ContinuityScore:
    cavity, settings = cavity_of(design), SETTINGS["draft"]
    force = centred_force(design, lambda share: tell("contact", share))
    flux = untouched_of(design, cavity, settings, base.seed)
    pairs = judged_pairs(cavity)
    readout = readout_of(design, flux, mask_of(pairs, cavity))
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm, settings.step_mm)
    curves = pair_curves(
        design,
        cavity,
        pairs,
        depth_mm,
        accuracy=settings.pairs,
        seed=base.seed,
        on_step=lambda share: tell("pairs", share),
    )
    judged = judged_alone(design, cavity, curves, readout)
    governing = governing_pair(judged, True)
    usable = usable_of_pairs(design, judged)
    return replace(
        base,
        verdict="DEADBAND" if any(pair.score.deadbands_mm for pair in judged) else "CONTIGUOUS",
        deadbands_mm=governing.score.deadbands_mm,
        usable_depth_mm=usable,
        usable_range_mm=(usable, usable),
        governing=governing.name,
        untouched_flux=flux,
        readout=readout,
        pairs=judged,
        causes=causes_of_pairs(design, [(pair.curves, pair.score) for pair in judged], readout),
        force=force,
    )


def _pairs_near(cavity: CavityGeometry, places_mm: FloatArray) -> BoolArray:
    """(place, emitter, receiver) pairs whose chord runs near each place; the others hardly change there."""
    near = np.zeros((len(places_mm), len(cavity.emitters), len(cavity.receivers)), dtype=np.bool_)
    for number, (x_mm, y_mm) in enumerate(places_mm.tolist()):
        for i, j in np.argwhere(direct_path_pairs(cavity)):
            away_mm, _ = beside_chord(cavity, (int(i), int(j)), (x_mm, y_mm))
            near[number, i, j] = away_mm <= NEAR_TIPS * cavity.tip_radius_mm
    return near
