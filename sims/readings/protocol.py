"""Simulate a press protocol on a sensor: light is traced once, then noisy data are drawn from it any number of times.

`protocol_curves` traces the light at all locations of a protocol. `draw` applies the signal chain with a random seed,
in seconds. Every press has its own random numbers, from the seed, the number of the set and the number of the press.
They do not depend on earlier draws. So a run that was interrupted continues with the same data, and a press is the same
whether it is drawn alone or with all others.

The seed of the draw sets the order of the locations, the offsets, drift, ambient light and noise. Locations and traced
light do not depend on it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.press_protocol import PressProtocol
from optopad.design.progress import OnStep
from optopad.design.recordings import OFF, SetEntry
from optopad.design.shape.cavity import cavity_of, judged_pairs, mask_of
from optopad.design.spec import SensorDesign
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.readings.press_data import PressCurves, PressData, knots_mm, traced_curves
from optopad.sims.readings.readout import Readout, readout_of
from optopad.sims.readings.signal_chain import (
    PressDraw,
    Remainder,
    SetDraw,
    SignalChain,
    blended,
    chain_of,
    drawn_press,
    drawn_set_offset_mm,
    true_depth_mm,
    unbonded_share,
    with_loose_walls,
)

ORDER, SET, PRESS, FRAME = range(4)
"""Purposes of random numbers, as part of their seed: order of presses, a set's errors, a press's errors, frame
noise.
"""


@dataclass(frozen=True, kw_only=True)
class ProtocolCurves:
    """Traced light of a press protocol on a design, for all of its locations.

    Attributes
    ----------
    design, protocol : the traced design and protocol
    curves : light against depth at all distinct locations
    loose : the same curves with an air gap at the walls; None if the design's walls do not come loose
    place_of : for each set, (place,) index in `curves` of each of its locations
    readout : gains, determined from the light without contact
    """

    design: SensorDesign
    protocol: PressProtocol
    curves: PressCurves
    loose: PressCurves | None
    place_of: tuple[IntArray, ...]
    readout: Readout


def protocol_curves(
    design: SensorDesign,
    protocol: PressProtocol,
    *,
    seed: int = 0,
    accuracy: str | Accuracy = "draft",
    is_coarse: bool | None = None,
    light: Callable[[FloatArray], FloatArray] | None = None,
    on_step: OnStep | None = None,
) -> ProtocolCurves:
    """Trace the light of a press protocol at all of its locations.

    Parameters
    ----------
    seed, accuracy : random seed and accuracy setting of the light model
    is_coarse : whether to trace fewer depths, with a larger error (docs/how-to/simulate-data-set.md). If None, the
        protocol decides
    light : function that gives the flux (n, emitter, receiver) of presses (n, 3) on bonded walls, in place of a trace
    on_step : called with the name of a stage and the fraction of it that is done (0 to 1)

    Raises
    ------
    ModelScopeError : the protocol has presses outside the design's workspace, or too deep for the design or the contact
        model.
    """
    places = protocol.places_mm(design)
    distinct, place_of = _distinct(places)
    coarse = protocol.curves == "coarse" if is_coarse is None else is_coarse
    knots = knots_mm(design, is_coarse=coarse, deepest_mm=protocol.deepest_mm)
    loose = None
    if light is not None:
        presses = [(x, y, depth) for x, y in distinct.tolist() for depth in knots.tolist()]
        flux = light(np.array(presses))
        flux = flux.reshape(len(distinct), len(knots), *flux.shape[1:])
        curves = PressCurves(places_mm=distinct, depth_mm=knots, flux=flux)
    else:
        curves = _traced(design, distinct, knots, accuracy, seed, on_step, "light")
    if design.noise.wall_unbonded_share > 0.0:
        loose = _traced(with_loose_walls(design), distinct, knots, accuracy, seed, on_step, "loose walls")
    return ProtocolCurves(
        design=design,
        protocol=protocol,
        curves=curves,
        loose=loose,
        place_of=place_of,
        readout=untouched_readout(design, curves.untouched),
    )


def untouched_readout(design: SensorDesign, untouched_flux: FloatArray) -> Readout:
    """Gains by the design's rule from the flux (emitter, receiver) without contact; the verdict uses the same gains."""
    draft = Draft.of(design)
    return readout_of(draft, untouched_flux, mask_of(judged_pairs(draft.cavity), draft.cavity))


def draw(
    curves: ProtocolCurves,
    chain: SignalChain | None = None,
    *,
    seed: int = 0,
    on_step: OnStep | None = None,
) -> PressData:
    """Draw all samples of a protocol: traced light with the errors and noise of one sensor unit.

    Parameters
    ----------
    chain : signal chain of the sensor unit; if None, the design's. Its `noise` also gives the errors of the stage, and
        how walls come loose
    seed : random seed for the order of presses, offsets, drift and noise
    """
    presses = []
    total = sum(map(len, curves.place_of))
    for press in drawn_presses(curves, chain, seed=seed):
        presses.append(press)
        if on_step is not None:
            on_step("data", len(presses) / total)
    return replace(
        presses[0],
        counts=np.concatenate([one.counts for one in presses]),
        press_mm=np.concatenate([one.press_mm for one in presses]),
        time_s=np.concatenate([one.time_s for one in presses]),
        set_number=np.concatenate([one.set_number for one in presses]),
        place_number=np.concatenate([one.place_number for one in presses]),
        true_press_mm=np.concatenate([one.true_press_mm for one in presses if one.true_press_mm is not None]),
    )


def drawn_presses(
    curves: ProtocolCurves,
    chain: SignalChain | None = None,
    *,
    seed: int = 0,
    but: frozenset[tuple[int, int]] = frozenset(),
) -> Iterator[PressData]:
    """Draw the samples of a protocol press by press, in the order of the sets; see `draw`.

    Parameters
    ----------
    but : presses to leave out, as (number of the set, number of the press in it)
    """
    whole = chain_of(curves.design, curves.readout) if chain is None else chain
    header = data_header(curves, whole, seed)
    for number in range(len(curves.place_of)):
        wanted = [k for k in range(len(curves.place_of[number])) if (number, k) not in but]
        if wanted:
            drawn = _DrawnSet(curves, whole, number, seed)
            for k in wanted:
                yield drawn.press(k, header)


def data_header(curves: ProtocolCurves, chain: SignalChain, seed: int) -> PressData:
    """Data without samples, with all information that samples share: names, sets, digest, protocol, signal chain."""
    protocol = curves.protocol
    return header_for(
        curves.design,
        chain,
        tuple(one.info for one in protocol.sets),
        {
            "protocol": protocol.model_dump(mode="json"),
            "points_per_press": len(protocol.depth_mm),
            "touched_per_press": int((protocol.depth_mm >= 0.0).sum()),
            "counts_per_flux": list(curves.readout.of_each(chain.gains.shape[1])),
            "knots_mm": curves.curves.depth_mm.tolist(),
            "seed": seed,
        },
    )


def header_for(
    design: SensorDesign, chain: SignalChain, sets: tuple[SetEntry, ...], attributes: Mapping[str, Any]
) -> PressData:
    """Data of a simulated design without samples; `attributes` are added to those that every simulation has."""
    cavity = cavity_of(design)
    states = (*(one.name for one in cavity.emitters), OFF)
    receivers = tuple(one.name for one in cavity.receivers)
    return PressData(
        counts=np.zeros((0, len(states), len(receivers)), dtype=np.float32),
        press_mm=np.zeros((0, 3)),
        time_s=np.zeros(0),
        set_number=np.zeros(0, dtype=np.int64),
        place_number=np.zeros(0, dtype=np.int64),
        sets=sets,
        state_names=states,
        receiver_names=receivers,
        full_scale_counts=chain.full_scale_counts,
        design_digest=design.digest,
        attributes={
            "design": design.name,
            "noise": {name: getattr(chain.noise, name) for name in type(chain.noise).model_fields},
            **attributes,
        },
        true_press_mm=np.zeros((0, 3)),
    )


class _DrawnSet:
    """Draws the presses of one set of a protocol; stores the values that they share, such as drift and order."""

    def __init__(self, curves: ProtocolCurves, chain: SignalChain, number: int, seed: int) -> None:
        self.curves, self.chain, self.number, self.seed = curves, chain, number, seed
        protocol, noise = curves.protocol, chain.noise
        self.order = self._rng(ORDER).permutation(len(curves.place_of[number]))
        rng = self._rng(SET)
        self.offset_mm = drawn_set_offset_mm(noise, rng)
        self.drawn: SetDraw = chain.draw_set(rng, is_ambient=protocol.sets[number].is_ambient)
        self.loose_share = self._loose_share()

    def press(self, k: int, header: PressData) -> PressData:
        """Samples of the k-th press of the set; `header` has the information that all presses share."""
        protocol, noise = self.curves.protocol, self.chain.noise
        place = self._place(k)
        errors, depth = self._true(k)
        reported = protocol.depth_mm
        rng = self._rng(FRAME, k)
        time_s = self._begins_s(k) + rng.uniform(0.0, self._frame_s, len(reported))
        flux = self._flux(k, place, depth)
        if noise.release_residue > 0.0:
            flux = self._with_memory(k, flux, depth, time_s)
        counts = self.chain.counts(flux, time_s, rng, drawn=self.drawn)
        at = self.curves.curves.places_mm[place]
        return replace(
            header,
            counts=counts,
            press_mm=_presses(at - errors.place_error_mm, reported),
            time_s=time_s,
            set_number=np.full(len(reported), self.number, dtype=np.int64),
            place_number=np.full(len(reported), k, dtype=np.int64),
            true_press_mm=_presses(at, depth),
        )

    def _place(self, k: int) -> int:
        return int(self.curves.place_of[self.number][self.order[k]])

    def _true(self, k: int) -> tuple[PressDraw, FloatArray]:
        """Errors of the stage in the k-th press, and its true depths (sample,) [mm]."""
        protocol, noise = self.curves.protocol, self.chain.noise
        errors = drawn_press(noise, self.offset_mm, self._rng(PRESS, k))
        lag_mm = noise.retract_lag_mm
        return errors, true_depth_mm(protocol.depth_mm, protocol.is_retracting, errors, lag_mm)

    def _with_memory(self, k: int, flux: FloatArray, depth_mm: FloatArray, time_s: FloatArray) -> FloatArray:
        """Flux with what the press before has left, and after the k-th press's own release with what that has left."""
        found, own = flux.copy(), slice(_released(depth_mm), None)
        if k > 0:
            found[: own.start] = self._remainder(k - 1).added(
                flux[: own.start], time_s[: own.start], self.chain.noise
            )
        found[own] = self._remainder(k).added(flux[own], time_s[own], self.chain.noise)
        return found

    def _remainder(self, k: int) -> Remainder:
        _, depth = self._true(k)
        deepest = self.curves.curves.at(np.array([self._place(k)]), depth.max(keepdims=True))[0]
        return Remainder(
            change=deepest - self.curves.curves.untouched,
            released_s=float(self._begins_s(k)[0] + _released(depth) * self.curves.protocol.dwell_s),
        )

    @property
    def _frame_s(self) -> float:
        """Period of the frames [s].

        Frames are not synchronised with the stage: one starts at a random time within a period after the stage arrives.
        """
        return 1.0 / self.curves.design.board.frame_rate_hz

    def _begins_s(self, k: int) -> FloatArray:
        protocol = self.curves.protocol
        return np.asarray(k * protocol.press_s + protocol.dwell_s * np.arange(len(protocol.depth_mm)))

    def _flux(self, k: int, place: int, depth_mm: FloatArray) -> FloatArray:
        places = np.full(len(depth_mm), place)
        bonded = self.curves.curves.at(places, depth_mm)
        if self.loose_share is None or self.curves.loose is None:
            return bonded
        return blended(bonded, self.curves.loose.at(places, depth_mm), self.loose_share[k])

    def _loose_share(self) -> FloatArray | None:
        """Loose share of the walls (press, sample), from the reported depths; None if they do not come loose."""
        protocol, noise = self.curves.protocol, self.chain.noise
        if noise.wall_unbonded_share == 0.0:
            return None
        if self.curves.loose is None:
            raise InputError(
                "noise.wall_unbonded_share: the curves were traced without loose walls; trace them with a share above 0"
            )
        presses = len(self.order)
        times = np.concatenate([self._begins_s(k) for k in range(presses)])
        share = unbonded_share(
            np.tile(protocol.depth_mm, presses),
            times,
            deepest_mm=self.curves.design.operating.max_depth_mm,
            share=noise.wall_unbonded_share,
            heal_s=noise.wall_heal_s,
        )
        return share.reshape(presses, -1)

    def _rng(self, purpose: int, k: int = 0) -> np.random.Generator:
        return np.random.default_rng([self.seed, self.number, purpose, k])


def _released(depth_mm: FloatArray) -> int:
    """Number of the sample of a press at which the tip has left the pad; the count of samples if it has not."""
    return int(np.flatnonzero(depth_mm > 0.0).max(initial=-1)) + 1


def _presses(at_mm: FloatArray, depth_mm: FloatArray) -> FloatArray:
    return np.column_stack([np.tile(at_mm, (len(depth_mm), 1)), depth_mm])


def _distinct(places: tuple[FloatArray, ...]) -> tuple[FloatArray, tuple[IntArray, ...]]:
    """All distinct locations, and for each set the indices of its locations among these."""
    known: dict[tuple[float, float], int] = {}
    numbers = tuple(
        np.array([known.setdefault((float(x), float(y)), len(known)) for x, y in one], dtype=np.int64)
        for one in places
    )
    return np.array(list(known)), numbers


def _traced(
    design: SensorDesign,
    places_mm: FloatArray,
    knots: FloatArray,
    accuracy: str | Accuracy,
    seed: int,
    on_step: OnStep | None,
    stage: str,
) -> PressCurves:
    def told(done: int, total: int) -> None:
        if on_step is not None:
            on_step(stage, done / total)

    return traced_curves(design, places_mm, depth_mm=knots, accuracy=accuracy, seed=seed, on_step=told)
