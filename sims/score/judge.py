"""Judge one design in stages: each stage is computed when it is first requested, and its result is cached.

    untouched light ──► readout ──► pairs, each under its own press        verdict of facing rows
                               └──► map: locations in the workspace        verdict of a pad
                                       └──► bounds of location and depth

A score, a draft and a search have the same stages and differ in accuracy. The verdict of a pad needs only its map; the
verdict of facing rows needs only their pairs.

Each use has named settings in `SETTINGS`:

| name   | for                                     | time on a pad of 48 pairs, two cores  |
|--------|-----------------------------------------|---------------------------------------|
| draft  | a layout that is being moved by hand    | one to six seconds, bounds two to ten |
| search | designs of a search and their base      | two to eight seconds                  |
| score  | `optopad score`                         | ten to forty seconds                  |
| full   | a score with a map of 11 points a side  | minutes                               |
| fine   | "full" with finer light and more bounds | minutes                               |

docs/validation/search.md has measured differences between the figures of a search and of a score. All designs of a
search are judged with the same settings, so their order is less affected than their figures.

After the first trace, some locations of the map are traced again. A location is undecided if the numerical error could
change the verdict there:

    light of the map ──► undecided locations ──► a second, independent trace
                     │                                └─► two finer traces while still undecided
                     └──► of a draft: locations close to the threshold ──► a finer trace
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.progress import OnShare, OnStep
from optopad.design.shape.cavity import (
    CavityGeometry,
    beside_chord,
    direct_path_pairs,
    is_facing_rows,
    judged_pairs,
    mask_of,
)
from optopad.design.shape.cavity import pair_name as name_of
from optopad.design.spec import SensorDesign
from optopad.sims.bounds.detection_threshold import DetectionThreshold, detection_threshold
from optopad.sims.bounds.fisher import COARSE_DEPTHS_MM, FINE_DEPTHS_MM
from optopad.sims.bounds.observability import BOUND_ACCURACIES, MANY_PAIRS_BOUNDS, PadBounds, pad_bounds
from optopad.sims.contact.force_curve import ForceCurve, force_curve
from optopad.sims.contact.indentation import require_corner, require_covered, solved_press
from optopad.sims.contact.scope import Contact, contact_of
from optopad.sims.optics.accuracy import ACCURACIES, Accuracy, LightSignals
from optopad.sims.optics.tracing import trace
from optopad.sims.press import COARSE_STEP_MM, STEP_MM, depth_schedule_mm
from optopad.sims.readings.readout import Readout, readout_of
from optopad.sims.score.result import Interval, JudgedPair
from optopad.sims.verdict.builds import pair_margin, score_curves
from optopad.sims.verdict.causes import Cause, causes_of_pad, causes_of_pairs
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD, TRACE_ERROR_LIMIT
from optopad.sims.verdict.pad_map import (
    COARSE_PLACES,
    FINE_PLACES,
    PadMap,
    Place,
    grid_places_mm,
    map_grid_mm,
    place_of,
)
from optopad.sims.verdict.presses import (
    DOUBT_ACCURACIES,
    MAP_ACCURACY,
    MOST_TRACED_AGAIN,
    NEAR_ACCURACY,
    PAIR_ACCURACY,
    SECOND_SEED,
    Pair,
    map_depths_mm,
    map_light,
    pad_light,
    pair_curves,
    states_of,
    untouched_flux,
)

NEAR_TIPS = 4.0
"""In a draft, a press farther than this from a pair's chord is taken not to change the pair's light [tip radii]. On the
paper's pad, 28 of 48 pairs are nearer. This changes margins of up to 20 noise units by 0.3, and larger margins by up to
7.
"""
HALF_OF_DEPTH = 0.5
MANY_PAIRS = 200
"""Number of judged pairs above which a layout is judged with coarser depth steps and other light settings
(`Settings.for_pairs`).
"""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Accuracy settings with which a design is judged.

    Attributes
    ----------
    untouched, pairs, map, bounds : accuracy settings of the light model for these stages; `bounds` has several, tried
        in turn
    near : accuracy setting for the map at shallow depths. If given, depth steps are finer there; if None, all depths
        have equal steps and the setting `map`
    step_mm, map_step_mm : depth steps for single pairs and for the map [mm]
    map_places, bound_places : number of locations along the longer side of the workspace, for the map and for the
        bounds
    bound_depths_mm : depths at which bounds are computed [mm]; the deepest possible one is added
    bound_depth_share : `bound_depths_mm` are used up to this share of the deepest press [-]
    near_tips : a press farther than this from a pair's chord is taken not to change the pair's light [tip radii]. If
        None, all pairs are traced for every press
    settled : which locations of the map are traced again: "open" are those that the numerical error leaves undecided,
        "close" those with a margin near the deadband threshold, and "none" stands for no location
    doubts : accuracy settings for tracing these locations again, tried in turn while a location is undecided
    has_detection : whether the detection threshold is computed along with the bounds
    has_losses : whether bounds are also computed with each component failed
    """

    untouched: str | Accuracy
    pairs: str | Accuracy
    map: Accuracy
    near: Accuracy | None
    bounds: tuple[Accuracy | str, ...]
    step_mm: float
    map_step_mm: float
    map_places: int
    bound_places: int
    bound_depths_mm: tuple[float, ...]
    bound_depth_share: float = 1.0
    near_tips: float | None = None
    settled: Literal["open", "close", "none"] = "none"
    doubts: tuple[Accuracy, ...] = ()
    has_detection: bool = False
    has_losses: bool = False

    def for_pairs(self, count: int, *, is_skin: bool = False) -> Settings:
        """These settings, adapted to the number of judged pairs of a layout, and to a skin on the top.

        Above `MANY_PAIRS` judged pairs, single pairs get the coarser depth steps of the map, as they take long and a
        pad's verdict follows from its map. For example, 30 LEDs and 32 photodiodes make 960 pairs, of which 552 are
        judged. The first trace for the bounds then uses more rays. In one measurement at equal cost, 16 of 27 voxels
        deeper than 0.3 mm had to be traced again after a first trace with the usual rays, but only 2 after one with
        more rays. Under a skin no finer setting has smaller errors, so the bounds are traced once.
        """
        if is_skin:
            return replace(self, step_mm=max(self.step_mm, self.map_step_mm), bounds=self.bounds[:1])
        if count <= MANY_PAIRS:
            return self
        bounds = MANY_PAIRS_BOUNDS if self.bounds == BOUND_ACCURACIES else self.bounds
        return replace(self, step_mm=max(self.step_mm, self.map_step_mm), bounds=bounds)


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
"""Accuracy setting for a draft's map. A press takes a third of the time that it takes in a search; the error is 1 % rms
of the untouched signal, mostly common to all depths.
"""

_SCORE = Settings(
    untouched="standard",
    pairs=PAIR_ACCURACY,
    map=MAP_ACCURACY,
    near=NEAR_ACCURACY,
    bounds=BOUND_ACCURACIES,
    step_mm=STEP_MM,
    map_step_mm=COARSE_STEP_MM,
    map_places=COARSE_PLACES,
    bound_places=COARSE_PLACES,
    bound_depths_mm=COARSE_DEPTHS_MM,
    settled="open",
    doubts=(MAP_ACCURACY, *DOUBT_ACCURACIES),
    has_detection=True,
    has_losses=True,
)
_FULL = replace(_SCORE, map_step_mm=STEP_MM, map_places=FINE_PLACES, bound_places=FINE_PLACES)

SETTINGS = {
    "draft": Settings(
        untouched=_QUICK,
        pairs=replace(_QUICK, rings=16, columns=40, image_step=0.2, top_rings=14, top_columns=32),
        map=_DRAFT_MAP,
        near=None,
        bounds=(ACCURACIES["score"],),  # coarser light leaves voxels open, which then count as not resolved
        step_mm=COARSE_STEP_MM,
        map_step_mm=2 * COARSE_STEP_MM,
        map_places=COARSE_PLACES,
        bound_places=3,
        bound_depths_mm=(1.5,),
        bound_depth_share=HALF_OF_DEPTH,
        near_tips=NEAR_TIPS,
        settled="close",
        doubts=DOUBT_ACCURACIES[:1],
        has_detection=True,
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
    "score": _SCORE,
    "full": _FULL,
    "fine": replace(
        _FULL,
        pairs="fine",
        map=ACCURACIES["standard"],
        bound_depths_mm=FINE_DEPTHS_MM,
        doubts=(ACCURACIES["standard"], *DOUBT_ACCURACIES),
    ),
}
"""Settings by name."""


def settings_of(*, fine: bool, full: bool) -> Settings:
    """The settings of `optopad score` with the options ``--fine`` and ``--full``."""
    return SETTINGS["fine" if fine else "full" if full else "score"]


CLOSE_UNITS = 1.0
"""A draft traces a location again if its margin is within this distance of the deadband threshold [noise units].
Margins of a draft were off by 0.3, enough to miss the deadband in the middle of the paper's 10 mm pad.
"""
MOST_CLOSE = 3
"""Largest number of locations that a draft traces again, those closest to the threshold first."""


def settled_open(
    draft: Draft,
    pad_map: PadMap,
    frames: MapFrames,
    doubts: Sequence[Accuracy],
    seed: int,
    on_step: OnShare,
) -> PadMap:
    """The map after its undecided locations are traced a second time, independently.

    Locations that are still undecided are traced twice with the next, finer setting, and so on.

    Parameters
    ----------
    doubts : accuracy settings of the light model, tried in turn; the first is the map's own
    """
    for settings in doubts:
        doubtful = pad_map.doubtful(MOST_TRACED_AGAIN)
        if not doubtful:
            break
        again = pad_map.open_depths(frames.depth_mm, doubtful)
        for half in (0, 1):
            if half == 0 and settings == doubts[0]:
                continue  # the map itself
            finer = pad_light(
                draft,
                frames.places_mm[doubtful],
                frames.depth_mm[again],
                accuracy=settings,
                seed=seed + half * SECOND_SEED,
                on_step=on_step,
            )
            frames.put(half, doubtful, again, finer)
        frames.errors[np.ix_(np.array(doubtful), np.flatnonzero(again))] = 0.0
        pad_map = pad_map.with_places({number: frames.place(number) for number in doubtful})
    return pad_map


def settled_close(
    draft: Draft,
    pad_map: PadMap,
    frames: MapFrames,
    doubts: Sequence[Accuracy],
    seed: int,
    on_step: OnShare,
) -> PadMap:
    """The map with the locations closest to the threshold judged again, from one trace with `doubts[0]`."""
    away = [abs(place.margin - DEADBAND_THRESHOLD) for place in pad_map.places]
    close = [number for number in np.argsort(away, kind="stable").tolist() if away[number] <= CLOSE_UNITS]
    close = close[:MOST_CLOSE]
    if not close:
        return pad_map
    places_mm = np.array([[pad_map.places[number].x_mm, pad_map.places[number].y_mm] for number in close])
    depth_mm = depth_schedule_mm(draft.design.operating.max_depth_mm, COARSE_STEP_MM)
    light = pad_light(draft, places_mm, depth_mm, accuracy=doubts[0], seed=seed, on_step=on_step)
    finer = MapFrames.traced_once(frames.mask, depth_mm, places_mm, light, frames.readout)
    return pad_map.with_places({number: finer.place(k) for k, number in enumerate(close)})


@dataclass(frozen=True, kw_only=True)
class MapFrames:
    """The readings of all judged pairs at a map's locations and depths.

    Attributes
    ----------
    mask : (emitter, receiver) whether a pair is judged
    readout : gains of the receivers
    places_mm, depth_mm : (place, 2) locations and (depth,) depths [mm]
    counts : (2, place, depth, pair) readings from two traces, not clipped at full scale [counts]; both are equal where
        light was traced once
    errors : (place, depth, pair) standard errors of the readings [counts] where light was traced once; 0 where there
        are two traces
    """

    mask: BoolArray
    readout: Readout
    places_mm: FloatArray
    depth_mm: FloatArray
    counts: FloatArray
    errors: FloatArray

    @classmethod
    def traced_once(
        cls,
        mask: BoolArray,
        depth_mm: FloatArray,
        places_mm: FloatArray,
        light: LightSignals,
        readout: Readout,
    ) -> MapFrames:
        """Readings from a single trace of the (emitter, receiver) pairs in `mask`.

        `light` has all depths of the first location, then all depths of the next, and so on.
        """
        shape = (len(places_mm), len(depth_mm), -1)
        counts, errors = (
            (values[:, mask] * readout.of_mask(mask)).reshape(shape)
            for values in (light.flux, light.error_of_changes)
        )
        return cls(
            mask=mask,
            readout=readout,
            places_mm=places_mm,
            depth_mm=depth_mm,
            counts=np.stack([counts, counts]),
            errors=errors,
        )

    def put(self, half: int, places: list[int], depths: BoolArray, light: LightSignals) -> None:
        """Replace the readings of trace number `half` (0 or 1) at the given locations and depths."""
        counts = light.flux[:, self.mask] * self.readout.of_mask(self.mask)
        rows = np.ix_(np.array(places), np.flatnonzero(depths))
        self.counts[half][rows] = counts.reshape(len(places), int(depths.sum()), -1)

    def place(self, number: int) -> Place:
        """Judge the location with this number from all its readings."""
        x_mm, y_mm = self.places_mm[number].tolist()
        return place_of(
            (x_mm, y_mm), self.depth_mm, self.counts[:, number], self.errors[number], self.readout
        )


class Judge:
    """The stages in which one design is judged; each stage is computed when first requested.

    Parameters
    ----------
    draft : the design; its verdict means something if it breaks no rule
    settings : accuracy settings, or their name in `SETTINGS`
    seed : random seed of the light model
    also_mm : (x, y) of further locations of a pad, such as one known to decide the verdict [mm]; locations outside the
        workspace are left out
    on_step : called with the name of the running stage and the share of it that is done, 0 to 1
    """

    def __init__(
        self,
        draft: Draft,
        settings: Settings | str = "score",
        *,
        seed: int = 0,
        also_mm: Sequence[tuple[float, float]] = (),
        on_step: OnStep | None = None,
    ) -> None:
        self.draft, self.design, self.seed, self.also_mm = draft, draft.design, seed, also_mm
        row = SETTINGS[settings] if isinstance(settings, str) else settings
        self.settings = row.for_pairs(len(self.names), is_skin=self.design.top is not None)
        self.tell = on_step or (lambda _stage, _share: None)

    def take(self, readout: Readout, pad_map: PadMap, light: LightSignals) -> None:
        """Continue from a readout, map and light that were computed before."""
        self.readout, self._mapped = readout, (pad_map, light, ())

    @cached_property
    def cavity(self) -> CavityGeometry:
        """Geometry of the design."""
        return self.draft.cavity

    @cached_property
    def contact(self) -> Contact:
        """The tip and the pad, as all presses share them."""
        return contact_of(self.design)

    @cached_property
    def is_facing(self) -> bool:
        """Whether the verdict is on facing pairs, not on a pad."""
        return is_facing_rows(self.cavity)

    @cached_property
    def names(self) -> tuple[Pair, ...]:
        """Judged pairs as (emitter, receiver) indices; the middle pair of facing rows is first."""
        return judged_pairs(self.cavity)

    @cached_property
    def force(self) -> ForceCurve:
        """Force of a press at the centre against depth, at the depths of a score."""
        depth_mm = depth_schedule_mm(self.deepest_mm)
        press = solved_press(self.contact, on_step=lambda share: self.tell("contact", share))
        require_corner(self.contact)
        return force_curve(press, depth_mm)

    @cached_property
    def deepest_mm(self) -> float:
        """Deepest press [mm].

        Raises
        ------
        ModelScopeError : the models give no verdict on the design (`require_covered`).
        """
        require_covered(self.contact)
        return self.design.operating.max_depth_mm

    @cached_property
    def untouched(self) -> FloatArray:
        """Received divided by emitted power of each pair (emitter, receiver) on the untouched pad [-]."""
        return untouched_flux(self.draft, seed=self.seed, accuracy=self.settings.untouched)

    @cached_property
    def readout(self) -> Readout:
        """Gains of the receivers, determined on the untouched pad."""
        return readout_of(self.draft, self.untouched, mask_of(self.names, self.cavity))

    def judged(self, pairs: tuple[Pair, ...]) -> tuple[JudgedPair, ...]:
        """Judge some pairs, each alone under a press on its own chord; loads and errors are not computed."""
        curves = pair_curves(
            self.draft,
            pairs,
            depth_schedule_mm(self.deepest_mm, self.settings.step_mm),
            accuracy=self.settings.pairs,
            seed=self.seed,
            on_step=lambda share: self.tell("pairs", share),
        )
        return tuple(
            JudgedPair(
                name=name_of(self.cavity, one.pair),
                curves=one,
                score=score_curves(one, self.readout),
            )
            for one in curves
        )

    @cached_property
    def pairs(self) -> tuple[JudgedPair, ...]:
        """Results of all judged pairs, each alone under a press on its own chord."""
        return self.judged(self.names)

    @cached_property
    def _mapped(self) -> tuple[PadMap, LightSignals, tuple[Place, ...]]:
        """The map, its light, and the results at the further locations `also_mm`."""
        x_mm, y_mm = map_grid_mm(self.cavity, self.settings.map_places)
        grid_mm = grid_places_mm(self.cavity.workspace, x_mm, y_mm)
        further = [place for place in self.also_mm if _is_further(self.cavity, grid_mm, place)]
        places_mm = np.concatenate([grid_mm, further]) if further else grid_mm
        depth_mm, light = self._map_light(places_mm)
        frames = MapFrames.traced_once(
            direct_path_pairs(self.cavity), depth_mm, places_mm, light, self.readout
        )
        places = tuple(frames.place(number) for number in range(len(places_mm)))
        pad_map = PadMap(x_mm=tuple(x_mm.tolist()), y_mm=tuple(y_mm.tolist()), places=places[: len(grid_mm)])
        own = _first_states(light, len(grid_mm) * len(depth_mm)) if further else light
        return self._settled(pad_map, frames), own, places[len(grid_mm) :]

    def _map_light(self, places_mm: FloatArray) -> tuple[FloatArray, LightSignals]:
        """Depths of the map [mm], and the light at all locations and depths."""
        settings = self.settings

        def on_step(share: float) -> None:
            self.tell("map", share)

        if settings.near is not None:
            depth_mm = map_depths_mm(self.deepest_mm, settings.map_step_mm)
            return depth_mm, map_light(
                self.draft,
                places_mm,
                depth_mm,
                accuracy=settings.map,
                near=settings.near,
                seed=self.seed,
                on_step=on_step,
            )
        depth_mm = depth_schedule_mm(self.deepest_mm, settings.map_step_mm)
        if settings.near_tips is None:
            return depth_mm, pad_light(
                self.draft, places_mm, depth_mm, accuracy=settings.map, seed=self.seed, on_step=on_step
            )
        near = _pairs_near(self.cavity, places_mm, settings.near_tips).repeat(len(depth_mm), axis=0)
        light = trace(
            self.draft,
            states_of(places_mm, depth_mm),
            accuracy=settings.map,
            seed=self.seed,
            pairs=near,
            on_step=lambda done, total: on_step(done / total),
        )
        return depth_mm, replace(light, flux=np.where(near, light.flux, self.untouched))

    def _settled(self, pad_map: PadMap, frames: MapFrames) -> PadMap:
        """The map, with some of its locations traced again if the settings require it."""
        kind = self.settings.settled
        if kind == "none":
            return pad_map
        settle = settled_open if kind == "open" else settled_close
        return settle(
            self.draft,
            pad_map,
            frames,
            self.settings.doubts,
            self.seed,
            lambda share: self.tell("open places", share),
        )

    @property
    def pad_map(self) -> PadMap:
        """The map of the pad: the judged locations of the workspace."""
        return self._mapped[0]

    @property
    def pad_signals(self) -> LightSignals:
        """The light from which the map is computed, with all depths of the first location, then all of the next."""
        return self._mapped[1]

    @property
    def places(self) -> tuple[Place, ...]:
        """Results at the locations of the map, followed by those at the further locations `also_mm`."""
        return (*self._mapped[0].places, *self._mapped[2])

    @cached_property
    def bounds(self) -> PadBounds:
        """Lower bounds on the error of location and depth, from all readings of one frame."""
        settings = self.settings
        limit = settings.bound_depth_share * self.deepest_mm
        return pad_bounds(
            self.draft,
            places=settings.bound_places,
            depths_mm=tuple(depth for depth in settings.bound_depths_mm if depth < limit) or (limit,),
            accuracies=settings.bounds,
            seed=self.seed,
            readout=self.readout,
            with_losses=settings.has_losses,
            detection=self._detection() if settings.has_detection else None,
            on_step=lambda share: self.tell("bounds", share),
        )

    def _detection(self) -> DetectionThreshold:
        pad_map, light = self.pad_map, self.pad_signals
        depth_mm = light.presses[: len(light.presses) // len(pad_map.places), 2]
        flux, error = (
            pad_map.grid(values.reshape(len(pad_map.places), len(depth_mm), -1))
            for values in (light.flux, light.error_of_changes)
        )
        return detection_threshold(
            self.contact, flux, error, pad_map.x_mm, pad_map.y_mm, depth_mm, self.readout
        )

    @property
    def verdict(self) -> Literal["CONTIGUOUS", "DEADBAND"]:
        """``DEADBAND`` if any facing pair, or any location of a pad, has a deadband; otherwise ``CONTIGUOUS``."""
        found = (
            any(pair.score.deadbands_mm for pair in self.pairs)
            if self.is_facing
            else any(place.deadbands_mm for place in self.places)
        )
        return "DEADBAND" if found else "CONTIGUOUS"

    @property
    def deadbands_mm(self) -> tuple[Interval, ...]:
        """(from, to) depths of the deadbands of the governing facing pair, or of the pad's worst location [mm]."""
        if self.is_facing:
            return tuple(self.governing.score.deadbands_mm)
        return max(self.places, key=lambda place: place.deadband_total_mm).deadbands_mm

    @property
    def governing(self) -> JudgedPair:
        """The pair that represents the others, chosen by `governing_pair`."""
        return governing_pair(self.pairs, self.is_facing)

    @property
    def usable_depth_mm(self) -> float:
        """Least depth at which any facing pair, or any location, stops resolving depth, or the deepest press [mm]."""
        if self.is_facing:
            return usable_of_pairs(self.design, self.pairs)
        return min(place.usable_mm for place in self.places)

    @property
    def usable_range_mm(self) -> Interval:
        """Smallest and largest usable depth within the numerical error of the light model [mm]."""
        if self.is_facing:
            return self.usable_depth_mm, self.usable_depth_mm
        return self.pad_map.usable_range_mm

    @property
    def margin(self) -> float:
        """Least margin of any facing pair, or any location [noise units]; a margin below 3 means a deadband."""
        if not self.is_facing:
            return min(place.margin for place in self.places)
        return min(pair_margin(self.readout, pair.curves, pair.score)[0] for pair in self.pairs)

    @cached_property
    def is_open(self) -> bool:
        """Whether the numerical error of the light model leaves the verdict undecided."""
        if not self.is_facing:
            return self.pad_map.is_open
        return self.settings.settled == "open" and self._pairs_are_open()

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Reasons why depth is not resolved: one for every interval of depth concerned, the worst interval first."""
        if self.is_facing:
            pairs = [(pair.curves, pair.score) for pair in self.pairs]
            return causes_of_pairs(self.design, pairs, self.readout, self.governing.name)
        return causes_of_pad(self.design, self.pad_map, self.pad_signals, self.readout)

    def _pairs_are_open(self) -> bool:
        """Whether it is still undecided after a second trace if the facing pairs have a deadband.

        The errors of the two traces are independent, so a result on which both agree is not due to them.
        """
        if any(pair.score.deadbands_mm for pair in self.pairs):
            return False
        doubtful = [
            pair
            for pair in self.pairs
            if pair.score.possible_deadbands_mm and (pair.score.noise_margin or 0.0) > TRACE_ERROR_LIMIT
        ]
        if not doubtful:
            return False
        again = pair_curves(
            self.draft,
            tuple(pair.curves.pair for pair in doubtful),
            self.pairs[0].curves.depth_mm,
            accuracy=self.settings.pairs,
            seed=self.seed + SECOND_SEED,
            on_step=lambda share: self.tell("open pairs", share),
        )
        for pair, second in zip(doubtful, again, strict=True):
            gain = self.readout.of_receiver(second.pair[1])
            halves = np.stack([pair.curves.total, second.total])[..., np.newaxis] * gain
            place = place_of(second.press_mm, second.depth_mm, halves, np.zeros_like(halves[0]), self.readout)
            if place.depths.is_open or place.deadbands_mm:
                return True
        return False


def _first_states(light: LightSignals, count: int) -> LightSignals:
    return replace(
        light,
        flux=light.flux[:count],
        by_class={name: values[:count] for name, values in light.by_class.items()},
        standard_error=light.standard_error[:count],
        change_error=light.error_of_changes[:count],
        presses=light.presses[:count],
        relative_error=None,
        is_met=None,
    )


def governing_pair(judged: tuple[JudgedPair, ...], facing: bool) -> JudgedPair:
    """The pair that represents the others in the figures of a score.

    For facing rows this is the middle pair if it has a deadband, otherwise the pair with the longest deadbands. For a
    pad it is the unclipped pair with the longest deadbands; among equals, the least even one.
    """
    if facing:
        worst = max(judged, key=lambda pair: pair.score.deadband_total_mm)
        return judged[0] if judged[0].score.deadbands_mm else worst
    return max(
        judged,
        key=lambda pair: (not pair.score.is_clipped, pair.score.deadband_total_mm, -pair.score.evenness),
    )


def usable_of_pairs(design: SensorDesign, judged: tuple[JudgedPair, ...]) -> float:
    """Least depth at which any facing pair stops resolving depth, or the deepest press [mm]."""
    ends = [pair.score.saturation_mm[0] for pair in judged if pair.score.saturation_mm is not None]
    return min([*ends, design.operating.max_depth_mm])


def _pairs_near(cavity: CavityGeometry, places_mm: FloatArray, tips: float) -> BoolArray:
    """Whether a pair's chord passes within `tips` tip radii of a location: mask (place, emitter, receiver)."""
    near = np.zeros((len(places_mm), len(cavity.emitters), len(cavity.receivers)), dtype=np.bool_)
    for number, (x_mm, y_mm) in enumerate(places_mm.tolist()):
        for i, j in np.argwhere(direct_path_pairs(cavity)):
            away_mm, _ = beside_chord(cavity, (int(i), int(j)), (x_mm, y_mm))
            near[number, i, j] = away_mm <= tips * cavity.tip_radius_mm
    return near


def _is_further(cavity: CavityGeometry, places_mm: FloatArray, place_mm: tuple[float, float]) -> bool:
    return (
        bool(cavity.workspace.contains(*place_mm, 0.0))
        and not (np.abs(places_mm - place_mm).max(axis=1) < 1e-9).any()
    )
