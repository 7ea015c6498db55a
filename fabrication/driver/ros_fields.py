"""Fields of optopad's ROS 2 messages as plain data, and the filling of a message object with them.

Lengths in messages of ROS's own types are metres, as REP 103 requires; fields with a unit in their name have that unit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fabrication.driver.recording.mcap_file import frame_message, sensor_message, stamp

if TYPE_CHECKING:
    from fabrication.driver.descriptor import Descriptor
    from fabrication.driver.stream import LinkCounts
    from fabrication.driver.touch_reader import Touch

__all__ = [
    "diagnosis",
    "filled",
    "frame_message",
    "marker",
    "sensor_message",
    "top_frame",
    "touch_message",
]

M_PER_MM = 1e-3
CUBE, SPHERE = 1, 2
"""Types of visualization_msgs/Marker."""
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


def touch_message(touch: Touch, frame_id: str) -> dict[str, Any]:
    """Fields of a touch's message; numbers that are not known are NaN."""
    frame, sigma = touch.frame, touch.sigma_mm * M_PER_MM
    depth = float(touch.press_mm[2])
    return {
        "header": {"stamp": stamp(frame.began_s), "frame_id": frame_id},
        "sequence": frame.sequence,
        "is_touched": touch.is_touched,
        "score": touch.touch_score,
        "point": _vector(touch.point_mm, M_PER_MM),
        "normal": _vector(touch.normal),
        "covariance": np.diag(sigma**2).ravel().tolist() if np.isfinite(sigma).all() else [math.nan] * 9,
        "depth": depth * M_PER_MM,
        "force": math.nan if touch.force_n is None else touch.force_n,
        "force_deviation": touch.force_sigma_n,
        "drift": touch.drift.drift,
        "is_drift_held": touch.drift.is_held,
        "is_gain_like": touch.drift.is_gain_like,
        "gain_steps": touch.drift.gain_steps,
        "latency": touch.latency_ms / 1e3,
    }


def top_frame(said: Descriptor, frame_id: str) -> dict[str, Any]:
    """Fields of the static transform from the pad's coordinates to the middle of the untouched top."""
    middle = (0.0, 0.0, 0.0) if said.surface is None else said.surface.top_mm
    return {
        "header": {"frame_id": frame_id},
        "child_frame_id": f"{frame_id}_top",
        "transform": {"translation": _vector(middle, M_PER_MM), "rotation": {"w": 1.0}},
    }


def marker(said: Descriptor, touch: Touch | None, frame_id: str, began_s: float) -> dict[str, Any]:
    """Fields of the marker for RViz: the pad's body without `touch`, else a ball at the touch, larger when deeper."""
    common = {"header": {"frame_id": frame_id, "stamp": stamp(began_s)}, "ns": frame_id, "action": 0}
    if touch is None:
        low, high = _box_mm(said)
        return common | {
            "id": 0,
            "type": CUBE,
            "pose": {"position": _vector((low + high) / 2, M_PER_MM), "orientation": {"w": 1.0}},
            "scale": _vector(high - low, M_PER_MM),
            "color": {"r": 0.6, "g": 0.8, "b": 1.0, "a": 0.35},
        }
    size = 1.0 + float(np.nan_to_num(touch.press_mm[2]))
    return common | {
        "id": 1,
        "type": SPHERE,
        "action": 0 if touch.is_touched else 2,  # 2 removes it
        "pose": {"position": _vector(np.nan_to_num(touch.point_mm), M_PER_MM), "orientation": {"w": 1.0}},
        "scale": _vector((size, size, size), M_PER_MM),
        "color": {"r": 1.0, "g": 0.4, "b": 0.1, "a": 0.9},
        "lifetime": {"sec": 0, "nanosec": int(SHOWN_S * 1e9)},
    }


def diagnosis(
    counts: LinkCounts | None, rate_hz: float | None, required_hz: float, fault: str
) -> dict[str, Any]:
    """Level, message and values of a sensor's diagnostic status.

    It is a warning if frames are lost, damaged or not read in time, or if the rate is below nine tenths of the required
    one.
    """
    values = {} if counts is None else {name: str(value) for name, value in vars(counts).items()}
    values |= {"rate_hz": "-" if rate_hz is None else f"{rate_hz:.1f}", "required_hz": f"{required_hz:.1f}"}
    if fault or counts is None:
        return {"level": ERROR, "message": fault or "not open", "values": values}
    is_slow = rate_hz is not None and rate_hz < 0.9 * required_hz
    faults = [name for name in ("lost", "damaged", "overrun") if getattr(counts, name)] + ["slow"] * is_slow
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
