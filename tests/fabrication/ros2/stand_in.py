"""A stand-in for ROS 2: rclpy's lifecycle nodes as far as the sensor's node uses them, with the real message types.

Types come from rosbags, so that every published message is serialised and read back as ROS does.
"""

from __future__ import annotations

import importlib.util
import sys
import time
import types
from dataclasses import field, make_dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import Nodetype

from fabrication.ros2.messages import definition, names

NODE = Path(__file__).parents[3] / "fabrication" / "ros2" / "optopad_ros" / "optopad_ros" / "sensor_node.py"


def store_of(version: str) -> Any:
    """The types of a ROS distribution and of optopad."""
    store = get_typestore(Stores[version])
    for name in names():
        store.register(get_types_from_msg(definition(name).partition("=" * 80)[0], name))
    return store


STORE = store_of("ROS2_HUMBLE")
_CLASSES: dict[str, type] = {}


def _default(kind: Any) -> Any:
    node, what = kind
    if node == Nodetype.BASE:
        name = what[0] if isinstance(what, tuple) else what
        return "" if name == "string" else False if name == "bool" else 0.0 if name.startswith("float") else 0
    if node == Nodetype.NAME:
        return class_of(what)()
    return []


def class_of(name: str) -> type:
    """A class with the fields of a message and defaults, as rclpy's generated classes have."""
    if name not in _CLASSES:
        _, entries = STORE.fielddefs[name]
        made = [
            (one, Any, field(default_factory=lambda kind=kind: _default(kind)))  # type: ignore[misc]
            for one, kind in entries
        ]
        _CLASSES[name] = make_dataclass(name.rpartition("/")[2], made, namespace={"msgtype": name})
    return _CLASSES[name]


def as_ros(message: Any) -> Any:
    """The message of rosbags with the content of a filled message object."""
    _, entries = STORE.fielddefs[message.msgtype]
    return STORE.types[message.msgtype](
        **{name: _value(kind, getattr(message, name)) for name, kind in entries}
    )


def _value(kind: Any, value: Any) -> Any:
    node, what = kind
    if node == Nodetype.BASE:
        return value[0] if isinstance(value, bytes) else value
    if node == Nodetype.NAME:
        return as_ros(value)
    inner, _ = what
    if inner[0] == Nodetype.NAME:
        return [as_ros(one) for one in value]
    name = inner[1][0] if isinstance(inner[1], tuple) else inner[1]
    return list(value) if name == "string" else np.array(value, dtype=name)


def cdr(message: Any) -> bytes:
    """A message in ROS 2's encoding; it is read back to see that nothing changes."""
    data = bytes(STORE.serialize_cdr(as_ros(message), message.msgtype))
    assert bytes(STORE.serialize_cdr(STORE.deserialize_cdr(data, message.msgtype), message.msgtype)) == data
    return data


class Publisher:
    """Keeps what it publishes, in order, with the time; a lifecycle publisher only while it is active."""

    def __init__(self, kind: type, topic: str, *, is_active: bool = True) -> None:
        self.kind, self.topic, self.is_active = kind, topic, is_active
        self.messages: list[tuple[float, Any]] = []

    def publish(self, message: Any) -> None:
        assert isinstance(message, self.kind)
        if self.is_active:
            self.messages.append((time.time(), message))


class Log:
    """Keeps its lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def info(self, text: str) -> None:
        self.lines.append(text)

    error = info


class Now:
    """The time of this machine."""

    @property
    def nanoseconds(self) -> int:
        return time.time_ns()

    def to_msg(self) -> Any:
        message = class_of("builtin_interfaces/msg/Time")()
        message.sec, message.nanosec = divmod(time.time_ns(), 10**9)
        return message


class LifecycleNode:
    """A node with its parameters, topics, services and log as attributes."""

    given: ClassVar[dict[str, Any]] = {}

    def __init__(self, name: str) -> None:
        self.name, self.log = name, Log()
        self.parameters: dict[str, Any] = {}
        self.topics: dict[str, Publisher] = {}
        self.published: dict[str, Publisher] = {}
        self.services: dict[str, Any] = {}
        self.timers: list[Any] = []

    def get_name(self) -> str:
        return self.name

    def get_logger(self) -> Log:
        return self.log

    def get_clock(self) -> Any:
        return types.SimpleNamespace(now=Now)

    def declare_parameter(self, name: str, value: Any) -> None:
        self.parameters[name] = self.given.get(name, value)

    def get_parameter(self, name: str) -> Any:
        return types.SimpleNamespace(value=self.parameters[name])

    def create_publisher(self, kind: type, topic: str, _qos: Any) -> Publisher:
        return self._made(Publisher(kind, topic))

    def create_lifecycle_publisher(self, kind: type, topic: str, _qos: Any) -> Publisher:
        return self._made(Publisher(kind, topic, is_active=False))

    def _made(self, publisher: Publisher) -> Publisher:
        self.topics[publisher.topic] = self.published[publisher.topic] = publisher
        return publisher

    def create_service(self, kind: Any, name: str, call: Any) -> str:
        self.services[name] = (kind, call)
        return name

    def create_timer(self, _period_s: float, call: Any) -> Any:
        self.timers.append(call)
        return call

    def destroy_timer(self, timer: Any) -> None:
        self.timers.remove(timer)

    def destroy_service(self, service: str) -> None:
        del self.services[service]

    def destroy_publisher(self, publisher: Publisher) -> None:
        del self.topics[publisher.topic]

    def on_activate(self, _state: Any) -> str:
        for publisher in self.topics.values():
            publisher.is_active = True
        return "SUCCESS"

    def on_deactivate(self, _state: Any) -> str:
        for name in ("frame", "touch"):
            self.topics[name].is_active = False
        return "SUCCESS"

    def call(self, name: str, **request: Any) -> Any:
        """Call a service, as a client would."""
        _, call = self.services[name]
        return call(types.SimpleNamespace(**request), types.SimpleNamespace(success=False, message=""))


class Transforms:
    """Keeps the static transforms on its node."""

    def __init__(self, node: Any) -> None:
        self.node = node

    def sendTransform(self, transform: Any) -> None:  # noqa: N802, the name in tf2_ros
        self.node.transform = transform


def node_module() -> Any:
    """The module of the sensor's node, imported with this stand-in in place of ROS 2."""
    messages = {
        "diagnostic_msgs": ("DiagnosticArray", "DiagnosticStatus", "KeyValue"),
        "geometry_msgs": ("TransformStamped",),
        "optopad_msgs": ("Frame", "Sensor", "Touch"),
        "visualization_msgs": ("Marker",),
    }
    made = {
        f"{room}.msg": {name: class_of(f"{room}/msg/{name}") for name in of} for room, of in messages.items()
    }
    made |= {
        "rclpy": {},
        "rclpy.lifecycle": {
            "LifecycleNode": LifecycleNode,
            "TransitionCallbackReturn": types.SimpleNamespace(SUCCESS="SUCCESS", FAILURE="FAILURE"),
        },
        "rclpy.qos": {
            "QoSProfile": lambda **given: given,
            "DurabilityPolicy": types.SimpleNamespace(TRANSIENT_LOCAL="kept"),
        },
        "std_srvs.srv": {"Trigger": object()},
        "optopad_msgs.srv": {"Record": object()},
        "tf2_ros.static_transform_broadcaster": {"StaticTransformBroadcaster": Transforms},
    }
    before = dict(sys.modules)
    try:
        for name, content in made.items():
            for part in (name.rpartition(".")[0], name):
                if part:
                    sys.modules[part] = types.ModuleType(part)
            for key, value in content.items():
                setattr(sys.modules[name], key, value)
        spec = importlib.util.spec_from_file_location("sensor_node", NODE)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        for name in set(sys.modules) - set(before):
            if name.split(".")[0] in ("rclpy", "tf2_ros") or name.endswith(
                ("_msgs", "_msgs.msg", ".srv", "_srvs")
            ):
                del sys.modules[name]
    return module
