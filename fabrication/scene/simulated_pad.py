"""The twin of a manufactured pad in a MuJoCo scene: the frames that its board would send of what touches it.

    pad = optopad.SimulatedPad(model, design, name="left")
    while True:
        mujoco.mj_step(model, data)
        frame = pad.frame(data)  # as optopad.Sensor gives it

From objects to a frame
-----------------------
    geoms in contact with the pad's top ──► their imprint in the untouched top, at the nodes of the map of light
    ──► light of every pair over its untouched light ──► interpolated to the time of the pair's conversion
    ──► gains, drift, noise, ambient light, dark states, full scale (`optopad.sims.readings.signal_chain`)

Times
-----
The board reads a frame at equal intervals: frame k begins at t_k = t_0 + k T, with T the interval of the design's rate,
or the time of a whole frame if that is longer. Its readings follow one another, and it is delivered at t_k + D, after
its last reading and its sending. D is the time of a whole frame in the timing model (5 ms with 8 emitters and 8
receivers on an ATmega). `SimulatedPad.frame` returns the latest frame that was delivered by `data.time`, as a program
at the port would get it. Until the next one is delivered it returns the same frame, so calls at every step make no more
noise than the board does.

A pair's light is interpolated between calls before and after its conversion, so the calls may be more or less frequent
than the frames. A call at every step of 1 to 4 ms follows the motion; with fewer calls the motion between them counts
as even. Of calls that are closer than the frame is long, those are taken between which something moved (`STEP_MM`), and
while objects rest on the pad, their light is computed once (`REST_MM`).
Frames that were delivered between two calls and replaced by a later one are made only for a recording or for
`optopad.SimulatedSensor`.

t_0 is the time of the first call. Before it the scene counts as at rest, as it then is: the first frame is returned by
that call, ahead of its delivery. If `data.time` goes back, the scene was reset: the board starts again with a frame as
at first, its frames have the next number of connection, and the unit, its drift and its baseline remain. Drift and the
flicker of ambient light go on by the number of frames, from the baseline on, as for a board that is never switched off.

`Frame.began_s` and `Frame.host_s` are on the simulation's clock, `Frame.device_us` counts from its zero.

Left out
--------
Loose walls (`noise.wall_unbonded_share`), the slow contact of the silicone, settling of amplifiers, the time of the
averages within a reading, a delay of the host, light that objects shed. What `signal_chain` leaves out is missing here,
too. What a press leaves (`noise.release_residue`) follows the deepest frame of the press.
"""

from __future__ import annotations

import math
import operator
import os
import warnings
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.design.recordings import signals_of, with_one_dark
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.descriptor import Descriptor, descriptor_of
from optopad.fabrication.driver.link.frames import US_PER_S, Frame
from optopad.fabrication.driver.link.link import interval_us
from optopad.fabrication.driver.link.protocol import frame_format, pack_frames
from optopad.fabrication.driver.recording.recorder import Recorder
from optopad.fabrication.driver.sensor import BASELINE_S, require_rate
from optopad.fabrication.driver.simulated.board import PadMemory, hello_message
from optopad.fabrication.driver.touch_reader import Touch, TouchReader
from optopad.fabrication.driver_config import driver_config
from optopad.fabrication.driver_file import DriverConfig
from optopad.fabrication.scene.pad_light import PadLight
from optopad.fabrication.scene.touching import PadTop, Touching
from optopad.fabrication.scene.unit_light import drawn_design, unit_light
from optopad.sims.readings.protocol import untouched_readout
from optopad.sims.readings.signal_chain import SignalChain, chain_of
from optopad.sims.robot.fast_light import Imprint, light_of, require_light_of, together

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

    from optopad.fabrication.driver.frame_source import FrameSource
    from optopad.sims.learning.inference.touch_model import TouchModel

SEEN_MM = 0.05
"""Depth of a contact by MuJoCo above which the object must be near some node of the map of light [mm]."""
BESIDE_MM = 1.0
"""Gap of an object to all nodes beyond which it is beside the map; a ball between nodes has less [mm]."""
STEP_MM, REST_MM = 0.05, 0.005
"""Motion within a frame for which light is computed once more, and motion since light was computed last below which it
is taken again [mm]. Light that changes by 30 % per mm is off by 0.15 % at most then, less than an emitter's
fluctuation."""
SAME_S = 1e-9
"""Times closer than this are equal: the rounding of sums of time steps [s]."""


class _Look:
    """The objects at the pad at one time, and the pad's light, computed when it is first needed."""

    __slots__ = ("deepest_mm", "ratios", "time_s", "touching")

    def __init__(self, time_s: float, touching: Touching) -> None:
        self.time_s, self.touching = time_s, touching
        self.ratios: FloatArray | None = None
        self.deepest_mm = 0.0


class SimulatedPad:
    """A pad of a compiled MuJoCo model, whose frames are those of its board.

    The model is changed: the pad's contact is tuned (`contact_fit.tuned`), so that forces follow the contact model, and
    its top is put where it is in the unit.

    Parameters
    ----------
    model : compiled model with the pad that `optopad scene` wrote for the design
    design : the pad's design
    name : name of the pad: "left" if it was attached with the prefix ``left_``; "" for a pad without a prefix
    light : map of the pad's light, or its file; if None, the one that `optopad scene DESIGN --fit` stored
    build : number of a unit, which is drawn within the design's tolerances and unmeasured values; or the design of a
        manufactured unit, as `optopad calibrate` writes it. Its light is traced and fitted (`unit_light`), which takes
        about a minute on 2 cores, and its top is moved to its height. If None, the pad is as designed
    seed : seed of drift and noise
    touch_model : trained model for `touch`; None if that is not needed
    touches : largest number of touches in a frame, 1 or 2
    rate_hz : frames per second; 0 for the board's highest rate. If None, the design's rate is used
    is_ambient : whether there is the design's ambient light
    stiffness : factor of the contact's forces, as in `contact_fit.tuned` [-]
    baseline_s : time for which the untouched pad was read before the simulation, for `baseline` [s]; 0 for no baseline

    Attributes
    ----------
    model, name : the model, and the pad's name in it
    unit : design of the unit; that of the pad if `build` is None
    config : driver configuration of the design
    descriptor : geometry, names, units and rates of the readings
    baseline : signals of the untouched pad, shape (emitters, receivers) [counts]; None if no baseline was taken
    interval_s : time between two frames [s]
    delay_s : time from a frame's first conversion to its delivery [s]
    made : number of frames made so far
    connection : number of the connection, from 1; it increases at each reset of the scene

    Raises
    ------
    InputError : the model has no pad of this name and design, or too long a time step; there is no map of light for the
        design, or it is of another.
    """

    def __init__(
        self,
        model: MjModel,
        design: SensorDesign,
        name: str = "",
        *,
        light: PadLight | str | os.PathLike[str] | None = None,
        build: int | SensorDesign | None = None,
        seed: int = 0,
        touch_model: TouchModel | None = None,
        touches: int = 1,
        rate_hz: float | None = None,
        is_ambient: bool = True,
        stiffness: float = 1.0,
        baseline_s: float = BASELINE_S,
    ) -> None:
        self.model, self.name = model, name
        self._warned: set[str] = set()
        self._light = _light_of(design, light)
        self._chain, self.config = _electronics(design, self._light.untouched)
        self.unit = design
        if build is not None:
            self.unit = (
                build if isinstance(build, SensorDesign) else drawn_design(design, operator.index(build))
            )
            self._light = unit_light(self._light, design, self.unit)
            self._chain, _ = _electronics(self.unit, self._light.untouched)
        raised_mm = self.unit.cavity.elastic_mm - design.cavity.elastic_mm
        self._top = PadTop(model, name, design.digest, raised_mm=raised_mm, stiffness=stiffness)
        if design.noise.wall_unbonded_share:
            self._warn("noise.wall_unbonded_share is not simulated; the walls stay bonded")
        self.descriptor: Descriptor = descriptor_of(self.config)
        self._layout = frame_format(self.config)
        self._lit_s = self._chain.read_at_s[self._chain.is_lit]
        self._first_s, self._last_s = float(self._lit_s.min()), float(self._lit_s.max())
        emitters, receivers = self._light.untouched.shape
        self._ones = np.ones((emitters, receivers))
        self._pairs = np.arange(emitters)[:, None], np.arange(receivers)
        self.delay_s = self.config.timing.frame_ms / 1e3
        asked_hz = self.config.timing.wanted_hz if rate_hz is None else rate_hz
        require_rate(asked_hz)
        self._interval_us = max(interval_us(asked_hz), math.ceil(self.config.timing.frame_ms * 1e3))
        self.interval_s = self._interval_us / US_PER_S
        self._rng = np.random.default_rng(seed)
        self._drawn = self._chain.draw_set(self._rng, is_ambient=is_ambient)
        self._recorders: list[Recorder] = []
        self._touch_model, self._touches = touch_model, touches
        self._reader: TouchReader | None = None
        self._touch: Touch | None = None
        self.made = self.connection = 0
        self._before = self._next = 0
        self.baseline: FloatArray | None = None
        if baseline_s > 0.0:
            frames = self.untouched_frames(max(1, round(baseline_s / self.interval_s)))
            self.baseline = np.mean([one.signals for one in frames], axis=0)
        self.reset()

    def reset(self) -> None:
        """Start the board again at the next call, with the scene at rest as it then is; a press is forgotten.

        It is called by itself when `data.time` goes back. Call it after objects were moved without a step of time.
        """
        if self._recorders and self._next:
            self._warn(
                "recording: the scene was reset, so its time and that of noted presses begin again; record each "
                "episode in a file of its own"
            )
        self._top.forget()
        self._looks: list[_Look] = []
        self._known: _Look | None = None
        self._begin_s: float | None = None
        self._last: Frame | None = None
        self._before += self._next
        self._next = 0
        memory = self.config.memory
        self._memory = None if memory is None else PadMemory(memory, self._light.untouched)
        self.connection += 1

    def observe(self, data: MjData) -> None:
        """Note where the objects are now, without making a frame; useful at every step if frames are read less often.

        `frame` and `arrived` do it, too.
        """
        now_s, looks = float(data.time), self._looks
        if looks and now_s < looks[-1].time_s - SAME_S:
            self.reset()
            looks = self._looks
        elif looks and now_s <= looks[-1].time_s + SAME_S:
            looks.pop()
        if self._begin_s is None:
            self._begin_s = now_s
            for recorder in self._recorders:
                self._greet(recorder, now_s)
        looks.append(_Look(now_s, self._top.touching(data)))
        due_s = self._begin_s + self._next * self.interval_s
        while len(looks) > 2 and looks[1].time_s <= due_s:
            del looks[0]

    def frame(self, data: MjData) -> Frame:
        """The latest frame that the board has delivered by `data.time`; see the module for its times."""
        frames = self._arrived(data, is_all=bool(self._recorders) or self._memory is not None)
        return frames[-1] if frames else self.last

    def arrived(self, data: MjData) -> list[Frame]:
        """All frames that the board has delivered since the last call, up to `data.time`; there may be none."""
        return self._arrived(data, is_all=True)

    def touch(self, data: MjData) -> Touch:
        """The trained model's prediction for the latest frame, as `optopad.TouchReader` makes it.

        Raises
        ------
        InputError : no trained model was given, or it is of another design.
        """
        if self._touch_model is None:
            raise InputError(
                "touch_model: is None; give SimulatedPad(..., touch_model=optopad.load_model(FILE))"
            )
        if self._reader is None:
            source = cast("FrameSource", _LatestFrames(self))
            self._reader = TouchReader(source, self._touch_model, touches=self._touches)
        frame = self.frame(data)
        if self._touch is None or self._touch.frame is not frame:
            self._touch = self._reader.read()
        return self._touch

    def record(self, file: str | os.PathLike[str]) -> Recorder:
        """Record every frame from now on, even if it is never read, until the recorder is closed.

        Presses that are noted in the recording need their time on the simulation's clock, `press(..., host_s=...)`.

        Raises
        ------
        OutputError : the file exists, or cannot be written.
        """
        recorder = Recorder(file, self.config)
        if self._begin_s is not None:
            self._greet(recorder, self._begin_s)
        self._recorders.append(recorder)
        return recorder

    def untouched_frames(self, count: int) -> list[Frame]:
        """Frames of the untouched pad, as if read before the simulation began."""
        began_s = np.arange(-count, 0, dtype=np.float64) * self.interval_s
        flux = np.broadcast_to(self._light.untouched, (count, *self._light.untouched.shape))
        return self._frames(flux, began_s, np.arange(-count, 0), [])

    def close(self, *, is_clean: bool = True) -> None:
        """Close all recordings; `is_clean` marks their normal end. Raises OutputError if one failed."""
        with ExitStack() as recordings:
            for recorder in self._recorders:
                recordings.callback(recorder.close, is_clean=is_clean)

    @property
    def last(self) -> Frame:
        """The latest frame that was made; raises InputError before the first call with data."""
        if self._last is None:
            raise InputError("the pad has no frame yet; call frame(data)")
        return self._last

    @property
    def now_s(self) -> float:
        """Time of the latest call on the simulation's clock [s]; 0 before the first one."""
        return self._looks[-1].time_s if self._looks else 0.0

    def _arrived(self, data: MjData, *, is_all: bool) -> list[Frame]:
        self.observe(data)
        assert self._begin_s is not None
        passed_s = self._looks[-1].time_s - self._begin_s - self.delay_s + SAME_S
        until = max(math.floor(passed_s / self.interval_s) + 1, 1)
        first = self._next if is_all else max(self._next, until - 1)
        if until <= self._next:
            return []
        numbers = np.arange(first, until)
        began_s = self._begin_s + numbers.astype(np.float64) * self.interval_s
        looks = self._between(began_s[0] + self._first_s, began_s[-1] + self._last_s)
        flux = self._flux(looks, began_s)
        if self._memory is not None:
            flux = self._with_residue(self._memory, looks, flux, began_s)
        if self._recorders:
            self._recorders = [one for one in self._recorders if one.is_open]
        frames = self._frames(flux, began_s, numbers, self._recorders)
        self._next, self._last = until, frames[-1]
        self.made += len(frames)
        return frames

    def _flux(self, looks: list[_Look], began_s: FloatArray) -> FloatArray:
        """(n, emitter, receiver) flux of frames, each pair at the time of its conversion."""
        untouched, count = self._light.untouched, len(began_s)
        if not any(one.touching.geoms for one in looks):
            return np.repeat(untouched[None], count, axis=0)
        ratios = self._ratios(looks)
        if len(looks) == 1:
            return np.repeat((untouched * ratios[0])[None], count, axis=0)
        at_s = began_s[:, None, None] + self._lit_s
        if len(looks) == 2:
            share = _share(at_s, looks[0].time_s, looks[1].time_s)
            before, behind = ratios
        else:
            times_s, known = np.array([one.time_s for one in looks]), np.array(ratios)
            after = np.clip(np.searchsorted(times_s, at_s), 1, len(looks) - 1)
            share = _share(at_s, times_s[after - 1], times_s[after])
            before, behind = known[after - 1, *self._pairs], known[after, *self._pairs]
        return np.asarray(untouched * (before + share * (behind - before)))

    def _between(self, first_s: float, last_s: float) -> list[_Look]:
        """The looks that are needed for the light between two times.

        They are the last one before the first time and the first one after the last time, or the oldest and newest; of
        those between, those since which objects moved by `STEP_MM`, and both around a new contact. If all objects rest,
        one look is enough.
        """
        looks = self._looks
        begin, end = 0, len(looks)
        while begin + 1 < end and looks[begin + 1].time_s <= first_s:
            begin += 1
        while end - 1 > begin and looks[end - 2].time_s >= last_s:
            end -= 1
        kept, most_mm = [looks[begin]], 0.0
        for k in range(begin + 1, end):
            moved_mm = kept[-1].touching.moved_mm(looks[k].touching)
            most_mm = max(most_mm, moved_mm)
            if moved_mm == math.inf and kept[-1] is not looks[k - 1]:
                kept.append(looks[k - 1])
            if moved_mm > STEP_MM or k == end - 1:
                kept.append(looks[k])
        return kept if most_mm > REST_MM else kept[-1:]

    def _ratios(self, looks: list[_Look]) -> list[FloatArray]:
        """Light over the untouched light (emitter, receiver) at each look, computed where it is not known yet [-]."""
        new = [one for one in looks if one.ratios is None and one.touching.geoms]
        if self._known is not None and new:
            for one in new:
                if self._known.touching.moved_mm(one.touching) <= REST_MM:
                    one.ratios, one.deepest_mm = self._known.ratios, self._known.deepest_mm
            new = [one for one in new if one.ratios is None]
        if new:
            each, most_mm = self._imprints([one.touching for one in new]), self._light.deepest_mm
            deepest_mm = np.maximum.reduce([one.deepest_mm for one in each]).tolist()
            imprint = together([one.limited(most_mm) for one in each])
            if max(deepest_mm) > most_mm:
                self._warn(
                    f"an object is {max(deepest_mm):.2f} mm deep, and the map of light ends at {most_mm:.2f} mm; "
                    "deeper objects count as that deep"
                )
            for one, deep_mm, ratios in zip(new, deepest_mm, self._light.ratios(imprint), strict=True):
                one.deepest_mm, one.ratios = deep_mm, ratios
            self._known = new[-1]
        return [self._ones if one.ratios is None else one.ratios for one in looks]

    def _imprints(self, many: list[Touching]) -> list[Imprint]:
        """Imprint of each object at n times."""
        found = []
        for geom in sorted({geom for one in many for geom in one.geoms}):
            shape = self._top.shape(geom)
            assert shape is not None
            rows = [(k, one.geoms.index(geom)) for k, one in enumerate(many) if geom in one.geoms]
            own = self._light.imprint(
                shape,
                np.array([many[k].centre_mm[place] for k, place in rows]),
                np.array([many[k].turn[place] for k, place in rows]),
            )
            if (
                any(many[k].pressed_mm[place] > SEEN_MM for k, place in rows)
                and own.overlap_mm.max() <= -BESIDE_MM
            ):
                self._warn(
                    f"the geom {self._top.geom_name(geom)} touches the pad beside the area of the map of light, at its "
                    "rim or walls; the frames show nothing of it"
                )
            found.append(own.among([k for k, _ in rows], len(many)))
        return found

    def _warn(self, text: str) -> None:
        """Warn once of each kind of limit; the first words tell the kinds apart."""
        kind = text.split()[0]
        if kind not in self._warned:
            self._warned.add(kind)
            warnings.warn(f"pad {self.name!r}: {text}", stacklevel=6)

    def _with_residue(
        self, memory: PadMemory, looks: list[_Look], flux: FloatArray, began_s: FloatArray
    ) -> FloatArray:
        """Flux of frames with what earlier presses left in the silicone."""
        times_s, depths_mm = [one.time_s for one in looks], [one.deepest_mm for one in looks]
        depth_mm = np.interp(began_s + self._first_s, times_s, depths_mm)
        frames = zip(flux, depth_mm.tolist(), began_s.tolist(), strict=True)
        return np.array([memory.added(*now) for now in frames])

    def _frames(
        self, flux: FloatArray, began_s: FloatArray, numbers: IntArray, recorders: list[Recorder]
    ) -> list[Frame]:
        layout = self._layout
        running_s = (self._before + numbers.astype(np.float64)) * self.interval_s
        readings = self._chain.readings(flux, running_s, self._rng, self._drawn)
        one_dark = readings
        if layout.dark != "frame":
            one_dark = np.rint(with_one_dark(readings, layout.lit, layout.full_scale))
        counts = one_dark.astype(np.uint16)
        signals, saturated = signals_of(counts.astype(np.int32)), counts >= layout.full_scale
        device_us = np.rint(began_s * US_PER_S).astype(np.int64)
        host_s = (began_s + self.delay_s).tolist()
        if recorders:
            messages = pack_frames(layout, numbers, device_us, readings)
            for recorder in recorders:
                for message, time_s in zip(messages, host_s, strict=True):
                    recorder.frame(message, time_s)
        return [
            Frame(
                connection=max(self.connection, 1),
                sequence=sequence,
                device_us=device_us[k].item(),
                host_s=host_s[k],
                lost_before=0,
                counts=counts[k],
                signals=signals[k],
                saturated=saturated[k],
                baseline=self.baseline,
                began_s=began_s[k].item(),
                began_error_s=0.0,
            )
            for k, sequence in enumerate(numbers.tolist())
        ]

    def _greet(self, recorder: Recorder, begin_s: float) -> None:
        recorder.hello(hello_message(self.config, self._interval_us), begin_s)


def _share(at_s: FloatArray, before_s: FloatArray | float, after_s: FloatArray | float) -> FloatArray:
    """Share of the way from one time to another [-], 0 before and 1 after them."""
    share = (at_s - before_s) / (after_s - before_s)
    return np.asarray(np.minimum(np.maximum(share, 0.0, out=share), 1.0, out=share))


class _LatestFrames:
    """What a reader needs of a source if it reads the latest frames alone."""

    def __init__(self, pad: SimulatedPad) -> None:
        self._pad, self.descriptor = pad, pad.descriptor

    @property
    def now_s(self) -> float:
        return self._pad.now_s

    def read(self) -> Frame:
        return self._pad.last

    def new_frames(self, seconds: float, least: int = 1) -> list[Frame]:
        """Frames of the untouched pad."""
        return self._pad.untouched_frames(max(least, round(seconds / self._pad.interval_s)))


def _light_of(design: SensorDesign, light: PadLight | str | os.PathLike[str] | None) -> PadLight:
    found = light_of(design, light) if light is None or isinstance(light, str | os.PathLike) else light
    require_light_of(design, found.digest)
    return found


def _electronics(design: SensorDesign, untouched: FloatArray) -> tuple[SignalChain, DriverConfig]:
    """Signal chain and driver configuration of a unit with this light of the untouched pad."""
    readout = untouched_readout(design, untouched)
    gains = readout.of_each(untouched.shape[1])
    chain = chain_of(design, readout)
    noise = chain.noise.model_copy(update={"quantised": True})  # a board sends whole counts
    return replace(chain, noise=noise), driver_config(design, gains, readout.counts(untouched))
