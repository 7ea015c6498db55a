"""Predicts touch, location, depth and force for each frame of a sensor, with a trained model and drift tracking.

import optopad

with optopad.Sensor("driver.toml") as sensor:
    for touch in optopad.TouchReader(sensor, optopad.load_model("pad.optomodel")):
        print(touch)  # touched   x 16.02 ± 0.21 mm, y 15.90 ± 0.18 mm, depth 1.00 ± 0.05 mm, score +1.32

With a model that knows two touches, a frame may have two contacts, whose numbers `tracks` keeps from frame to frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver.descriptor import Descriptor
from optopad.fabrication.driver.drift import (
    GUARD_S,
    LEAST_START_FRAMES,
    TIME_CONSTANT_S,
    DriftState,
    DriftTracker,
)
from optopad.fabrication.driver.frame_source import FrameSource
from optopad.fabrication.driver.link.frames import US_PER_S, Frame
from optopad.fabrication.driver.sensor import BASELINE_S
from optopad.fabrication.driver.slip import NO_SLIP, SlipDetector
from optopad.fabrication.driver.tracks import Tracks
from optopad.sims.learning.inference.header import ModelHeader, require_design
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.inference.two_touches import (
    Touches,
    found_touches,
    require_one_or_two,
    require_two_touches,
)

AXES = ("x", "y", "depth")
"""Names of the three numbers of a press."""

ODD_S = 5.0
"""Time that frames may differ from the untouched ones without a touch before a note says so [s]."""

MOST_TOGETHER = 64
"""Largest number of waiting frames that the model predicts in one batch."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Contact:
    """One of the touches of a frame.

    Attributes
    ----------
    number : number of the touch, which it keeps while it lasts; numbers count up from 1 within a connection
    press_mm, sigma_mm, point_mm, normal, force_n, force_sigma_n : as in `Touch`
    """

    number: int
    press_mm: FloatArray
    sigma_mm: FloatArray
    point_mm: FloatArray
    normal: FloatArray
    force_n: float | None
    force_sigma_n: float

    def __str__(self) -> str:
        """Number, location and depth [mm], force [N] if known, each with its uncertainty."""
        return f"#{self.number} {', '.join(self.quantities)}"

    @property
    def quantities(self) -> list[str]:
        """Location and depth [mm], and force [N] if known, each with its uncertainty."""
        parts = [
            f"{axis} {with_sigma(self.press_mm[k], self.sigma_mm[k], 'mm')}" for k, axis in enumerate(AXES)
        ]
        if self.force_n is not None:
            parts.append(f"force {with_sigma(self.force_n, self.force_sigma_n, 'N')}")
        return parts


@dataclass(frozen=True, kw_only=True)
class Touch:
    """The model's prediction for one frame.

    Location, depth and force are those of the first contact, which is the deepest.

    Attributes
    ----------
    frame : the frame
    is_touched : whether the model reports a touch; always False while the signals' change is due to gains of parts
    touch_score : the model's score for touch [-]; positive if it reports a touch, and larger for more confidence
    press_mm : x and y in the cavity's coordinate system, and depth along the surface normal [mm]; NaN if untouched
    point_mm, normal : point of first contact [mm] and outward unit normal of the surface there [-], in the cavity's
        coordinate system; NaN if untouched, or if the driver configuration does not describe the top surface
    sigma_mm : standard deviations of x, y and depth [mm]; NaN if untouched, or if the model does not estimate them
    force_n : force from the model's force curve [N]; 0 if untouched; None if the model has no such curve
    force_sigma_n : standard deviation of the force [N]; NaN if untouched or unknown. It includes that of the depth and,
        if the modulus was fitted to a load cell, that of the modulus
    contacts : the frame's touches, the deepest first; empty if untouched
    is_slipping : whether the touch moves sideways at more than 2 mm/s; always False while there are two
    slip_mm_s : speed of this movement along x and y [mm/s]; 0 unless it slips
    drift : the drift tracker's result for the frame
    latency_ms : time from the frame's arrival on this computer to this prediction [ms]
    """

    frame: Frame
    is_touched: bool
    touch_score: float
    press_mm: FloatArray
    point_mm: FloatArray
    normal: FloatArray
    sigma_mm: FloatArray
    force_n: float | None
    force_sigma_n: float
    contacts: tuple[Contact, ...]
    is_slipping: bool
    slip_mm_s: FloatArray
    drift: DriftState
    latency_ms: float

    def __str__(self) -> str:
        """Location and depth [mm], force [N] if known, each with its uncertainty; slip, score and note.

        A line for each contact, with numbers if there are two.
        """
        first, *more = [str(one) for one in self.contacts] or ["untouched"]
        if self.is_touched and not more:
            parts = self.contacts[0].quantities
            if self.is_slipping:
                parts.append(f"slips at {math.hypot(*self.slip_mm_s):.0f} mm/s")
            first = ", ".join(parts)
        lead = "touched   " * self.is_touched
        end = f", score {self.touch_score:+.2f}{'; ' * bool(self.note)}{self.note}"
        return "\n".join([f"{lead}{first}{end}", *(f"{lead}{one}" for one in more)])

    @property
    def note(self) -> str:
        """Why the frame is not as untouched although the model reports no touch; "" otherwise."""
        if self.drift.is_gain_like:
            return "a change of gain, no touch"
        if self.drift.held_without_touch_s > ODD_S:
            return (
                "not as untouched, but no touch for the model: lighter than trained, dirt, or left of a press"
            )
        return ""


def with_sigma(value: float, sigma: float, unit: str) -> str:
    """A value with its standard deviation, which is left out if it is not known (NaN)."""
    return f"{value:.2f}{f' ± {sigma:.2f}' if math.isfinite(sigma) else ''} {unit}"


class TouchReader:
    """Reads touches from a sensor: tracks drift, and predicts location, depth and force with a trained model.

    A board that restarts or is plugged in again may find its pad touched, so the untouched signals of before are kept,
    and everything else of drift tracking begins anew. A change of gains since then is taken over after 1 s, slow drift
    with the time constant, and any other change counts as a touch. `restart` measures the untouched signals again.

    Parameters
    ----------
    sensor : open sensor, or `optopad.SimulatedSensor`; the pad must be untouched at the first read
    model : model trained for this sensor's design
    touches : largest number of touches in a frame, 1 or 2. Slips are found while there is one touch
    time_constant_s : time constant of drift tracking [s]
    guard_s : time before and after a touch during which drift is not tracked [s]
    start_s : shortest time for which the untouched pad is read at the start [s]

    Raises
    ------
    InputError : the model was trained for another design, for other parts or for one touch alone, or a number is
        invalid.
    """

    def __init__(
        self,
        sensor: FrameSource,
        model: TouchModel,
        *,
        touches: int = 1,
        time_constant_s: float = TIME_CONSTANT_S,
        guard_s: float = GUARD_S,
        start_s: float = BASELINE_S,
    ) -> None:
        require_fits(model.header, sensor.descriptor)
        require_touches(model, touches)
        self.sensor, self.model, self.most_touches = sensor, model, touches
        self._times_s = time_constant_s, guard_s
        self._start_s = start_s
        self._tracker: DriftTracker | None = None
        self._slips: SlipDetector | None = None
        self._tracks = Tracks()
        self._last: Frame | None = None

    def __iter__(self) -> Iterator[Touch]:
        return self.touches()

    def read(self) -> Touch:
        """The model's prediction for the next frame; raises the same errors as `Sensor.read`."""
        self.begin()
        (touch,) = self._answered([self.sensor.read()])
        return touch

    def touches(self, count: int | None = None, seconds: float | None = None) -> Iterator[Touch]:
        """Yield predictions until a number of frames or a time [s] is reached, whichever is first; None means no limit.

        Waiting frames are predicted in one batch, which is faster for most models, so a slow computer can keep up.
        """
        self.begin()
        return self._touches(self.sensor.frames(count, seconds))

    def begin(self) -> None:
        """Measure the untouched signals unless they have already been measured; the pad must be untouched.

        Raises
        ------
        DeviceError : no frames arrive.
        """
        if self._tracker is None:
            self.restart()

    def restart(self) -> None:
        """Measure the untouched signals again; the pad must be untouched."""
        frames = self.sensor.new_frames(self._start_s, least=4 * LEAST_START_FRAMES)
        tau_s, guard_s = self._times_s
        start = np.array([frame.signals for frame in frames], dtype=np.float64)
        self._tracker = DriftTracker(
            start,
            self.model.header.untouched_counts,
            time_constant_s=tau_s,
            guard_s=guard_s,
            full_scale=float(self.sensor.descriptor.full_scale),
        )
        self._slips = SlipDetector(self.model, self._tracker.features(start.reshape(len(start), -1)))
        self._last = frames[-1]

    @property
    def tracker(self) -> DriftTracker:
        """The drift tracker; raises DeviceError before the first read."""
        if self._tracker is None:
            raise DeviceError("the reader has not begun; read a frame first, with the pad untouched")
        return self._tracker

    def _touches(self, frames: Iterator[Frame]) -> Iterator[Touch]:
        for first in frames:
            together = min(self.sensor.waiting, MOST_TOGETHER - 1)
            yield from self._answered([first, *islice(frames, together)])

    def _answered(self, frames: list[Frame]) -> list[Touch]:
        signals = np.array([frame.signals for frame in frames], dtype=np.float64).reshape(len(frames), -1)
        features = self.tracker.features(signals)
        found = self._found(features)
        assert self._slips is not None
        seen, slopes = self._slips.seen(features, np.nan_to_num(found.press_mm[:, 0]))
        return [
            self._touch(frame, signals[k], found, k, seen[k], slopes[k]) for k, frame in enumerate(frames)
        ]

    def _found(self, features: FloatArray) -> Touches:
        if self.most_touches > 1:
            return found_touches(self.model, features)
        found = self.model.predict(features)
        return Touches(
            count=found.is_touched.astype(np.int64),
            touch_score=found.touch_score,
            second_score=np.full(len(features), -np.inf),
            press_mm=found.press_mm[:, None],
            sigma_mm=found.sigma_mm[:, None],
            force_n=None if found.force_n is None else found.force_n[:, None],
        )

    def _touch(
        self,
        frame: Frame,
        signals: FloatArray,
        found: Touches,
        k: int,
        seen: FloatArray,
        slopes: FloatArray,
    ) -> Touch:
        tracker, slips, last = self.tracker, self._slips, self._last
        assert slips is not None
        if last is None or frame.connection != last.connection or frame.device_us < last.device_us:
            tracker.restart()
            slips.forget()
            self._tracks = Tracks()
        self._last = frame
        time_s = frame.device_us / US_PER_S
        state = tracker.follow(time_s, signals, bool(found.count[k]))
        count = 0 if state.is_gain_like else int(found.count[k])
        contacts = self._contacts(time_s, found, k, count)
        if count == 1:
            slip = slips.follow(time_s, seen, slopes)
        else:
            slip = NO_SLIP
            slips.forget()
        first = contacts[0] if contacts else NO_CONTACT
        return Touch(
            frame=frame,
            is_touched=count > 0,
            touch_score=float(found.touch_score[k]),
            press_mm=first.press_mm,
            point_mm=first.point_mm,
            normal=first.normal,
            sigma_mm=first.sigma_mm,
            force_n=None if found.force_n is None else first.force_n,
            force_sigma_n=first.force_sigma_n,
            contacts=contacts,
            is_slipping=slip.is_slipping,
            slip_mm_s=slip.slip_mm_s,
            drift=state,
            latency_ms=1e3 * (self.sensor.now_s - frame.host_s),
        )

    def _contacts(self, time_s: float, found: Touches, k: int, count: int) -> tuple[Contact, ...]:
        presses_mm, sigmas_mm = found.press_mm[k, :count], found.sigma_mm[k, :count]
        numbers = self._tracks.follow(time_s, presses_mm, sigmas_mm)
        made = []
        for i, (number, press_mm, sigma_mm) in enumerate(zip(numbers, presses_mm, sigmas_mm, strict=True)):
            point_mm, normal = self._on_top(press_mm)
            made.append(
                Contact(
                    number=number,
                    press_mm=press_mm,
                    sigma_mm=sigma_mm,
                    point_mm=point_mm,
                    normal=normal,
                    force_n=None if found.force_n is None else float(found.force_n[k, i]),
                    force_sigma_n=self._force_sigma_n(float(press_mm[2]), float(sigma_mm[2])),
                )
            )
        return tuple(made)

    def _on_top(self, press_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        surface = self.sensor.descriptor.surface
        if surface is None or not np.isfinite(press_mm).all():
            return np.full(3, np.nan), np.full(3, np.nan)
        point, normal = surface.point_and_normal(float(press_mm[0]), float(press_mm[1]))
        return np.array(point), np.array(normal)

    def _force_sigma_n(self, depth_mm: float, sigma_mm: float) -> float:
        """Standard deviation of the force [N], from that of the depth and from the relative one of the force curve."""
        curve = self.model.header.force_curve
        if curve is None:
            return math.nan
        low, force, high = curve.at(np.array([depth_mm - sigma_mm, depth_mm, depth_mm + sigma_mm]))
        return math.hypot((high - low) / 2, curve.relative_sigma * force)


_UNKNOWN = np.full(3, np.nan)
NO_CONTACT = Contact(
    number=0,
    press_mm=_UNKNOWN,
    sigma_mm=_UNKNOWN,
    point_mm=_UNKNOWN,
    normal=_UNKNOWN,
    force_n=0.0,
    force_sigma_n=math.nan,
)
"""The first contact of a frame without one."""


def require_touches(model: TouchModel, touches: int) -> None:
    """Check that a model finds so many touches in a frame.

    Raises
    ------
    InputError : the number is not 1 or 2, or is 2 and the model knows one touch; the message says what to do.
    """
    require_one_or_two(touches)
    if touches == 2:
        require_two_touches(model)


def require_fits(header: ModelHeader, said: Descriptor) -> None:
    """Check that a model was trained for this sensor's design and parts.

    Raises
    ------
    InputError : the design or the parts differ; the message says what to do.
    """
    require_design(header, said.digest)
    for kind, had, needed in (
        ("emitters", header.emitter_names, said.emitters.names),
        ("receivers", header.receiver_names, said.receivers.names),
    ):
        if had != needed:
            raise InputError(
                f"model: its {kind} are {', '.join(had)}, the sensor's {', '.join(needed)}; train a model on "
                "recordings of this sensor"
            )
