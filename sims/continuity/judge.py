"""One design, judged stage by stage: each stage is worked out when it is first asked for, and kept.

    untouched light ──► readout ──► pairs, each under its own press        verdict of facing rows
                               └──► map: places of the workspace           verdict of a pad
                                       └──► bounds of location and depth

How finely is a row of `SETTINGS`; the stages are the same for a score, a draft and a search. A pad's verdict needs the
map alone, that of facing rows their pairs alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Literal

import numpy as np

from design.arrays import BoolArray, FloatArray
from design.errors import ModelScopeError
from design.progress import OnStep
from design.shape.cavity import CavityGeometry, cavity_of
from design.shape.pairs import beside_chord, direct_path_pairs, is_facing_rows, judged_pairs, mask_of
from design.shape.pairs import pair_name as name_of
from design.spec import SensorDesign
from sims.bounds.felt import FeltForce, felt_force
from sims.bounds.observability import PadBounds, pad_bounds
from sims.contact.force_curve import ForceCurve, force_curve
from sims.contact.indentation import solved_press
from sims.continuity.map_judging import MapFrames, settled_close, settled_open
from sims.continuity.result import Interval, JudgedPair
from sims.continuity.settings import SETTINGS, Settings
from sims.optics.light_signals import LightSignals
from sims.optics.tracing import trace
from sims.press.depths import depth_schedule_mm
from sims.readings.readout import Readout, readout_of
from sims.verdict.builds import pair_margin, score_curves
from sims.verdict.causes import Cause, causes_of_pad, causes_of_pairs
from sims.verdict.pad_map import PadMap, Place, grid_places_mm, map_grid_mm, place_of
from sims.verdict.pair.defaults import DEADBAND_MIN_LENGTH_MM, TRACE_ERROR_LIMIT
from sims.verdict.presses import (
    SECOND_SEED,
    Pair,
    map_depths_mm,
    map_light,
    pad_light,
    pair_curves,
    states_of,
    untouched_flux,
)


class Judge:
    """The stages of one design.

    Parameters
    ----------
    design : one that breaks no rule
    settings : a row of `SETTINGS`, or its name
    seed : of the light model's random shifts
    also_mm : (x, y) of further places of a pad, such as one that is known to decide; left out where they are not in the
        workspace [mm]
    on_step : called with a stage's name and the share of it that is done
    """

    def __init__(
        self,
        design: SensorDesign,
        settings: Settings | str = "score",
        *,
        seed: int = 0,
        also_mm: Sequence[tuple[float, float]] = (),
        on_step: OnStep | None = None,
    ) -> None:
        self.design, self.seed, self.also_mm = design, seed, also_mm
        self.settings = SETTINGS[settings] if isinstance(settings, str) else settings
        self.tell = on_step or (lambda _stage, _share: None)

    def take(self, readout: Readout, pad_map: PadMap, light: LightSignals) -> None:
        """Go on from a map that is known."""
        self.readout, self._mapped = readout, (pad_map, light, ())

    @cached_property
    def cavity(self) -> CavityGeometry:
        """Geometry of the design."""
        return cavity_of(self.design)

    @cached_property
    def is_facing(self) -> bool:
        """Whether the verdict is that of facing pairs, not of the pad."""
        return is_facing_rows(self.cavity)

    @cached_property
    def names(self) -> tuple[Pair, ...]:
        """Judged pairs, the middle one of facing rows first."""
        return judged_pairs(self.cavity)

    @cached_property
    def force(self) -> ForceCurve:
        """Load of the centred press at the depths of a score."""
        press = solved_press(self.design, on_step=lambda share: self.tell("contact", share))
        return force_curve(self.design, press, depth_schedule_mm(self.deepest_mm))

    @property
    def deepest_mm(self) -> float:
        """Deepest press [mm].

        Raises
        ------
        ModelScopeError : less than a deadband's least length, so that none could be.
        """
        deepest = self.design.operating.max_depth_mm
        if deepest < DEADBAND_MIN_LENGTH_MM:
            raise ModelScopeError(
                f"operating.max_depth_mm: {deepest:g} mm is less than a deadband's least length, "
                f"{DEADBAND_MIN_LENGTH_MM:g} mm, so nothing can be judged; raise it"
            )
        return deepest

    @cached_property
    def untouched(self) -> FloatArray:
        """(emitter, receiver) flux of the untouched pad [-]."""
        return untouched_flux(self.design, self.cavity, seed=self.seed, accuracy=self.settings.untouched)

    @cached_property
    def readout(self) -> Readout:
        """Gains of the receivers, set on the untouched pad."""
        return readout_of(self.design, self.untouched, mask_of(self.names, self.cavity))

    def judged(self, pairs: tuple[Pair, ...]) -> tuple[JudgedPair, ...]:
        """Some pairs, each judged by itself under its own press, without loads and errors."""
        curves = pair_curves(
            self.design,
            self.cavity,
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
                score=score_curves(self.design, one, self.readout),
            )
            for one in curves
        )

    @cached_property
    def pairs(self) -> tuple[JudgedPair, ...]:
        """All judged pairs."""
        return self.judged(self.names)

    @cached_property
    def _mapped(self) -> tuple[PadMap, LightSignals, tuple[Place, ...]]:
        """The map, its light, and further places."""
        x_mm, y_mm = map_grid_mm(self.cavity, self.settings.map_places)
        grid_mm = grid_places_mm(self.cavity.workspace, x_mm, y_mm)
        further = [place for place in self.also_mm if _is_further(self.cavity, grid_mm, place)]
        places_mm = np.concatenate([grid_mm, further]) if further else grid_mm
        depth_mm, light = self._map_light(places_mm)
        frames = MapFrames.traced_once(
            direct_path_pairs(self.cavity), depth_mm, places_mm, light, self.readout
        )
        places = tuple(frames.place(self.design, number) for number in range(len(places_mm)))
        pad_map = PadMap(x_mm=tuple(x_mm.tolist()), y_mm=tuple(y_mm.tolist()), places=places[: len(grid_mm)])
        own = _first_states(light, len(grid_mm) * len(depth_mm)) if further else light
        return self._settled(pad_map, frames), own, places[len(grid_mm) :]

    def _map_light(self, places_mm: FloatArray) -> tuple[FloatArray, LightSignals]:
        """Depths of the map, and its light."""
        settings = self.settings

        def on_step(share: float) -> None:
            self.tell("map", share)

        if settings.near is not None:
            depth_mm = map_depths_mm(self.deepest_mm, settings.map_step_mm)
            return depth_mm, map_light(
                self.design,
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
                self.design, places_mm, depth_mm, accuracy=settings.map, seed=self.seed, on_step=on_step
            )
        near = _pairs_near(self.cavity, places_mm, settings.near_tips).repeat(len(depth_mm), axis=0)
        light = trace(
            self.design,
            states_of(places_mm, depth_mm),
            accuracy=settings.map,
            seed=self.seed,
            pairs=near,
            on_step=lambda done, total: on_step(done / total),
        )
        return depth_mm, replace(light, flux=np.where(near, light.flux, self.untouched))

    def _settled(self, pad_map: PadMap, frames: MapFrames) -> PadMap:
        """The map with its doubtful places traced again, as the settings have it."""
        kind = self.settings.settled
        if kind == "none":
            return pad_map
        settle = settled_open if kind == "open" else settled_close
        return settle(
            self.design,
            pad_map,
            frames,
            self.settings.doubts,
            self.seed,
            lambda share: self.tell("open places", share),
        )

    @property
    def pad_map(self) -> PadMap:
        """What the places of the workspace say."""
        return self._mapped[0]

    @property
    def pad_signals(self) -> LightSignals:
        """The light behind the map, places outermost."""
        return self._mapped[1]

    @property
    def places(self) -> tuple[Place, ...]:
        """Places of the map, and further ones."""
        return (*self._mapped[0].places, *self._mapped[2])

    @cached_property
    def bounds(self) -> PadBounds:
        """What all readings of a frame can tell of location and depth at best."""
        settings = self.settings
        limit = settings.bound_depth_share * self.deepest_mm
        return pad_bounds(
            self.design,
            places=settings.bound_places,
            depths_mm=tuple(depth for depth in settings.bound_depths_mm if depth < limit) or (limit,),
            accuracies=settings.bounds,
            seed=self.seed,
            readout=self.readout,
            with_losses=settings.has_losses,
            felt=self._felt() if settings.has_felt else None,
            on_step=lambda share: self.tell("bounds", share),
        )

    def _felt(self) -> FeltForce:
        """The lightest press felt at the map's places, by the map's light."""
        pad_map, light = self.pad_map, self.pad_signals
        depth_mm = light.presses[: len(light.presses) // len(pad_map.places), 2]
        flux, error = (
            pad_map.grid(values.reshape(len(pad_map.places), len(depth_mm), -1))
            for values in (light.flux, light.error_of_changes)
        )
        return felt_force(self.design, flux, error, pad_map.x_mm, pad_map.y_mm, depth_mm, self.readout)

    @property
    def verdict(self) -> Literal["CONTIGUOUS", "DEADBAND"]:
        """DEADBAND where some facing pair, or some place of a pad, has one."""
        found = (
            any(pair.score.deadbands_mm for pair in self.pairs)
            if self.is_facing
            else any(place.deadbands_mm for place in self.places)
        )
        return "DEADBAND" if found else "CONTIGUOUS"

    @property
    def deadbands_mm(self) -> tuple[Interval, ...]:
        """Intervals of the governing facing pair, or of the worst place of a pad [mm]."""
        if self.is_facing:
            return tuple(self.governing.score.deadbands_mm)
        return max(self.places, key=lambda place: place.deadband_total_mm).deadbands_mm

    @property
    def governing(self) -> JudgedPair:
        """The pair that stands for the rest."""
        return governing_pair(self.pairs, self.is_facing)

    @property
    def usable_depth_mm(self) -> float:
        """Least depth from which on some facing pair, or place, does not resolve depth; or the deepest press [mm]."""
        if self.is_facing:
            return usable_of_pairs(self.design, self.pairs)
        return min(place.usable_mm for place in self.places)

    @property
    def usable_range_mm(self) -> Interval:
        """What the light's own error leaves of that [mm]."""
        if self.is_facing:
            return self.usable_depth_mm, self.usable_depth_mm
        return self.pad_map.usable_range_mm

    @property
    def margin(self) -> float:
        """Least margin of any facing pair, or place [noise units]; below 3 is a deadband."""
        if not self.is_facing:
            return min(place.margin for place in self.places)
        return min(pair_margin(self.design, self.readout, pair.curves, pair.score)[0] for pair in self.pairs)

    @cached_property
    def is_open(self) -> bool:
        """Whether the light's own error may make or hide every deadband."""
        if not self.is_facing:
            return self.pad_map.is_open
        return self.settings.settled == "open" and self._pairs_are_open()

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Why depth is not told, for every blind interval, the worst first."""
        if self.is_facing:
            pairs = [(pair.curves, pair.score) for pair in self.pairs]
            return causes_of_pairs(self.design, pairs, self.readout)
        return causes_of_pad(self.design, self.pad_map, self.pad_signals, self.readout)

    def _pairs_are_open(self) -> bool:
        """Whether a second trace leaves a deadband of facing pairs open.

        Two traces err independently of each other, so what both agree on is no error (`sims.verdict.frame_depths`).
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
            self.design,
            self.cavity,
            tuple(pair.curves.pair for pair in doubtful),
            self.pairs[0].curves.depth_mm,
            accuracy=self.settings.pairs,
            seed=self.seed + SECOND_SEED,
            on_step=lambda share: self.tell("open pairs", share),
        )
        for pair, second in zip(doubtful, again, strict=True):
            gain = self.readout.of_receiver(second.pair[1])
            halves = np.stack([pair.curves.total, second.total])[..., np.newaxis] * gain
            place = place_of(
                self.design,
                second.press_mm,
                second.depth_mm,
                halves,
                np.zeros_like(halves[0]),
                self.readout.full_scale_counts,
            )
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
    """The middle facing pair, or the worst one if only another has a deadband.

    Of a pad: the pair with most deadband, then least evenness, clipped ones last.
    """
    if facing:
        worst = max(judged, key=lambda pair: pair.score.deadband_total_mm)
        return judged[0] if judged[0].score.deadbands_mm else worst
    return max(
        judged,
        key=lambda pair: (not pair.score.is_clipped, pair.score.deadband_total_mm, -pair.score.evenness),
    )


def usable_of_pairs(design: SensorDesign, judged: tuple[JudgedPair, ...]) -> float:
    """Least depth of any facing pair from which on its depth is not told any more, or the deepest press [mm]."""
    ends = [pair.score.saturation_mm[0] for pair in judged if pair.score.saturation_mm is not None]
    return min([*ends, design.operating.max_depth_mm])


def _pairs_near(cavity: CavityGeometry, places_mm: FloatArray, tips: float) -> BoolArray:
    """(place, emitter, receiver) pairs whose chord runs near each place; the others hardly change there."""
    near = np.zeros((len(places_mm), len(cavity.emitters), len(cavity.receivers)), dtype=np.bool_)
    for number, (x_mm, y_mm) in enumerate(places_mm.tolist()):
        for i, j in np.argwhere(direct_path_pairs(cavity)):
            away_mm, _ = beside_chord(cavity, (int(i), int(j)), (x_mm, y_mm))
            near[number, i, j] = away_mm <= tips * cavity.tip_radius_mm
    return near


def _is_further(cavity: CavityGeometry, places_mm: FloatArray, place_mm: tuple[float, float]) -> bool:
    """Whether a place is in this design's workspace, and not among those already."""
    return (
        bool(cavity.workspace.contains(*place_mm, 0.0))
        and not (np.abs(places_mm - place_mm).max(axis=1) < 1e-9).any()
    )
