"""Fields of optopad's ROS 2 messages as plain data, the filling of a message object with them, and parameters.

Lengths in messages of ROS's own types are metres, as REP 103 requires; fields with a unit in their name have that unit.

A touch's message has the first contact in its own fields, as before two touches were known, and all contacts in a
sequence of any length. So a subscriber of one touch need not change, and one of several has no empty places to skip.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.mcap_file import stamp

if TYPE_CHECKING:
    from optopad.fabrication.driver.descriptor import Descriptor
    from optopad.fabrication.driver.link.frames import Frame
    from optopad.fabrication.driver.stream import LinkCounts
    from optopad.fabrication.driver.touch_reader import Contact, Touch

M_PER_MM = 1e-3
CUBE, SPHERE = 1, 2
"""Types of visualization_msgs/Marker."""
ADD, DELETE = 0, 2
"""Actions of visualization_msgs/Marker."""
BODY_ID, TOUCH_ID = 0, 1
"""Numbers of the markers of the body and of the first contact."""
OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostic_msgs/DiagnosticStatus."""
SHOWN_S = 0.5
"""Time for which a touch's marker is shown after its last message [s]."""


def filled(message: Any, fields: dict[str, Any]) -> Any:
    """Set the fields of a message object, and of the messages that it contains; returns the message.

    A list of dictionaries fills a sequence of messages, whose type the dictionaries' key ``""`` names.
    """
    for name, value in fields.items():
        if isinstance(value, dict):
            filled(getattr(message, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            setattr(message, name, [filled(one[""](), {k: v for k, v in one.items() if k}) for one in value])
        else:
            setattr(message, name, value)
    return message


def parameter(name: str, given: Any, default: bool | int | float | str) -> Any:
    """A parameter's value in the type of its default.

    ROS 2 takes the type from how a value is written: `200` is an integer, and a name of digits is a number.

    Raises
    ------
    InputError : the value has another type, or is no number where one is needed.
    """
    kind = type(default)
    with suppress(ValueError):
        if isinstance(given, bool) == (kind is bool) and isinstance(given, (bool, int, float, str)):
            value = kind(given)
            if kind is not int or float(given) == value:
                return value
    words = {bool: "true or false", int: "a whole number", float: "a number", str: "text, in quotes"}
    need = words[kind]
    raise InputError(f"{name}: {given!r} is refused: give {need}")


class NodeClock:
    """Turns times of this machine's clock into times of a node's clock, which differs with ``use_sim_time`` only.

    A time by the clock of a simulation is its time now, less the time that has passed by this machine's clock. That
    clock advances in steps, so the times of frames are kept from going back, unless the clock itself goes back.
    """

    def __init__(self) -> None:
        self._now_s = self._latest_s = 0.0

    def frame(self, frame: Frame, now_s: float | None) -> Frame:
        """A frame with its times by the node's clock.

        Parameters
        ----------
        now_s : time of the simulation [s]; None if the node's clock is this machine's
        """
        if now_s is None:
            return frame
        if now_s < self._now_s:
            self._latest_s = 0.0
        ahead_s = now_s - time.time()
        self._now_s, self._latest_s = now_s, max(self._latest_s, frame.began_s + ahead_s)
        return replace(frame, began_s=self._latest_s, host_s=max(self._latest_s, frame.host_s + ahead_s))


def touch_message(touch: Touch, frame_id: str, contact_type: type) -> dict[str, Any]:
    """Fields of a touch's message; numbers that are not known are NaN.

    Parameters
    ----------
    contact_type : class of the message `optopad_msgs/Contact`
    """
    frame = touch.frame
    return {
        "header": {"stamp": stamp(frame.began_s), "frame_id": frame_id},
        "sequence": frame.sequence,
        "is_touched": touch.is_touched,
        "score": touch.touch_score,
        **_press_fields(touch),
        "slip": _vector((*touch.slip_mm_s, 0.0), M_PER_MM),
        "drift": touch.drift.drift,
        "is_drift_held": touch.drift.is_held,
        "is_gain_like": touch.drift.is_gain_like,
        "gain_steps": touch.drift.gain_steps,
        "latency": touch.latency_ms / 1e3,
        "contacts": [{"": contact_type, "number": one.number} | _press_fields(one) for one in touch.contacts],
    }


def _press_fields(one: Touch | Contact) -> dict[str, Any]:
    sigma = one.sigma_mm * M_PER_MM
    return {
        "point": _vector(one.point_mm, M_PER_MM),
        "normal": _vector(one.normal),
        "covariance": np.diag(sigma**2).ravel().tolist() if np.isfinite(sigma).all() else [math.nan] * 9,
        "depth": float(one.press_mm[2]) * M_PER_MM,
        "force": math.nan if one.force_n is None else one.force_n,
        "force_deviation": one.force_sigma_n,
    }


def wrench_message(touch: Touch, frame_id: str) -> dict[str, Any]:
    """Fields of a touch as a wrench: the force of the pad on all that touches it, and its torque about the origin.

    The force of each contact is along its outward normal, +z on a flat pad. Both are zero without a touch, or without a
    known force.
    """
    force, torque = np.zeros(3), np.zeros(3)
    for one in touch.contacts:
        normal = np.where(np.isfinite(one.normal), one.normal, (0.0, 0.0, 1.0))
        own = normal * float(np.nan_to_num(one.force_n or 0.0))
        point = np.nan_to_num(np.where(np.isfinite(one.point_mm), one.point_mm, (*one.press_mm[:2], 0.0)))
        force, torque = force + own, torque + np.cross(point * M_PER_MM, own)
    return {
        "header": {"stamp": stamp(touch.frame.began_s), "frame_id": frame_id},
        "wrench": {"force": _vector(force), "torque": _vector(torque)},
    }


def top_frame(said: Descriptor, frame_id: str, now_s: float) -> dict[str, Any]:
    """Fields of the static transform from the pad's coordinates to the middle of the untouched top."""
    middle = (0.0, 0.0, 0.0) if said.surface is None else said.surface.top_mm
    return {
        "header": {"stamp": stamp(now_s), "frame_id": frame_id},
        "child_frame_id": f"{frame_id}_top",
        "transform": {"translation": _vector(middle, M_PER_MM), "rotation": {"w": 1.0}},
    }


def body_marker(said: Descriptor, frame_id: str, time_s: float) -> dict[str, Any]:
    """Fields of the marker of the pad's body for RViz."""
    low, high = _box_mm(said)
    return _marker(frame_id, time_s, BODY_ID, CUBE, ADD) | {
        "pose": {"position": _vector((low + high) / 2, M_PER_MM), "orientation": {"w": 1.0}},
        "scale": _vector(high - low, M_PER_MM),
        "color": {"r": 0.6, "g": 0.8, "b": 1.0, "a": 0.35},
    }


def contact_markers(
    contacts: Sequence[Contact], shown: int, frame_id: str, time_s: float
) -> list[dict[str, Any]]:
    """Fields of the markers of contacts: a ball at each, larger when deeper.

    Parameters
    ----------
    shown : number of balls that are shown until now; those beyond the contacts are removed
    """
    made = [
        _marker(frame_id, time_s, TOUCH_ID + k, SPHERE, ADD)
        | {
            "pose": {"position": _vector(np.nan_to_num(one.point_mm), M_PER_MM), "orientation": {"w": 1.0}},
            "scale": _vector([1.0 + float(one.press_mm[2])] * 3, M_PER_MM),
            "color": {"r": 1.0, "g": 0.4, "b": 0.1, "a": 0.9},
            "lifetime": {"sec": 0, "nanosec": int(SHOWN_S * 1e9)},
        }
        for k, one in enumerate(contacts)
    ]
    gone = range(len(contacts), shown)
    return made + [_marker(frame_id, time_s, TOUCH_ID + k, SPHERE, DELETE) for k in gone]


def _marker(frame_id: str, time_s: float, number: int, kind: int, action: int) -> dict[str, Any]:
    header = {"frame_id": frame_id, "stamp": stamp(time_s)}
    return {"header": header, "ns": frame_id, "id": number, "type": kind, "action": action}


def diagnosis(
    counts: LinkCounts | None,
    before: LinkCounts | None,
    rate_hz: float | None,
    required_hz: float,
    fault: str,
) -> dict[str, Any]:
    """Level, message and values of a sensor's diagnostic status.

    It is an error if there is a fault. It is a warning if frames were lost, damaged or not read in time since the
    counts `before`, or if the rate is below nine tenths of the required one.
    """
    values = {} if counts is None else {name: str(value) for name, value in vars(counts).items()}
    values |= {"rate_hz": "-" if rate_hz is None else f"{rate_hz:.1f}", "required_hz": f"{required_hz:.1f}"}
    if fault or counts is None:
        return {"level": ERROR, "message": fault or "not open", "values": values}
    is_slow = rate_hz is not None and rate_hz < 0.9 * required_hz
    faults = [
        name
        for name in ("lost", "damaged", "overrun")
        if getattr(counts, name) > (0 if before is None else getattr(before, name))
    ] + ["slow"] * is_slow
    return {"level": WARN if faults else OK, "message": ", ".join(faults) or "reading", "values": values}


def _box_mm(said: Descriptor) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the box around the active areas of all components, up to the top [mm]."""
    places = np.concatenate([said.emitters.position_mm, said.receivers.position_mm])
    low, high = places.min(axis=0), places.max(axis=0)
    low[2] = 0.0
    if said.surface is not None:
        high[2] = said.surface.top_mm[2]
    return low, high


def _vector(values: Any, scale: float = 1.0) -> dict[str, float]:
    return {axis: scale * float(value) for axis, value in zip("xyz", values, strict=True)}
