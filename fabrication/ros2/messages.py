"""Definitions of optopad's ROS 2 messages, complete with those of the messages that they contain."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files

PACKAGE = "optopad_msgs"
_FOLDER = files("optopad.fabrication.ros2") / PACKAGE / "msg"
_LINE = "=" * 80
_FIELD = re.compile(r"^(?P<type>[A-Za-z][\w/]*)(?:\[\d*\])?\s+\w", re.MULTILINE)

COMMON = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
}
"""Messages of ROS itself that optopad's contain; they are the same in Humble and Jazzy."""


def names() -> tuple[str, ...]:
    """Types of all messages, such as ``optopad_msgs/msg/Frame``."""
    return tuple(sorted(f"{PACKAGE}/msg/{one.name.removesuffix('.msg')}" for one in _FOLDER.iterdir()))


@cache
def definition(name: str) -> str:
    """The definition of a message, followed by those of all messages that it contains, as in MCAP files."""
    text = (_FOLDER / f"{name.rpartition('/')[2]}.msg").read_text(encoding="utf-8")
    parts, wanted, done = [text], _contained(text), set[str]()
    while wanted:
        one = wanted.pop(0)
        if one not in done:
            done.add(one)
            parts.append(f"{_LINE}\nMSG: {one}\n{COMMON[one]}")
            wanted += _contained(COMMON[one])
    return "".join(parts)


def _contained(text: str) -> list[str]:
    return [found["type"] for found in _FIELD.finditer(text) if "/" in found["type"]]
